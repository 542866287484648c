"""What stands between the players and the table: delays of their actions, cameras, and histories."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.cameras import resolve_camera
from airhockey_env.checks import fault
from airhockey_env.interface_parts import CameraPart, DelayPart, HistoryPart, Part, Tables
from airhockey_env.kernel.state import LEFT, RIGHT

SIDES = ("left", "right")
"""What the fields of saved states begin with."""


class PlayerInterface:
    """What stands between the player of a seat and the table, on all tables of a game.

    Args:
        seat: LEFT or RIGHT.
        tables: of the game.
        stack: how many observations the caller is shown at once.
        action_delay_ms: the delay of actions, or the range (low, high) that it is drawn from.

    Attributes:
        stack: as above.
        delay, camera, history: the parts, None where there is none.
    """

    def __init__(self, seat: int, tables: Tables, stack: int, action_delay_ms: float | tuple[float, float]) -> None:
        self._seat, self._tables, self.stack = seat, tables, stack
        low, high = action_delay_ms if isinstance(action_delay_ms, tuple) else (action_delay_ms, action_delay_ms)
        self.delay = DelayPart(seat, tables, low, high) if high > 0.0 else None
        self.camera: CameraPart | None = None
        self.history: HistoryPart | None = None

    @property
    def parts(self) -> list[Part]:
        """The parts that there are, in the order in which they follow a step."""
        return [part for part in (self.delay, self.camera, self.history) if part is not None]

    def set_camera(self, camera: Any) -> None:
        """Let the player see through a camera, as `resolve_camera` takes it; or exactly, with None."""
        self.camera = None if camera is None else CameraPart(self._seat, self._tables, resolve_camera(camera))

    @property
    def rows(self) -> int:
        """How many observations are kept, the present one included."""
        return 1 if self.history is None else self.history.rows.shape[1]

    def looks_on(self, stack: int) -> bool:
        """Tell whether it follows what there is to see, whoever plays, for players with stacks up to this one."""
        return self.camera is not None or max(stack, self.stack, self.rows) > 1

    def remember(self, stack: int) -> None:
        """Keep as many observations as the caller and players with stacks up to this one need, and never fewer."""
        rows = max(stack, self.stack)
        if rows <= self.rows:
            return
        if self.history is None:
            self.history = HistoryPart(self._seat, self._tables, rows)
        else:
            self.history.lengthen(rows)

    def seen(self, stack: int | None = None, final: bool = False) -> NDArray[np.float32]:
        """What a player with this stack is shown: (N, 13), or (N, stack, 15) if it is more than 1; not copies.

        Args:
            stack: at most `rows`; None for the caller's.
            final: what it saw at the end of episodes, where an automatic reset began others in the same step.
        """
        stack = self.stack if stack is None else stack
        if stack == 1 or self.history is None:
            out = self._tables.out
            return (out.final_observation if final else out.observation)[self._seat]
        return (self.history.final if final else self.history.rows)[:, -stack:]

    def act(self, first: int, last: int, actions: NDArray[np.float32]) -> NDArray[np.float32]:
        """What the paddles on the tables `first` to `last` (excluded) obey in the coming step, (N, 2).

        Args:
            actions: (N, 2) what the caller or a policy sends.
        """
        return actions if self.delay is None else self.delay.act(first, last, actions)


class PlayerInterfaces:
    """The interfaces of both players of a game, by their seats.

    Args:
        tables: of the game.
        stacks: how many observations the caller is shown at once, of the left and of the right player.
        action_delays_ms: the delays of their actions, each a number or a range (low, high).
        camera: what they see the game through, for both or a pair (left, right); None for exact states.

    Attributes:
        parts: those of both.

    Raises:
        ValueError: no such camera.
    """

    def __init__(self, tables: Tables, stacks: Sequence[int], action_delays_ms: Sequence[Any], camera: Any) -> None:
        left, right = (PlayerInterface(seat, tables, stacks[seat], action_delays_ms[seat]) for seat in (LEFT, RIGHT))
        self._of_seats = left, right
        self.parts: list[Part] = []
        self.set_camera(camera)

    def __getitem__(self, seat: int) -> PlayerInterface:
        return self._of_seats[seat]

    def set_camera(self, camera: Any) -> None:
        """Put other cameras, or none, before the players.

        Raises:
            ValueError: no such camera. Nothing has changed then.
        """
        pair = camera if isinstance(camera, (list, tuple)) else (camera, camera)
        if len(pair) != 2:
            raise fault("camera", "one camera for both players or a pair (left, right)", camera)
        resolved = [None if one is None else resolve_camera(one) for one in pair]
        for interface, one in zip(self._of_seats, resolved, strict=True):
            interface.set_camera(one)
        self._gather()

    def remember(self, left_stack: int, right_stack: int) -> None:
        """Keep as many observations as players in the two seats with stacks up to these need; see `PlayerInterface`."""
        self[LEFT].remember(left_stack)
        self[RIGHT].remember(right_stack)
        self._gather()

    def _gather(self) -> None:
        self.parts = [part for interface in self._of_seats for part in interface.parts]

    def saved_fields(self) -> dict[str, NDArray[Any]]:
        """All that the parts keep of the tables, arrays (N, ...), by the names that saved states have for them."""
        return {_named(part, name): array for part in self.parts for name, array in part.kept().items()}

    def check(self, saved: NDArray[np.void], states: NDArray[np.void], parameters: NDArray[np.void]) -> None:
        """Raises ValueError unless all parts could be in these saved states; see `Part.could_be`."""
        for part in self.parts:
            own = {name: saved[_named(part, name)] for name in part.kept()}
            if not part.could_be(own, states, parameters):
                raise ValueError(
                    f"state must hold what this game's {part.what} can know, got another {part.what}'s or a damaged one"
                )


def _named(part: Part, name: str) -> str:
    """What saved states call an array that a part keeps."""
    return f"{SIDES[part.seat]}_{name}"
