"""What commands say of arguments that will not do: the option and what was given, before anything is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers import Call

LINES = """
benchmark --rounds 0
benchmark --seconds nan
benchmark --json no/x.json
benchmark --page none.md
curves none
curves
model_card
model_card none
clone
clone none-v0 --epochs 0
clone none-v0 --seed -1
clone none-v0 --out policy.npy
clone none-v0 --out none/policy.npz
evaluate
evaluate nobody
evaluate idle --opponent nobody
evaluate idle --opponent goalie --task hit
evaluate idle --task juggle
evaluate idle --table billiards
evaluate idle --table none.json
evaluate idle --randomize worlds
evaluate idle --randomize none.yaml
evaluate idle --camera eagle
evaluate idle --camera none.yml
evaluate idle --action-delay-ms -1
evaluate idle --action-delay-ms 1 2 3
evaluate idle --action-delay-ms nan
evaluate idle --episodes 0
evaluate idle --opponent-skill 1.1
evaluate idle --opponent-skill nan
evaluate idle --seed -1
evaluate idle --episodes 2 --json none/result.json
export
export expert --onnx policy.npz
export expert --onnx none/policy.onnx
fit_study --tables 0
fit_study --seconds 1
fit_study --seed -1
fit_study --json none/study.json
fit_study --page none.md
fit_table
fit_table none.csv
fit_table none.csv --table billiards
fit_table none.csv --length -1
fit_table none.csv --width nan
fit_table none.csv --puck-radius 0
fit_table none.csv --goal-width 11
fit_table none.csv --out table.yml
fit_table none.csv --out none/table.json
fit_table none.csv --json none/fit.json
fit_table none.csv --plot fit.pdf
fit_table none.csv --demo 1
fit_table none.csv --seed -1
kiss_study --out nowhere/deep
kiss_study --json nowhere/x.json
ladder nobody
ladder --points 0
ladder --seed -1
ladder --table billiards
ladder --randomize worlds
ladder --camera eagle
ladder --action-delay-ms -1
ladder --plot ladder.pdf
ladder --plot none/ladder.png
ladder --json none/ladder.json
make_dataset --player nobody
make_dataset --player striker
make_dataset --opponent nobody
make_dataset --steps 0
make_dataset --steps 1000000000
make_dataset --task juggle
make_dataset --table billiards
make_dataset --randomize worlds
make_dataset --camera eagle
make_dataset --action-delay-ms -1
make_dataset --stack 65
make_dataset --seed -1
make_dataset --replays none.npz
play --opponent nobody
play --skill 1.5
play --points 0
play --fps 1
play --size 10 500
play --table pool
play --randomize worlds
play --camera eagle
play --action-delay-ms -1
record_video nobody
record_video idle --opponent nobody
record_video idle --opponent goalie --task hit
record_video idle --task juggle
record_video idle --out video.avi
record_video idle --out none/video.gif
record_video idle --seconds -1
record_video idle --seconds nan
record_video idle --fps 0
record_video idle --width 5
record_video idle --table billiards
record_video idle --randomize worlds
record_video idle --camera eagle
record_video idle --action-delay-ms -1
robustness
robustness nobody
robustness idle --opponent nobody
robustness idle --points 0
robustness idle --seed -1
robustness idle --only camera --plot card.pdf
robustness idle --json none/card.json
scorecard
scorecard nobody
scorecard idle --opponent nobody
scorecard idle --points 0
scorecard idle --episodes 0
scorecard idle --seed -1
scorecard idle --table billiards
scorecard idle --randomize worlds
scorecard idle --camera eagle
scorecard idle --action-delay-ms -1
scorecard idle --plot card.pdf
scorecard idle --plot none/card.png
scorecard idle --json none/card.json
torture --seconds nan
torture --jobs 0
torture --seed -1
torture --replay nothing.json
distill --teacher striker
distill --teacher nobody
distill --start none
distill --imitation-steps -1
distill --imitation-rate 2
distill --noise 0
distill --stack 65
distill --task chess
distill --stack 3 --obs-type rgb
distill --camera eagle
distill --net-width 0
train --algo dreamer
train --env CartPole-v1
train --obs-type sound
train --obs-type rgb --algo sac
train --hyperparams none.yml
train --table billiards
train --randomize worlds
train --camera eagle
train --action-delay-ms -1
train_ppo --eval-opponent nobody
train_ppo --opponent striker nobody
train_ppo --table billiards
train_ppo --randomize worlds
train_ppo --camera eagle
train_ppo --action-delay-ms -1
train_ppo --reward huge
train_ppo --num-envs 0
train_ppo --device abacus
train_self_play --responses worst
train_self_play --exchange no/folder
train_self_play --response-every 0
distill --more-cameras eye
train_ppo --steps 0
train_ppo --steps many
train_ppo --n-steps 1
train_ppo --batch-size 1
train_ppo --learning-rate -1
train_ppo --gamma nan
train_ppo --eval-episodes 0
train_ppo --eval-every 0
train_ppo --report-episodes 0
train_ppo --video-seconds -1
train_ppo --seed -1
train_ppo --threads 0
train_ppo --name ../outside
train_ppo --resume none
train_ppo --start none
train_ppo --start none/policy.npz
train_self_play --start none
train_self_play --table billiards
train_self_play --randomize worlds
train_self_play --camera eagle
train_self_play --action-delay-ms -1
train_self_play --latest-share 1.1
train_self_play --scripted-share 0.8
train_self_play --snapshot-every 0
train_self_play --most-past-selves 0
train_self_play --warmup-steps -1
train_self_play --opponent
"""
NAMELESS = {
    **dict.fromkeys(("evaluate", "exploit", "export", "ladder", "record_video", "robustness", "scorecard"), "MODEL"),
    **dict.fromkeys(("curves", "model_card"), "RUN"),
    "fit_table": "TRACK.csv",
}
"""What the arguments without an option are called in the help."""


@pytest.mark.parametrize("line", LINES.split("\n")[1:-1])
def test_the_option_is_named_and_nothing_is_written(line: str, call: Call, tmp_path: Path) -> None:
    script, *arguments = line.split()
    option = next((one for one in reversed(arguments) if one.startswith("--")), NAMELESS.get(script, ""))
    printed = call(script, *arguments, fails=True)
    assert option in printed
    assert not arguments or arguments[-1] in printed
    assert not list(tmp_path.iterdir())
