"""The learner study where the libraries are missing, and with wrong options."""

from __future__ import annotations

import importlib.util
import re

import pytest

from tests.helpers import Call


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--learners", "puffer"), "--learners must be one of .*puffer"),
        (("--learners",), "--learners .*none"),
        (("--points", "0"), "--points .*0"),
        (("--json", "nowhere/rows.json"), "nowhere"),
    ],
)
def test_wrong_options_train_nothing(options: tuple[str, ...], message: str, call: Call) -> None:
    assert re.search(message, call("learner_study", *options, fails=True))


@pytest.mark.skipif(importlib.util.find_spec("sbx") is not None, reason="SBX is installed")
def test_a_missing_library_names_the_extra(call: Call) -> None:
    assert "ecosystem" in call("learner_study", "--learners", "sb3", "sbx", fails=True)
