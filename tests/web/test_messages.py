"""Messages are checked field by field, and so is what a visitor uses."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from airhockey_env.web.limits import Allowance
from airhockey_env.web.messages import Message, Refused, encode


def message(**fields: Any) -> Message:
    return Message(json.dumps({"type": "x", **fields}))


@pytest.mark.parametrize(
    "text",
    [
        "", "null", "[]", "7", '"turn"', "{}", '{"type": 7}', '{"type": "turn"', '{"type": "turn", "a": NaN}',
        '{"type": "turn", "type": "turn"}', "[" * 100_000, '{"type": "turn", "a": ' + "[" * 4000, "\x00", "\ud800",
    ],
)  # fmt: skip
def test_what_is_no_message(text: str) -> None:
    with pytest.raises(Refused):
        Message(text)


@pytest.mark.parametrize(
    ("take", "good", "bad"),
    [
        (lambda m: m.number("a", -1.0, 2.0), [-1, 0.5, 2.0], [3, -1.1, "1", None, True, [1], {}, 10**400, 1e308]),
        (lambda m: m.whole("a", 1, 5), [1, 5], [0, 6, 2.0, "2", None, True, 10**400]),
        (lambda m: m.numbers("a", 2, 3.0), [[0, 1.5], [-3, 3]], [[1], [1, 2, 3], [1, 4], [1, "2"], 1, "ab", [[1], 2]]),
        (lambda m: m.choice("a", ("one", "two")), ["one"], ["three", 1, None, ["one"], {"one": 1}, ""]),
        (lambda m: m.flag("a"), [True, False], [1, 0, "true", None]),
    ],
)
def test_fields(take: Callable[[Message], Any], good: list[Any], bad: list[Any]) -> None:
    for value in good:
        taken = take(message(a=value))
        assert (list(taken) if isinstance(taken, tuple) else taken) == value
    for value in bad:
        with pytest.raises(Refused, match=r"^a must be"):
            take(message(a=value))
    with pytest.raises(Refused, match=r"a$"):
        take(message(b=1))


def test_a_number_that_json_makes_infinite_is_refused() -> None:
    with pytest.raises(Refused, match=r"^a must be"):
        Message('{"type": "x", "a": 1e999}').number("a", 0.0, float("inf"))


def test_defaults_and_nulls() -> None:
    assert message().number("a", 0.0, 1.0, 0.25) == 0.25
    assert not message(a=None).has("a") and not message().has("a") and message(a=0).has("a")


def test_fields_that_nobody_takes_are_refused() -> None:
    with_more = message(a=1, b=2)
    with_more.whole("a", 0, 5)
    with pytest.raises(Refused, match='"b"'):
        with_more.finish()
    nothing = message(a=None)
    nothing.has("a")
    nothing.finish()


def test_reasons_are_short() -> None:
    with pytest.raises(Refused) as refused:
        message(a="x" * 3000).number("a", 0.0, 1.0)
    assert len(str(refused.value)) < 120


def test_answers_hold_finite_numbers_alone() -> None:
    assert encode({"type": "x", "a": [1.5]}) == '{"type":"x","a":[1.5]}'
    with pytest.raises(ValueError, match="JSON"):
        encode({"type": "x", "a": float("nan")})


def test_an_allowance_fills_up_again() -> None:
    allowance = Allowance(10.0, 5.0)
    assert [allowance.spend(1.0, 100.0) for _ in range(5)] == [0.0] * 5
    assert allowance.spend(1.0, 100.0) == pytest.approx(0.1)
    assert allowance.spend(1.0, 100.15) == pytest.approx(0.05)
    assert allowance.spend(5.0, 200.0) == 0.0  # never more than the burst
    assert allowance.spend(1.0, 200.0) == pytest.approx(0.1)
