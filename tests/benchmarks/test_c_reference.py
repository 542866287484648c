"""The game in C that the benchmark measures against is the same game, whatever compiler builds it."""

from __future__ import annotations

import platform
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from gymnasium.vector import AutoresetMode

from airhockey_env.game import Game
from airhockey_env.kernel.state import CONTACT_ROWS, LEFT
from airhockey_env.reset_options import ResetOptions
from benchmarks.speed import build
from benchmarks.speed.reference import C_STATE, OUTPUTS, CGame, library, outputs_of

COMPILERS = build.compilers()
TABLES, STEPS = 128, 300
# The processors that object code is made for, whatever the one that runs this: -march= of gcc and of clang.
X86 = ("haswell", "bdver2", "skylake-avx512", "sapphirerapids")
ARM = ("armv8-a", "armv8.3-a", "armv8.6-a+sve2")
HERE = X86 if platform.machine().lower() in ("x86_64", "amd64") else ARM
ARM_COMPILERS = (
    ("aarch64-linux-gnu-gcc",),
    ("clang", "--target=aarch64-linux-gnu", "--sysroot=/usr/aarch64-linux-gnu", "-I/usr/aarch64-linux-gnu/include"),
)

needs_compiler = pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
every_compiler = pytest.mark.parametrize("command", COMPILERS, ids=" ".join)


def the_same(game: Game, c_game: CGame) -> None:
    for name in C_STATE.names:
        np.testing.assert_array_equal(c_game.states[name], game.states[name], err_msg=name)
    recorded = np.arange(CONTACT_ROWS) < game.out.n_contacts[:, np.newaxis]
    for name in OUTPUTS:
        ours, theirs = outputs_of(game, name), c_game.out[name]
        if name == "contacts":
            ours, theirs = ours[recorded], theirs[recorded]
        np.testing.assert_array_equal(theirs, ours, err_msg=name)


@every_compiler
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("play", ["random", "chase"])
def test_the_c_game_plays_the_same_to_the_bit(mode: AutoresetMode, play: str, command: tuple[str, ...]) -> None:
    game = Game(TABLES, autoreset_mode=mode, max_episode_steps=200, num_threads=1)
    game.reset(seed=0)
    c_game = CGame(game, library(command))
    the_same(game, c_game)
    rng = np.random.default_rng(0)
    contacts = goals = timeouts = 0
    for _ in range(STEPS):
        actions = rng.uniform(-1.5, 1.5, (TABLES, 2)).astype(np.float32)
        if play == "chase":  # contacts of every kind: the puck is squeezed against walls and posts
            actions[:, 0] = game.out.observation[LEFT][:, 8] - game.out.observation[LEFT][:, 0]
            actions[:, 1] = game.out.observation[LEFT][:, 9] - game.out.observation[LEFT][:, 1]
            actions *= 20.0
        game.step(left=actions)
        c_game.step(actions)
        the_same(game, c_game)
        contacts = max(contacts, int(game.out.n_contacts.max()))
        goals += int(game.out.terminated.sum())
        timeouts += int(game.out.truncated.sum())
    assert contacts >= 3
    assert goals > 100
    assert timeouts > 5 or play == "chase"


@every_compiler
def test_resets_are_the_same(command: tuple[str, ...]) -> None:
    game = Game(TABLES, num_threads=1)
    rows = np.arange(TABLES)
    game.seed(rows.tolist(), rows, lambda n: np.zeros(n))
    c_game = CGame(game, library(command))
    game.begin(rows, ResetOptions())
    c_game.reset()
    the_same(game, c_game)


def fused(command: tuple[str, ...], options: list[str], folder: Path, link: bool = False) -> list[str]:
    """The fused multiply-adds of the game as this compiler builds it with these options."""
    found = build.fused(build.build(command, options, folder / "airhockey.o", link))
    if found is None:
        pytest.skip("needs a disassembler")
    return found


@every_compiler
def test_nothing_is_fused_on_this_processor(command: tuple[str, ...], tmp_path: Path) -> None:
    assert fused(command, build.flags(command), tmp_path, link=True) == []


@pytest.mark.parametrize(
    ("command", "processor"),
    [
        *((command, processor) for command in COMPILERS for processor in HERE),
        *((command, processor) for command in ARM_COMPILERS if shutil.which(command[0]) for processor in ARM),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_nothing_is_fused_on_any_processor(command: tuple[str, ...], processor: str, tmp_path: Path) -> None:
    options = [flag for flag in build.flags(command) if flag not in build.NATIVE] + [f"-march={processor}"]
    if not build.knows(command, options[-1], "-include", "math.h"):
        pytest.skip("the compiler does not build for this processor")
    assert fused(command, options, tmp_path) == []


@every_compiler
def test_what_is_fused_is_found(command: tuple[str, ...], tmp_path: Path) -> None:
    options = ["-O3", f"-march={HERE[0]}", "-ffp-contract=fast"]
    if not build.knows(command, *options):
        pytest.skip("the compiler does not build for this processor")
    assert len(fused(command, options, tmp_path)) > 10


def test_flags_that_a_compiler_does_not_know_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler = tmp_path / "compiler.py"  # an old one of ARM's, say
    compiler.write_text("import sys\nsys.exit('-march=native' in sys.argv or '-fno-tree-slp-vectorize' in sys.argv)\n")
    command = (sys.executable, str(compiler))
    assert build.flags(command) == ["-O3", "-mcpu=native", "-ffp-contract=off", "-fno-math-errno"]
    monkeypatch.setenv("CC", " ".join(command))
    assert build.compiler() == command


def test_a_compiler_that_is_missing_or_broken_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(DependencyNotInstalled, match="no-such-compiler"):
        build.compiler()
    broken = (sys.executable, "-c", "raise SystemExit('no headers')")
    with pytest.raises(DependencyNotInstalled, match="no headers"):
        build.build(broken, build.FLAGS, tmp_path / "airhockey.so")


@needs_compiler
def test_actions_of_another_kind_are_refused() -> None:
    c_game = CGame(Game(TABLES))
    with pytest.raises(ValueError, match=r"^actions .*float32"):
        c_game.step(np.zeros((TABLES, 2)))
