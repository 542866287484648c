"""Pictures: exact areas in the rasteriser, the right thing in the right place in a frame, and the window."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

from airhockey_env.drawing import raster
from airhockey_env.drawing.palette import COLORS
from airhockey_env.drawing.render import Renderer
from airhockey_env.drawing.window import Window
from airhockey_env.tables import CHALLENGE, FULL_SIZE, PRESETS

SMALL = (96, 52)
MIDDLE = (240, 130)
REST = np.array([[-0.9, 0.1], [0.85, -0.2], [-0.3, 0.25]])
WHITE = (255, 255, 255)


def canvas(height: int = 40, width: int = 48, channels: int = 3) -> np.ndarray:
    return np.zeros((height, width, channels), dtype=np.uint8)


def area(image: np.ndarray) -> float:
    """What white shapes on black cover, in pixels."""
    return float(image[:, :, 0].sum()) / 255.0


def place(renderer: Renderer, position: np.ndarray) -> tuple[float, float]:
    """Where a position should be in the picture, (column, row): x to the right, y up, the origin in the middle."""
    width, height = renderer.size
    return width / 2 + position[0] * renderer.scale, height / 2 - position[1] * renderer.scale


def pixel(renderer: Renderer, frame: np.ndarray, position: np.ndarray) -> np.ndarray:
    column, row = place(renderer, position)
    return frame[int(row), int(column)].astype(int)


# Rasteriser


@pytest.mark.parametrize(("x", "y"), [(24.0, 20.0), (24.5, 19.5), (23.3, 20.7)])
@pytest.mark.parametrize("radius", [2.0, 5.3, 12.0])
def test_disc_covers_its_area_and_balances_on_its_centre(x: float, y: float, radius: float) -> None:
    image = canvas()
    raster.disc(image, x, y, radius, 1.0, WHITE, 1.0)
    # A straight ramp across the rim adds pi / 12 to the area; the rest is what sampling at pixel centres costs.
    assert area(image) == pytest.approx(np.pi * (radius**2 + 1.0 / 12.0), rel=0.01, abs=0.4)
    rows, columns = np.indices(image.shape[:2]) + 0.5
    weights = image[:, :, 0] / image[:, :, 0].sum()
    assert (weights * columns).sum() == pytest.approx(x, abs=0.03)
    assert (weights * rows).sum() == pytest.approx(y, abs=0.03)


def test_disc_is_anti_aliased_solid_inside_and_nothing_outside() -> None:
    image = canvas()
    raster.disc(image, 24.0, 20.0, 8.0, 1.0, WHITE, 1.0)
    rows, columns = np.indices(image.shape[:2]) + 0.5
    distance = np.hypot(columns - 24.0, rows - 20.0)
    assert (image[distance <= 7.5] == 255).all()
    assert (image[distance >= 8.5] == 0).all()
    rim = image[(distance > 7.5) & (distance < 8.5)]
    assert len(np.unique(rim)) > 3


def test_ring_stroke_and_box_cover_their_areas() -> None:
    image = canvas()
    raster.ring(image, 23.7, 20.2, 12.0, 3.0, 1.0, WHITE, 1.0)
    assert area(image) == pytest.approx(2.0 * np.pi * 12.0 * 3.0, rel=0.01)
    image = canvas()
    raster.stroke(image, np.array([[8.0, 9.0], [36.0, 30.0]]), 4.0, 1.0, WHITE, 1.0)
    assert area(image) == pytest.approx(35.0 * 4.0 + np.pi * 2.0**2, rel=0.01)
    image = canvas()
    raster.box(image, 5.25, 6.0, 40.5, 33.75, 6.0, 1.0, WHITE, 1.0)
    assert area(image) == pytest.approx(35.25 * 27.75 - (4.0 - np.pi) * 6.0**2, rel=0.003)


def test_box_shortcut_for_its_core_changes_no_pixel() -> None:
    solid, slow = canvas(), canvas()
    raster.box(solid, 3.3, 4.4, 41.2, 35.1, 5.0, 6.0, WHITE, 1.0)
    # Just below full opacity there is no shortcut, and the weight in 256ths is the same.
    raster.box(slow, 3.3, 4.4, 41.2, 35.1, 5.0, 6.0, WHITE, 1.0 - 1e-9)
    np.testing.assert_array_equal(solid, slow)


def test_see_through_stroke_is_even_where_its_segments_meet_and_cross() -> None:
    image = canvas()
    cross = np.array([[10.0, 10.0], [30.0, 30.0], [30.0, 10.0], [10.0, 30.0]])
    raster.stroke(image, cross, 4.0, 1.0, WHITE, 0.5)
    assert image.max() == image[20, 20, 0] == image[30, 30, 0] == 128


def test_alpha_blends_exactly_at_both_ends() -> None:
    image = np.full((9, 9, 3), (10, 200, 77), dtype=np.uint8)
    raster.disc(image, 4.5, 4.5, 4.0, 1.0, (255, 0, 33), 0.0)
    assert (image == (10, 200, 77)).all()
    raster.disc(image, 4.5, 4.5, 4.0, 1.0, (255, 0, 33), 1.0)
    assert tuple(image[4, 4]) == (255, 0, 33)
    raster.disc(image, 4.5, 4.5, 4.0, 1.0, (5, 100, 133), 0.5)
    assert tuple(image[4, 4]) == (130, 50, 83)


@pytest.mark.parametrize(("x", "y"), [(-3.0, 5.0), (48.0, 40.0), (24.0, -1.0), (1e300, 20.0), (-1e9, -1e9)])
def test_shapes_over_the_edge_are_clipped(x: float, y: float) -> None:
    small, large = canvas(), canvas(60, 68)
    raster.disc(small, x, y, 6.0, 1.0, WHITE, 1.0)
    raster.disc(large, x + 10.0, y + 10.0, 6.0, 1.0, WHITE, 1.0)
    np.testing.assert_array_equal(small, large[10:50, 10:58])
    raster.ring(small, x, y, 6.0, 2.0, 1.0, WHITE, 1.0)
    raster.box(small, x - 5.0, y - 5.0, x + 5.0, y + 5.0, 1.0, 1.0, WHITE, 1.0)
    raster.stroke(small, np.array([[x, y], [x, y]]), 3.0, 1.0, WHITE, 1.0)


def test_grey_pictures_have_one_channel() -> None:
    grey, color = canvas(channels=1), canvas()
    raster.disc(grey, 20.3, 17.1, 7.0, 1.0, (180,), 0.8)
    raster.disc(color, 20.3, 17.1, 7.0, 1.0, (180, 180, 180), 0.8)
    np.testing.assert_array_equal(grey[:, :, 0], color[:, :, 1])


# Frames


@pytest.mark.parametrize("size", [(64, 36), (84, 84), (32, 32), (200, 400), (301, 97)])
@pytest.mark.parametrize("name", sorted(PRESETS))
def test_frames_have_the_size_asked_for(name: str, size: tuple[int, int]) -> None:
    frame = Renderer(PRESETS[name], size).draw(REST, (3, 5), 0.5)
    assert frame.dtype == np.uint8
    assert frame.shape == (size[1], size[0], 3)


def test_default_size_fits_the_table() -> None:
    assert Renderer(FULL_SIZE).size == (960, 520)
    width, height = Renderer(CHALLENGE).size
    assert width == 960 and height % 8 == 0 and height > 520


def test_numpy_integers_are_sizes() -> None:
    assert Renderer(FULL_SIZE, tuple(np.array([64, 40]))).size == (64, 40)


BAD = {
    "render_size": [(31, 200), (200, 31), (0, 0), (-64, 64), (64.0, 64.0), (64,), (64, 64, 3), 64, "ab", (True, 64)],
    "positions": [np.zeros((2, 2)), np.zeros(6), np.full((3, 2), np.nan), np.full((3, 2), np.inf)],
    "score": [(-1, 0), (0, 1.5), (1,), 3, None],
    "clock": [1.01, -2.0, float("nan")],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in BAD.items() for value in values])
def test_bad_arguments_are_named(name: str, value: Any) -> None:
    size, drawn = (value, {}) if name == "render_size" else (SMALL, {name: value})
    with pytest.raises(ValueError, match=rf"^{name} "):
        Renderer(FULL_SIZE, size).draw(**{"positions": REST, **drawn})


@pytest.mark.parametrize("size", [SMALL, (320, 174)])
def test_pieces_are_where_they_should_be_in_their_colours(size: tuple[int, int]) -> None:
    renderer = Renderer(FULL_SIZE, size)
    frame = renderer.draw(REST)
    # Beside the knob where there is one, or in the middle of a piece too small for it.
    beside = 0.0 if size == SMALL else 0.83 * FULL_SIZE.paddle_radius
    left, right = (pixel(renderer, frame, position + np.array([beside, 0.0])) for position in REST[:2])
    np.testing.assert_allclose(left, COLORS.left, atol=30)
    np.testing.assert_allclose(right, COLORS.right, atol=30)
    assert pixel(renderer, frame, REST[2]).max() < 100
    for mirrored in REST * (1.0, -1.0):
        assert pixel(renderer, frame, mirrored).min() > 180


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.0017, -0.0031), (0.0041, 0.0023)])
def test_pieces_move_by_parts_of_a_pixel(shift: tuple[float, float]) -> None:
    renderer = Renderer(FULL_SIZE, MIDDLE)
    far = np.array([[-0.9, -0.45], [0.9, -0.45], [0.9, 0.45]])
    here = far.copy()
    here[2] = np.array([-0.3, 0.25]) + shift
    dark = renderer.draw(far).astype(int) - renderer.draw(here)
    column, row = place(renderer, here[2])
    around = dark[int(row) - 8 : int(row) + 9, int(column) - 8 : int(column) + 9, 0]
    assert around.sum() > 0
    columns = np.arange(int(column) - 8, int(column) + 9) + 0.5
    # Sideways only: downwards, the shadow has its weight as well.
    assert (around.sum(axis=0) * columns).sum() / around.sum() == pytest.approx(column, abs=0.1)


def test_only_the_neighbourhood_of_a_moved_puck_changes() -> None:
    renderer = Renderer(FULL_SIZE, MIDDLE)
    moved = REST.copy()
    moved[2] += 0.1
    changed = (renderer.draw(REST) != renderer.draw(moved)).any(axis=2)
    assert changed.any()
    for position in (REST[2], moved[2]):
        column, row = (int(v) for v in place(renderer, position))
        changed[row - 8 : row + 10, column - 8 : column + 9] = False
    assert not changed.any()


def test_mirrored_puck_gives_the_mirrored_picture() -> None:
    renderer = Renderer(FULL_SIZE, MIDDLE)
    positions = np.array([[-0.6, -0.4], [0.6, -0.4], [-0.31, 0.23]])
    mirrored = positions.copy()
    mirrored[2, 0] *= -1.0
    # The middle of the upper half: beyond it are the players' colours.
    middle = (slice(20, 65), slice(60, 180))
    picture, mirror = renderer.draw(positions)[middle].astype(int), renderer.draw(mirrored)[middle].astype(int)
    assert picture.min() < 100
    assert abs(picture - mirror[:, ::-1]).max() <= 1


def test_table_keeps_its_proportions_and_the_rest_is_plain() -> None:
    frame = Renderer(FULL_SIZE, (84, 120)).draw(REST)
    flat = Renderer(FULL_SIZE, (84, 46)).draw(REST)
    np.testing.assert_array_equal(frame[37:83], flat)
    assert (frame[:37] == COLORS.room).all() and (frame[83:] == COLORS.room).all()


def test_unusual_tables_are_drawn() -> None:
    tiny = dataclasses.replace(
        FULL_SIZE, length=0.2, width=0.08, goal_width=0.03, puck_radius=0.01, paddle_radius=0.012
    )
    long = dataclasses.replace(FULL_SIZE, length=60.0)
    for table in (tiny, long):
        assert Renderer(table, SMALL).draw(np.zeros((3, 2)), (1, 2), 0.5).shape == (52, 96, 3)
    assert min(Renderer(long).size) >= 32


def test_goals_are_open_on_both_sides() -> None:
    renderer = Renderer(FULL_SIZE, MIDDLE)
    frame = renderer.draw(REST)
    depth = 0.5 * FULL_SIZE.length + 0.04
    for side in (-1.0, 1.0):
        mouth = pixel(renderer, frame, np.array([side * depth, 0.0]))
        rail = pixel(renderer, frame, np.array([side * depth, 0.8 * FULL_SIZE.goal_width]))
        assert mouth.max() < 30 < rail.max()


@pytest.mark.parametrize("x", [-1.2, -0.5 * FULL_SIZE.length, 0.5 * FULL_SIZE.length, 1.2, 50.0])
def test_puck_on_and_beyond_the_goal_line_is_drawn(x: float) -> None:
    positions = REST.copy()
    positions[2] = (x, 0.05)
    renderer = Renderer(FULL_SIZE, SMALL)
    frame = renderer.draw(positions)
    if abs(x) < 1.25:
        assert pixel(renderer, frame, positions[2]).max() < 70


def test_score_shows_on_the_players_own_side_in_larger_pictures_only() -> None:
    renderer = Renderer(FULL_SIZE, (320, 174))
    before, after = renderer.draw(REST, (0, 3)), renderer.draw(REST, (4, 3))
    changed = (before != after).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert len(rows) > 0 and rows.max() < 20 and columns.max() < 160
    numbers = [renderer.draw(REST, (n, 3))[:20].tobytes() for n in (*range(11), 26, 123)]
    assert len(set(numbers)) == len(numbers)
    np.testing.assert_array_equal(renderer.draw(REST, (0, 3)), before)
    tiny = Renderer(FULL_SIZE, SMALL)
    np.testing.assert_array_equal(tiny.draw(REST, (0, 0), 0.0), tiny.draw(REST, (4, 3), 1.0))


def test_clock_grows_towards_the_pucks_side_and_warns() -> None:
    renderer = Renderer(FULL_SIZE, (320, 174))
    still = renderer.draw(REST)

    def lit(clock: float) -> np.ndarray:
        return (renderer.draw(REST, (0, 0), clock) != still).any(axis=2)

    assert lit(0.2).sum() < lit(0.6).sum() < lit(1.0).sum()
    assert np.nonzero(lit(0.9))[1].mean() > 170
    assert np.nonzero(lit(-0.9))[1].mean() < 150
    np.testing.assert_array_equal(lit(0.7), lit(-0.7)[:, ::-1])

    def color(clock: float) -> np.ndarray:
        return renderer.draw(REST, (0, 0), clock)[lit(0.1)].astype(int).max(axis=0)

    assert color(0.2)[2] >= color(0.2)[0] - 5
    assert color(1.0)[0] > color(1.0)[1] + 100


def test_same_arguments_same_bits_and_no_aliasing() -> None:
    renderer, before = Renderer(FULL_SIZE, MIDDLE), REST.copy()
    first = renderer.draw(REST, (1, 2), 0.4)
    kept = first.copy()
    renderer.draw(-REST, (5, 6), -0.8)
    np.testing.assert_array_equal(first, kept)
    first[:] = 0
    np.testing.assert_array_equal(renderer.draw(REST, (1, 2), 0.4), kept)
    np.testing.assert_array_equal(Renderer(FULL_SIZE, MIDDLE).draw(REST, (1, 2), 0.4), kept)
    np.testing.assert_array_equal(REST, before)


def test_drawing_needs_no_display_or_imaging_library() -> None:
    code = (
        "import sys, airhockey_env.drawing.render, airhockey_env.drawing.window;"
        "assert not {'pygame', 'PIL', 'matplotlib', 'cv2'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# Window


def test_window_shows_a_frame(pygame) -> None:
    frame = Renderer(FULL_SIZE, SMALL).draw(REST)
    window = Window(SMALL, "a title", fps=1000.0)
    window.show(frame)
    assert not window.closed
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, frame)
    assert pygame.display.get_caption()[0] == "a title"
    window.close()
    window.close()
    assert window.closed and not pygame.display.get_init()


def test_window_closed_by_its_user_stops_showing(pygame) -> None:
    frame = Renderer(FULL_SIZE, SMALL).draw(REST)
    window = Window(SMALL, fps=1000.0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    for _ in range(2):
        window.show(frame)
        assert window.closed
    window.close()


def test_window_survives_a_display_shut_down_elsewhere(pygame) -> None:
    window = Window(SMALL, fps=1000.0)
    pygame.display.quit()
    window.show(Renderer(FULL_SIZE, SMALL).draw(REST))
    assert window.closed


def test_later_window_takes_the_earlier_ones_place(pygame) -> None:
    first = Window(SMALL, fps=1000.0)
    second = Window((64, 40), fps=1000.0)
    assert first.closed and not second.closed
    first.close()
    second.show(Renderer(FULL_SIZE, (64, 40)).draw(REST))
    assert not second.closed


def test_window_rejects_frames_that_do_not_fit(pygame) -> None:
    window = Window(SMALL, fps=1000.0)
    for bad in (np.zeros((96, 52, 3), np.uint8), np.zeros((52, 96, 3)), np.zeros((52, 96), np.uint8)):
        with pytest.raises(ValueError, match=r"^frame "):
            window.show(bad)
    for fps in (0.0, math.inf, True):
        with pytest.raises(ValueError, match=r"^fps must be "):
            Window(SMALL, fps=fps)


def test_missing_pygame_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match=r"\[human\]"):
        Window(SMALL)


@pytest.mark.filterwarnings("ignore:.*invalid escape sequence")  # moviepy, where pip has not compiled it
def test_gymnasiums_record_video(tmp_path):
    pytest.importorskip("moviepy", reason='needs the extra "video"')
    env = gymnasium.make("AirHockey-v0", render_mode="rgb_array", render_size=(64, 36), max_episode_steps=6)
    env = gymnasium.wrappers.RecordVideo(env, str(tmp_path / "videos"), episode_trigger=lambda episode: True)
    env.reset(seed=0)
    for _ in range(6):
        env.step(env.action_space.sample())
    env.close()
    (video,) = (tmp_path / "videos").iterdir()
    assert video.suffix == ".mp4" and video.stat().st_size > 500
