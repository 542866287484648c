"""The air table: pucks on a table without friction, stepped by all three methods at once."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.air_table import METHODS, AirTable
from airhockey_env.web.fan import MOST_PUCKS as MOST_PUCKS_OF_A_FAN
from airhockey_env.web.fan import fan, position_at
from airhockey_env.web.kisses import kisses
from airhockey_env.web.messages import Message, Refused, encode
from airhockey_env.web.scenes import MOST_PUCKS, SCENES, Puck, Scene
from airhockey_env.web.sessions.base import Answer, Handler, Session

LONGEST = 3500
"""Characters of a scene as a text."""
MOST_SPEED = 4.0
"""The greatest speed, as a multiple of the wall clock's."""
MOST_BEHIND = 0.1
"""s on the wall for which a page may not have asked; after a longer time, the table goes on from where it was."""
MOST_CONTACTS = 4
"""The most contacts of each method that an answer describes: the last ones."""
PULL_SECONDS = 0.04
"""s in which a puck that is held would reach the pointer."""
MOST_PULL = 10.0
"""m/s. Greatest component of the velocity of a puck that is held."""
SLOW = 0.01
"""s of the processor for a tick after which the next ones are played in another thread."""
MOST_BOUND = 1e4
"""Numbers of a message are at most so large; what they may be is checked with the scene."""

_Held = tuple[int, NDArray[np.float64]]
"""A puck and the place, m, that it is pulled to."""


class AirSession(Session):
    """Three tables that begin alike; the page asks for their state before every picture."""

    _scene: Scene | None = None
    _speed = 0.0
    _revision = -1

    @classmethod
    def prepare(cls) -> None:
        """Compile all methods, with and without the broad phase that many pucks have."""
        for name in ("pool_shot", "break_of_a_rack"):
            for table in SCENES[name].tables().values():
                table.step(0.01)

    def handlers(self) -> dict[str, Handler]:
        """See docs/web.md."""
        return {
            "start": self._start,
            "turn": self._turn,
            "speed": self._set_speed,
            "step": self._step,
            "restart": self._restart,
            "reverse": self._reverse,
            "throw": self._throw,
            "add": self._add,
            "remove": self._remove,
            "change": self._change,
            "settings": self._settings,
            "keep": self._keep,
            "fan": self._fan,
        }

    # Scenes -----------------------------------------------------------------------------------------------------

    def _start(self, message: Message, now: float) -> Answer:
        """Begin with a scene; a link that is none ends the session."""
        text = message.text("scene", LONGEST)
        message.finish()
        try:
            scene = Scene.parse(text)
            self._show(scene, now)
        except ValueError as error:
            raise Refused(f"this scene cannot be shown: {error}") from error
        return self._told()

    def _restart(self, message: Message, now: float) -> Answer:
        self._show(self._shown, now)
        return self._told()

    def _add(self, message: Message, now: float) -> Answer:
        method = self._method(message)
        x, y = message.numbers("position", 2, MOST_BOUND)
        radius, mass = message.number("radius", 0.0, MOST_BOUND), message.number("mass", 0.0, MOST_BOUND)
        message.finish()
        return self._edit(method, now, lambda pucks: [*pucks, Puck(x, y, 0.0, 0.0, radius, mass)])

    def _remove(self, message: Message, now: float) -> Answer:
        method, number = self._method(message), self._number(message)
        message.finish()
        return self._edit(method, now, lambda pucks: pucks[:number] + pucks[number + 1 :])

    def _change(self, message: Message, now: float) -> Answer:
        method, number = self._method(message), self._number(message)
        new: dict[str, float] = {}
        for name, fields in (("position", ("x", "y")), ("velocity", ("vx", "vy"))):
            if message.has(name):
                new.update(zip(fields, message.numbers(name, 2, MOST_BOUND), strict=True))
        for name in ("radius", "mass"):
            if message.has(name):
                new[name] = message.number(name, 0.0, MOST_BOUND)
        message.finish()
        return self._edit(
            method, now, lambda pucks: [*pucks[:number], pucks[number]._replace(**new), *pucks[number + 1 :]]
        )

    def _settings(self, message: Message, now: float) -> Answer:
        """Step the scene otherwise, from its start."""
        names = ("tick", "restitution", "wall_restitution", "phase")
        new: dict[str, Any] = {n: message.number(n, 0.0, MOST_BOUND) for n in names if message.has(n)}
        message.finish()
        scene = self._shown
        return self._try(lambda: replace(scene, **new), now)

    def _keep(self, message: Message, now: float) -> Answer:
        """Make a scene of what one table shows at present."""
        method = self._method(message)
        message.finish()
        return self._edit(method, now, lambda pucks: pucks)

    def _fan(self, message: Message, now: float) -> Answer:
        scene = self._shown
        message.finish()
        if len(scene.pucks) > MOST_PUCKS_OF_A_FAN:
            return _note(f"paths are fanned out for scenes of at most {MOST_PUCKS_OF_A_FAN} pucks")
        return lambda: encode({"type": "fan", "revision": str(self._revision), **fan(scene)}).encode()

    def _edit(self, method: str, now: float, changed: Callable[[list[Puck]], list[Puck]]) -> Answer:
        """Change the pucks as they are on one table at present; all tables begin again with that."""
        table = self._present[method]

        def make() -> Scene:
            scene = self._shown.moved(table.positions, table.velocities)
            return replace(scene, pucks=tuple(changed(list(scene.pucks))))

        return self._try(make, now)

    def _try(self, make: Callable[[], Scene], now: float) -> Answer:
        try:
            self._show(make(), now)
        except ValueError as error:  # a mistake that anybody makes: nothing has changed
            return _note(str(error))
        return self._told()

    def _show(self, scene: Scene, now: float) -> None:
        tables = scene.tables()
        self._scene, self._tables, self._revision = scene, tables, self._revision + 1
        self._starts = {method: table.positions.copy() for method, table in tables.items()}
        self._ticks, self._part, self._asked = 0, 0.0, now
        self._slow = False
        self._clock, self._way = 0, 1  # ticks since the start in the scene's own time, and whether that goes on or back
        self._returned: list[float] | None = None

    def _told(self) -> Answer:
        scene = self._shown
        return {
            "type": "scene",
            "revision": str(self._revision),
            "text": scene.text,
            "name": scene.name,
            "scenes": list(SCENES),
            "methods": list(METHODS),
            "most_pucks": MOST_PUCKS,
            "pucks": [puck._asdict() for puck in scene.pucks],
            "tick": scene.tick,
            "restitution": scene.restitution,
            "wall_restitution": scene.wall_restitution,
            "phase": scene.phase,
            **self._state_fields(self._asked, []),
        }

    # Time -------------------------------------------------------------------------------------------------------

    def _set_speed(self, message: Message, now: float) -> Answer:
        self._speed = message.number("speed", 0.0, MOST_SPEED)
        return None

    def _played(self, play: Callable[[], dict[str, Any]]) -> Answer:
        """What a function that plays ticks returns, or that function where it takes long."""
        long = self._slow or self._shown.many_contacts
        return (lambda: encode(play()).encode()) if long else play()

    def _turn(self, message: Message, now: float) -> Answer:
        scene, held = self._shown, None
        if message.has("hold"):
            number, x, y = message.numbers("hold", 3, MOST_BOUND)
            if number not in range(len(scene.pucks)):
                raise Refused(f"hold must begin with the number of a puck, below {len(scene.pucks)}, got {number:g}")
            held = (int(number), np.array([x, y]))
        message.finish()
        elapsed = min(now - self._asked, MOST_BEHIND) * self._speed
        self._asked = now
        return self._played(lambda: self._advance(scene, elapsed, held, now))

    def _advance(self, scene: Scene, elapsed: float, held: _Held | None, now: float) -> dict[str, Any]:
        contacts: list[dict[str, Any]] = []
        ends = time.perf_counter() + self.limits.answer_seconds
        self._part += elapsed
        while self._part >= scene.tick:
            self._part -= scene.tick
            contacts += self._play_tick(scene, held)
            if self._speed == 0.0 or time.perf_counter() > ends:  # what is left is not caught up with
                self._part = 0.0
        return self._state(now, contacts)

    def _step(self, message: Message, now: float) -> Answer:
        """One tick, while the tables stand still; or many, until pucks touch on one of them."""
        until_contact = message.flag("until_contact", False)
        message.finish()
        scene = self._shown
        self._asked, self._part = now, 0.0
        return self._played(lambda: self._play_steps(scene, until_contact, now))

    def _play_steps(self, scene: Scene, until_contact: bool, now: float) -> dict[str, Any]:
        ends = time.perf_counter() + self.limits.answer_seconds
        contacts = self._play_tick(scene, None)
        while until_contact and not contacts and not self._at_start and time.perf_counter() < ends:
            contacts = self._play_tick(scene, None)
        return {**self._state(now, contacts), "sought": until_contact}

    def _reverse(self, message: Message, now: float) -> Answer:
        """Turn the time round: every puck goes back the way it came, as far as the method can."""
        message.finish()
        for table in self._present.values():
            table.velocities[:] *= -1.0
        self._part, self._returned, self._way = 0.0, None, -self._way
        return None

    def _throw(self, message: Message, now: float) -> Answer:
        """Let go of a puck that was held, with this velocity on all tables."""
        number, velocity = self._number(message), message.numbers("velocity", 2, MOST_PULL)
        message.finish()
        for table in self._present.values():
            table.velocities[number] = velocity
        return None

    def _play_tick(self, scene: Scene, held: _Held | None) -> list[dict[str, Any]]:
        contacts, began, began_at = [], time.thread_time(), self._clock * scene.tick
        for table in self._tables.values():
            if held is not None:
                number, place = held
                pull = (place - table.positions[number]) / max(PULL_SECONDS, scene.tick)
                table.velocities[number] = np.clip(pull, -MOST_PULL, MOST_PULL)
            positions, velocities = table.positions.copy(), table.velocities.copy()
            touched = table.step(scene.tick)
            if (touched["b"] >= 0).any():
                new = kisses(table, positions, velocities, scene.tick, touched)[-MOST_CONTACTS:]
                contacts += [{"time": began_at + self._way * kiss["contact_time"], **kiss} for kiss in new]
        self._ticks += 1
        self._clock += self._way
        self._slow = time.thread_time() - began > SLOW
        if self._at_start:
            self._returned = [
                float(np.hypot(*(table.positions - self._starts[method]).T).max())
                for method, table in self._tables.items()
            ]
            self._speed = 0.0
        return contacts

    def _state(self, now: float, contacts: list[dict[str, Any]]) -> dict[str, Any]:
        return {"type": "state", "notice": str(self._revision), **self._state_fields(now, contacts)}

    def _state_fields(self, now: float, contacts: list[dict[str, Any]]) -> dict[str, Any]:
        tables = self._tables.values()
        masses = self._shown.masses
        kept = [c for method in METHODS for c in [c for c in contacts if c["method"] == method][-MOST_CONTACTS:]]
        return {
            "time": round(now, 4),
            "elapsed": self._ticks * self._shown.tick + self._part,
            "ticks": self._ticks,
            "clock": self._clock * self._shown.tick + self._way * self._part,
            "playing": self._speed > 0.0,
            "positions": [row for table in tables for row in position_at(table, self._part).round(5).tolist()],
            "velocities": [row for table in tables for row in table.velocities.round(4).tolist()],
            "energy": [table.energy for table in tables],
            "momentum": [math.hypot(*(masses @ table.velocities)) for table in tables],
            "contacts": kept,
            "turned": self._way < 0,
            "returned": self._returned,
        }

    # Checks -----------------------------------------------------------------------------------------------------

    @property
    def _at_start(self) -> bool:
        """Whether time has gone back to the start just now."""
        return self._way < 0 and self._clock == 0

    @property
    def _shown(self) -> Scene:
        if self._scene is None:
            raise Refused("there is no scene: start one first")
        return self._scene

    @property
    def _present(self) -> dict[str, AirTable]:
        """The tables, by method."""
        if self._scene is None:
            raise Refused("there is no scene: start one first")
        return self._tables

    def _method(self, message: Message) -> str:
        return message.choice("method", METHODS, "continuous")

    def _number(self, message: Message) -> int:
        return message.whole("puck", 0, len(self._shown.pucks) - 1)


def _note(text: str) -> Answer:
    """What a person did wrong, for the page to show."""
    return {"type": "note", "text": text}
