"""Other people's libraries, each doing what docs/works_with.md says, in environments of their own.

The test command of the README leaves them out. `.ci/libraries` builds both environments and runs

    .venv-ecosystem/bin/python -m pytest tests/ecosystem --ignore tests/ecosystem/test_rllib.py
    .venv-distributed/bin/python -m pytest tests/ecosystem/test_rllib.py
"""

from __future__ import annotations

import os

import pytest

# Nothing is sent anywhere; and one thread each, since the tests run side by side.
os.environ.update(
    WANDB_MODE="offline",
    OMP_NUM_THREADS="1",
    XLA_FLAGS="--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
)


def pytest_configure(config: pytest.Config) -> None:
    """These libraries warn of each other, and of us only where we are at fault."""
    config.addinivalue_line("filterwarnings", "ignore")
    config.addinivalue_line("filterwarnings", "error:::airhockey_env")
