"""A league: an agent plays against itself, its past selves and scripted opponents.

An opponent is drawn for every episode. The latest self, the scripted opponents and the past selves have fixed shares of
the episodes. Each scripted opponent is drawn equally often; otherwise they would soon be too easy to be drawn, and the
agent would forget them. Among the past selves, prioritised fictitious self-play draws harder ones more often (Vinyals
et al., "Grandmaster level in StarCraft II using multi-agent reinforcement learning", Nature 575, 2019).

A point lost costs 1, but one won may be worth less than 1 (`win_value`), except against scripted opponents. An agent
that attacks whenever it wins more points than it loses leaves its goal to whoever waits for that. One for which losses
count more holds back until it is safe. `forward_cost` helps it to find out that it can come back after a shot, and
`step_cost` lets it hurry where there is little to fear.

The environment is exactly the same from both sides, so the agent learns on the left and its opponents play on the
right.

Several workers have one league: each holds a copy, and after every rollout they exchange the results of their points.
"""

from __future__ import annotations

import itertools
import re
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback

from agents.files import COUNT, FILE, SHARE, TEXT, or_none, read_json, write_json
from agents.models import export_policy
from agents.seeding import sequence
from agents.training import runs, workers
from agents.training.exchange import Exchange
from agents.training.joined_tables import JoinedTables
from agents.training.responses import Responses
from agents.training.stopping import Stop
from airhockey_env.opponents.players import Player as Opponent
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

if TYPE_CHECKING:
    from agents.training.self_play import SelfPlayArgs

WINDOW = 400
"""The number of points over which a member's record is averaged."""

LEAST_PRIORITY = 0.02
"""The priority of a member that always loses; that of one that always wins is 1. Records of easy members are thereby
updated too."""

LATEST = "latest self"

OTHER = "other "
"""The names of members that other runs have left begin with this."""

NAME = re.compile(rf"(self|response [a-z]+-[0-9]+) at [0-9]+|{OTHER}{runs.NAME.pattern}")
"""The names of members with files."""


BACK = -0.6
"""A paddle that is at most so far forward, in half lengths, counts as back at its goal."""


@dataclass
class Member:
    """A member of the league, and the agent's recent results against it."""

    name: str
    points: int = 0
    won: float = 0.5  # share of points won by the agent; a draw counts as half
    drawn: float = 0.0

    def record(self, won: float, drawn: float) -> None:
        """Add a point to the averages, which decay exponentially after the first `WINDOW` points."""
        self.points += 1
        share = 1.0 / min(self.points, WINDOW)
        self.won += share * (won - self.won)
        self.drawn += share * (drawn - self.drawn)

    @property
    def priority(self) -> float:
        return max((1.0 - self.won) ** 2, LEAST_PRIORITY)


def forward(exact: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far the paddles are forward while the puck is on the far side or on its way: (N,), 0 to 1 at the centre line.

    Args:
        exact: exact states, (N, 13), as the environment's docstring describes them.
    """
    gone = (exact[:, 8] > 0.0) | (exact[:, 10] > 0.0)
    return np.where(gone, np.maximum(exact[:, 0] - BACK, 0.0) / -BACK, 0.0).astype(np.float32)


class League(BaseCallback):
    """Draws an opponent for every episode, and regularly adds a copy of the agent to the opponents."""

    def __init__(self, args: SelfPlayArgs) -> None:
        super().__init__()
        self.args = args
        self.scripted = args.opponent
        self.members = [Member(LATEST), *(Member(name) for name in self.scripted)]
        self.past: dict[int, MlpPolicy] = {}  # past selves and best responses by their number among the members
        self.due = 0  # steps at which the next copy joins
        self.exchange: Exchange | None = None  # set with the run's name
        self.responses = Responses(args.responses, args.response_steps, args.seed)
        self.responses_due = args.response_every  # steps at which the next best responses begin
        self.responses_at: int | None = None  # steps of the agent that those under way are trained against
        self.stop = Stop()
        self.random = np.random.default_rng(sequence("league", args.seed))
        self._results: list[tuple[int, float, float]] = []  # not yet shared with workers: member, won, drawn
        self._shared: list[Member] = []  # the members when results were last shared

    @property
    def pool(self) -> tuple[Opponent, ...]:
        """The environment's pool of opponents: the members, in their order."""
        # "idle" is a placeholder for the latest self, which takes its place before the first step.
        return ("idle", *self.scripted, *(self.past[number] for number in sorted(self.past)))

    @property
    def tables(self) -> AirHockeySB3VecEnv:
        """The batch on which the agent plays points, whatever wraps it, and without the tables for practice."""
        batch: Any = self.training_env.unwrapped
        return batch.parts[0] if isinstance(batch, JoinedTables) else batch

    def draw(self, number: int) -> np.ndarray:
        """Draw opponents for some episodes: their places in the pool, (number,)."""
        scripted = len(self.scripted)
        past = np.array([member.priority for member in self.members[1 + scripted :]])
        shares = np.concatenate(
            [
                [self.args.latest_share],
                np.full(scripted, self.args.scripted_share / scripted),
                (1.0 - self.args.latest_share - self.args.scripted_share) * past / max(past.sum(), LEAST_PRIORITY),
            ]
        )
        shares[0] += 1.0 - shares.sum()  # the share of the past selves, while there are none
        return self.random.choice(len(self.members), number, p=shares)

    def begin(self, run: str, stop: Stop) -> None:
        """Learn the name of the run, and what asks it to stop."""
        self.stop, self.responses.name = stop, run
        if self.args.exchange is not None:
            known = [member.name.removeprefix(OTHER) for member in self.members]
            self.exchange = Exchange(self.args.exchange, run, known)

    def _on_training_start(self) -> None:
        self.random = np.random.default_rng(sequence("league", self.args.seed, self.num_timesteps, *workers.part()))
        self._remember()
        self.tables.set_opponents(self.draw(self.tables.num_envs))
        if self.responses_at is not None:  # the run was stopped before they were done
            self.responses.begin(None, self.responses_at)

    def _on_rollout_start(self) -> None:
        latest = export_policy(self.model)
        self.tables.set_opponent(0, latest)
        if self.num_timesteps >= self.due:
            self.due = self.num_timesteps + self.args.snapshot_every
            self.take_in(f"self at {self.num_timesteps}", latest)
            if self.exchange is not None:
                self.exchange.put(latest, self.num_timesteps)
        if self.exchange is not None:
            for name, policy in self.exchange.take():
                self.take_in(f"{OTHER}{name}", policy)
        if self.args.responses and self.num_timesteps >= self.responses_due:
            self._see_to_responses(latest)
        self._remember()
        self.logger.record("league/drawn", float(np.mean([member.drawn for member in self.members])))
        self.logger.record("league/won", float(np.mean([member.won for member in self.members])))

    def _on_step(self) -> bool:
        rewards = self.locals["rewards"]  # changed in place, before Stable-Baselines3 stores them
        rewards[np.flatnonzero(self._scripted(self.tables.opponent_indices))] -= self.args.step_cost
        if self.args.forward_cost > 0.0:
            rewards[: self.tables.num_envs] -= self.args.forward_cost * forward(self.tables.exact_observations())
        rows = np.flatnonzero(self.locals["dones"][: self.tables.num_envs])
        if len(rows):
            numbers = self.tables.opponent_indices[rows]
            for row, number in zip(rows, numbers, strict=True):
                info = self.locals["infos"][row]
                drawn, won = info["TimeLimit.truncated"], info["is_success"]
                if won and not self._scripted(number):
                    rewards[row] += self.args.win_value - 1.0
                result = (int(number), 0.5 if drawn else float(won), float(drawn))
                self._results.append(result)
                self.members[number].record(*result[1:])
            self.tables.set_opponents(self.draw(len(rows)), rows)
        return True

    def _scripted(self, number: Any) -> Any:
        """Whether the opponents of these numbers are among the given ones."""
        return (number > 0) & (number <= len(self.scripted))

    def _see_to_responses(self, latest: MlpPolicy) -> None:
        """Take the best responses in, and begin new ones to the agent as it is now."""
        while not self.responses.done:
            if self.stop.asked:
                return
            time.sleep(0.2)
        for name, policy in self.responses.take():
            self.take_in(name, policy)
        self.responses_at = None
        self.responses_due = self.num_timesteps + self.args.response_every
        assert self.args.steps is not None
        if self.responses_due < self.args.steps:  # else they would join too late
            self.responses_at = self.num_timesteps
            self.responses.begin(latest, self.responses_at)

    def _on_rollout_end(self) -> None:
        self._share_results()

    def _on_training_end(self) -> None:
        self.responses.stop()
        self._share_results()

    def _share_results(self) -> None:
        """Take up the results of all workers in one order, so that all have the same records."""
        if workers.number() > 1:
            results = workers.gather(self._results)
            self.members = self._shared
            for number, won, drawn in itertools.chain.from_iterable(results):
                self.members[number].record(won, drawn)
        self._remember()

    def _remember(self) -> None:
        self._results, self._shared = [], [replace(member) for member in self.members]

    def take_in(self, name: str, policy: MlpPolicy) -> None:
        """Add a copy of the agent, or a best response. If the league is full, it replaces the weakest of these."""
        if len(self.past) < self.args.most_past_selves:
            number = len(self.members)
            self.members.append(Member(name))
            self.tables.add_opponent(policy)
        else:
            number = max(self.past, key=lambda k: self.members[k].won)
            self.members[number] = Member(name)
            self.tables.set_opponent(number, policy)
        self.past[number] = policy

    def save(self, folder: Path) -> None:
        """Write the members, their records and the past selves' policies."""
        (folder / "league").mkdir(exist_ok=True)
        files = {number: f"{self.members[number].name.replace(' ', '_')}.npz" for number in self.past}
        for number, policy in self.past.items():
            policy.save(folder / "league" / files[number])
        members = [{**asdict(member), "file": files.get(k)} for k, member in enumerate(self.members)]
        responses = {"due": self.responses_due, "at": self.responses_at}
        write_json(folder / "league.json", {"due": self.due, "responses": responses, "members": members})
        for file in (folder / "league").glob("*.npz"):  # last, so that a failure above loses no policy
            if file.name not in files.values():
                file.unlink()

    def load(self, folder: Path) -> None:
        """Read what `save` wrote. Call this before training begins.

        Raises:
            FileNotFoundError, ValueError: files are missing or damaged.
        """
        member = {"name": TEXT, "points": COUNT, "won": SHARE, "drawn": SHARE, "file": or_none(FILE)}
        path = folder / "league.json"
        responses = {"due": COUNT, "at": or_none(COUNT)}
        kept: dict[str, Any] = read_json(path, {"due": COUNT, "responses": responses, "members": [member]})
        first = [(name, None) for name in (LATEST, *self.scripted)]
        found = [(entry["name"], entry.pop("file")) for entry in kept["members"]]
        names = [name for name, file in found[len(first) :] if file]  # these become names of files
        fits = len(first) + len(names) == len(found) and all(map(NAME.fullmatch, names))
        if found[: len(first)] != first or not fits:
            raise ValueError(f"{path} must begin with {first}, then have past selves with a file each, got {found}")
        self.members = [Member(**{name: entry[name] for name in asdict(Member(""))}) for entry in kept["members"]]
        self.due, responses = kept["due"], kept["responses"]
        self.responses_due, self.responses_at = responses["due"], responses["at"]
        self.past = {k: MlpPolicy.load(folder / "league" / file) for k, (_, file) in enumerate(found) if file}
