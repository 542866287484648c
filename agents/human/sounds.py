"""The sounds of a match, synthesised: nothing is read from files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.drawing.window import import_pygame
from airhockey_env.live.match import KINDS, Event

RATE = 44_100
"""Samples a second."""

QUIETEST = 0.02
"""Hits weaker than this are not heard."""


def _tone(pitch: float, seconds: float, fade: float) -> NDArray[np.float64]:
    """A note that dies away; Hz, s, 1/s."""
    time = np.arange(round(seconds * RATE)) / RATE
    attack = np.minimum(time / 0.002, 1.0)
    release = np.minimum((seconds - time) / 0.01, 1.0)
    return np.sin(2.0 * np.pi * pitch * time) * np.exp(-fade * time) * attack * release


def _tune(*pitches: float, apart: float = 0.09, seconds: float = 0.35) -> NDArray[np.float64]:
    """Notes, each starting a little after the one before."""
    length = round(((len(pitches) - 1) * apart + seconds) * RATE) + 1
    wave = np.zeros(length)
    for k, pitch in enumerate(pitches):
        note = _tone(pitch, seconds, 9.0) + 0.3 * _tone(2.0 * pitch, seconds, 14.0)
        start = round(k * apart * RATE)
        wave[start : start + len(note)] += note
    return wave


def _knock(pitch: float, fade: float) -> NDArray[np.float64]:
    """Something hard on something hard."""
    wave = _tone(pitch, 0.12, fade) + 0.5 * _tone(2.76 * pitch, 0.12, 1.6 * fade)
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, len(wave))
    return wave + 0.5 * noise * np.exp(-600.0 * np.arange(len(wave)) / RATE)


def synthesise(kind: str) -> NDArray[np.int16]:
    """The sound of a kind of event, (n,) samples."""
    waves = {
        "paddle": lambda: _knock(1150.0, 55.0),
        "wall": lambda: _knock(420.0, 45.0),
        "goal": lambda: _tune(523.3, 659.3, 784.0),
        "conceded": lambda: _tune(392.0, 311.1),
        "foul": lambda: _tune(233.1, 233.1, apart=0.16),
        "won": lambda: _tune(523.3, 659.3, 784.0, 1046.5, apart=0.12, seconds=0.6),
        "lost": lambda: _tune(392.0, 349.2, 311.1, 261.6, apart=0.16, seconds=0.5),
    }
    wave = waves[kind]()
    return np.round(wave / np.abs(wave).max() * 0.5 * 32767.0).astype(np.int16)


class Sounds:
    """Plays what happens, louder for harder hits, from the side of the table where it happens.

    Without an audio device it stays silent: `working` is False then.

    Args:
        length: of the table, m.
    """

    def __init__(self, length: float) -> None:
        self._length = length
        self._sounds: dict[str, Any] = {}
        pygame = import_pygame()
        with _silenced_stderr():  # on which the system's audio libraries complain, past Python
            try:
                pygame.mixer.init(RATE, -16, 2, 256)
                self._sounds = {
                    kind: pygame.mixer.Sound(buffer=np.repeat(synthesise(kind), 2).tobytes()) for kind in KINDS
                }
            except (pygame.error, NotImplementedError, AttributeError):  # no device, or a pygame without sound
                self._sounds = {}
        self._pygame = pygame

    @property
    def working(self) -> bool:
        """Whether there is anything to be heard."""
        return bool(self._sounds)

    def play(self, events: Iterable[Event]) -> None:
        """Play what happened during one picture: of each kind the strongest."""
        strongest: dict[str, Event] = {}
        for event in events:
            if event.kind not in strongest or event.strength > strongest[event.kind].strength:
                strongest[event.kind] = event
        for kind, event in strongest.items():
            if kind not in self._sounds or event.strength < QUIETEST:
                continue
            channel = self._sounds[kind].play()
            if channel is not None:  # all of them are in use
                loud = min(0.15 + event.strength, 1.0)
                side = min(max(event.x / self._length, -0.5), 0.5)
                channel.set_volume(loud * (0.75 - 0.5 * side), loud * (0.75 + 0.5 * side))

    def close(self) -> None:
        """Let the audio device go."""
        if self._sounds:
            self._sounds = {}
            self._pygame.mixer.quit()


@contextmanager
def _silenced_stderr() -> Iterator[None]:
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
