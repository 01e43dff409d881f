"""Digital filters of SciPy in a structure, sections in an order, and fraction bits of systems."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy import signal

from gpbnb import FixedFormat, LinearSystem, required_precision
from gpbnb.bounds.system import OutputBounds
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.fixed import with_fraction_bits

SOS = signal.butter(4, 0.1, output="sos")
B, A = signal.butter(4, 0.1)


# -- sections ---------------------------------------------------------------------------------------------------------


def test_sections_are_paired_and_ordered_as_stated():
    poles = {"far": (-1, 0.5), "near": (0, 0.81)}  # and the zeros that are nearest to each
    zeros = {"far": -1.8, "near": 0}
    crossed = [[1, zeros["far"], 1, 1, *poles["near"]], [1, zeros["near"], 1, 1, *poles["far"]]]
    expected = LinearSystem.from_sections(crossed).outputs(np.eye(40, 1))[:, 0, 0]
    orders = {None: None, "given": None, "up": "far", "down": "near", (1, 0): "far", (0, 1): "near"}
    for pairing, (order, first) in itertools.product((None, "given", "nearest"), orders.items()):
        if pairing == "nearest" and isinstance(order, tuple):
            continue  # numbers of sections that are not made yet
        made = LinearSystem.from_sections(crossed, pairing=pairing, order=order)
        first = first or ("far" if pairing == "nearest" else "near")
        second = "near" if first == "far" else "far"
        zero = {each: zeros[each if pairing == "nearest" else "near" if each == "far" else "far"] for each in poles}
        found = made.made.coefficients.astype(float)
        assert found[[1, 4, 6, 9]].tolist() == [zero[first], poles[first][1], zero[second], poles[second][1]]
        assert made.outputs(np.eye(40, 1))[:, 0, 0] == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("scale", [False, True])
def test_a_design_passes_on_what_it_is_asked_for(scale):
    cascade = "cascade of direct form II transposed"
    found = FilterDesign(sos=SOS, scale=scale, output_names=["y (V)"]).system(cascade)
    expected = LinearSystem.from_sections(SOS, cascade, scale=scale)
    assert found.made.coefficients.tolist() == expected.made.coefficients.tolist()
    assert (found.input_names, found.output_names) == ((), ("y (V)",))
    for design in (FilterDesign(sos=SOS, name="mine"), FilterDesign(b=B, a=A, name="mine")):
        assert {each.name for each in design.systems("all").values()} == {"mine"}


# -- fraction bits ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("structure", ["direct form I", "cascade", "lattice", "state space"])
def test_fraction_bits_of_a_system(structure):
    u = np.random.default_rng(0).uniform(-1, 1, (100, 1))
    system = FilterDesign(sos=SOS).system(structure)
    like = WordFormats(FixedFormat(12, 1), FixedFormat(6, 24), FixedFormat(16, 13, overflow="wrap"))
    observed = required_precision(system, u, 1e-3, kind="fixed", like=like)
    proved = required_precision(system, u, 1e-3, kind="fixed", basis="guarantee", like=like)
    assert observed.format == with_fraction_bits(like, observed.digits)
    assert observed.format.sums.fraction_bits == observed.digits + 12
    assert observed.digits <= proved.digits <= observed.digits + 8
    for bits, ratio in observed.tried:
        if math.isfinite(ratio):
            found = system.outputs(u, with_fraction_bits(like, bits)) - system.outputs(u)
            assert ratio == pytest.approx(float(np.abs(found.sum(axis=-1)).max() / 1e-3), rel=1e-9)
    errors = OutputBounds(system, np.abs(u).max()).errors(proved.format)
    assert dict(proved.tried)[proved.digits] == pytest.approx(errors[0] / 1e-3)
    assert errors[0] <= 1e-3
