"""The torture chamber sees faults, writes files that reproduce them, and every file ever found plays as it should."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from airhockey_env import AirHockeyVectorEnv, game
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from scripts import torture
from tests.helpers import ROOT
from tests.torture import chamber, hostile
from tests.torture.cases import Case
from tests.torture.trial import play_case

REGRESSIONS = sorted(torture.REGRESSIONS.glob("*.json"))


@pytest.mark.parametrize("path", REGRESSIONS, ids=lambda path: path.stem)
def test_what_was_found_once_holds_now(path: Path) -> None:
    assert play_case(Case.load(path)) == ""


def test_a_bout_is_counted_and_repeats_to_the_bit() -> None:
    first, second = (chamber.play_bout(seed=4, number=8, steps=500, trials=6) for _ in range(2))
    assert first == second and first.cases == []
    assert first.hostile_steps == 2 * 512, "every eighth bout plays them twice"
    assert first.trials == 6 and first.trial_steps > 100 and first.operations > 60


def lively_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Walls that give energy."""
    good = game.make_parameters

    def bad(*arguments: object) -> np.ndarray:
        parameters = good(*arguments)
        parameters["wall_restitution"] = 1.3
        return parameters

    monkeypatch.setattr(game, "make_parameters", bad)


def forgetful_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """States that lose the shot clock when they are put back."""
    good = AirHockeyVectorEnv.set_state

    def bad(self: AirHockeyVectorEnv, state: np.ndarray, indices: object = None) -> None:
        state = state.copy()
        state["clock"] = 0
        good(self, state, indices)

    monkeypatch.setattr(AirHockeyVectorEnv, "set_state", bad)


def late_rewards(monkeypatch: pytest.MonkeyPatch) -> None:
    """A face that gives other rewards than the game."""
    good = AirHockeySB3VecEnv.step_wait

    def bad(self: AirHockeySB3VecEnv) -> tuple:
        observations, rewards, dones, infos = good(self)
        return observations, np.where(dones, np.float32(0.5), rewards), dones, infos

    monkeypatch.setattr(AirHockeySB3VecEnv, "step_wait", bad)


def meek_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """A batch that takes actions that are no numbers."""
    good = game.Game.check_actions

    def bad(self: game.Game, seat: int, actions: object) -> np.ndarray:
        return good(self, seat, None if actions is None else np.nan_to_num(actions))

    monkeypatch.setattr(game.Game, "check_actions", bad)


FAULTS = {
    lively_walls: ("game", "the puck gained speed without a paddle"),
    forgetful_states: ("vector", "not the same bits: "),
    late_rewards: ("sb3", "not the same bits: reward"),
    meek_checks: ("", "bad input was not refused"),
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_fault_is_caught_and_its_file_reproduces_it(
    fault: object, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    face, law = FAULTS[fault]
    with monkeypatch.context() as broken:
        fault(broken)
        tally = chamber.Tally()
        for number in range(20):
            tally.add(chamber.play_bout(seed=0, number=number, steps=2000 if face == "game" else 1, trials=20))
            found = [case for case in tally.cases if law in case.law and face in case.face]
            if found:
                break
        chamber.save_cases(tally, tmp_path, seed=0)
        path = tally.files[tally.cases.index(found[0])]
        assert sorted(tmp_path.iterdir()) == sorted(set(tally.files)) and len(tally.files) == len(tally.cases)
        assert play_case(Case.load(path)) == found[0].law
    assert play_case(Case.load(path)) == ""


def run(arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> object:
    """Run the command; its exit code."""
    monkeypatch.setattr(sys, "argv", ["torture", *arguments])
    with pytest.raises(SystemExit) as ended:
        torture.main()
    return ended.value.code


def test_the_command_reports_failures_and_replays_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(chamber, "HOSTILE_STEPS", 100)
    with monkeypatch.context() as broken:
        lively_walls(broken)
        broken.setattr(chamber, "play_bout", lambda seed, number: GOOD_BOUT(seed, number, 3000, 0))
        assert run(["--seconds", "100", "--steps", "3000", "--out", str(tmp_path)], broken) == 1
        (path,) = tmp_path.iterdir()
        assert f"the puck gained speed without a paddle: {path}" in capsys.readouterr().out
        assert run(["--replay", str(path)], broken) == 1
    assert run(["--replay", str(path)], monkeypatch) == 0
    assert "all laws hold" in capsys.readouterr().out


GOOD_BOUT = chamber.play_bout


def test_ctrl_c_reports_what_was_done(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def play(seed: int, number: int) -> chamber.Tally:
        if number == 2:
            raise KeyboardInterrupt
        return GOOD_BOUT(seed, number, 100, 0)

    monkeypatch.setattr(chamber, "play_bout", play)
    assert run(["--out", str(tmp_path)], monkeypatch) == 130
    assert "bouts 0 to 1" in capsys.readouterr().out


def test_hostile_play_gives_a_case_of_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    lively_walls(monkeypatch)
    case = hostile.play_hostile("full_size", 50.0, 3000, seed=0).case
    assert case is not None and [operation["do"] for operation in case.operations] == ["state", "step"]


def test_the_command_names_what_it_needs() -> None:
    code = "import sys; sys.modules['pettingzoo'] = None; from scripts import torture; torture.main()"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("torture: ") and "airhockey-env[multiagent]" in done.stderr
    assert "Traceback" not in done.stderr
