"""Every check has the same idea of what a number is, and names the argument, what is allowed and what was given."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from airhockey_env import checks

NUMBERS = {
    "one number": lambda value: checks.check_number("name", value, -math.inf, math.inf),
    "a positive number": lambda value: checks.check_positive("name", value),
    "a pair": lambda value: checks.check_pair("name", (value, value))[0],
    "an array": lambda value: checks.check_array("name", [[value], [value]], (2, 1), "two rows")[0, 0],
    "a skill": lambda value: checks.check_skill(value, 1),
    "skills": lambda value: checks.check_skill([value, value], 2)[0],
    "actions": lambda value: checks.check_velocities("name", [[value, value]], (1, 2))[0, 0],
}
REAL = [1, 0.5, np.int64(1), np.float16(0.5), np.float32(0.5), np.longdouble(0.5), Fraction(1, 2), Decimal("0.5")]
NOT_REAL = [
    True, np.True_, "1", b"1", 1j, np.complex128(1.0), np.timedelta64(1, "s"), np.datetime64("2020-01-01"), {}, [],
    None, 10**400, Fraction(10**400), Decimal("1e400"), math.nan, np.float64("nan"), Decimal("NaN"),
]  # fmt: skip


@pytest.mark.parametrize("check", NUMBERS.values(), ids=NUMBERS)
@pytest.mark.parametrize("value", REAL, ids=lambda value: type(value).__name__)
def test_every_real_number_will_do(check, value):
    assert check(value) == float(value)


@pytest.mark.parametrize("check", NUMBERS.values(), ids=NUMBERS)
@pytest.mark.parametrize("value", NOT_REAL, ids=lambda value: type(value).__name__)
def test_what_is_not_a_number_is_refused(check, value):
    with pytest.raises(ValueError, match=r"^(name|opponent_skill) must be .*[,;] got "):
        check(value)


WHOLE = {
    "one number": lambda value: checks.check_whole("name", value, 0, math.inf),
    "a limit": lambda value: checks.check_limit(value, 7, "name"),
    "a seed": checks.check_seed,
    "a pair": lambda value: checks.check_whole_pair("name", (value, value), 0)[0],
    "a direction": lambda value: checks.check_directions("name", value, ()) is not None and 5,
    "rows": lambda value: checks.check_rows("name", value, 6)[0],
}


@pytest.mark.parametrize("check", WHOLE.values(), ids=WHOLE)
@pytest.mark.parametrize("value", [5, np.int8(5), np.uint64(5)], ids=lambda value: type(value).__name__)
def test_every_whole_number_will_do(check, value):
    assert check(value) == 5


@pytest.mark.parametrize("check", WHOLE.values(), ids=WHOLE)
@pytest.mark.parametrize("value", [*NOT_REAL[:9], 5.0, np.float64(5.0), Fraction(5), Decimal(5), -(10**400), math.inf])
def test_what_is_not_a_whole_number_is_refused(check, value):
    with pytest.raises(ValueError, match=r"^(name|seed) must be .*, got "):
        check(value)


def test_seeds_may_be_of_any_size():
    assert checks.check_seed(10**400) == 10**400


def test_messages_show_values_without_the_names_of_numpys_types():
    assert checks.shown(np.float64(2.0)) == "2.0"
    assert checks.shown((np.float32(0.5), [np.int64(3), True])) == "(0.5, [3, True])"
    assert checks.shown(10**5000) == "a int that cannot be shown"


def test_an_array_that_a_check_returns_is_not_the_callers():
    given = np.array([0.5, 0.25])
    for kept in (
        checks.check_pair("name", given),
        checks.check_skill(given, 2),
        checks.check_array("name", given, (2,), ""),
    ):
        given[:] = 1.0
        assert kept.tolist() == [0.5, 0.25]
        given[:] = 0.5, 0.25


def test_a_message_says_what_else_is_allowed():
    with pytest.raises(ValueError, match=r"^name must be None or a number from 0 to 1, got 2$"):
        checks.check_number("name", 2, 0, 1, also="None")
    with pytest.raises(ValueError, match=r"^name must be None, -1 \(no limit\) or a whole number from 1 to 2147483647"):
        checks.check_limit(0, 7, "name")


def test_choices():
    assert checks.check_choice("name", "a", {"a": 1}) == "a"
    for value in ("c", None, ["a"], {}):
        with pytest.raises(ValueError, match=r"^name must be one of \('a', 'b'\), got "):
            checks.check_choice("name", value, ("a", "b"))
