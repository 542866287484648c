"""Replays: small files that hold what was played, and play back equal to the bit.

```python
env = RecordReplay(gymnasium.make("AirHockey-v0"), "game.npz")
...  # play, any number of episodes
env.close()

for state in play_back("game.npz"):
    print(state["position"])
```

`RecordVectorReplay` records tables of a batch, and `airhockey_env.replay.parallel.RecordParallelReplay` a game of two
players; `python -m scripts.record_video game.npz --out game.mp4` makes a video of a file. See docs/replays.md.

A file is an .npz without pickles:

| array | contents |
|---|---|
| `replay` | JSON: `format`, the package's `version`, the dynamics' `fingerprint`, the environment's `id` (or null), its `arguments`, and for every segment the `seeds` that its reset was given (or null) |
| `starts` | (E,) int64: the number of actions before each segment |
| `states`, `ends` | (E,) records: the table's state at the start and at the end of each segment |
| `actions` | (T, 2) float32 target velocities that reached the left paddle or, with `continuous=False` and without `action_delay_ms`, (T,) int8 directions |
| `right_actions` | (T, 2) float32 actions of the right player, as it sees the table; (0, 2) if that is a named one |

A segment is a stretch of play without a break. It begins with a reset, or where a state was set in the middle of an
episode. If several tables of a batch were recorded, all segments of one come before those of the next.

The fingerprint is a hash of a short rollout of the same game (task, table, rate, opponent and so on) from fixed seeds
with fixed actions. A replay stays valid as long as this game's dynamics do: adding a task or an opponent does not
invalidate it. If the rollout differs, on another version of the package or another machine, the replay is refused. What
the rollout might miss is noticed at the end of a segment.
"""  # noqa: E501

from airhockey_env.replay.dynamics import arguments_of, fingerprint
from airhockey_env.replay.file import Replay, is_replay
from airhockey_env.replay.playback import play_back, play_back_frames, play_back_game
from airhockey_env.replay.wrappers import RecordReplay, RecordVectorReplay

__all__ = [
    "RecordReplay",
    "RecordVectorReplay",
    "Replay",
    "arguments_of",
    "fingerprint",
    "is_replay",
    "play_back",
    "play_back_frames",
    "play_back_game",
]
