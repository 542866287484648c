"""Threads, forks and signals: what runs beside a step must not break it."""

from __future__ import annotations

import copy
import os
import pickle
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv, AirTable
from airhockey_env.game import ROWS_PER_THREAD
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.threads import Threads
from tests.helpers import random_actions, same

LARGE = 2 * ROWS_PER_THREAD  # tables: two threads share them


def ours() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith("airhockey")]


# The rows are shared


@pytest.mark.parametrize("threads", [1, 2, 3, 7])
@pytest.mark.parametrize("n", [0, 1, 99, 100, 1001])
def test_every_row_is_worked_on_once(n: int, threads: int) -> None:
    done = np.zeros(n, np.int64)

    def work(first: int, last: int, step: int) -> None:
        done[first:last] += step

    shared = Threads(threads)
    shared.share(n, 10, work, 3)
    shared.close()
    assert (done == 3).all()


def test_an_error_in_one_part_waits_for_the_others() -> None:
    finished = []
    first_failed = threading.Event()

    def work(first: int, last: int) -> None:
        if first == 0:
            first_failed.set()
            raise MemoryError
        first_failed.wait()
        finished.append(first)

    shared = Threads(3)
    with pytest.raises(MemoryError):
        shared.share(300, 10, work)
    assert sorted(finished) == [100, 200]
    shared.close()


def test_close_ends_the_threads_and_a_later_step_starts_them_again() -> None:
    before = len(ours())
    for make in (AirHockeyVectorEnv, AirHockeySB3VecEnv):
        envs: Any = make(LARGE, num_threads=2)
        envs.reset()
        envs.step(np.zeros((LARGE, 2), np.float32))
        assert len(ours()) == before + 1
        envs.close()
        assert len(ours()) == before
    envs.step(np.zeros((LARGE, 2), np.float32))
    envs.close()
    assert len(ours()) == before


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))])
def test_a_copy_has_threads_and_a_lock_of_its_own(copied: Any) -> None:
    envs = AirHockeyVectorEnv(LARGE, num_threads=2)
    envs.reset(seed=0)
    actions = random_actions(0, 1, LARGE)[0]
    envs.step(actions)
    other = copied(envs)
    with envs._game._threads.lock:
        stepped = []
        beside = threading.Thread(target=lambda: stepped.append(other.step(actions)))
        beside.start()
        beside.join()
    assert same(stepped[0][:4], envs.step(actions)[:4])
    envs.close()
    other.close()


# Callers' threads


@pytest.mark.parametrize("n", [1, 64, LARGE])
def test_two_threads_that_step_one_batch_take_turns(n: int) -> None:
    """As many steps are played as by one thread, and every one is whole: the results are those of one thread."""
    steps, callers = 40, 4
    envs = AirHockeyVectorEnv(n, num_threads=2)
    alone = AirHockeyVectorEnv(n, num_threads=1)
    envs.reset(seed=0)
    alone.reset(seed=0)
    actions = random_actions(0, 1, n)[0]  # always the same, so that the order does not matter
    expected = [alone.step(actions)[0].tobytes() for _ in range(steps * callers)]
    with ThreadPoolExecutor(callers) as pool:
        found = list(pool.map(lambda _: envs.step(actions)[0].tobytes(), range(steps * callers)))
    assert sorted(found) == sorted(expected)
    assert same(envs.get_state(), alone.get_state())
    envs.close()


def test_two_threads_may_step_look_and_save_at_once() -> None:
    """Whatever one thread sees of a table while another plays it is a state between two steps."""
    env, alone = AirHockeyEnv(render_mode="rgb_array", render_size=(64, 48)), AirHockeyEnv()
    env.reset(seed=0)
    alone.reset(seed=0)
    actions = np.ones(2, np.float32) * 0.3
    states = [alone.get_state().tobytes()]
    for _ in range(150):
        alone.step(actions)
        states.append(alone.get_state().tobytes())
    over = threading.Event()
    seen: list[bytes] = []

    def look() -> None:
        while not over.is_set():
            seen.append(env.get_state().tobytes())
            env.render()

    watcher = threading.Thread(target=look)
    watcher.start()
    for _ in range(150):
        env.step(actions)
    over.set()
    watcher.join()
    assert seen and set(seen) <= set(states)


def test_two_threads_that_step_one_air_table_take_turns() -> None:
    """A crowd, so that the pairs that are near each other are kept in arrays of their own."""
    rng = np.random.default_rng(0)
    places = np.stack(np.meshgrid(np.linspace(-0.8, 0.8, 8), np.linspace(-0.3, 0.3, 4)), axis=-1).reshape(-1, 2)
    table = AirTable(places, rng.uniform(-1.0, 1.0, places.shape), 0.03)
    alone = copy.deepcopy(table)
    expected = [alone.step(0.01).tobytes() for _ in range(200)]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: table.step(0.01).tobytes(), range(200)))
    assert sorted(found) == sorted(expected) and any(expected)
    assert same(table.positions, alone.positions) and table.time == alone.time


# Forks


FORK = """
import os, threading
import numpy as np
from airhockey_env import AirHockeyVectorEnv

envs = AirHockeyVectorEnv(4096, num_threads=2)
envs.reset(seed=0)
actions = np.zeros((4096, 2), np.float32)
envs.step(actions)
held, fork_is_over = threading.Event(), threading.Event()

def hold():
    with envs._game._threads.lock:
        held.set()
        fork_is_over.wait()

holder = threading.Thread(target=hold)  # in the middle of a step of its own
holder.start()
held.wait()
child = os.fork()
if child == 0:
    envs.step(actions)
    os._exit(37 if np.isfinite(envs.step(actions)[0]).all() else 1)
fork_is_over.set()
holder.join()
envs.step(actions)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_child_steps_a_batch_that_has_stepped_with_threads() -> None:
    """Regression: it waited for ever for threads that stayed in the parent."""
    run = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORK]
    result = subprocess.run(run, capture_output=True, text=True, timeout=300)
    assert result.stdout.split() == ["37"], result.stderr


MEMORY = """
import hashlib, threading
import numpy as np
from airhockey_env import Game

def play(allocating):
    over = threading.Event()

    def allocate():
        while not over.is_set():
            np.full(5000, 1e300)
            np.full(6700, 3.0)

    others = [threading.Thread(target=allocate) for _ in range(allocating)]
    for thread in others:
        thread.start()
    game = Game(3000, num_threads=1)
    game.reset(seed=5)
    rng = np.random.default_rng(0)
    digest = hashlib.sha256()
    for _ in range(100):
        game.step(left=rng.uniform(-1.0, 1.0, (3000, 2)))
        digest.update(game.get_state())
    over.set()
    for thread in others:
        thread.join()
    return digest.hexdigest()

assert len({play(0), play(1), play(2)}) == 1
print("alike")
"""


def test_no_other_thread_is_given_the_memory_of_a_step() -> None:
    """Regression: the room of a block was freed before the step, which glibc's threads notice if they share a heap."""
    environment = {**os.environ, "MALLOC_ARENA_MAX": "1"}
    result = subprocess.run(
        [sys.executable, "-c", MEMORY], capture_output=True, text=True, timeout=300, env=environment
    )
    assert result.stdout.split() == ["alike"], result.stderr


# Ctrl-C


INTERRUPT = """
import os, signal, sys, threading, time
import numpy as np
from airhockey_env import AirHockeyVectorEnv

n = int(sys.argv[1])
envs = AirHockeyVectorEnv(n, num_threads=2, autoreset_mode="SameStep")
envs.reset(seed=0)
actions = np.zeros((n, 2), np.float32)
envs.step(actions)
over = threading.Event()
playing = False

def press():
    while not over.is_set():
        time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGINT)

def handle(number, frame):
    # Only what the step was doing when Ctrl-C was pressed counts, not this script's own loop around it.
    if playing and frame.f_code.co_filename != "<string>":
        raise KeyboardInterrupt

signal.signal(signal.SIGINT, handle)

presser = threading.Thread(target=press)
presser.start()
caught = 0
playing = True
while caught < 200:
    try:
        while True:
            envs.step(actions)
    except KeyboardInterrupt:
        caught += 1
playing = False
signal.signal(signal.SIGINT, signal.SIG_IGN)
over.set()
presser.join()
state = envs.get_state()
assert np.isfinite(state["position"]).all()
envs.step(actions)
print("played on")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals of POSIX")
@pytest.mark.parametrize("n", [1, LARGE])
def test_ctrl_c_in_the_middle_of_a_step_is_a_keyboard_interrupt(n: int) -> None:
    """Regression: it was now and then a SystemError, where compiled code handed out arrays."""
    result = subprocess.run([sys.executable, "-c", INTERRUPT, str(n)], capture_output=True, text=True, timeout=300)
    assert result.stdout.split() == ["played", "on"], result.stderr


TERMINATE = """
import os, signal
import gymnasium as gym
import airhockey_env

env = gym.make("AirHockey-v0", render_mode="human")
env.reset(seed=0)
env.step(env.action_space.sample())
os.kill(os.getpid(), signal.SIGTERM)
for _ in range(5):
    env.step(env.action_space.sample())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals of POSIX")
def test_sigterm_ends_a_process_that_has_a_window() -> None:
    """Regression: SDL made an event of the window out of it."""
    screen = {**os.environ, "SDL_VIDEODRIVER": "dummy"}
    result = subprocess.run([sys.executable, "-c", TERMINATE], capture_output=True, env=screen, timeout=300)
    assert result.returncode == -signal.SIGTERM, result.stderr


def test_ctrl_c_while_another_thread_works_waits_for_it() -> None:
    """The rows may not be touched before: a signal is sent while the caller waits for the other part."""
    caller_is_done, told = threading.Event(), threading.Event()
    finished = []

    def work(first: int, last: int) -> None:
        if first == 0:
            caller_is_done.set()
            return
        caller_is_done.wait()
        signal.raise_signal(signal.SIGINT)  # is handled by the main thread, which waits
        told.wait(1.0)
        finished.append(first)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    shared = Threads(2)
    try:
        with pytest.raises(KeyboardInterrupt):
            shared.share(200, 10, work)
        assert finished == [100]
    finally:
        signal.signal(signal.SIGINT, before)
        shared.close()
