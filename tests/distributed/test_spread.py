"""Work spread over Ray tasks: the same results, whatever happens to workers, and what signals keep."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from agents.cluster import connect, spread
from tests.helpers import Call, start

needs_ray = pytest.mark.skipif(
    os.name == "nt" or not __import__("importlib.util").util.find_spec("ray"), reason="needs Ray"
)
