"""Ray on this machine: a real one of two processors, or a cluster of two nodes. Without Ray these tests are skipped.

`.ci/libraries` builds an environment with Ray and runs

    .venv-distributed/bin/python -m pytest tests/distributed
"""

from __future__ import annotations

import os
from importlib.util import find_spec

import pytest

from agents.cluster import ALWAYS, OWN

os.environ.update(ALWAYS | OWN, OMP_NUM_THREADS="1")  # before Ray is imported: no ports but this machine's own


def pytest_configure(config: pytest.Config) -> None:
    """Ray leaves processes and files to be closed by the end of the process, which is no fault of ours."""
    if find_spec("ray") is not None:
        config.addinivalue_line("filterwarnings", "ignore")
        config.addinivalue_line("filterwarnings", "error:::agents")
