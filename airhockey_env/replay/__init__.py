"""Replays: small files that hold what was played, and play back equal to the bit.

```python
env = RecordReplay(gymnasium.make("AirHockey-v0"), "game.npz")
...  # play, any number of episodes
env.close()

for state in play_back("game.npz"):
    print(state["position"])
```

`RecordVectorReplay` does it for tables of a batch, and `airhockey_env.replay.parallel.RecordParallelReplay` for two
players; `python -m scripts.record_video game.npz --out game.mp4` makes a video of one. See docs/replays.md.

A file is an .npz without pickles:

| array | what |
|---|---|
| `replay` | JSON: `format`, the package's `version`, the dynamics' `fingerprint`, the environment's `id` (or null), its `arguments`, and of every take the `seeds` that its reset was given (or null) |
| `starts` | (E,) int64: the number of actions that came before each take |
| `states`, `ends` | (E,) records: the table's state at the start of each take and at its end |
| `actions` | (T, 2) float32 target velocities or, with `continuous=False`, (T,) int8 directions |
| `others` | (T, 2) float32: what the right player from outside did, as it saw it; (0, 2) with a scripted one |

A take is what was played on end: it begins with a reset, or where the state was set in the midst of an episode. Of
several tables of a batch, all takes of one come before those of the next.

The fingerprint is a hash of a short rollout of the same game (task, table, rate, opponent and so on) from fixed
seeds with fixed actions. So changes of the package that leave this game what it was, a new task or a better opponent
of another name, say, leave its replays valid; and one that plays otherwise, be it for another version of the package
or for a machine that calculates differently, is refused. What such a rollout might miss shows at the end of a take.
"""  # noqa: E501

from airhockey_env.replay.dynamics import arguments_of, fingerprint
from airhockey_env.replay.file import Replay, is_replay
from airhockey_env.replay.playback import play_back, play_back_frames
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
]
