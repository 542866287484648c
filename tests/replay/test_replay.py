"""Replays: recorded through the environment, played back equal to the bit, refused where they would not be."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys

import gymnasium as gym
import numpy as np
import pytest

import airhockey_env
from airhockey_env import AirHockeyEnv, replay
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.parallel_env import AGENTS, AirHockeyParallelEnv
from airhockey_env.replay import (
    RecordReplay,
    RecordVectorReplay,
    Replay,
    is_replay,
    play_back,
    play_back_frames,
    playback,
)
from airhockey_env.replay.parallel import RecordParallelReplay
from airhockey_env.saved_states import game_state
from tests.helpers import IDS, pursue, random_actions, shown

VARIANTS = [
    {},
    {"opponent": "random", "opponent_skill": 0.6},
    {"opponent": pursue, "reward": "shaped"},
    {"continuous": False, "table": "challenge", "control_hz": 30},
    {"continuous": False, "opponent": pursue, "obs_type": "grayscale"},
    {"randomize": {"width": (1.0, 1.2), "puck_radius": (0.03, 0.045)}, "opponent": "goalie", "reward": "shaped"},
]


def record(path, name="AirHockey-v0", seed=0, steps=200, limit=70, **arguments):
    """Record some episodes; the states that were seen on the way."""
    env = RecordReplay(gym.make(name, max_episode_steps=limit, **arguments), path)
    observation, _ = env.reset(seed=seed)
    states = [env.unwrapped.get_state()]
    for action in random_actions(seed, steps, 1, arguments.get("continuous", True))[:, 0]:
        chase = isinstance(env.action_space, gym.spaces.Box) and observation.shape == (13,) and len(states) % 3
        _, _, terminated, truncated, _ = result = env.step(pursue(observation[np.newaxis])[0] if chase else action)
        observation = result[0]
        states.append(env.unwrapped.get_state())
        if terminated or truncated:
            observation, _ = env.reset()
            states.append(env.unwrapped.get_state())
    if env._recordings[0].starts[-1] == len(env._recordings[0].actions):
        env.step(env.action_space.sample() * 0)
        states.append(env.unwrapped.get_state())
    env.close()
    return states


def plays_back(path, states):
    played = list(play_back(path))
    assert len(played) == len(states)
    assert all(one.dtype == other.dtype and one.tobytes() == other.tobytes() for one, other in zip(played, states))  # noqa: B905


def changed(path, target, **arrays):
    """A replay's file with other arrays in it."""
    with np.load(path) as file:
        np.savez(target, **{**file, **arrays})
    return target


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("replays") / "game.npz"
    record(path)
    return path


@pytest.mark.parametrize("seed", [0, 1, 2**40])
@pytest.mark.parametrize("arguments", VARIANTS, ids=shown)
def test_plays_back_equal_to_the_bit(arguments, seed, tmp_path):
    path = tmp_path / "game.npz"
    states = record(path, seed=seed, **arguments)
    plays_back(path, states)
    loaded = Replay.load(path)
    assert len(loaded.starts) > 2 and loaded.seeds[:2] == (seed, None)
    assert len(loaded) == len(states) - len(loaded.starts) >= 200
    assert loaded.actions.dtype == (np.float32 if arguments.get("continuous", True) else np.int8)
    assert len(loaded.right_actions) == (len(loaded) if arguments.get("opponent") is pursue else 0)


@pytest.mark.parametrize("name", IDS)
def test_every_task(name, tmp_path):
    path = tmp_path / "game.npz"
    plays_back(path, record(path, name=name, seed=3))
    assert Replay.load(path).id == name


def test_what_the_file_holds(recorded):
    with np.load(recorded, allow_pickle=False) as file:
        assert set(file.files) == {"replay", "starts", "states", "ends", "actions", "right_actions"}
        notes = json.loads(str(file["replay"]))
    assert notes["version"] == airhockey_env.__version__ and notes["id"] == "AirHockey-v0"
    assert notes["arguments"]["opponent"] == "striker" and notes["arguments"]["task"] == "point"
    assert notes["seeds"][0] == 0
    assert recorded.stat().st_size < 12_000  # 200 steps
    loaded = Replay.load(recorded)
    assert loaded.control_hz == 50.0 and loaded.seconds == len(loaded) / 50.0


def test_the_environment_itself_from_seed_and_actions(recorded):
    """The file is enough to play the same through `gymnasium.make`."""
    loaded = Replay.load(recorded)
    env = gym.make(loaded.id, opponent=loaded.arguments["opponent"])
    env.reset(seed=loaded.seeds[0])
    stop = loaded.starts[1]
    for action in loaded.actions[:stop]:
        env.step(action)
    assert env.unwrapped.get_state().tobytes() == loaded.ends[:1].tobytes()


def test_a_state_that_is_set_on_the_way_begins_a_take(tmp_path):
    path = tmp_path / "game.npz"
    env = RecordReplay(AirHockeyEnv(opponent="goalie"), path)
    env.reset(seed=4)
    states = [env.unwrapped.get_state()]
    for step, action in enumerate(random_actions(1, 60, 1)[:, 0]):
        if step in (20, 21, 40):
            env.unwrapped.set_state(states[10])
            states.append(env.unwrapped.get_state())
        env.step(action)
        states.append(env.unwrapped.get_state())
    env.close()
    assert Replay.load(path).starts.tolist() == [0, 20, 21, 40]
    plays_back(path, states)


def test_options_of_a_reset_and_a_reset_without_play(tmp_path):
    path = tmp_path / "game.npz"
    env = RecordReplay(AirHockeyEnv(opponent="idle"), path)
    env.reset(seed=4)
    env.reset(seed=5, options={"puck_position": (0.3, 0.2), "puck_velocity": (-2.0, 1.0)})
    states = [env.unwrapped.get_state()]
    for _ in range(20):
        env.step(np.zeros(2))
        states.append(env.unwrapped.get_state())
    env.close()
    assert Replay.load(path).seeds == (5,)
    plays_back(path, states)


def test_actions_of_any_kind(tmp_path):
    path = tmp_path / "game.npz"
    env = RecordReplay(AirHockeyEnv(opponent="idle"), path)
    env.reset(seed=4)
    states = [env.unwrapped.get_state()]
    for action in ([1e300, -2.0], [0.1, 0.3], np.array([3.0, -0.2], np.float32), (1, -1), np.array([0.7, 0.7])):
        for _ in range(5):
            env.step(action)
            states.append(env.unwrapped.get_state())
    with pytest.raises(ValueError, match="finite"):
        env.step([np.nan, 0.0])
    env.close()
    plays_back(path, states)


def test_written_at_the_ends_of_episodes_and_at_once(tmp_path):
    path = tmp_path / "game.npz"
    env = RecordReplay(AirHockeyEnv(max_episode_steps=10), path)
    for episode in range(3):
        env.reset(seed=episode)
        for _ in range(10):
            env.step(np.zeros(2))
        assert len(Replay.load(path)) == 10 * (episode + 1)
    env.reset()
    env.step(np.zeros(2))
    assert len(Replay.load(path)) == 30
    env.save()
    assert len(Replay.load(path)) == 31
    assert [file.name for file in tmp_path.iterdir()] == ["game.npz"]


def test_a_failed_write_leaves_the_old_file(recorded, tmp_path, monkeypatch):
    path = tmp_path / "game.npz"
    shutil.copy(recorded, path)
    before = path.read_bytes()

    def fail(*_):
        raise OSError("no space left")

    monkeypatch.setattr("airhockey_env.files.os.replace", fail)
    with pytest.raises(OSError, match="no space"):
        Replay.load(recorded).save(path)
    assert path.read_bytes() == before and [file.name for file in tmp_path.iterdir()] == ["game.npz"]


def test_pictures(recorded):
    loaded = Replay.load(recorded)
    number = len(loaded) + len(loaded.starts)
    frames = list(play_back_frames(loaded, size=(64, 32)))
    assert len(frames) == number
    assert all(frame.shape == (32, 64, 3) and frame.dtype == np.uint8 for frame in frames)
    env = gym.make("AirHockey-v0", render_mode="rgb_array", render_size=(64, 32))
    env.reset(seed=0)
    assert (env.render() == frames[0]).all()
    env.step(loaded.actions[0])
    assert (env.render() == frames[1]).all()
    assert len(list(play_back_frames(recorded, size=(64, 32), fps=10))) == -(-number // 5)
    for fps in (0, 51, float("nan")):
        with pytest.raises(ValueError, match=r"^fps must be .* greater than 0 and at most 50.0, got"):
            play_back_frames(recorded, fps=fps)


# Refusal


def test_other_dynamics_are_refused(recorded, tmp_path, monkeypatch):
    message = r"game.npz was recorded with other dynamics, by version .*, and would not play back the same in this"
    loaded = Replay.load(recorded)
    dataclasses.replace(loaded, fingerprint="0" * 32, version="9.9").save(tmp_path / "game.npz")
    for play in (play_back, play_back_frames):
        with pytest.raises(ValueError, match=message):  # at once, not with the first state
            play(tmp_path / "game.npz")
    monkeypatch.setattr(playback, "__version__", "10.0")  # not by the version's number
    list(play_back(recorded))
    monkeypatch.setattr(playback, "fingerprint", lambda arguments: "other")
    with pytest.raises(ValueError, match=r"and would not play back the same in this version 10.0$"):
        play_back(recorded)


def test_the_fingerprint_tells_games_apart_and_repeats():
    base = replay.arguments_of(AirHockeyEnv()._game)
    changes = [
        {"opponent": "goalie"},
        {"opponent": None},
        {"task": "hit"},
        {"control_hz": 60.0},
        {"reward": "shaped"},
        {"randomize": {"width": [1.0, 1.2]}},
        *({"table": {**base["table"], name: value * 0.99}} for name, value in base["table"].items()
          if value > 0.0 and name not in ("puck_mass", "puck_speed")),
    ]  # fmt: skip
    prints = [replay.fingerprint({**base, **change}) for change in ({}, *changes)]
    assert len(set(prints)) == len(prints)
    assert prints[0] == replay.fingerprint(json.loads(json.dumps(base)))


def test_no_limit_is_null_in_files_of_older_versions(recorded, tmp_path):
    loaded, states = Replay.load(recorded), list(play_back(recorded))
    for limit in (-1, None):
        dataclasses.replace(loaded, arguments={**loaded.arguments, "max_episode_steps": limit}).save(tmp_path / "a.npz")
        plays_back(tmp_path / "a.npz", states)


def test_a_replay_opens_no_other_file(recorded, tmp_path):
    MlpPolicy([np.zeros((2, 13))], [np.zeros(2)]).save(tmp_path / "policy.npz")
    loaded = Replay.load(recorded)
    forged = dataclasses.replace(loaded, arguments={**loaded.arguments, "opponent": str(tmp_path / "policy.npz")})
    with pytest.raises(ValueError, match="opponent must be "):
        play_back(forged)


def test_what_the_fingerprint_misses_shows_at_the_end_of_a_take(recorded, tmp_path):
    ends = Replay.load(recorded).ends.copy()
    ends["position"][1, 2, 0] = np.nextafter(ends["position"][1, 2, 0], 9.0)
    path = changed(recorded, tmp_path / "other.npz", ends=ends)
    with pytest.raises(ValueError, match=r"other.npz has not played back the same from step \d+ to \d+: "):
        list(play_back(path))


def test_a_layout_of_another_version(recorded, tmp_path):
    loaded = Replay.load(recorded)
    names = [name for name in loaded.states.dtype.names if name != "wander"]
    path = tmp_path / "other.npz"
    dataclasses.replace(loaded, states=loaded.states[names], ends=loaded.ends[names]).save(path)
    with pytest.raises(ValueError, match=r"other.npz holds states of another layout"):
        play_back(path)


@pytest.mark.parametrize("change", [{"task": "golf"}, {"opponent": "wall"}, {"table": {}}, {"new": 1}], ids=str)
def test_a_game_that_there_is_not(recorded, tmp_path, change):
    loaded = Replay.load(recorded)
    path = tmp_path / "other.npz"
    dataclasses.replace(loaded, arguments={**loaded.arguments, **change}).save(path)
    with pytest.raises(ValueError, match=r"other.npz holds a game that this version cannot play: "):
        play_back(path)


def test_damaged_files(recorded, tmp_path):
    whole = recorded.read_bytes()
    path = tmp_path / "bad.npz"
    spoiled = [b"", b"no replay", whole[:100], whole[: len(whole) // 2], whole[:-10]]
    middle = bytearray(whole)
    middle[len(whole) // 3] ^= 0xFF
    for content in (*spoiled, bytes(middle)):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"bad.npz does not hold a replay: it is .* as RecordReplay writes it$"):
            Replay.load(path)
    with pytest.raises(FileNotFoundError):
        Replay.load(tmp_path / "none.npz")


def test_a_replay_and_a_policy_are_told_apart(recorded, tmp_path):
    """Regression: the errors were NumPy's: "'activation is not a file in the archive'"."""
    with pytest.raises(ValueError, match=r"not hold a policy: it is a file of something else: .* there is 'replay'"):
        MlpPolicy.load(recorded)
    path = tmp_path / "policy.npz"
    MlpPolicy([np.zeros((2, 13))], [np.zeros(2)]).save(path)
    with pytest.raises(ValueError, match=r"not hold a replay: it is a file of something else: .* is 'activation'"):
        Replay.load(path)


def test_files_that_do_not_fit_together(recorded, tmp_path):
    loaded = Replay.load(recorded)
    notes = json.dumps({"format": 2, **{name: getattr(loaded, name) for name in ("version", "id", "seeds")}})
    bad = [
        {"starts": loaded.starts + 1},
        {"starts": loaded.starts[::-1].copy()},
        {"starts": loaded.starts[:-1]},
        {"starts": loaded.starts[:0]},
        {"states": loaded.states[:-1]},
        {"actions": loaded.actions[:, :1]},
        {"actions": loaded.actions[: loaded.starts[-1] - 1]},
        {"actions": np.full_like(loaded.actions, np.nan)},
        {"actions": np.zeros(len(loaded), np.int8)},
        {"right_actions": np.zeros((len(loaded), 2), np.float32)},
        {"replay": np.array(notes)},
        {"replay": np.array("{}")},
        {"replay": np.array("nothing")},
        {"states": np.array([None] * len(loaded.starts))},
    ]
    for arrays in bad:
        path = changed(recorded, tmp_path / "bad.npz", **arrays)
        with pytest.raises(ValueError, match=r"bad.npz does not hold a replay: "):
            Replay.load(path)


# The wrapper


def test_what_the_wrapper_refuses(tmp_path):
    with pytest.raises(ValueError, match=r"^env must be an AirHockeyEnv, got"):
        RecordReplay(gym.make("CartPole-v1"), tmp_path / "game.npz")
    with pytest.raises(ValueError, match=r"^path must end in .npz, got 'game.txt'"):
        RecordReplay(AirHockeyEnv(), tmp_path / "game.txt")
    with pytest.raises(FileNotFoundError, match=r"^path must lie in a folder that exists"):
        RecordReplay(AirHockeyEnv(), tmp_path / "none" / "game.npz")
    with pytest.raises(ValueError, match="inside of ClipAction, which changes actions"):
        RecordReplay(gym.wrappers.ClipAction(AirHockeyEnv()), tmp_path / "game.npz")
    env = RecordReplay(AirHockeyEnv(), tmp_path / "game.npz")
    with pytest.raises(ValueError, match="nothing to replay yet"):
        env.save()
    env.close()
    assert not list(tmp_path.iterdir())


def test_wrappers_around_and_inside(tmp_path):
    path = tmp_path / "game.npz"
    inner = RecordReplay(gym.make("AirHockey-v0", max_episode_steps=15), path)
    env = gym.wrappers.RescaleAction(gym.wrappers.Autoreset(inner), np.float32(0.0), np.float32(1.0))
    env.reset(seed=1)
    for action in random_actions(2, 100, 1)[:, 0]:
        env.step(np.abs(action).clip(0.0, 1.0))
    env.close()
    assert len(list(play_back(path))) == len(Replay.load(path)) + 7
    inside = RecordReplay(gym.wrappers.Autoreset(gym.make("AirHockey-v0", max_episode_steps=15)), path)
    inside.reset(seed=1)
    for action in random_actions(2, 100, 1)[:, 0]:
        inside.step(action.clip(-1.0, 1.0))
    inside.close()
    assert len(list(play_back(path))) == 101
    assert inside.spec is None or "RecordReplay" in inside.spec.to_json()


# Two players, and tables of a batch


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"task": "match", "reward": "shaped", "table": "challenge"},
        {"continuous": False, "obs_type": "grayscale", "control_hz": 30},
        {"randomize": {"width": (1.0, 1.2)}, "reward": "shaped"},
    ],
    ids=shown,
)
def test_two_players(arguments, tmp_path):
    path = tmp_path / "game.npz"
    env = RecordParallelReplay(AirHockeyParallelEnv(max_episode_steps=70, **arguments), path)
    assert env.max_num_agents == 2
    env.reset(seed=3)
    states = [env.unwrapped.get_state()]
    continuous = arguments.get("continuous", True)
    for actions in random_actions(3, 200, 2, continuous):
        if continuous and len(states) % 3 and arguments.get("obs_type") is None:
            actions = [pursue(seen[np.newaxis])[0] for seen in env.unwrapped.observe().values()]
        env.step(dict(zip(AGENTS, actions, strict=True)))
        states.append(env.unwrapped.get_state())
        if not env.agents:
            assert len(Replay.load(path)) == len(env._recordings[0].actions)  # written at the end of an episode
            assert env.step({}) == ({}, {}, {}, {}, {})
            env.reset()
            states.append(env.unwrapped.get_state())
    env.close()
    plays_back(path, states)
    loaded = Replay.load(path)
    assert loaded.arguments["opponent"] is None and loaded.id is None and loaded.seeds[:2] == (3, None)
    assert len(loaded) == len(loaded.right_actions) == 200 and len(loaded.starts) > 2
    dataclasses.replace(loaded, fingerprint="0" * 32).save(path)
    with pytest.raises(ValueError, match=r"game.npz was recorded with other dynamics"):
        play_back(path)


MIXED = ["striker", pursue, "goalie", lambda seen: np.zeros((len(seen), 2))]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize(
    ("arguments", "tables"),
    [
        ({}, [0, 3]),
        ({"opponent": pursue, "reward": "shaped"}, [4, 1]),
        ({"opponent": MIXED, "reward": "shaped"}, [2]),
        ({"opponent": MIXED, "reward": "shaped"}, [1, 3, 5]),
        ({"continuous": False, "randomize": {"width": (1.0, 1.2)}, "task": "match"}, [0, 1, 2, 3, 4, 5]),
    ],
    ids=shown,
)
def test_tables_of_a_batch(arguments, tables, mode, tmp_path):
    """Each plays back as a table of its own, whose states are those that the batch showed."""
    path = tmp_path / "game.npz"
    envs = RecordVectorReplay(
        gym.make_vec("AirHockey-v0", num_envs=6, max_episode_steps=40, autoreset_mode=mode, **arguments), path, tables
    )
    seen = {i: [] for i in tables}
    ended = np.zeros(6, int)

    def note():
        geometry = envs.unwrapped.positions, envs.unwrapped.velocities
        for i in tables:
            seen[i].append(np.stack([one[i] for one in geometry]))

    envs.reset(seed=7)
    note()
    for actions in random_actions(2, 130, 6, arguments.get("continuous", True)):
        _, _, terminated, truncated, _ = envs.step(actions)
        note()
        over = terminated | truncated
        ended += over
        if mode == "Disabled" and over.any():
            envs.reset(options={"reset_mask": over})
            note()
    envs.close()
    loaded = Replay.load(path)
    played = [game_state(one) for one in play_back(path)]
    begins = np.append(loaded.starts + np.arange(len(loaded.starts)), len(played))
    firsts = [loaded.seeds.index(7 + i) for i in tables]  # only each table's first take was seeded
    assert firsts[0] == 0 and firsts == sorted(firsts) and len(loaded.starts) > 2 * len(tables)
    for i, first, stop in zip(tables, firsts, [*firsts[1:], len(loaded.starts)], strict=True):
        geometry = {
            np.stack([one["position"][0], one["velocity"][0]]).tobytes() for one in played[begins[first] : begins[stop]]
        }
        assert len(geometry) > 100 and {one.tobytes() for one in seen[i]} <= geometry
        assert stop - first - 1 <= ended[i] <= stop - first
    assert loaded.arguments["opponent"] == {0: "striker", 2: "goalie"}.get(tables[0])


def test_what_the_wrapper_of_a_batch_refuses(tmp_path):
    path = tmp_path / "game.npz"
    make = lambda **arguments: gym.make_vec("AirHockey-v0", num_envs=4, **arguments)  # noqa: E731
    with pytest.raises(ValueError, match=r"^env must be an AirHockeyVectorEnv, got"):
        RecordVectorReplay(gym.make_vec("CartPole-v1", num_envs=2), path)
    for tables in ([4], [-1], [1, 1], [0.5]):
        with pytest.raises(ValueError, match=r"^tables must be whole numbers from 0 to 3, each once"):
            RecordVectorReplay(make(), path, tables)
    with pytest.raises(ValueError, match=r"^tables must be numbers of one table or more, got \[\]"):
        RecordVectorReplay(make(), path, [])
    with pytest.raises(ValueError, match=r"which is striker, and an opponent from outside plays on table 1: record it"):
        RecordVectorReplay(make(opponent=["striker", pursue]), path, [0, 1])
    with pytest.raises(ValueError, match="inside of ClipAction, which changes actions"):
        RecordVectorReplay(gym.wrappers.vector.ClipAction(make()), path)
    envs = RecordVectorReplay(make(opponent=["striker", "goalie", pursue, pursue]), path, [2])
    envs.reset(seed=0)
    actions = np.zeros((4, 2), np.float32)
    envs.step(actions)
    envs.unwrapped.set_opponents(1, tables=[2])
    before = envs.unwrapped.get_state()
    with pytest.raises(ValueError, match=r"which is an opponent from outside, and goalie plays on table 2: record it"):
        envs.step(actions)
    assert envs.unwrapped.get_state().tobytes() == before.tobytes()
    envs.close()
    assert len(list(play_back(path))) == 2
    with pytest.raises(ValueError, match=r"^env must be an AirHockeyParallelEnv itself, got"):
        RecordParallelReplay(AirHockeyEnv(), path)


# The command


def test_a_video_of_a_replay(recorded, tmp_path, monkeypatch, capsys):
    from PIL import Image

    from scripts import record_video

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["record_video", *map(str, arguments)])
        record_video.main()

    out = tmp_path / "game.gif"
    call(recorded, "--out", out, "--width", 64, "--height", 32, "--fps", 10)
    seconds = Replay.load(recorded).seconds
    with Image.open(out) as video:
        assert video.size == (64, 32) and abs(video.n_frames - 10 * seconds) <= 1
    assert f"{seconds:g} s of play" in capsys.readouterr().out
    call(recorded, "--out", out, "--width", 64, "--height", 32, "--fps", 10, "--seconds", 1)
    with Image.open(out) as video:
        assert video.n_frames == 10
    record(tmp_path / "slow.npz", steps=30, control_hz=12)
    call(tmp_path / "slow.npz", "--out", out, "--width", 64, "--height", 32)  # 12 pictures a second, not 25
    with Image.open(out) as video:
        assert abs(video.n_frames - 30) <= 1
    for option, value in (("--opponent", "goalie"), ("--table", "ideal"), ("--seed", 1)):
        with pytest.raises(SystemExit, match=f"{option} does not go with a replay"):
            call(recorded, "--out", out, option, value)
    two = RecordParallelReplay(AirHockeyParallelEnv(), tmp_path / "two.npz")
    two.reset(seed=0)
    for _ in range(25):
        two.step({agent: np.ones(2, np.float32) for agent in AGENTS})
    two.close()
    call(tmp_path / "two.npz", "--out", out, "--width", 64, "--height", 32, "--fps", 10)
    with Image.open(out) as video:
        assert abs(video.n_frames - 5) <= 1
    dataclasses.replace(Replay.load(recorded), fingerprint="").save(tmp_path / "old.npz")
    with pytest.raises(SystemExit, match=r"was\s+recorded\s+with\s+other\s+dynamics"):
        call(tmp_path / "old.npz", "--out", out)


def test_a_policy_is_no_replay(recorded, tmp_path):
    policy = MlpPolicy([np.zeros((2, 13), np.float32)], [np.zeros(2, np.float32)])
    policy.save(tmp_path / "policy.npz")
    (tmp_path / "text").write_text("text")
    assert is_replay(recorded)
    assert not any(map(is_replay, (tmp_path / "policy.npz", tmp_path / "text", tmp_path, tmp_path / "none", "striker")))
