"""Formats without compiled loops are refused with the setting that prevents them."""

from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest

from gpbnb import BINARY32, DECIMAL32, FixedFormat, FloatFormat, LinearModel, LinearSystem, Rounding
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.bounds.gains import filter_schedule
from gpbnb.filters.run import Run, Sums
from gpbnb.filters.system import state_space

REFUSED = [
    (FloatFormat(2, 54, "even"), "got 54 bits, rounded even; needed at most 53 "),
    (FloatFormat(2, 60), "got 60 bits; needed at most 53 "),
    (FloatFormat(2, 53, emin=-1022, emax=1023), "got 53 bits with a limited range; needed at most 52 "),
    (FloatFormat(10, 19, "even"), "got 19 decimal digits, rounded even; needed at most 18 "),
    (FloatFormat(16, 14, "chop"), "got 14 base-16 digits; needed at most 13 "),
    (FloatFormat(3, 10), "got base 3; needed one with compiled loops: 2, 10, 16"),
    (FloatFormat(2, 30, "stochastic"), "got 30 bits, rounded stochastic; needed at most 29 "),
    (FloatFormat(10, 8, "stochastic"), "got stochastic rounding in base 10; needed base 2 "),
    (FloatFormat(2, 24, emin=-5000, emax=5000), r"got a range .* -5000 and up to 5000; needed numbers.*2\*\*-320"),
    (FloatFormat(10, 3, emin=-5, emax=5, largest=Fraction(900000)), "got a largest number that does not end in nines"),
    (FloatFormat(2, 1, "even"), "got 1 bit; needed at least 2 "),
    (FixedFormat(3, 60), "got 63 bits in fixed point; needed at most 51 "),
    (FixedFormat(3, 10, overflow="wrap"), "got overflow that wraps around; needed 'raise' or 'saturate' "),
]  # fmt: skip


@pytest.mark.parametrize(("fmt", "message"), REFUSED, ids=lambda each: str(each)[:40])
def test_the_setting_that_prevents_compiled_loops_is_named(fmt, message):
    with pytest.raises(ValueError, match=message):
        fmt.check_compiled()
    model = LinearModel([["0.9"]], [[1]], [[1]], [[1]], [0], [[1]])
    for call in (
        lambda: filter_schedule(state_space([["0.9"]], [["0.1"]]), fmt),
        lambda: LinearSystem([["0.9"]], [["0.1"]]).outputs([[1]], fmt),
        lambda: Run(model, fmt, "innovation", (1,)),
        lambda: Run(model, fmt, "innovation", (1,), Sums(order="pairwise")),
    ):
        with pytest.raises(ValueError, match=message) as caught:
            call()
        assert "scale" not in str(caught.value)
        assert not isinstance(caught.value, OverflowError)


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


@pytest.mark.parametrize("options", [{"order": "pairwise"}, {"fused": True}])
def test_other_sums_in_53_bits_name_the_digits(options):
    model = LinearModel([["0.9"]], [[1]], [[1]], [[1]], [0], [[1]])
    with pytest.raises(ValueError, match=r"in 53 bits; needed up to 52 bits, or up to 13 base-16 digits"):
        Run(model, FloatFormat(2, 53), "innovation", (1,), Sums(**options))


def test_an_overflow_that_a_format_does_not_have_is_refused():
    for make, message in (
        (lambda: replace(BINARY32, overflow="wrap"), "overflow: got 'wrap'; needed one of 'raise', 'saturate'"),
        (lambda: FloatFormat(2, 8, overflow="saturate"), "or overflow without a range; needed emin and emax as well"),
        (replace(DECIMAL32, overflow="saturate").check_compiled, "got overflow that saturates in base 10; needed"),
    ):
        with pytest.raises(ValueError, match=message):
            make()
