"""Says which extra to install where whole commands need it."""

from __future__ import annotations

from importlib.util import find_spec


def need(what: str, *modules: str) -> None:
    """End the process with a message unless these modules of the extra `train` are there. Imports none of them.

    A command imports what it needs at its top, where no error of its own could be shown without a traceback.
    """
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise SystemExit(f'{what}: {", ".join(missing)} missing; pip install -c constraints.txt -e ".[train]"')
