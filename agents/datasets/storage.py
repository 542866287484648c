"""Writing a Minari data set: the whole of it or nothing."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from agents.datasets.episodes import Episode
from agents.datasets.settings import Setting

_ID = re.compile(r"(?:[-\w]+/)*[-\w]+-v\d+", re.ASCII)


class Written(NamedTuple):
    """What a new data set contains, and where it is."""

    folder: Path
    steps: int
    returns: NDArray[np.float64]
    """(episodes,) the sum of the rewards of each."""

    @property
    def megabytes(self) -> float:
        """Size of the files, 10^6 bytes."""
        return sum(path.stat().st_size for path in self.folder.rglob("*")) / 1e6


def check_minari(what: str) -> None:
    """Raise DependencyNotInstalled if Minari is missing; `what` is the beginning of the message."""
    try:
        import h5py  # noqa: F401
        import minari  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled(f'{what} the extra "data": pip install -e ".[data]"') from error


def check_id(option: str, dataset_id: str) -> str:
    """Check the id of a new data set.

    Args:
        option: what errors call it.
        dataset_id: namespaces, a name and a version, such as "airhockey/point/expert-v0".

    Raises:
        ValueError: it is no such id.
        FileExistsError: there is a data set with it already.
        OSError: Minari's folder cannot be used.
    """
    from minari.storage import get_dataset_path

    if not _ID.fullmatch(dataset_id):
        raise ValueError(f'{option} must be an id such as "airhockey/point/expert-v0", got {dataset_id!r}')
    folder = get_dataset_path(dataset_id)
    if folder.exists():
        raise FileExistsError(
            f"{option} must be the id of no other data set, and {dataset_id} is in {folder}; give it another version, "
            f"or delete the old one: minari delete {dataset_id}"
        )
    return dataset_id


def write_dataset(
    dataset_id: str, setting: Setting, metadata: Mapping[str, Any], episodes: Iterable[Episode]
) -> Written:
    """Write episodes into Minari's folder (`MINARI_DATASETS_PATH`, or ~/.minari/datasets), where Minari finds them.

    Until everything is written, the files are in a hidden folder beside the data sets, which goes away whatever
    interrupts the writing.

    Args:
        dataset_id: the id, checked.
        setting: the environment of the episodes.
        metadata: Minari's further fields by name.
        episodes: the episodes, at least one.

    Raises:
        OSError: the disk is full, there is such a data set by now, or something else is wrong with the files.
        MemoryError: the episodes do not fit into memory.
    """
    from minari import __version__
    from minari.dataset.minari_dataset import parse_dataset_id
    from minari.dataset.minari_storage import MinariStorage
    from minari.namespace import create_namespace, list_local_namespaces
    from minari.storage import get_dataset_path

    spec, final = setting.spec, get_dataset_path(dataset_id)
    with _hidden_folder(get_dataset_path()) as hidden:
        folder = hidden / "dataset"
        folder.mkdir()
        storage = MinariStorage.new(folder / "data", env_spec=spec, data_format="hdf5")
        content, lengths, returns = _as_hdf5(episodes)
        (folder / "data" / "main_data.hdf5").write_bytes(content.getbuffer())
        steps = sum(lengths)
        facts = {
            "dataset_id": dataset_id,
            "minari_version": __version__,
            "eval_env_spec": spec.to_json(),
            "total_episodes": len(lengths),
            "total_steps": steps,
        }
        storage.update_metadata({**facts, **metadata})
        storage.update_metadata({"dataset_size": float(storage.get_size())})
        namespace = parse_dataset_id(dataset_id)[0]
        if namespace is not None and namespace not in list_local_namespaces():
            create_namespace(namespace)
        check_id("the data set's id", dataset_id)  # another process may have been quicker
        os.rename(folder, final)
    return Written(final, steps, np.array(returns))


@contextlib.contextmanager
def _hidden_folder(parent: Path) -> Iterator[Path]:
    """A new folder that Minari does not see, for as long as the context lasts, even if SIGTERM ends it."""
    main = threading.current_thread() is threading.main_thread()  # Python handles signals only there
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number)) if main else None
    hidden = Path(tempfile.mkdtemp(prefix=".part-", dir=parent))
    try:
        yield hidden
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
        if main:
            signal.signal(signal.SIGTERM, before)


def _as_hdf5(episodes: Iterable[Episode]) -> tuple[io.BytesIO, list[int], list[float]]:
    """A file as Minari's "dataset standards" describe it, and the lengths and the returns of the episodes.

    In memory, because HDF5 does not survive a full disk. Minari's own writer takes six times as long, most of it for
    arrays that can grow later.
    """
    import h5py
    from h5py import h5a, h5d, h5g, h5s, h5t

    scalar, types = h5s.create(h5s.SCALAR), {}
    for kind in (np.float32, np.float64, np.bool_, np.int64):
        types[np.dtype(kind)] = h5t.py_create(np.dtype(kind), logical=True)

    def add_array(group: Any, name: bytes, array: NDArray[Any]) -> None:
        space = h5s.create_simple(array.shape)
        h5d.create(group, name, types[array.dtype], space).write(h5s.ALL, h5s.ALL, np.ascontiguousarray(array))

    def add_number(group: Any, name: bytes, number: int) -> None:
        h5a.create(group, name, types[np.dtype(np.int64)], scalar).write(np.array(number, np.int64))

    content, lengths, returns = io.BytesIO(), [], []
    with h5py.File(content, "w") as file:
        for number, episode in enumerate(episodes):
            group = h5g.create(file.id, b"episode_%d" % number)
            add_number(group, b"id", number)
            add_number(group, b"total_steps", len(episode))
            if episode.seed is not None:
                add_number(group, b"seed", episode.seed)
            if episode.state is not None:
                h5py.Group(group).attrs["state"] = np.frombuffer(episode.state.tobytes(), np.uint8)
            ends = np.zeros((2, len(episode)), np.bool_)
            ends[0 if episode.terminated else 1, -1] = True
            add_array(group, b"observations", episode.observations)
            add_array(group, b"actions", episode.actions)
            add_array(group, b"rewards", episode.rewards)
            add_array(group, b"terminations", ends[0])
            add_array(group, b"truncations", ends[1])
            h5g.create(group, b"infos")  # empty, as Minari writes it: printing an episode needs it
            lengths.append(len(episode))
            returns.append(float(episode.rewards.sum()))
    return content, lengths, returns
