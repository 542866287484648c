"""The passes over a block: the compiler makes them work on several tables at once, without fusing operations."""

from __future__ import annotations

import re

import llvmlite.binding as llvm
import numba
import numpy as np
import pytest
from numba.core import config

from airhockey_env.game import Game
from airhockey_env.kernel import scripted, step
from airhockey_env.kernel.block import BLOCK, TABLES

GAME = Game(1, left=None, right=None, reward="shaped")
RECORD, NUMBER = numba.typeof(np.zeros(1, BLOCK)[0]), numba.int64
SETTINGS = numba.typeof(GAME.settings[0])
CHOICE = tuple(map(numba.typeof, (GAME.states, GAME._drivers, GAME._no_actions)))

PASSES = {  # and how many loops each has: over two seats, two players who look at the table, six coordinates
    scripted.choose: ((RECORD, NUMBER, NUMBER, NUMBER, *CHOICE), 4),
    step.keep_potentials: ((RECORD, NUMBER, SETTINGS), 1),
    step.drive_paddles: ((RECORD, NUMBER), 2),
    step.glide_pucks: ((RECORD, NUMBER), 1),
    step.find_quiet: ((RECORD, NUMBER), 1),
    step.fly_quiet: ((RECORD, NUMBER), 6),
    step.judge_tables: ((RECORD, NUMBER, SETTINGS), 1),
    step.earn: ((RECORD, NUMBER, SETTINGS), 3),
}


def code_of(function, signature):
    """What LLVM made of a function."""
    compiled = numba.njit(function.py_func, nogil=True, error_model="numpy")
    compiled.compile(signature)
    (code,) = compiled.inspect_llvm().values()
    return code


WIDE = not config.DISABLE_JIT and config.CPU_NAME is None and llvm.get_host_cpu_features().get("avx2", False)


@pytest.mark.skipif(not WIDE, reason="for a processor whose registers hold four numbers, where it is worth it")
@pytest.mark.parametrize("function", PASSES, ids=lambda function: function.py_func.__name__)
def test_a_pass_works_on_several_tables_at_once(function):
    signature, loops = PASSES[function]
    code = code_of(function, signature)
    assert re.search(r"<\d+ x (double|i64)>", code)
    assert len(re.findall(r"^vector\.body", code, re.MULTILINE)) >= loops
    assert not re.search(r"llvm\.(fma|fmuladd)|\b(contract|fast|reassoc)\b", code)
    assert "masked.gather" not in code and "masked.scatter" not in code


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_tables_are_not_gathered():
    """Processors gather numbers from far apart many times as slowly as they read them one by one."""
    parameters = numba.typeof(GAME.parameters)
    for function, signature in (
        (step.load, (RECORD, NUMBER, NUMBER, CHOICE[0], parameters, SETTINGS)),
        (step.store, (RECORD, NUMBER, NUMBER, CHOICE[0])),
    ):
        code = code_of(function, signature)
        assert "masked.gather" not in code and "masked.scatter" not in code


def test_blocks_are_even():
    assert TABLES % 2 == 0
    assert all(BLOCK[name].shape[-1] == TABLES for name in BLOCK.names if name != "hits")
