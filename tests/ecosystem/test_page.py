"""docs/works_with.md does what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ecosystem.page import IN_ANOTHER_ENVIRONMENT, run_section, sections


@pytest.mark.parametrize("name", [name for name in sections() if name not in IN_ANOTHER_ENVIRONMENT])
def test_section(name: str, tmp_path: Path) -> None:
    run_section(name, tmp_path)
