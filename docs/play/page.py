"""The page "Play" of airhockey_env/web without its server: python -m docs.play.page FOLDER

The page and its modules are those that the server has, but for one: the connection to the server is replaced by a
session that plays the match in the page itself (js/connection.js). The build of the site calls `write_page`.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.drawing.palette import COLORS
from airhockey_env.engine.records import CONTACT
from airhockey_env.game import Game
from airhockey_env.kernel.state import STATE
from airhockey_env.live import match, pointer, recording
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import trained_policy
from airhockey_env.replay.dynamics import arguments_of, fingerprint
from airhockey_env.replay.file import FORMAT
from airhockey_env.tables import PRESETS, TableSpec
from airhockey_env.version import __version__
from airhockey_env.web.assets import FOLDER as STATIC
from airhockey_env.web.catalogue import dimensions
from benchmarks.speed.reference import C_PARAMETERS

FOLDER = Path(__file__).parent
TRAINED = ("expert", "adept")
"""Trained opponents on the page, the first one chosen. The scripted `striker` plays too: the game in C contains it."""
POINTS = 7
"""That win the match."""

KINDS = {"policy": None, "striker": "striker"}
"""Who plays on the right in a replay, by kinds of opponents: None where the file holds the actions."""
LIVE = {
    match: ("most_behind", "trust", "start_pause", "point_pause", "foul_pause"),
    pointer: ("grasp", "memory"),
    recording: ("most_seconds",),
}
"""Constants of live matches, in lower case, which apply here too."""

CHANGES = (
    (r'"/static/(?:css/)?', '"'),
    (
        r"<nav.*?</nav>",
        '<nav aria-label="Pages"><a href="../index.html">Documentation</a>'
        '<a href="../web.html#without-a-server">How this works</a></nav>',
    ),
    ("<title>Play air hockey</title>", "<title>Play the expert now: air hockey in the browser</title>"),
    (r'(<select id="opponent">)', rf"\1<option>{TRAINED[0]}</option>"),
    (r"<label[^>]*>Points to win .*?</label>", f'<input id="points" type="hidden" value="{POINTS}" />'),
)
"""What is different on this page: patterns, and what takes the place of a match."""


def write_page(folder: Path, policies: Mapping[str, MlpPolicy] | None = None) -> None:
    """Write the page with all that it needs.

    Args:
        folder: where to; made if it does not exist.
        policies: trained opponents by name; those in `TRAINED` by default.

    Raises:
        ValueError: the page of the server, or a policy, is not of the form that this one is made for.
    """
    if policies is None:
        policies = {name: trained_policy(name) for name in TRAINED}
    (folder / "js").mkdir(parents=True, exist_ok=True)
    for path in (*modules("play.js"), STATIC / "css" / "site.css", STATIC / "icon.svg", FOLDER / "game.wasm"):
        shutil.copy(path, folder / ("js" if path.suffix == ".js" else "") / path.name)
    (folder / "index.html").write_text(page(), encoding="utf-8")
    for name, policy in policies.items():
        (folder / f"{name}.bin").write_bytes(weights(policy).tobytes())
    (folder / "game.json").write_text(json.dumps(facts(policies)), encoding="utf-8")


def modules(first: str) -> list[Path]:
    """A module and those that it imports. One that this page has replaces the server's of the same name."""
    found, waiting = {}, [first]
    while waiting:
        name = waiting.pop()
        own = FOLDER / "js" / name
        found[name] = own if own.exists() else STATIC / "js" / name
        text = found[name].read_text(encoding="utf-8")
        waiting += set(re.findall(r'^import .* from "\./(.*)";$', text, flags=re.MULTILINE)) - set(found)
    return list(found.values())


def page() -> str:
    """The page of the server with the `CHANGES`.

    Raises:
        ValueError: there is nothing to change.
    """
    text = (STATIC / "play.html").read_text(encoding="utf-8")
    for pattern, new in CHANGES:
        text, count = re.subn(pattern, new, text, flags=re.DOTALL)
        if not count:
            raise ValueError(f"{STATIC / 'play.html'} must contain {pattern!r}, which docs/play/page.py replaces")
    return text


def weights(policy: MlpPolicy) -> NDArray[np.float32]:
    """The weights (in, out) and biases (out,) of one layer after the other, as `forward` in policy.c takes them.

    Raises:
        ValueError: the policy chooses directions or takes stacks of observations, which the page cannot play.
    """
    if policy.discrete or policy.stack != 1:
        raise ValueError(
            f"policies must be continuous and take one observation, got one with discrete={policy.discrete} and "
            f"stack={policy.stack}"
        )
    layers = zip(policy.weights, policy.biases, strict=True)
    return np.concatenate([part for weight, bias in layers for part in (weight.T.ravel(), bias)]).astype("<f4")


def facts(policies: Mapping[str, MlpPolicy]) -> dict[str, Any]:
    """What the page's modules need to know of the package."""
    return {
        "control_hz": match.CONTROL_HZ,
        "hold": round(match.CONTROL_HZ / match.POLICY_HZ),
        "live": {name: getattr(module, name.upper()) for module, names in LIVE.items() for name in names},
        "palette": COLORS._asdict(),
        "policies": {name: network(policy) for name, policy in policies.items()},
        "tables": {name: table(spec) for name, spec in PRESETS.items()},
        "state": record(STATE),
        "contact": record(CONTACT),
    }


def network(policy: MlpPolicy) -> dict[str, Any]:
    """The form of a policy, whose weights are in a file."""
    sizes = [policy.weights[0].shape[1], *(len(bias) for bias in policy.biases)]
    return {"sizes": sizes, "tanh": policy.activation == "tanh", "squash": policy.squash}


def table(spec: TableSpec) -> dict[str, Any]:
    """A table's dimensions, parameters for the game in C, and what a replay says of matches on it."""
    games = {
        kind: Game(1, right=right, table=spec, points=POINTS, control_hz=match.CONTROL_HZ)
        for kind, right in KINDS.items()
    }
    parameters = games["policy"].parameters
    part = np.zeros(1, C_PARAMETERS)
    for name in C_PARAMETERS.names or ():
        part[name] = parameters[name]
    return {
        "dimensions": dimensions(spec),
        "paddle_speed": spec.paddle_speed,
        "paddle_step": float(parameters["paddle_step"][0]),
        "clock_limit": int(parameters["clock_limit"][0]),
        "hardest_impulse": spec.puck_mass * spec.puck_speed,
        "parameters": list(part.tobytes()),
        "replays": {kind: replay_notes(game) for kind, game in games.items()},
    }


def replay_notes(game: Game) -> str:
    """The notes in the file of a replay, as JSON; see airhockey_env/replay/file.py."""
    arguments = arguments_of(game)
    notes = {"format": FORMAT, "version": __version__, "fingerprint": fingerprint(arguments), "id": None}
    return json.dumps({**notes, "arguments": arguments, "seeds": [None]})


def record(dtype: np.dtype) -> dict[str, Any]:
    """The memory layout of a record: its size, the places of its fields, and its type as .npy files say it."""
    places = {name: field[1] for name, field in (dtype.fields or {}).items()}
    return {"size": dtype.itemsize, "places": places, "descr": repr(np.lib.format.dtype_to_descr(dtype))}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description='Write the page "Play" that needs no server.')
    parser.add_argument("folder", type=Path, help="The folder to write to; serve it with python -m http.server.")
    write_page(parser.parse_args().folder)
