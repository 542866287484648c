"""Courses and leagues: whom an agent meets while it trains, and what a resumed run takes up."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from agents.course import Course
from agents.league import LATEST, LEAST_PRIORITY, League, Member
from agents.ppo import TrainArgs, make_env, make_model
from agents.self_play import SelfPlayArgs

SMALL = {"num_envs": 6, "n_steps": 8, "batch_size": 16, "net_width": 8}
UPDATE = 6 * 8


def learn(args: TrainArgs, steps: int, course: Course | None = None) -> Course:
    course = args.course() if course is None else course
    make_model(args, make_env(args, course.pool)).learn(steps, callback=course)
    return course


def indices(course: Course) -> np.ndarray:
    return course.training_env.get_attr("opponent_indices", 0)[0]


class TestCourse:
    def test_the_warm_up_comes_first(self) -> None:
        args = TrainArgs(
            **SMALL,
            warmup_opponents=("idle", "random"),
            warmup_steps=2 * UPDATE,
            opponents=("striker", "goalie", "striker"),
        )
        course = learn(args, 2 * UPDATE)
        assert indices(course).tolist() == [0, 1, 0, 1, 0, 1]
        course = learn(args, 3 * UPDATE)
        assert indices(course).tolist() == [2, 3, 4, 2, 3, 4]
        assert [course.pool[k] for k in indices(course)] == ["striker", "goalie", "striker"] * 2

    def test_without_a_warm_up(self) -> None:
        course = learn(TrainArgs(**SMALL, warmup_steps=0), UPDATE)
        assert {course.pool[k] for k in indices(course)} == {"striker"}


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
    ARGS = SelfPlayArgs(
        **SMALL, warmup_steps=UPDATE, opponents=("striker", "idle"), snapshot_every=UPDATE, most_past_selves=2
    )

    def test_draws_follow_the_priorities(self) -> None:
        league = self.ARGS.course()
        league.members[1].won, league.members[2].won = 0.5, 0.0  # priorities 1/4 and 1
        drawn = np.bincount(league.draw(20_000), minlength=4) / 20_000
        np.testing.assert_allclose(drawn, [0.0, 0.3, 0.7 / 5, 0.7 * 4 / 5], atol=0.02)

    def test_past_selves_join_and_the_weakest_leaves(self) -> None:
        league = learn(self.ARGS, 6 * UPDATE)
        assert isinstance(league, League)
        assert [member.name for member in league.members[:3]] == [LATEST, "striker", "idle"]
        assert len(league.members) == 5
        assert sorted(league.past) == [3, 4]
        pool = league.training_env.get_attr("opponents", 0)[0]
        assert pool[0] == pool[3] == "idle"
        assert pool[2] == "striker"
        assert [pool[4], pool[5]] == [league.past[3], league.past[4]]
        names = {league.members[k].name for k in league.past}
        assert f"self at {5 * UPDATE}" in names, "the newest one"
        assert f"self at {UPDATE}" not in names, "the weakest, or the first among equals"

    def test_points_are_counted_for_who_played_them(self) -> None:
        args = dataclasses.replace(self.ARGS, opponents=("striker",), latest_share=0.0, snapshot_every=10**9)
        league = args.course()
        learn(args, 60 * UPDATE, league)
        latest, striker, past = league.members
        assert latest.points == 0
        assert striker.points > 0
        assert striker.won < 0.5, "untrained, it loses to the striker"
        assert 0.0 <= past.won <= 1.0

    def test_save_and_load(self, tmp_path: Path) -> None:
        league = learn(self.ARGS, 6 * UPDATE)
        league.save(tmp_path)
        league.save(tmp_path)
        assert len(list((tmp_path / "league").iterdir())) == 2
        loaded = self.ARGS.course()
        loaded.load(tmp_path)
        assert loaded.members == league.members
        assert loaded.due == league.due
        assert len(loaded.pool) == 6
        seen = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 13)).astype(np.float32)
        for number, policy in league.past.items():
            np.testing.assert_array_equal(loaded.past[number](seen), policy(seen))
            np.testing.assert_array_equal(loaded.pool[loaded.first + number](seen), policy(seen))

    @pytest.mark.parametrize("damage", ["", "{}", "[]", '{"due": 0, "members": [{"file": null}]}', '{"members": 3}'])
    def test_damaged_files(self, damage: str, tmp_path: Path) -> None:
        league = self.ARGS.course()
        league.save(tmp_path)
        (tmp_path / "league.json").write_text(damage)
        with pytest.raises(ValueError, match=r"league\.json"):
            league.load(tmp_path)

    def test_a_past_self_that_is_missing(self, tmp_path: Path) -> None:
        league = learn(self.ARGS, 3 * UPDATE)
        league.save(tmp_path)
        next((tmp_path / "league").iterdir()).unlink()
        with pytest.raises(FileNotFoundError):
            self.ARGS.course().load(tmp_path)

    def test_the_file_is_json(self, tmp_path: Path) -> None:
        self.ARGS.course().save(tmp_path)
        assert [row["name"] for row in json.loads((tmp_path / "league.json").read_text())["members"]] == [
            LATEST, "striker", "idle",
        ]  # fmt: skip
