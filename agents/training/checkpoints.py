"""Checkpoints: the model, its replay buffer and league, and the records of a run, written atomically."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from agents.features import stack_of_shape
from agents.files import COUNT, NUMBER, or_none, read_json, replace_together, write_json
from agents.models import export_policy, seen_space
from agents.sb3_files import load_weights
from agents.training.recipe import History, Setup
from agents.training.runs import RunFolder
from airhockey_env.files import read_arrays

TIMES = {"steps": COUNT, "seconds": NUMBER}
"""The steps and seconds of training before an evaluation or an update, as a pattern of `read_json`."""

HISTORY = {"practice": or_none(COUNT), "evaluations": [TIMES], "updates": [TIMES], "report": [{}]}
"""The records of a run, as a pattern of `read_json`. `practice` is the steps after which shooting practice was over."""

BUFFER_ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def save(folder: RunFolder, setup: Setup, history: History) -> None:
    """Write the model, its policy if it sees states, its replay buffer and league if it has them, and the records.

    The new files replace the old ones when all of them are complete.

    Raises:
        OSError: the files cannot be written. The old ones are intact.
    """
    model = setup.model
    writes: dict[Path, Callable[[Path], object]] = {folder.model: model.save}
    if stack_of_shape(seen_space(model).shape or ()):
        writes[folder.policy] = export_policy(model).save
    if isinstance(model, OffPolicyAlgorithm) and model.replay_buffer is not None:
        writes[folder.buffer] = lambda part: save_buffer(model.replay_buffer, part)
    writes[folder.evaluations] = lambda part: write_json(part, history)
    try:
        if setup.league is not None:
            setup.league.save(folder.path)
        replace_together(writes)
    except OSError as error:
        raise OSError(f"{folder.path} could not be saved, its last checkpoint is intact: {error}") from error


def load(folder: RunFolder, setup: Setup) -> History:
    """Load what `save` wrote into a newly built model and its league, and return the records.

    Raises:
        OSError, ValueError: a file is missing or damaged.
    """
    history = read_json(folder.evaluations, {**HISTORY, "evaluations": [{**TIMES, **setup.evaluation}]})
    load_weights(setup.model, folder.model)
    if isinstance(setup.model, OffPolicyAlgorithm):
        load_buffer(setup.model.replay_buffer, folder.buffer)
    if setup.league is not None:
        setup.league.load(folder.path)
    return {name: history[name] for name in HISTORY}


def save_buffer(buffer: Any, path: Path) -> None:
    """Write the filled part of a `ReplayBuffer` as plain arrays (steps, tables, ...)."""
    arrays = {name: getattr(buffer, name)[: buffer.size()] for name in BUFFER_ARRAYS if hasattr(buffer, name)}
    np.savez(path, position=buffer.pos, full=buffer.full, **arrays)


def load_buffer(buffer: Any, path: Path) -> None:
    """Fill a `ReplayBuffer` from a file of `save_buffer`.

    Raises:
        OSError: the file cannot be opened.
        ValueError: the file is damaged, or belongs to a buffer of another shape.
    """
    names = [name for name in BUFFER_ARRAYS if hasattr(buffer, name)]
    try:
        most = sum(getattr(buffer, name).nbytes for name in names) + 2**14  # 2**14 for the headers
        kept = read_arrays(path, "a training run", ("position", "full", *names), most)
        position, full = int(kept["position"]), bool(kept["full"])
        size = buffer.buffer_size if full else position
        if not 0 <= position < buffer.buffer_size:
            raise ValueError(f"position must be below {buffer.buffer_size}, got {position}")
        for name in names:
            own, saved = getattr(buffer, name), kept[name]
            if saved.shape != (size, *own.shape[1:]) or saved.dtype != own.dtype:
                wanted = (size, *own.shape[1:])
                raise ValueError(f"{name} must be {wanted} of {own.dtype}, got {saved.shape} of {saved.dtype}")
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path} does not hold this run's replay buffer: {error}") from error
    for name in names:
        getattr(buffer, name)[:size] = kept[name]
    buffer.pos, buffer.full = position, full
