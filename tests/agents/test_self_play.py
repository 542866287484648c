"""Self-play: whom an agent meets in a league while it trains, and what a resumed run takes up."""

from __future__ import annotations

import dataclasses
import json
import signal
import threading
from pathlib import Path

import numpy as np
import pytest

from agents.training.exchange import Exchange
from agents.training.league import LATEST, LEAST_PRIORITY, League, Member, forward
from agents.training.ppo import make_env, make_model, make_points_env, make_tables
from agents.training.recipe import conditions_of
from agents.training.responses import Responses
from agents.training.self_play import SelfPlayArgs
from agents.training.train import train
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import random_actions, some_policy

UPDATE = 6 * 8
ARGS = SelfPlayArgs(
    num_envs=6,
    n_steps=8,
    batch_size=16,
    net_width=8,
    opponent=("striker", "idle"),
    snapshot_every=UPDATE,
    most_past_selves=2,
)


def learn(steps: int, args: SelfPlayArgs = ARGS) -> League:
    league = League(args)
    make_model(args, make_env(args, opponents=league.pool)).learn(steps, callback=league)
    return league


class TestPractice:
    def test_tables_for_practice_come_last(self) -> None:
        env = make_points_env(dataclasses.replace(ARGS, practice_share=0.5), ("idle",))
        assert [part.num_envs for part in env.unwrapped.parts] == [3, 2, 1]
        conditions = conditions_of(ARGS)
        alone = [
            make_tables(ARGS, conditions, 3, "point", ("idle",)),
            make_tables(ARGS, conditions, 2, "hit", ("idle",)),
            make_tables(ARGS, conditions, 1, "defend", ("idle",)),
        ]
        env.seed(5)
        for part, seed in zip(alone, (5, 8, 10), strict=True):
            part.seed(seed)
        np.testing.assert_array_equal(env.reset(), np.concatenate([part.reset() for part in alone]))
        bounds, ended = ((0, 3), (3, 5), (5, 6)), 0
        for actions in random_actions(2, 200, 6):
            seen, rewards, dones, infos = env.step(actions)
            each = [part.step(actions[first:last]) for part, (first, last) in zip(alone, bounds, strict=True)]
            np.testing.assert_array_equal(seen, np.concatenate([one[0] for one in each]))
            np.testing.assert_array_equal(rewards, np.concatenate([one[1] for one in each]))
            np.testing.assert_array_equal(dones, np.concatenate([one[2] for one in each]))
            assert [bool(info) for info in infos] == dones.tolist()
            ended += dones[5]
        assert ended > 2

    def test_one_table_at_least_plays_points(self) -> None:
        env = make_points_env(dataclasses.replace(ARGS, practice_share=1.0), ("idle",))
        assert [part.num_envs for part in env.unwrapped.parts] == [1, 3, 2]

    def test_none_is_the_batch_itself(self) -> None:
        assert isinstance(make_points_env(ARGS, ("idle",)).unwrapped, AirHockeySB3VecEnv)

    def test_a_league_records_points_only(self) -> None:
        args = dataclasses.replace(ARGS, practice_share=0.5, opponent=("striker",), scripted_share=0.7)
        league = League(args)
        env = make_points_env(args, league.pool)
        points = []
        step = env.unwrapped.parts[0].step_wait
        env.unwrapped.parts[0].step_wait = lambda: points.append(result := step()) or result
        make_model(args, env).learn(120 * UPDATE, callback=league)
        assert sum(member.points for member in league.members) <= sum(dones.sum() for _, _, dones, _ in points)
        assert sum(member.points for member in league.members) > 0


class TestMember:
    def test_records(self) -> None:
        member = Member("somebody")
        for won, drawn in ((1.0, 0.0), (0.5, 1.0), (0.0, 0.0), (0.5, 1.0)):
            member.record(won, drawn)
        assert (member.points, member.won, member.drawn) == (4, pytest.approx(0.5), pytest.approx(0.5))

    def test_old_points_are_forgotten(self) -> None:
        member = Member("somebody")
        for _ in range(1000):
            member.record(0.0, 0.0)
        for _ in range(2000):
            member.record(1.0, 0.0)
        assert member.won > 0.99

    def test_harder_ones_come_first(self) -> None:
        priorities = [Member("", won=won).priority for won in (0.0, 0.3, 0.8, 1.0)]
        assert priorities == sorted(priorities, reverse=True)
        assert priorities[-1] == LEAST_PRIORITY > 0.0


class TestLeague:
    def test_draws_follow_the_shares_and_the_priorities(self) -> None:
        league = League(ARGS)
        league.members[1].won, league.members[2].won = 0.5, 0.0  # named opponents have equal shares
        drawn = np.bincount(league.draw(20_000), minlength=3) / 20_000
        np.testing.assert_allclose(drawn, [0.75, 0.125, 0.125], atol=0.02)  # no past selves yet
        league.past = {3: some_policy(), 4: some_policy()}
        league.members += [Member("one", won=0.0), Member("other", won=1.0)]
        drawn = np.bincount(league.draw(20_000), minlength=5) / 20_000
        hard, easy = 1.0 / (1.0 + LEAST_PRIORITY), LEAST_PRIORITY / (1.0 + LEAST_PRIORITY)
        np.testing.assert_allclose(drawn, [0.3, 0.125, 0.125, 0.45 * hard, 0.45 * easy], atol=0.02)

    def test_past_selves_join_and_the_weakest_leaves(self) -> None:
        league = learn(6 * UPDATE)
        assert [member.name for member in league.members[:3]] == [LATEST, "striker", "idle"]
        assert len(league.members) == 5
        assert sorted(league.past) == [3, 4]
        pool = league.tables.opponents
        assert pool[1:3] == ("striker", "idle")
        assert pool[3:] == (league.past[3], league.past[4])
        names = {league.members[k].name for k in league.past}
        assert f"self at {5 * UPDATE}" in names, "the newest one"
        assert "self at 0" not in names, "the weakest, or the first among equals"

    def test_the_latest_self_is_the_agent(self) -> None:
        league = learn(3 * UPDATE)
        latest = league.tables.opponents[0]
        newest = next(k for k in league.past if league.members[k].name == f"self at {2 * UPDATE}")
        seen = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 13)).astype(np.float32)
        np.testing.assert_array_equal(latest(seen), league.past[newest](seen))

    def test_points_are_counted_for_who_played_them(self) -> None:
        args = dataclasses.replace(
            ARGS, opponent=("striker",), latest_share=0.0, scripted_share=1.0, snapshot_every=10**9
        )
        latest, striker, past = learn(60 * UPDATE, args).members
        assert latest.points == 0
        assert striker.points > 0
        assert striker.won < 0.5, "untrained, it loses to the striker"
        assert 0.0 <= past.won <= 1.0

    def test_rewards_are_weighed_by_opponent(self) -> None:
        args = dataclasses.replace(
            ARGS, reward="sparse", latest_share=0.0, scripted_share=0.7, win_value=0.25, step_cost=0.125
        )
        league = League(args)
        model = make_model(args, make_env(args, opponents=league.pool))
        model.learn(UPDATE, callback=league)
        assert (model.rollout_buffer.rewards == -0.125).any(), "what is changed in place is what the agent learns from"
        league.tables.set_opponents([0, 1, 1, 2, 3, 3])
        won, over = np.array([1, 1, 0, 0, 1, 0], bool), np.array([1, 1, 1, 0, 1, 1], bool)
        rewards = np.where(over, np.where(won, 1.0, -1.0), 0.0).astype(np.float32)
        infos = [{"is_success": w, "TimeLimit.truncated": False} if o else {} for w, o in zip(won, over, strict=True)]
        league.update_locals({"rewards": rewards, "dones": over, "infos": infos})
        league.on_step()
        np.testing.assert_array_equal(rewards, np.float32([0.25, 0.875, -1.125, -0.125, 0.25, -1.0]))

    def test_a_paddle_that_stays_forward_costs(self) -> None:
        exact = np.zeros((6, 13), np.float32)
        exact[:, 0] = [0.0, -0.3, -0.3, -0.3, -0.8, -0.6]  # the paddle's x, then the puck's x and velocity
        exact[:, 8] = [0.5, -0.1, 0.5, -0.1, 0.5, 0.5]
        exact[:, 10] = [0.0, 0.2, -0.2, -0.2, 0.2, 0.2]
        np.testing.assert_allclose(forward(exact), [1.0, 0.5, 0.5, 0.0, 0.0, 0.0], rtol=1e-6)
        args = dataclasses.replace(ARGS, reward="sparse", forward_cost=0.5, gamma=0.99)
        league = League(args)
        model = make_model(args, make_env(args, opponents=league.pool))
        model.learn(UPDATE, callback=league)
        vars(league.tables)["exact_observations"] = lambda: exact
        league.update_locals({"rewards": (rewards := np.zeros(6, np.float32)), "dones": np.zeros(6, bool), "infos": []})
        league.on_step()
        np.testing.assert_allclose(rewards, [-0.5, -0.25, -0.25, 0.0, 0.0, 0.0], rtol=1e-6)

    def test_save_and_load(self, tmp_path: Path) -> None:
        league = learn(6 * UPDATE)
        league.save(tmp_path)
        league.save(tmp_path)
        assert len(list((tmp_path / "league").iterdir())) == 2
        loaded = League(ARGS)
        loaded.load(tmp_path)
        assert loaded.members == league.members
        assert loaded.due == league.due
        seen = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 13)).astype(np.float32)
        for number, policy in league.past.items():
            np.testing.assert_array_equal(loaded.past[number](seen), policy(seen))
            np.testing.assert_array_equal(loaded.pool[number](seen), policy(seen))

    @pytest.mark.parametrize("damage", ["", "{}", "[]", '{"due": 0, "members": [{"file": null}]}', '{"members": 3}'])
    def test_damaged_files(self, damage: str, tmp_path: Path) -> None:
        league = League(ARGS)
        league.save(tmp_path)
        (tmp_path / "league.json").write_text(damage)
        with pytest.raises(ValueError, match=r"league\.json"):
            league.load(tmp_path)

    def test_a_past_self_that_is_missing(self, tmp_path: Path) -> None:
        league = learn(3 * UPDATE)
        league.save(tmp_path)
        next((tmp_path / "league").iterdir()).unlink()
        with pytest.raises(FileNotFoundError):
            League(ARGS).load(tmp_path)

    def test_the_file_is_json(self, tmp_path: Path) -> None:
        League(ARGS).save(tmp_path)
        members = json.loads((tmp_path / "league.json").read_text())["members"]
        assert [row["name"] for row in members] == [LATEST, "striker", "idle"]


class TestResponses:
    """Best responses that are trained beside the agent."""

    def test_they_join_the_league(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        args = dataclasses.replace(
            ARGS, name="main", steps=3 * UPDATE, warmup_steps=0, eval_episodes=2, report_episodes=2, video_seconds=0.0,
            snapshot_every=10**9, responses=("scratch",), response_steps=32, response_every=UPDATE, seed=4,
        )  # fmt: skip
        train(args)
        kept = json.loads(Path("runs/main/league.json").read_text())
        assert [member["name"] for member in kept["members"][3:]] == ["self at 0", f"response scratch-4 at {UPDATE}"]
        run = Path(f"runs/main-response-{UPDATE}-scratch-4")
        joined = Path("runs/main/league", kept["members"][4]["file"])
        assert np.load(joined)["weight_0"].tolist() == np.load(run / "policy.npz")["weight_0"].tolist()
        config = json.loads((run / "config.json").read_text())
        assert config["opponent"] == [f"runs/main-response-{UPDATE}/policy.npz"]
        assert kept["responses"] == {"due": 3 * UPDATE, "at": None}, "others would have joined after the end"

    def test_stopping_and_going_on(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        responses = Responses(("scratch",), 10**9, 0)
        responses.name = "main"
        responses.begin(some_policy(), 7)
        assert not responses.done
        responses.stop()
        assert responses.running == []
        assert Path("runs/main-response-7/policy.npz").exists()
        going_on = Responses(("scratch",), 1, 0)
        going_on.name = "main"
        going_on.begin(None, 7)
        assert going_on.running[0].name == "response scratch-0 at 7"
        going_on.stop()

    def test_one_that_fails(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        responses = Responses(("own",), 32, 0)
        responses.name = "main"
        responses.begin(some_policy(), 0)
        Path("runs/main-response-0/policy.npz").write_bytes(b"damaged")
        responses.running[0].process.wait()
        with pytest.raises(RuntimeError, match="main-response-0-own-0"):
            _ = responses.done

    def test_ctrl_c_while_waiting_for_them(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        league = League(dataclasses.replace(ARGS, responses=("scratch",), steps=100))
        league.responses.name = "main"
        league.responses.begin(some_policy(), 0)
        threading.Timer(0.3, lambda: league.stop.note(signal.SIGINT)).start()
        league._see_to_responses(some_policy())
        assert league.responses.running, "they have not joined"
        league.responses.stop()

    def test_kinds(self) -> None:
        with pytest.raises(ValueError, match="--responses"):
            train(dataclasses.replace(ARGS, responses=("worst",)))

    def test_one_worker(self) -> None:
        with pytest.raises(ValueError, match="--workers"):
            train(dataclasses.replace(ARGS, responses=("own",), workers=2))


class TestExchange:
    """Runs that share a folder."""

    ARGS = dataclasses.replace(
        ARGS, steps=3 * UPDATE, warmup_steps=0, eval_episodes=2, report_episodes=2, video_seconds=0.0,
        snapshot_every=2 * UPDATE, most_past_selves=9, exchange=Path("shared"),
    )  # fmt: skip

    @staticmethod
    def members(run: str) -> dict[str, str]:
        kept = json.loads(Path(f"runs/{run}/league.json").read_text())["members"][3:]
        members = {member["name"]: f"runs/{run}/league/{member['file']}" for member in kept}
        assert len(members) == len(kept), "nobody is there twice"
        return members

    def test_each_takes_in_what_the_others_leave(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        train(dataclasses.replace(self.ARGS, name="one"))
        assert sorted(path.name for path in Path("shared").iterdir()) == ["one@0.npz", f"one@{2 * UPDATE}.npz"]
        assert set(self.members("one")) == {"self at 0", f"self at {2 * UPDATE}"}, "its own are no others"
        some_policy(seed=8).save(Path("shared/somebody.npz"))
        train(dataclasses.replace(self.ARGS, name="other", seed=1))
        members = self.members("other")
        others = {"other one@0": "one@0", f"other one@{2 * UPDATE}": f"one@{2 * UPDATE}", "other somebody": "somebody"}
        assert set(members) == {"self at 0", f"self at {2 * UPDATE}", *others}
        for name, file in others.items():
            assert np.load(members[name])["weight_0"].tolist() == np.load(f"shared/{file}.npz")["weight_0"].tolist()
        train(SelfPlayArgs(resume="runs/other", steps=4 * UPDATE))
        assert self.members("other") == members

    def test_files_that_are_no_policies_are_left_out(self, tmp_path: Path) -> None:
        (tmp_path / "damaged.npz").write_bytes(b"damaged")
        (tmp_path / ".part-late.npz").write_bytes(b"not yet whole")
        some_policy().save(tmp_path / "what a name.npz")
        some_policy().save(tmp_path / "good.npz")
        exchange = Exchange(tmp_path, "run")
        with pytest.warns(UserWarning, match="join the league") as warned:
            assert [name for name, _ in exchange.take()] == ["good"]
        assert len(warned) == 2
        assert exchange.take() == []
