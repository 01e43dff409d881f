"""Fixed-point words: every integer against plain fraction loops, in compiled loops and in Python's integers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from test_structures import random_filter

from gpbnb import FixedFormat, LinearSystem
from gpbnb.arithmetic.kernels import backends
from gpbnb.bounds.system import OutputBounds
from gpbnb.filters.structures import STRUCTURES
from gpbnb.filters.system import SystemRun
from gpbnb.filters.word_formats import WordFormats
from gpbnb.filters.words import integers_of
from tests.oracles import fixed, limited

pytestmark = pytest.mark.usefixtures("loops_at_once")


def integers(system, u, words):
    """States and outputs after each step, in units of the data."""
    (found,) = SystemRun(system, words).blocks(u)
    return found


MODES = ["nearest", "even", "chop", "up", "down", "odd", "half up"]


def test_numbers_are_rounded_to_integers_as_by_their_definition():
    values = np.concatenate([np.arange(-300, 300) / 32, np.random.default_rng(0).uniform(-9, 9, 200)])
    for mode in MODES:
        fmt = FixedFormat(3, 4, mode, "saturate")
        rounded = [limited(4, 3, "saturate")(fixed(4, mode)(Fraction(x))) for x in values]
        assert [int(n) * fmt.unit for n in integers_of(values, fmt)] == rounded


def test_a_smoother_in_integers_stops_three_below_its_step():
    """y += 1097/4096 (u - y) in 16 bits with floor: 1097 · 3 < 4096, so a difference of 3 moves nothing."""
    words = WordFormats(FixedFormat(15, 0, "down"), FixedFormat(3, 12))
    found = integers(LinearSystem.smoother("1097/4096"), np.full((200, 1), 512), words)
    assert found[-1].tolist() == [509, 509]
    assert found[-100:, 1].tolist() == [509] * 100


@pytest.mark.parametrize("in_python", [False, True])
def test_overflow_names_state_and_step(in_python, monkeypatch):
    monkeypatch.setattr(backends, "LOOPS_AFTER", 1e9 * in_python)
    system = LinearSystem.from_coefficients([1], [1, "-0.9"], "direct form I")
    words = WordFormats(FixedFormat(2, 5), FixedFormat(1, 8))
    with pytest.raises(OverflowError, match="state 0 at step 2: got a number beyond the range of data of 8 bits"):
        system.outputs(np.full((9, 1), 3.0), words)


@pytest.mark.parametrize("wide", [False, True])
def test_half_up_is_the_shift_of_integers_in_c(wide):
    """Two sections in direct form I, as fixed-point C has them: (p + half) >> n for each product, or for each sum."""
    bits, half = 14, 1 << 13
    sections = [[0.25, 0.5, 0.25, 1, -1.5, 0.75], [0.5, -0.25, 0.125, 1, -1.25, 0.625]]
    rng = np.random.default_rng(7252)
    x = rng.integers(-2000, 2000, 2000).tolist()
    signal = x
    for b0, b1, b2, _, a1, a2 in sections:
        factors, kept, made = [int(each * 2**bits) for each in (b0, b1, b2, a1, a2)], [0] * 4, []
        for each in signal:
            products = [c * v for c, v in zip(factors, (each, *kept), strict=True)]
            if not wide:
                products = [(p + half) >> bits for p in products]
            y = sum(products[:3]) - sum(products[3:])
            y = (y + half) >> bits if wide else y
            kept, _ = [each, kept[0], y, kept[2]], made.append(y)
        signal = made
    system = LinearSystem.from_sections(sections, "direct form I")
    differ = {}
    for rounding in ("half up", "nearest"):
        data = FixedFormat(23, 0, rounding)
        words = WordFormats(data, FixedFormat(1, bits), FixedFormat(40, bits, rounding) if wide else None)
        found = integers(system, np.array(x)[:, None], words)[:, -1]
        differ[rounding] = int((found != np.array(signal)).sum())
    assert differ["half up"] == 0
    assert differ["nearest"] > 0


def test_the_output_of_a_section_is_stored_before_the_next_takes_it():
    """Two sections v = u - a v_, y = b v + v_ in whole numbers: sums with 8 more bits are cut between them."""
    words = WordFormats(FixedFormat(15, 0, "chop"), FixedFormat(1, 8), FixedFormat(30, 8, "chop"))
    factors, u = [(200, 100), (90, -60)], np.random.default_rng(3).integers(-500, 500, 300).tolist()
    signal = u

    def cut(n):
        return n // 256 if n >= 0 else -(-n // 256)

    for b, a in factors:
        t = s = 0
        made = []
        for each in signal:
            v = each - t
            made.append(cut(b * v + 256 * s))
            t, s = cut(a * v), v
        signal = made
    sections = [[Fraction(b, 256), 1, 0, 1, Fraction(a, 256), 0] for b, a in factors]
    system = LinearSystem.from_sections(sections, "direct form I transposed")
    assert integers(system, np.array(u)[:, None], words)[:, -1].tolist() == signal


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("wide", [False, True])
def test_no_run_is_beyond_its_guarantee(structure, wide):
    """In formats whose guarantee exists, none overflows; and the errors come within a hundredth of the bounds."""
    rng = np.random.default_rng([wide, STRUCTURES.index(structure)])
    shares, proved = [], 0
    for _ in range(4):
        b, a = random_filter(rng, int(rng.integers(1, 5)))
        system = LinearSystem.from_coefficients(b, a, structure)
        u = np.clip(rng.uniform(-2, 2, (150, 1)), -1, 1)
        mode = str(rng.choice(MODES))
        sums = FixedFormat(int(rng.integers(5, 9)), 20, mode, str(rng.choice(["raise", "wrap"]))) if wide else None
        words = WordFormats(FixedFormat(int(rng.integers(4, 8)), 12, mode), FixedFormat(6, 16), sums)
        try:
            bound = OutputBounds(system, 1.0).errors(words)[0]
        except OverflowError:
            continue
        found, true = system.outputs(u, words), system.outputs(u)
        error = np.abs((found - true).sum(axis=-1)).max()
        assert error <= bound
        shares.append(error / bound)
        proved += 1
    assert proved >= 2
    assert max(shares) > 0.01


def test_the_range_is_proved_where_the_worst_input_just_fits():
    """y = u + y/2 reaches 2 for inputs within 1, and errors of half a unit each double to two units of 1/64 at most."""
    system = LinearSystem.from_coefficients([1], [1, "-0.5"], "direct form I")
    bound = OutputBounds(system, 1.0).errors(WordFormats(FixedFormat(2, 6), FixedFormat(2, 8)))
    # Inputs are off by 1/128 and products by 1/128, doubled; a claim is larger by 2**-20, so that its proof may round.
    assert 1 / 32 <= bound[0] <= (1 / 32) * (1 + 2.0**-19)
    with pytest.raises(OverflowError, match=r"a sum, operation 3 of 3, may reach 2.02344, beyond the 1 integer bits"):
        OutputBounds(system, 1.0).errors(WordFormats(FixedFormat(1, 6), FixedFormat(2, 8)))
