"""Formats without compiled loops are refused with the setting that prevents them."""

from itertools import product

import pytest

from gpbnb import FixedFormat, FloatFormat, LinearModel, LinearSystem, Rounding
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.bounds.gains import filter_schedule
from gpbnb.filters.run import Run, Sums
from gpbnb.filters.structures import state_space


def test_whoever_needs_loops_names_the_setting_that_prevents_them():
    model = LinearModel([["0.9"]], [[1]], [[1]], [[1]], [0], [[1]])
    for fmt in (FloatFormat(2, 60), FloatFormat(2, 24, emin=-5000, emax=5000), FixedFormat(3, 10, overflow="wrap")):
        for call in (
            fmt.check_compiled,
            lambda fmt=fmt: filter_schedule(state_space([["0.9"]], [["0.1"]]), fmt),
            lambda fmt=fmt: Run(model, fmt, "innovation", (1,)),
            lambda fmt=fmt: Run(model, fmt, "innovation", (1,), Sums(order="pairwise")),
            # systems in fixed point run on integers, which wrap
            *[lambda fmt=fmt: LinearSystem([["0.9"]], [["0.1"]]).outputs([[1]], fmt)] * isinstance(fmt, FloatFormat),
        ):
            with pytest.raises(ValueError, match=r"^(?!.*scale)") as caught:
                call()
            assert str(caught.value) == reason(fmt)


def test_every_refusal_is_right_and_a_digit_less_or_another_rounding_helps():
    ranges = ({}, {"emin": -30, "emax": 31}, {"emin": -30, "emax": 31, "subnormal": False}, {"emin": -400, "emax": 300})
    refused = 0
    for base, digits, rounding, limits in product(
        (2, 3, 10, 16), (1, 2, 13, 14, 18, 19, 29, 30, 52, 53, 54), Rounding, ranges
    ):
        fmt = FloatFormat(base, digits, rounding, **limits)
        if isinstance(fmt.backend, Compiled):
            fmt.check_compiled()
            continue
        refused += 1
        with pytest.raises(ValueError, match=r"^got ") as caught:
            fmt.check_compiled()
        message = str(caught.value)
        if "needed at most" in message:
            most = int(message.split("needed at most ")[1].split()[0])
            assert most < digits
            shorter = FloatFormat(base, most, rounding, **limits)
            assert isinstance(shorter.backend, Compiled) or "needed numbers, with all digits" in reason(shorter)
        elif "got 1 " in message:
            longer = FloatFormat(base, 2, rounding, **limits)
            assert isinstance(longer.backend, Compiled) or "needed numbers, with all digits" in reason(longer)
        elif "needed numbers" in message:
            assert limits == ranges[3]
        else:
            assert base == 3 or (rounding is Rounding.STOCHASTIC and base != 2)
    assert refused > 300


def reason(fmt):
    with pytest.raises(ValueError, match=r"^got ") as caught:
        fmt.check_compiled()
    return str(caught.value)
