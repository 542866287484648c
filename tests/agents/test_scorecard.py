"""Score cards: hand-made scenes for every count, and what must hold for any play."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.conditions import EXACT, Conditions
from agents.measuring.evaluation import play_points
from agents.measuring.scorecard import Defence, measure
from agents.measuring.scorecard_report import draw_card
from agents.measuring.shares import Share, quartiles
from agents.measuring.shots import Recorder, play_on, speed_of
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.tables import FIELDS, FULL_SIZE, TABLES
from tests.helpers import Call

REACH = FULL_SIZE.paddle_radius + FULL_SIZE.puck_radius
STILL = (0.0, 0.0)
ASIDE = (0.9, 0.5)


class Scene:
    """One table on which both paddles do as the scene says, and a recorder that looks on."""

    def __init__(
        self,
        left: tuple[float, float],
        right: tuple[float, float],
        puck: tuple[float, float],
        velocity: tuple[float, float] = STILL,
    ) -> None:
        self.game = Game(1, right=None)
        self.game.reset()
        table = self.game.states
        table["position"][0] = left, right, puck
        table["velocity"][0, PUCK] = velocity
        table["side"] = -1 if puck[0] < 0.0 else 1
        self.recorder = Recorder(self.game)

    def play(
        self, left: tuple[float, float] = STILL, right: tuple[float, float] = STILL, seconds: float = 2.0
    ) -> Scene:
        """Both do the same until the point or the time is over; actions as the players see them."""
        for _ in range(round(seconds * 50)):
            self.game.step(np.array([left], np.float32), np.array([right], np.float32))
            self.recorder.note(np.ones(1, np.bool_))
            if self.game.out.terminated[0]:
                break
        return self


def turned(place: tuple[float, float]) -> tuple[float, float]:
    return -place[0], -place[1]


@pytest.mark.parametrize("shooter", [LEFT, RIGHT])
class TestScenes:
    """Each from both sides: what the left player does in the scene as written, the right one does in its image."""

    def scene(self, shooter: int, own: Any, other: Any, puck: Any, velocity: Any = STILL) -> Scene:
        if shooter == LEFT:
            return Scene(own, other, puck, velocity)
        return Scene(turned(other), turned(own), turned(puck), turned(velocity))

    def play(self, scene: Scene, shooter: int, own: Any, other: Any = STILL, seconds: float = 2.0) -> Recorder:
        left, right = (own, other) if shooter == LEFT else (other, own)
        return scene.play(left, right, seconds).recorder

    def test_a_direct_goal(self, shooter: int) -> None:
        scene = self.scene(shooter, (-0.9, 0.0), ASIDE, (-0.4, 0.0))
        recorder = self.play(scene, shooter, (1.0, 0.0))
        (shot,) = recorder.shots
        assert shot["shooter"] == shooter and shot["scored"] and not shot["touched"] and not shot["banked"]
        assert 8.0 < speed_of(recorder.shots)[0] < 1.8 * FULL_SIZE.paddle_speed
        courses = play_on(recorder.shots, 50)
        assert courses.on_target.all() and not courses.bank.any()
        assert courses.arrives == pytest.approx(0.0, abs=1e-9)
        assert recorder.goals == 1 and not recorder.own_goals.any() and not recorder.fouls.any()
        assert recorder.zone[shooter] > 0 and recorder.zone[1 - shooter] > 0
        assert recorder.zone.sum() == recorder.steps

    def test_a_bank_goal(self, shooter: int) -> None:
        # The puck leaves along the line of centres, by 0.52 rad; off the wall it goes into the goal.
        angle = 0.52
        puck = np.array([-0.6, 0.0])
        own = puck - 2.0 * REACH * np.array([math.cos(angle), math.sin(angle)])
        scene = self.scene(shooter, tuple(own), ASIDE, tuple(puck))
        recorder = self.play(scene, shooter, (math.cos(angle), math.sin(angle)))
        (shot,) = recorder.shots
        assert shot["shooter"] == shooter and shot["scored"] and not shot["touched"]
        courses = play_on(recorder.shots, 50)
        assert courses.on_target.all() and courses.bank.all()

    def test_a_wall_before_the_last_touch_makes_no_bank_shot(self, shooter: int) -> None:
        scene = self.scene(shooter, (-0.9, 0.0), ASIDE, (-0.6, 0.0), (0.0, 0.0))
        scene.game.states["position"][0, PUCK] = (-0.6, 0.45) if shooter == LEFT else (0.6, -0.45)
        scene.game.states["velocity"][0, PUCK] = (-0.5, 1.0) if shooter == LEFT else (0.5, -1.0)
        recorder = Recorder(scene.game)
        walls = 0
        for _ in range(200):  # at the puck's height until it is there
            own, puck = (scene.game.states["position"][0, disc] for disc in (shooter, PUCK))
            sign = 1.0 if shooter == LEFT else -1.0
            action = np.array([[0.0, np.clip(20.0 * sign * (puck[1] - own[1]), -1.0, 1.0)]], np.float32)
            if abs(puck[1] - own[1]) < 0.003:
                action[0, 0] = 1.0
            actions = (action, np.zeros((1, 2), np.float32))
            scene.game.step(*(actions if shooter == LEFT else actions[::-1]))
            recorder.note(np.ones(1, np.bool_))
            walls += int((scene.game.out.contacts[0, : scene.game.out.n_contacts[0]]["b"] < 0).sum())
            if len(recorder.shots) or (recorder.zone[shooter] and walls):
                break
        assert walls
        start = recorder._live if not len(recorder.shots) else recorder.shots
        assert start["shooter"][0] == shooter and not start["banked"][0]

    def test_off_target(self, shooter: int) -> None:
        scene = self.scene(shooter, (-0.9, 0.35), ASIDE, (-0.4, 0.35))
        recorder = self.play(scene, shooter, (1.0, 0.0))
        shot = recorder.shots[0]  # over when it came back from the end wall to the paddle, which has run after it
        assert shot["shooter"] == shooter and not shot["scored"] and not shot["touched"]
        assert len(recorder.shots) > 1, "the paddle shoots once more, over the line"
        courses = play_on(recorder.shots[:1], 50)
        assert not courses.on_target.any() and not courses.bank.any()
        assert abs(courses.arrives[0]) == pytest.approx(0.35, abs=1e-9)

    def test_an_own_goal(self, shooter: int) -> None:
        scene = self.scene(shooter, (-0.5, 0.0), ASIDE, (-0.8, 0.0))
        recorder = self.play(scene, shooter, (-1.0, 0.0))
        assert recorder.goals == 1
        assert recorder.own_goals[shooter] == 1 and recorder.own_goals[1 - shooter] == 0
        assert not len(recorder.shots)
        assert recorder.possession[shooter] > 0 and recorder.zone[shooter] == 0

    def test_fouls_take_turns(self, shooter: int) -> None:
        scene = self.scene(shooter, (-0.9, 0.0), ASIDE, (-0.4, 0.0))
        recorder = self.play(scene, shooter, STILL, seconds=7.0)
        assert not recorder.fouls.any()
        recorder = self.play(scene, shooter, STILL, seconds=0.02)
        assert recorder.fouls[shooter] == 1 and recorder.fouls[1 - shooter] == 0
        recorder = self.play(scene, shooter, STILL, seconds=7.02)
        assert recorder.fouls[shooter] == 1 and recorder.fouls[1 - shooter] == 1
        assert not len(recorder.shots) and recorder.goals == 0
        assert not recorder.possession.any(), "nobody has touched it"

    def test_a_save(self, shooter: int) -> None:
        scene = self.scene(shooter, (-0.9, 0.0), (0.9, 0.0), (-0.4, 0.0))
        recorder = self.play(scene, shooter, (1.0, 0.0))
        shot = recorder.shots[0]
        assert shot["shooter"] == shooter and shot["touched"] and not shot["scored"]
        assert play_on(recorder.shots[:1], 50).on_target.all()
        assert not recorder.own_goals.any()

    def test_a_save_that_fails(self, shooter: int) -> None:
        # The other paddle moves away from its goal, past the puck: it touches that, and it goes in all the same.
        scene = self.scene(shooter, (-0.9, 0.1), (1.05, 0.185), (-0.4, 0.1))
        recorder = self.play(scene, shooter, (1.0, 0.0), (-1.0, 0.0))
        (shot,) = recorder.shots
        assert shot["shooter"] == shooter and shot["touched"] and shot["scored"]
        assert recorder.own_goals[1 - shooter] == 1


def watched(
    first: str, second: str, points: int, conditions: Conditions = EXACT
) -> tuple[list[tuple[Recorder, int]], Any]:
    recorders: list[tuple[Recorder, int]] = []

    def observer(game: Game, own: int) -> Callable[[NDArray[np.bool_]], None]:
        recorders.append((Recorder(game), own))
        return recorders[-1][0].note

    return recorders, play_points(first, second, points, conditions=conditions, observer=observer)


@pytest.mark.parametrize("conditions", [EXACT, Conditions(randomize=TABLES)])
def test_what_must_hold_for_any_play(conditions: Conditions) -> None:
    recorders, result = watched("striker", "goalie", 200, conditions)
    assert result == play_points("striker", "goalie", 200, conditions=conditions), "who looks on changes nothing"
    assert sum(recorder.goals for recorder, _ in recorders) == result.wins + result.losses
    assert sum(recorder.steps for recorder, _ in recorders) / 50 == pytest.approx(result.seconds * result.points)
    for recorder, _ in recorders:
        shots = recorder.shots
        courses = play_on(shots, 50)
        assert 0.1 < courses.bank.mean() < 0.9 and 0.1 < courses.on_target.mean() < 0.9
        untouched = ~shots["touched"]
        assert shots["scored"].any()
        # The engine says the same of a shot that nobody stopped as the game did. (It may have come back off the end
        # wall and gone in off its shooter, whose touch is an own one: those are not shots.)
        assert courses.on_target[untouched & shots["scored"]].all()
        assert not (courses.on_target & untouched & ~shots["scored"]).any()
        assert np.isfinite(courses.arrives[courses.on_target]).all()
        goals = shots["spec"][:, FIELDS.index("goal_width")]
        assert (np.abs(courses.arrives) < 0.5 * goals)[courses.on_target].all()
        deflected = (shots["scored"] & shots["touched"]).sum()
        assert shots["scored"].sum() + recorder.own_goals.sum() - deflected <= recorder.goals
        assert (recorder.zone + recorder.possession <= recorder.steps).all()


def test_reaction() -> None:
    game = Game(200, task="defend", right="idle")
    game.reset(seed=0)
    defence = Defence(game)
    assert 0.3 < defence.has_to_move.mean() < 0.95
    assert defence.courses.on_target.mean() > 0.9
    assert 0.3 < defence.courses.bank.mean() < 0.7
    towards = np.sign(np.nan_to_num(defence.courses.passes - game.states["position"][:, LEFT, 1]))
    waiting = np.arange(200) % 4  # steps until a player sets off; the fourth sets off to the other side
    running = np.ones(200, np.bool_)
    for step in range(10):
        go = np.where(waiting == 3, -1.0, step >= waiting)
        game.step(np.stack([np.zeros(200), go * towards], axis=1).astype(np.float32))
        defence.note(running)
        running &= ~(game.out.terminated | game.out.truncated)
    still_there = defence.has_to_move & running & (towards != 0.0)
    for wait in range(3):
        assert still_there[waiting == wait].sum() > 5
        np.testing.assert_allclose(defence.reaction[still_there & (waiting == wait)], 0.02 * (wait + 1))
    assert np.isinf(defence.reaction[still_there & (waiting == 3)]).all()


def test_saves_in_the_task_are_its_successes() -> None:
    card = measure("goalie", "idle", player_name="goalie", opponent_name="idle", points=2, episodes=300)
    counted = sum(saves.defend.of for saves in card.saves), sum(saves.defend.count for saves in card.saves)
    wide = card.defend.episodes - counted[0]
    assert 0 <= wide < 30
    assert counted[0] - counted[1] <= card.defend.failures <= counted[0] - counted[1] + wide
    assert card.saves[0].defend.of == 0, "the slowest shots have 2 m/s"
    assert card.fouls >= 2 and card.hit.successes == 0 and card.shots["all"].on_target.of == 0
    assert card.zone + card.possession == card.attacking <= 1.0


def test_shares_and_quartiles() -> None:
    assert Share(0, 0).interval == (0.0, 1.0) and math.isnan(Share(0, 0).value)
    assert Share(1, 4).value == 0.25
    assert quartiles(np.array([1.0, 2.0, 3.0, np.inf, np.inf])) == [2.0, 3.0, np.inf]
    assert all(math.isnan(value) for value in quartiles(np.zeros(0)))


def test_the_command(tmp_path: Path, call: Call) -> None:
    from PIL import Image

    arguments = ("--points", "4", "--episodes", "4", "--opponent", "random")
    printed = call("scorecard", "striker", *arguments, "--json", "card.json", "--plot", "card.png")
    printed = " ".join(printed.split())  # a narrow terminal breaks lines
    assert "Shots of striker" in printed and "play against random" in printed
    written = json.loads((tmp_path / "card.json").read_text(), parse_constant=pytest.fail)
    assert written["play"]["points"] == 4 and written["player"] == "striker"
    assert [task["episodes"] for task in written["tasks"]] == [4, 4]
    assert written["shots"]["all"]["shots"] == sum(written["shots"][kind]["shots"] for kind in ("direct", "bank"))
    with Image.open(tmp_path / "card.png") as picture:
        assert min(picture.size) > 300
    assert not list(tmp_path.glob(".part*"))


def test_texts_beside_the_bars_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: a part's name was wider than its bar or missing, and one foul was "1, 0 an hour"."""
    from matplotlib.legend import Legend

    drawn: list[Any] = []
    monkeypatch.setattr("agents.measuring.scorecard_report.save_figure", lambda figure, _: drawn.append(figure))
    card = measure("idle", "idle", player_name="a", opponent_name="b", points=2, episodes=2)
    draw_card(dataclasses.replace(card, zone=0.78, possession=0.1, fouls=1, seconds=12000.0), FULL_SIZE, tmp_path)
    drawn[0].draw_without_rendering()
    axis = drawn[0].axes[-1]
    names = [child for child in axis.get_children() if isinstance(child, Legend)]
    shown = [[text.get_text() for text in legend.get_texts()] for legend in names]
    assert shown == [["won 0", "drawn 100", "lost 0"], ["far half 78", "in possession 10", "neither 12"]]
    assert "fouls: 1 (0.3 an hour of play)" in axis.texts[-1].get_text()
    frame, bars = axis.get_window_extent(), [bar.get_window_extent() for bar in axis.patches]
    boxes = sorted((part.get_window_extent() for part in (*names, *axis.texts)), key=lambda box: -box.y0)
    for box in boxes:
        assert frame.x0 - 1 <= box.x0 < box.x1 <= frame.x1 + 1 and not any(box.overlaps(bar) for bar in bars)
    assert all(above.y0 > below.y1 for above, below in pairwise(boxes))
