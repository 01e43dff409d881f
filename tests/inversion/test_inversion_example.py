"""gpbnb.report.inversion.example: Table 1 computed again, and the searches, which find what is there to be found."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import inverse_of
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import example, existence, procedure
from gpbnb.report.inversion.example import PLACES, PRINTED, Wordlength
from gpbnb.report.inversion.procedure import Reading

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
MORE = Wordlength("t = places + 1", NEAREST)
FIXED = Wordlength("fixed point", NEAREST)


def exact_inverse():
    """By cofactors."""
    (a, b, c), (d, e, f), (g, h, i) = [[Fraction(x) for x in row] for row in example.MATRIX]
    adjugate = [
        [e * i - f * h, c * h - b * i, b * f - c * e],
        [f * g - d * i, a * i - c * g, c * d - a * f],
        [d * h - e * g, b * g - a * h, a * e - b * d],
    ]
    determinant = a * adjugate[0][0] + b * adjugate[1][0] + c * adjugate[2][0]
    return np.array(adjugate, dtype=object) / determinant


class TestInverses:
    @pytest.mark.parametrize("method", example.METHODS)
    def test_without_rounding_they_are_exact(self, method):
        found = example.METHODS[method](example.matrix(), lambda x: x)
        assert (found == exact_inverse()).all()

    @pytest.mark.parametrize("wordlength", example.WORDLENGTHS[:4], ids=str)
    def test_elimination_has_the_digits_of_linalg(self, wordlength):
        for places in PLACES:
            fmt = wordlength.format(places)
            a = fmt.array(example.MATRIX)
            found = example.METHODS["elimination"](a.to_fractions(), wordlength.rounder(places))
            assert (found == linalg.inv(a).to_fractions()).all()
            assert (found == linalg.inv(a, pivot=True).to_fractions()).all()

    def test_nothing_of_the_wordlength_is_nearer_than_rounded_once(self):
        true = exact_inverse()
        for wordlength, places in itertools.product((MORE, FIXED), PLACES):
            best = example.METHODS["rounded once"](example.matrix(), wordlength.rounder(places))
            for method in example.METHODS.values():
                found = method(example.matrix(), wordlength.rounder(places))
                assert (abs(best - true) <= abs(found - true)).all()


class TestReadings:
    def test_a_bound_is_that_of_the_procedure(self):
        (column,) = [
            c
            for c in example.bound_readings()
            if (c.wordlength, c.detail, c.norm, c.relative)
            == (MORE, "sizes, (96), A_T, its own digits", "row sum", False)
        ]
        for value, places in zip(column.values, PLACES, strict=True):
            a = FloatFormat(10, places + 1).array(example.MATRIX)
            reduction = procedure.as_fractions(procedure.reduce(a))
            reading = Reading(False, "(96)", True, "row sum")
            (exact,) = procedure.evaluate_all(reduction, a.format.unit_roundoff, [reading])
            assert value == pytest.approx(float(exact.bound), rel=1e-12, abs=0)

    def test_an_error_is_that_of_the_inverse(self):
        (column,) = [
            c
            for c in example.error_readings()
            if (c.wordlength, c.detail, c.norm, c.relative)
            == (MORE, "elimination, against the matrix as given", "column sum", True)
        ]
        true = exact_inverse()
        for value, places in zip(column.values, PLACES, strict=True):
            x = linalg.inv(FloatFormat(10, places + 1).array(example.MATRIX)).to_fractions()
            error = abs(x - true).sum(axis=0).max() / abs(true).sum(axis=0).max()
            assert value == pytest.approx(float(error), rel=1e-12, abs=0)


def norm_of(error, norm):
    sizes = abs(error)
    match norm:
        case "column sum":
            return sizes.sum(axis=0).max()
        case "row sum":
            return sizes.sum(axis=1).max()
        case "largest entry":
            return sizes.max()
    return Fraction(math.sqrt((sizes * sizes).sum()))


class TestPossible:
    @pytest.mark.parametrize("norm", existence.SEARCHED)
    @pytest.mark.parametrize("kind", example.KINDS)
    def test_the_error_of_an_inverse_is_found_possible(self, norm, kind):
        wordlength = Wordlength(kind, NEAREST)
        for places in PLACES:
            x = example.gauss_jordan(example.matrix(), wordlength.rounder(places))
            printed = f"{float(norm_of(x - exact_inverse(), norm)):.3e}"
            found = existence.possible(wordlength, places, norm, printed=printed)
            assert found is not None
            for index in np.ndindex(3, 3):  # numbers of the wordlength
                assert wordlength.rounder(places)(found[index]) == found[index]
            assert example.agree(norm_of(found - exact_inverse(), norm), printed)

    @pytest.mark.parametrize("transposed", [False, True])
    def test_none_is_missed_in_four_digits(self, transposed):
        # All sums of three multiples of the units near the true entries, by brute force.
        true = exact_inverse().T if transposed else exact_inverse()
        low, high = Fraction("7.7815e-5"), Fraction("7.783e-5")
        hits = 0
        for j in range(3):
            choices = []
            for x in true[:, j]:
                unit = Fraction(10) ** (math.floor(math.log10(abs(x))) + 1 - 4)
                start = math.floor(x / unit)
                reach = math.ceil(high / unit) + 1
                choices.append([abs(k * unit - x) for k in range(start - reach, start + reach + 1)])
            *two, last = sorted(choices, key=len)
            last = np.sort(np.array(last, dtype=object))
            for p, q in itertools.product(*two):
                hits += np.searchsorted(last, high - p - q) - np.searchsorted(last, low - p - q)
        found = existence.possible(MORE, 3, "row sum" if transposed else "column sum")
        assert (found is not None) == (hits > 0)

    @pytest.mark.parametrize("rounding", [NEAREST, CHOP])
    def test_against_the_matrix_as_stored(self, rounding):
        # Three digits: the error of the best inverse of the stored matrix is found possible.
        wordlength = Wordlength("t = places", rounding)
        fl = wordlength.rounder(3)
        stored = fl(example.matrix())
        true = inverse_of(stored)
        assert (true @ stored == np.eye(3, dtype=int)).all()
        for norm in existence.SEARCHED:
            error = norm_of(example.METHODS["rounded once"](stored, fl) - true, norm)
            printed = f"{float(error):.3e}"
            found = existence.possible(wordlength, 3, norm, printed=printed, reference="stored")
            assert example.agree(norm_of(found - true, norm), printed)
        for norm in existence.SEARCHED:  # and the largest error of the best inverse is above the print
            assert norm_of(example.METHODS["rounded once"](stored, fl) - true, norm) > Fraction(PRINTED["error"][0])
