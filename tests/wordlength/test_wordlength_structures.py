"""Digital filters of SciPy in a structure, sections in an order, and fraction bits of systems."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from gpbnb import LinearSystem

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


# -- fraction bits ----------------------------------------------------------------------------------------------------
