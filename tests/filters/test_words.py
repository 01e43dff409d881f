"""Fixed-point words: every integer against plain fraction loops, in compiled loops and in Python's integers."""

from __future__ import annotations

import numpy as np
import pytest
from test_structures import random_filter

from gpbnb import FixedFormat, LinearSystem
from gpbnb.bounds.system import OutputBounds
from gpbnb.filters.structures import STRUCTURES
from gpbnb.filters.word_formats import WordFormats

pytestmark = pytest.mark.usefixtures("loops_at_once")


MODES = ["nearest", "even", "chop", "up", "down", "odd", "half up"]


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
