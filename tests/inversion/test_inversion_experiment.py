"""gpbnb.report.inversion.experiment: trials are what they say, and the kept sweeps are what the command computes."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.inverse import a_posteriori
from gpbnb.report.inversion import bounds, experiment, procedure, theory
from gpbnb.report.inversion.procedure import Reading
from gpbnb.report.stored_table import StoredTable
from tests import oracles

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
FMT = FloatFormat(2, 24)


def draw(family, n, seed=3):
    return experiment.FAMILIES[family](n, np.random.default_rng(seed))


class TestTrial:
    @pytest.mark.parametrize("fmt", [FMT, FloatFormat(10, 5), FloatFormat(16, 6, CHOP), FloatFormat(3, 9)], ids=str)
    @pytest.mark.parametrize("pivot", [False, True])
    def test_inverse_and_error(self, fmt, pivot):
        slow = oracles.Numbers.of(fmt)
        exact = oracles.Numbers(oracles.floating(fmt.base, 400, "nearest"))
        for n in (1, 2, 4):
            one = experiment.trial(fmt.array(draw("random", n)), pivot)
            a = one.matrix.to_fractions()
            assert one.computed.to_fractions().tolist() == slow.inv(a.tolist(), pivot)
            true = np.array(exact.inv(a.tolist(), True), dtype=object)
            error = max(abs(one.computed.to_fractions() - true).sum(axis=0))
            assert one.error == pytest.approx(error, rel=1e-12, abs=0)
            condition = max(abs(a).sum(axis=0)) * max(abs(true).sum(axis=0))
            assert one.condition == pytest.approx(float(condition), rel=1e-12)
            assert one.pivot is pivot

    def test_bounds_are_those_of_their_modules(self):
        a = FMT.array(draw("random", 4))
        one = experiment.trial(a)
        assert tuple(one.bounds) == experiment.ALL_BOUNDS
        assert set(experiment.ALL_BOUNDS) == {*map(str, experiment.PRINTED), *experiment.BETTER}
        reduction, beta = procedure.as_fractions(procedure.reduce(a, True)), FMT.unit_roundoff
        for found in procedure.evaluate_all(reduction, beta, experiment.PRINTED):
            assert one.bounds[str(found.reading)] == pytest.approx(float(found.bound), rel=1e-11)
        assert one.bounds["corrected"] == pytest.approx(float(theory.bound(reduction, beta)), rel=1e-12)
        factors, x = linalg.lu(a, True), linalg.inv(a, True)
        assert one.bounds["Wilkinson"] == bounds.wilkinson(factors, x)
        assert one.bounds["Higham"] == bounds.higham(factors, x)
        assert one.bounds["ball"] == bounds.ball(a, x)
        assert one.bounds["a posteriori"] == a_posteriori(a, x)

    def test_what_proves_nothing_is_absent(self):
        few = FloatFormat(10, 2, CHOP)
        one = experiment.trial(few.array([[1, "0.9"], ["0.9", 1]]))
        assert "Higham" not in one.bounds
        assert set(one.bounds) >= {*map(str, experiment.PRINTED), "corrected"}

    def test_violations_and_ratios(self):
        bound_below = experiment.InverseTrial(
            "", FMT.array([[1]]), FMT.array([[1]]), True, 1.0, Fraction(1, 3), {"x": 1 / 3}
        )
        assert bound_below.violates("x")  # 1/3 as a float64 is below 1/3
        assert bound_below.overestimation("x") == pytest.approx(1)
        exact = experiment.InverseTrial(
            "", FMT.array([[1]]), FMT.array([[1]]), True, 1.0, Fraction(0), {"x": 0.1, "y": 0.0}
        )
        assert exact.overestimation("x") == np.inf
        assert exact.overestimation("y") == 1
        assert not exact.violates("y")


class TestFamilies:
    def test_random_families_are_made_from_uniform_numbers(self):
        """Drawn from the same seeds: whole multiples of 2**-30 from -1 to 1."""
        rng = np.random.default_rng(3)
        u = np.asarray(rng.integers(-(2**30), 2**30, (5, 5)).astype(object)) * Fraction(1, 2**30)
        assert (draw("random", 5, seed=3) == u).all()
        assert (draw("symmetric", 5, seed=3) == u + u.T).all()
        nearly = np.vstack([u[:4], u[:4].sum(axis=0) + u[4] / 1000])
        found = draw("nearly singular", 5, seed=3)
        assert (found[:4] == nearly[:4]).all()
        assert np.abs(found[4] - nearly[4]).max() < Fraction(1, 10**15)  # the nearest float64 to 1/1000
        wilkinson = [[1, 0, 0, 0, 1], [-1, 1, 0, 0, 1], [-1, -1, 1, 0, 1], [-1, -1, -1, 1, 1], [-1, -1, -1, -1, 1]]
        assert (draw("Wilkinson", 5, seed=3) == np.array(wilkinson, dtype=object) * (1 + u[0] / 1000)).all()
        rng = np.random.default_rng(3)
        rows, columns = ([Fraction(1, 10 ** int(k)) for k in rng.permutation(5)] for _ in range(2))
        u = np.asarray(rng.integers(-(2**30), 2**30, (5, 5)).astype(object)) * Fraction(1, 2**30)
        found = draw("graded", 5, seed=3)
        for i, j in np.ndindex(5, 5):  # in float64, two products of a power of ten: four roundings
            assert found[i, j] == pytest.approx(float(rows[i] * u[i, j] * columns[j]), rel=5e-16, abs=0)

    def test_nearly_singular_has_the_condition_it_is_meant_to(self):
        # median over draws: one part in 10**3 of a row, to a factor of some hundreds
        trials = [
            experiment.trial(FloatFormat(10, 15).array(draw("nearly singular", 5, seed=k)), names=()) for k in range(9)
        ]
        assert 1e3 < np.median([one.condition for one in trials]) < 1e6


class TestSweeps:
    def test_all_together(self):
        cells = [
            experiment.InverseCell(family, FMT, True, (2, 4), 3, (1, k)) for k, family in enumerate(("random", "Kahan"))
        ]
        names = ("ball",)
        results = [(cell, experiment.computed(cell, names=names)) for cell in cells]
        lines = [line for each in results for line in experiment.rows(*each, names=names)]
        lines += experiment.sums(results, names=names)
        rows = StoredTable(experiment.COLUMNS, tuple(lines), {}).records()
        assert [(row["family"], row["format"]) for row in rows] == [
            ("random", "2:24:nearest"),
            ("Kahan", "2:24:nearest"),
            ("random", "all"),
            ("Kahan", "all"),
            ("all", "all"),
        ]
        assert int(rows[-1]["trials"]) == int(rows[0]["trials"]) + int(rows[1]["trials"]) == 8
        ratios = [one.overestimation("ball") for cell in cells for one in cell.trials(names)]
        assert rows[-1]["median"] == f"{np.median(ratios):.4g}"


def kept(sweep):
    return experiment.stored_sweep(sweep).load()


class TestKept:
    @pytest.mark.parametrize("sweep", experiment.SWEEPS)
    def test_the_parts_add_up(self, sweep):
        cells, names = experiment.SWEEPS[sweep]
        assert {row["bound"] for row in kept(sweep).records()} == set(names)
        for name in names:
            parts = [row for row in kept(sweep).records(bound=name) if row["format"] != "all"]
            (whole,) = kept(sweep).records(bound=name, family="all")
            assert len(parts) == len(cells())
            for count in ("trials", "failed", "exact", "absent", "violations", "regular", "tight"):
                assert sum(int(row[count]) for row in parts) == int(whole[count])

    @pytest.mark.parametrize(
        ("sweep", "which"),
        [
            ("variants", lambda c: c.family == "Kahan" and c.pivot and c.fmt == FMT),
            ("variants", lambda c: c.family == "Hilbert" and not c.pivot and c.fmt == FloatFormat(10, 9)),
            ("random", lambda c: c.sizes == (14,) and c.fmt == FloatFormat(2, 11)),
        ],
    )
    def test_a_slice_comes_out_again(self, sweep, which):
        cells_of, names = experiment.SWEEPS[sweep]
        (cell,) = filter(which, cells_of())
        again = experiment.rows(cell, experiment.computed(cell, names=names), names=names)
        assert len(again) == len(names)
        assert set(again) <= set(kept(sweep).rows)

    def test_what_is_proved_was_never_exceeded(self):
        proved = ("strict", "Wilkinson", "Higham", "ball", "preconditioned ball", "a posteriori")
        for sweep in experiment.SWEEPS:
            for row in kept(sweep).records():
                if row["bound"] in proved:
                    assert row["violations"] == "0"

    def test_a_posteriori_reaches_its_goal(self):
        (whole,) = kept("random").records(family="all", bound="a posteriori")
        assert int(whole["trials"]) >= 100_000
        assert float(whole["median"]) <= 1.1
        assert int(whole["tight"]) > int(whole["trials"]) / 2


@pytest.mark.parametrize(
    ("matrix", "reading"),
    [([[-12, -11], [-17, 83]], Reading()), ([[9, -2], [-59, 71]], Reading(triangular=True))],
)
def test_the_signed_procedure_is_no_bound(matrix, reading):
    fmt = FloatFormat(10, 3)
    one = experiment.trial(fmt.array(matrix), names=(str(reading), str(Reading(False, "(96)"))))
    reduction = procedure.as_fractions(procedure.reduce(one.matrix, True))
    (found,) = procedure.evaluate_all(reduction, fmt.unit_roundoff, [reading])
    assert found.bound < one.error
    assert one.violates(str(reading))
    assert not one.violates("sizes, (96), A")
