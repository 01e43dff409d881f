"""What an answer says limits a filter: its coefficients, its scale or its direct form, and what would do."""

from __future__ import annotations

import numpy as np
from scipy import signal

from gpbnb import LinearSystem, required_precision


def test_a_cascade_says_what_scaling_its_sections_saves():
    """A low-pass of order 6, whose sections have gains far from one."""
    sos, u = signal.butter(6, 0.05, output="sos"), np.random.default_rng(1).uniform(-1, 1, (300, 1))
    given, scaled = (LinearSystem.from_sections(sos, scale=scale) for scale in (False, True))
    found, best = (required_precision(each, u, 1e-4, kind="fixed", coefficient_bits=24) for each in (given, scaled))
    word = 1 + best.format.data.precision
    assert word < found.format.data.precision - 10
    how = "(scale=True; in a TOML file, scale = true beside sos)"
    saved = f"{how}, {best.digits} fraction bits in a word of {word} bits are enough"
    assert str(found).count(f"; with its sections scaled by powers of two {saved}") == 1
    assert not any("scaled" in note for note in best.notes)


# -- what a refusal says ----------------------------------------------------------------------------------------------


def test_a_direct_form_that_no_precision_suits_says_by_how_much_it_misses():
    long = LinearSystem.from_coefficients(*signal.butter(8, 0.02))
    found = required_precision(long, np.ones((500, 1)), 1e-7)
    assert f"; 53 bits give {found.tried[-1][1]:.3g} times the tolerance; second-order sections usually" in str(found)
    lasting = required_precision(long, np.ones((500, 1)), 1e-4, basis="bound")
    assert f"; 53 bits give {lasting.tried[-1][1]:.3g} times the tolerance; second-order" in str(lasting)
