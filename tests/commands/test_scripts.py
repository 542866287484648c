"""Every command, by a small real run in a folder of its own; and what it says when something is wrong."""

from __future__ import annotations

import dataclasses
import io
import json
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from agents.conditions import Conditions
from agents.measuring.evaluation import OPPONENTS
from agents.sb3_files import read_model
from airhockey_env.cameras import CAMERAS, SLOW, Camera
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.tables import CHALLENGE, PRESETS, TABLE_RANGES, TABLES
from benchmarks.speed import options
from benchmarks.speed.measure import Effort
from tests.helpers import ROOT, Call, run

SCRIPTS = sorted(path.stem for path in ROOT.glob("scripts/[!_]*.py"))
TINY = (
    *("--num-envs", "8", "--n-steps", "16", "--batch-size", "64", "--net-width", "8"),
    *("--eval-episodes", "2", "--report-episodes", "2", "--threads", "1"),
)
UPDATE = 8 * 16
PNG = b"\x89PNG"
LAST_LINE = "model.zip, policy.npz, evaluations.json, training.png"


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tiny run that was trained to its end."""
    folder = tmp_path_factory.mktemp("trained")
    printed = run(
        *("train_ppo", "--name", "tiny", "--steps", str(2 * UPDATE), "--eval-every", str(UPDATE)),
        *("--warmup-steps", "1000"),
        *("--video-seconds", "0.2", *TINY),
        folder=folder,
    )
    assert LAST_LINE in printed
    for told in ("80%", "1,000 steps", "striker", f"{2 * UPDATE} steps"):  # what it will do, and that this is little
        assert told in " ".join(printed.split())
    return folder / "runs" / "tiny"


def copy_of(trained: Path, folder: Path) -> Path:
    """The model and records of a run, to spoil."""
    copied = folder / "runs" / "tiny"
    copied.mkdir(parents=True)
    for name in ("config.json", "model.zip", "policy.npz", "evaluations.json"):
        (copied / name).write_bytes((trained / name).read_bytes())
    return copied


def contents(run: Path) -> dict[str, bytes]:
    """What the files in a run's folder hold; the lock is no part of it."""
    return {path.name: path.read_bytes() for path in run.iterdir() if path.is_file() and path.name != ".lock"}


@pytest.mark.parametrize("script", SCRIPTS)
def test_help(script: str, call: Call) -> None:
    printed = call(script, "--help")
    assert f"python -m scripts.{script}" in printed


CONDITIONS = {"--table", "--randomize", "--camera", "--action-delay-ms", *PRESETS, *TABLE_RANGES, *CAMERAS}
"""What the help says of the conditions of play."""


@pytest.mark.parametrize(
    "script",
    ["evaluate", "exploit", "export", "ladder", "make_dataset", "play", "record_video", "robustness", "scorecard"],
)
def test_help_names_all_players(script: str, call: Call) -> None:
    words = [word.rstrip(".,:") for word in call(script, "--help").split()]
    assert {*OPPONENTS, "policy.npz", "model.zip", "--trust"} <= set(words)


@pytest.mark.parametrize("script", ["evaluate", "ladder", "make_dataset", "play", "record_video", "scorecard"])
def test_help_names_all_conditions(script: str, call: Call) -> None:
    assert set(CONDITIONS) <= {word.rstrip(".,:") for word in call(script, "--help").split()}


@pytest.mark.parametrize("script", ["train", "train_ppo", "train_self_play"])
def test_help_of_training_names_all_conditions(script: str, call: Call) -> None:
    words = {word.rstrip(".,:") for word in call(script, "--help").split()}
    assert {*CONDITIONS, "--stack"} <= words


@pytest.mark.parametrize("script", SCRIPTS)
def test_an_unknown_option(script: str, call: Call) -> None:
    assert f"scripts.{script} --help" in call(script, "--no-such-option", "1", fails=True)


class TestTrainPpo:
    def test_the_folder_of_a_run(self, trained: Path) -> None:
        from PIL import Image

        assert json.loads((trained / "config.json").read_text())["steps"] == 2 * UPDATE
        assert list((trained / "tensorboard").glob("events.*"))
        assert not list(trained.rglob("*part*"))
        history = json.loads((trained / "evaluations.json").read_text(), parse_constant=pytest.fail)
        assert history["practice"] is None, "it was not over yet"
        assert [row["steps"] for row in history["evaluations"]] == [0, UPDATE, 2 * UPDATE]
        assert [row["steps"] for row in history["updates"]] == [UPDATE, 2 * UPDATE]
        assert [row["opponent"] for row in history["report"]] == list(OPPONENTS)
        assert all(row["points"] == 2 for row in history["report"])
        for name in ("training.png", "video.gif"):
            with Image.open(trained / name) as picture:
                assert min(picture.size) > 300

    def test_resume(self, trained: Path, tmp_path: Path, call: Call) -> None:
        copied = copy_of(trained, tmp_path)
        printed = call("train_ppo", "--resume", "tiny", "--steps", str(4 * UPDATE))
        assert "python -m airhockey_env.web --run runs/tiny" in " ".join(printed.split())
        assert read_model(copied / "model.zip").data["num_timesteps"] == 4 * UPDATE
        history = json.loads((copied / "evaluations.json").read_text())
        assert [row["steps"] for row in history["updates"]] == [UPDATE * k for k in (1, 2, 3, 4)]
        seconds = [row["seconds"] for row in history["updates"]]
        assert seconds == sorted(seconds)
        assert MlpPolicy.load(copied / "policy.npz").weights[0].shape[0] == 8, "with the run's own arguments"

    def test_conditions_and_a_stack(self, tmp_path: Path, call: Call) -> None:
        """The files are not needed again: config.json has what was in them."""
        (tmp_path / "table.json").write_text(json.dumps({**dataclasses.asdict(CHALLENGE), "puck_mass": 0.02}))
        (tmp_path / "ranges.yml").write_text("length: [1.9, 2.0]\nwidth: [1.0, 1.1]")
        (tmp_path / "camera.yaml").write_text("delay_ms: [10, 20]\nnoise_mm: 2")
        files = ("--table", "table.json", "--randomize", "ranges.yml", "--camera", "camera.yaml")
        steps = ("--steps", str(UPDATE), "--warmup-steps", "0", "--video-seconds", "0.1")
        call("train_ppo", "--name", "far", *files, "--action-delay-ms", "5", "9", "--stack", "3", *steps, *TINY)
        for path in tmp_path.glob("*.*"):
            path.unlink()
        folder = tmp_path / "runs" / "far"
        kept = json.loads((folder / "config.json").read_text())
        conditions = Conditions.of_dict(kept["conditions"])
        assert conditions.table == dataclasses.replace(CHALLENGE, puck_mass=0.02)
        assert conditions.randomize == {"length": (1.9, 2.0), "width": (1.0, 1.1)}
        assert conditions.camera == Camera(delay_ms=(10, 20), noise_mm=2)
        assert conditions.action_delay_ms == (5, 9)
        assert LAST_LINE in call("train_ppo", "--resume", "far", "--steps", str(3 * UPDATE))
        policy = MlpPolicy.load(folder / "policy.npz")
        assert policy.stack == 3
        assert policy.weights[0].shape == (8, 45)
        assert "--camera" in call("train_ppo", "--resume", "far", "--camera", "robot", fails=True)
        (folder / "config.json").write_text(json.dumps({**kept, "conditions": {"table": {}}}))
        assert "config.json" in call("train_ppo", "--resume", "far", fails=True)

    def test_a_finished_run_gets_what_it_lacks(self, trained: Path, tmp_path: Path, call: Call) -> None:
        """As after Ctrl-C in the last evaluation."""
        copied = copy_of(trained, tmp_path)
        history = json.loads((copied / "evaluations.json").read_text())
        (copied / "evaluations.json").write_text(json.dumps({**history, "evaluations": [], "report": []}))
        for _ in range(2):
            assert LAST_LINE in call("train_ppo", "--resume", "tiny")
            history = json.loads((copied / "evaluations.json").read_text())
            assert [row["steps"] for row in history["evaluations"]] == [2 * UPDATE]
            assert len(history["report"]) == len(OPPONENTS)

    def test_what_is_not_resumed(self, trained: Path, tmp_path: Path, call: Call) -> None:
        copied = copy_of(trained, tmp_path)
        before = contents(copied)
        printed = call("train_ppo", "--resume", "tiny", "--steps", str(UPDATE), fails=True)
        assert all(told in printed for told in ("--steps", str(2 * UPDATE), str(UPDATE)))
        assert "--seed" in call("train_ppo", "--resume", "tiny", "--seed", "3", fails=True)
        assert before == contents(copied)

    @pytest.mark.parametrize("command", ["train_ppo", "train_self_play"])
    def test_runs_and_files_are_opponents(self, command: str, trained: Path, tmp_path: Path, call: Call) -> None:
        copied = copy_of(trained, tmp_path)
        members = ("striker", str(copied.relative_to(tmp_path)), str(copied / "policy.npz"))
        arguments = ("--opponent", *members, "--eval-opponent", members[1], "--start", "tiny", "--video-seconds", "0.1")
        assert LAST_LINE in call(command, "--name", "other", "--steps", str(UPDATE), *arguments, *TINY)
        run = tmp_path / "runs" / "other"
        assert json.loads((run / "config.json").read_text())["opponent"] == list(members)
        history = json.loads((run / "evaluations.json").read_text())
        assert [row["opponent"] for row in history["evaluations"]] == ["tiny"] * 2
        assert history["practice"] is None and LAST_LINE in call(command, "--resume", "other")

    def test_a_run_is_not_overwritten(self, trained: Path, tmp_path: Path, call: Call) -> None:
        copied = copy_of(trained, tmp_path)
        before = (copied / "model.zip").read_bytes()
        assert "runs/tiny contains a run already" in call("train_ppo", "--name", "tiny", *TINY, fails=True)
        assert (copied / "model.zip").read_bytes() == before

    @pytest.mark.parametrize("name", ["config.json", "model.zip", "evaluations.json"])
    def test_damaged_runs_are_not_resumed(self, name: str, trained: Path, tmp_path: Path, call: Call) -> None:
        copied = copy_of(trained, tmp_path)
        (copied / name).write_bytes(b"{}")
        assert str(Path("runs/tiny")) in call("train_ppo", "--resume", "tiny", fails=True)
        assert (copied / name).read_bytes() == b"{}"


class TestTrainSelfPlay:
    def test_a_run_and_going_on_with_it(self, tmp_path: Path, call: Call) -> None:
        steps = ("--steps", str(4 * UPDATE), "--eval-every", str(2 * UPDATE), "--warmup-steps", str(UPDATE))
        league = ("--snapshot-every", str(UPDATE), "--most-past-selves", "2")
        assert LAST_LINE in call("train_self_play", "--name", "own", *steps, *league, "--video-seconds", "0", *TINY)
        folder = tmp_path / "runs" / "own"
        before = {member["name"] for member in json.loads((folder / "league.json").read_text())["members"]}
        assert len(list((folder / "league").iterdir())) == 2
        assert LAST_LINE in call("train_self_play", "--resume", "own", "--steps", str(6 * UPDATE))
        after = {member["name"] for member in json.loads((folder / "league.json").read_text())["members"]}
        assert json.loads((folder / "evaluations.json").read_text())["practice"] == UPDATE
        assert "striker" in before & after
        assert f"self at {5 * UPDATE}" in after - before
        assert read_model(folder / "model.zip").data["num_timesteps"] == 6 * UPDATE

    def test_a_league_of_stacks_through_a_camera(self, tmp_path: Path, call: Call) -> None:
        steps = ("--steps", str(3 * UPDATE), "--warmup-steps", "0", "--snapshot-every", str(UPDATE))
        conditions = ("--camera", "robot", "--stack", "2", "--action-delay-ms", "10")
        call("train_self_play", "--name", "own", *steps, *conditions, "--video-seconds", "0", *TINY)
        past = [MlpPolicy.load(path) for path in (tmp_path / "runs" / "own" / "league").iterdir()]
        assert past and all(policy.stack == 2 for policy in past)

    def test_a_start_from_another_run(self, trained: Path, tmp_path: Path, call: Call) -> None:
        arguments = ("--start", str(trained), "--learning-rate", "0", "--steps", str(UPDATE), "--video-seconds", "0")
        assert LAST_LINE in call("train_self_play", "--name", "own", *arguments, *TINY)
        ours, theirs = (MlpPolicy.load(folder / "policy.npz") for folder in (tmp_path / "runs" / "own", trained))
        for own, other in zip(ours.weights, theirs.weights, strict=True):
            np.testing.assert_array_equal(own, other)


def test_distill_from_a_run(trained: Path, tmp_path: Path, call: Call) -> None:
    steps = ("--steps", str(2 * UPDATE), "--imitation-steps", str(UPDATE), "--stack", "2", "--camera", "robot")
    arguments = ("--teacher", str(trained), *steps, "--video-seconds", "0.2")
    printed = call("distill", "--name", "student", *arguments, *TINY)
    assert LAST_LINE in printed and str(trained) in "".join(printed.split())
    assert MlpPolicy.load(tmp_path / "runs" / "student" / "policy.npz").stack == 2
    assert LAST_LINE in call("distill", "--resume", "student", "--steps", str(3 * UPDATE))


def test_curves_of_two_runs(trained: Path, tmp_path: Path, call: Call) -> None:
    copied = copy_of(trained, tmp_path)
    copied.rename(copied.parent / "other")
    printed = call("curves", str(trained), "other", "--plot", "curves.png")
    assert "tiny" in printed and "other" in printed
    assert (tmp_path / "curves.png").read_bytes().startswith(PNG)


def test_the_model_card_of_a_run(trained: Path, tmp_path: Path, call: Call) -> None:
    copied = copy_of(trained, tmp_path)
    few = {
        "ladder": ("striker", "--only", "--points", "4"),
        "scorecard": ("--points", "2", "--episodes", "2"),
        "exploit": ("--steps", "64", "--seeds", "1", "--kinds", "own", "--points", "2"),
    }
    for name, arguments in few.items():
        call(name, str(copied), *arguments, "--json", f"{name}.json")
    files = [word for name in few for word in (f"--{name}", f"{name}.json")]
    assert "README.md" in call("model_card", copied.name, *files)
    card = (copied / "README.md").read_text()
    for part in ("scripts.train_ppo --name", "| `striker` |", "## Rating", "## Tasks", "## Exploitability"):
        assert part in card
    call("model_card", copied.name, "--out", "other.md")
    assert "## Rating" not in (tmp_path / "other.md").read_text()


class TestEvaluate:
    def test_a_run(self, trained: Path, tmp_path: Path, call: Call) -> None:
        printed = call("evaluate", str(trained), "--episodes", "4", "--json", "result.json")
        written = json.loads((tmp_path / "result.json").read_text())
        assert written["model"] == str(trained)
        assert [row["opponent"] for row in written["results"]] == list(OPPONENTS)
        for row in written["results"]:
            assert row["opponent"] in printed
            assert row["wins"] + row["losses"] + row["draws"] == row["points"] == 4

    def test_a_models_file_plays_as_its_policy(self, trained: Path, tmp_path: Path, call: Call) -> None:
        results = []
        for name in ("model.zip", "policy.npz"):
            call("evaluate", str(trained / name), "--opponent", "goalie", "--episodes", "4", "--json", f"{name}.json")
            results.append(json.loads((tmp_path / f"{name}.json").read_text())["results"])
        assert results[0] == results[1]

    def test_a_scripted_player(self, call: Call) -> None:
        printed = call("evaluate", "striker", "--opponent", "goalie", "--episodes", "20")
        assert printed == call("evaluate", "striker", "--opponent", "goalie", "--episodes", "20")
        assert printed != call("evaluate", "striker", "--opponent", "goalie", "--episodes", "20", "--seed", "1")

    def test_a_task(self, tmp_path: Path, call: Call) -> None:
        printed = call("evaluate", "striker", "--task", "hit", "--episodes", "20", "--json", "result.json")
        assert "20 episodes" in printed
        (row,) = json.loads((tmp_path / "result.json").read_text())["results"]
        assert row["task"] == "hit"
        assert row["successes"] + row["failures"] + row["timeouts"] == row["episodes"] == 20

    def test_conditions(self, tmp_path: Path, call: Call) -> None:
        conditions = ("--table", "challenge", "--randomize", "tables", "--camera", "slow", "--action-delay-ms", "20")
        for task in ("point", "hit"):
            printed = set()
            for given in ((), conditions):
                line = ("expert", "--task", task, "--episodes", "200", "--json", "result.json", *given)
                printed.add(call("evaluate", *line, *(("--opponent", "striker") if task == "point" else ())))
            assert len(printed) == 2
            written = json.loads((tmp_path / "result.json").read_text())["conditions"]
            assert Conditions.of_dict(written) == Conditions(CHALLENGE, TABLES, SLOW, 20.0)

    def test_without_a_model_the_help_is_named(self, call: Call) -> None:
        assert "python -m scripts.evaluate --help" in call("evaluate", fails=True)

    def test_a_damaged_file(self, trained: Path, tmp_path: Path, call: Call) -> None:
        (tmp_path / "model.zip").write_bytes((trained / "model.zip").read_bytes()[:-100])
        assert "model.zip" in call("evaluate", "model.zip", fails=True)

    def test_ctrl_c(self, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr("scripts.evaluate.play_points", interrupt)
        assert call("evaluate", "idle", fails=True).strip() == "Stopped."


class TestRecordVideo:
    def test_gif(self, trained: Path, tmp_path: Path, call: Call) -> None:
        from PIL import Image

        call("record_video", str(trained), "--seconds", "0.4", "--out", "play.gif")
        with Image.open(tmp_path / "play.gif") as video:
            assert video.format == "GIF"
            assert video.size == (640, 344)
            assert video.n_frames == 10

    def test_conditions(self, tmp_path: Path, call: Call) -> None:
        names = []
        for k, given in enumerate([(), ("--randomize", "tables"), ("--camera", "slow"), ("--action-delay-ms", "90")]):
            names.append(f"{k}.gif")
            call("record_video", "expert", "--seconds", "1", "--fps", "5", "--out", names[-1], *given)
        assert len({(tmp_path / name).read_bytes() for name in names}) == 4

    def test_mp4(self, tmp_path: Path, call: Call) -> None:
        """With an odd width and height, which the format does not take."""
        ffmpeg = pytest.importorskip("imageio_ffmpeg")
        call("record_video", "striker", "--seconds", "0.4", "--out", "play.mp4", "--width", "333", "--height", "201")
        frames, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "play.mp4"))
        assert frames == 10
        assert seconds == pytest.approx(0.4)
        reader = ffmpeg.read_frames(str(tmp_path / "play.mp4"))
        assert next(reader)["size"] == (332, 200)
        reader.close()
        assert [path.name for path in tmp_path.iterdir()] == ["play.mp4"]

    def test_a_missing_extra_is_named(self, call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
        (tmp_path / "video.mp4").write_text("old")
        assert '".[video]"' in call("record_video", "idle", "--seconds", "0.2", "--out", "video.mp4", fails=True)
        assert (tmp_path / "video.mp4").read_text() == "old"


class TestBenchmark:
    def test_a_quick_one(self, tmp_path: Path, call: Call) -> None:
        page = "# Speed\n\n<!-- table {part} -->\n<!-- end of table {part} -->\n"
        (tmp_path / "page.md").write_text(page.format(part="batch"))
        files = ("--json", "result.json", "--plot", "plot.png", "--page", "page.md")
        printed = call("benchmark", "--quick", "--only", "batch", *files)
        assert "Batches" in printed
        rows = json.loads((tmp_path / "result.json").read_text())["batch"]
        assert {row["at"] for row in rows} == {1, 16, 256}
        assert all(row["best"] >= row["per_second"] > 0.0 for row in rows)
        written = (tmp_path / "page.md").read_text(encoding="utf-8")
        assert "| environments |" in written and "| its compiled step alone |" in written
        assert (tmp_path / "plot.png").read_bytes().startswith(PNG)

    def test_a_terminal_without_the_letters_gets_others(
        self, tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
        monkeypatch.setattr(sys, "stdout", shown)
        call("benchmark", "--quick", "--only", "single")
        shown.seek(0)
        assert "?s a step" in shown.read()

    @pytest.mark.parametrize("part", ["c_flags", "single", "options", "pucks", "start", "training"])
    def test_every_part(self, part: str) -> None:
        module = import_module(f"benchmarks.speed.{part}")
        rows, _ = module.measure(Effort(1, 0.001, quick=True))
        assert rows
        head, *cells = module.table(rows)
        assert cells and all(len(line) == len(head) for line in cells)

    def test_ratios_are_written_for_reading(self) -> None:
        """Regression: those from 100 on were 1.2e+02."""
        speeds = {options.DEFAULT: 122.4, "a": 99.6, "b": 99.4, "c": 26.2, "d": 3.14, "e": 0.0421, options.CART: 1.0}
        rows = [{"what": what, "at": 1, "per_second": speed, "best": speed} for what, speed in speeds.items()]
        assert [line[-1] for line in options.table(rows)[1:]] == ["122", "100", "99", "26", "3.1", "0.042", "1"]

    def test_a_page_without_a_place_is_refused_before_anything_is_measured(self, tmp_path: Path, call: Call) -> None:
        page = "<!-- table batch -->\n<!-- end of table batch -->\n"
        (tmp_path / "page.md").write_text(page)
        assert "'c_flags'" in call("benchmark", "--quick", "--page", "page.md", fails=True)
        assert (tmp_path / "page.md").read_text() == page
