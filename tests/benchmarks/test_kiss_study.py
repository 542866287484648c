"""The kiss study: its numbers where they are known, the laws that its figures show, and what the command writes."""

from __future__ import annotations

import json
import math
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled

from benchmarks import page
from benchmarks.kiss import engines, picture, reversal
from benchmarks.kiss.scenes import METHODS, RADIUS, REACH, Scene, crowd, exact_angle, shot, struck
from scripts.kiss_study import PARTS, KissStudyArgs, kiss_study
from tests.helpers import ROOT

ROUNDING = 1e-9  # degrees


def written_tables(text: str) -> dict[str, list[str]]:
    """Lines of the tables on a page of the study."""
    tables = {}
    for part in PARTS:
        _, rest = text.split(f"<!-- table {part} -->\n")
        inside, _ = rest.split(f"<!-- end of table {part} -->\n")
        tables[part] = [line for line in inside.splitlines() if line]
    return tables


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a quick study."""
    out = tmp_path_factory.mktemp("study")
    kiss_study(KissStudyArgs(out=out, quick=True, json=out / "numbers.json"))
    return out


@pytest.fixture(scope="module")
def numbers(study: Path) -> dict[str, Any]:
    return json.loads((study / "numbers.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("part", [part for part in PARTS if part != "engines"])
def test_every_part_writes_its_figure_and_table(part: str, study: Path) -> None:
    assert (study / f"kiss_{part}.png").read_bytes().startswith(b"\x89PNG")
    assert len(written_tables((study / "kiss_study.md").read_text(encoding="utf-8"))[part]) > 3
    assert not list(study.glob(".part-*"))


def test_the_page_in_docs_is_whole() -> None:
    tables = written_tables((ROOT / "docs" / "kiss_study.md").read_text(encoding="utf-8"))
    for part in PARTS:
        assert len(tables[part]) > 3
    assert len(tables["engines"]) == 2 + 4 * len(engines.RATES)


def test_one_part_leaves_the_others_as_they_are(study: Path, tmp_path: Path) -> None:
    (tmp_path / "kiss_study.md").write_text((study / "kiss_study.md").read_text(encoding="utf-8"), encoding="utf-8")
    before = written_tables((tmp_path / "kiss_study.md").read_text(encoding="utf-8"))
    kiss_study(KissStudyArgs(out=tmp_path, only="picture"))
    assert written_tables((tmp_path / "kiss_study.md").read_text(encoding="utf-8")) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kiss_picture.png", "kiss_study.md"]


def test_the_folder_is_made(tmp_path: Path) -> None:
    kiss_study(KissStudyArgs(out=tmp_path / "new", only="picture"))
    assert (tmp_path / "new" / "kiss_picture.png").exists()
    with pytest.raises(OSError, match=r"--out .*kiss_picture\.png"):
        kiss_study(KissStudyArgs(out=tmp_path / "new" / "kiss_picture.png"))


def test_the_picture_is_that_of_the_triangles(numbers: dict[str, Any]) -> None:
    data = numbers["picture"]
    assert data["hypotenuse"] == pytest.approx(REACH, abs=1e-15)
    assert math.hypot(data["shared_leg"], data["top_leg"]) == pytest.approx(REACH, abs=1e-15)
    kiss = np.array([-math.sqrt(REACH**2 - 0.055**2), 0.055])
    np.testing.assert_allclose(data["kiss"], kiss, atol=1e-15)
    assert data["penetration_time"] == pytest.approx((-0.03 - kiss[0]) / 8.0, abs=1e-15)
    assert data["normal_angle"]["continuous"] == pytest.approx(180.0 - math.degrees(math.asin(0.55)), abs=ROUNDING)
    assert data["normal_angle"]["overlap"] == pytest.approx(math.degrees(math.atan2(0.055, -0.03)), abs=ROUNDING)
    normal = kiss / REACH
    along = normal * (normal @ picture.VELOCITY)
    np.testing.assert_allclose(data["velocities"]["continuous"], [picture.VELOCITY - along, along], atol=1e-14)


@pytest.mark.parametrize(("share", "degrees"), [(0.0, 0.0), (0.5, -30.0), (1.0, -90.0)])
def test_exact_angles(share: float, degrees: float) -> None:
    assert exact_angle(share * REACH) == pytest.approx(degrees, abs=1e-12)


def test_only_the_overlap_is_wrong_and_more_so_the_longer_the_tick(numbers: dict[str, Any]) -> None:
    rows = numbers["error"]["by_travel"]
    assert all(row["worst"] < ROUNDING and row["missed"] == 0.0 for row in rows["continuous"])
    assert all(row["worst"] < ROUNDING for row in rows["kiss"])
    assert [row["missed"] for row in rows["kiss"]] == [row["missed"] for row in rows["overlap"]]
    assert rows["kiss"][-1]["missed"] > 0.0
    short = [
        row["median"] for row, travel in zip(rows["overlap"], numbers["error"]["travels"], strict=True) if travel <= 2
    ]
    assert len(short) >= 2 and short == sorted(short) and short[0] > 0.1


def test_thin_hits_are_worse(numbers: dict[str, Any]) -> None:
    by_offset = numbers["error"]["by_offset"]
    medians = [row["median"] for row in by_offset["overlap"]]
    assert medians[0] < medians[1] < medians[2]
    assert all(row["worst"] < ROUNDING for method in ("kiss", "continuous") for row in by_offset[method])


def test_the_phase_of_the_tick_matters_to_the_overlap_alone(numbers: dict[str, Any]) -> None:
    data = numbers["phases"]
    spread = {method: np.ptp(data["angles"][method]) for method in METHODS}
    assert spread["overlap"] > 20.0 and spread["kiss"] < ROUNDING and spread["continuous"] < ROUNDING
    assert data["angles"]["continuous"][0] == pytest.approx(-math.degrees(math.asin(0.6)), abs=ROUNDING)


def test_a_shot_that_jumps_over_the_puck_is_seen_by_continuous_alone() -> None:
    seen = {method: struck(method, 0.5 * REACH, 0.5, 1.0) is not None for method in METHODS}
    assert seen == {"overlap": False, "kiss": False, "continuous": True}


def test_only_continuous_comes_back() -> None:
    for seed in range(3):
        scene = crowd(seed)
        ways = {method: reversal.there_and_back(scene, method, 60) for method in METHODS}
        assert ways["continuous"][0] > 5 and ways["continuous"][1] < 1e-6
        assert ways["overlap"][1] > reversal.BACK


def test_contacts_are_counted_up_to_the_first_way_without_return() -> None:
    assert reversal.contacts_until_lost([(3, 1e-15), (8, 1e-5), (9, 0.5), (12, 1e-9)]) == 8
    assert reversal.contacts_until_lost([(2, 0.1)]) == 0


@pytest.mark.parametrize("name", [engines.OURS, *engines.PEERS])
class TestEngines:
    """Every engine gets the scenes right as far as it can: nobody is handicapped by a mistake of ours."""

    @staticmethod
    def open_table(name: str, scene: Scene, hz: float) -> engines.Table:
        opened, _, missing = engines.available()
        if name not in opened:
            pytest.skip(missing[0])
        return opened[name](scene, hz)

    def test_a_head_on_shot_hands_everything_over(self, name: str) -> None:
        table = self.open_table(name, shot(10.0, 0.0, 0.3), 240.0)
        for _ in range(20):
            table.step()
        np.testing.assert_allclose(table.velocities, [[0.0, 0.0], [10.0, 0.0]], atol=0.15)
        assert table.positions[1, 0] > 0.2

    def test_a_half_hit_is_about_right(self, name: str) -> None:
        self.open_table(name, shot(10.0, 0.0, 0.3), 240.0)
        result = engines.play_shots(engines.available()[0][name], 1000.0, 10.0, offsets=3, phases=1)
        assert result["missed"] == 0.0
        assert result["worst_error"] is not None and result["worst_error"] < (ROUNDING if name == engines.OURS else 2.0)

    def test_walls_stand_where_they_should(self, name: str) -> None:
        corner = np.array([[0.5, 0.2], [-0.5, -0.2]])
        table = self.open_table(name, Scene(corner, 2.0 * np.array([[1.0, 0.7], [-1.0, -0.7]]), (2.0, 1.0)), 240.0)
        reached = np.zeros(2)
        for _ in range(240):
            table.step()
            reached = np.maximum(reached, np.abs(table.positions).max(axis=0))
        np.testing.assert_allclose(reached, [1.0 - RADIUS, 0.5 - RADIUS], atol=0.01)
        assert (table.velocities**2).sum() == pytest.approx(2 * 4.0 * 1.49, rel=0.05)


def test_without_the_other_engines_their_part_is_not_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in ("Box2D", "pymunk", "mujoco"):
        monkeypatch.setitem(sys.modules, module, None)
    for module in engines.PEERS.values():
        monkeypatch.delitem(sys.modules, f"benchmarks.kiss.{module}", raising=False)
        monkeypatch.delattr(import_module("benchmarks.kiss"), module, raising=False)
    with pytest.raises(DependencyNotInstalled, match=r"--only engines .*\[study\]"):
        kiss_study(KissStudyArgs(out=tmp_path, quick=True, only="engines"))
    printed = capsys.readouterr().out
    assert printed.count('pip install -e ".[study]"') == 3 and "engines is skipped" in printed
    assert not list(tmp_path.iterdir())


def test_a_page_without_a_place_for_a_table_is_refused() -> None:
    with pytest.raises(ValueError, match="'error'"):
        page.insert("# A page\n", "error", [("a",), ("1",)])
