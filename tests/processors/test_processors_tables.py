"""Tables and figures of the chapters on processors and wordlength."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from small_filter import unscaled
from tabulated import by_header

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BFLOAT16, BINARY32, IBM_HEX32
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.system import biquad
from gpbnb.report.guarantees import table as guarantees
from gpbnb.report.guarantees.published import fixif_longitudinal
from gpbnb.report.processors import tables as processor_tables
from gpbnb.report.processors.experiment import PROCESSORS, Processor, ProcessorResult, Sum
from gpbnb.report.wordlengths import figures
from gpbnb.wordlength import fixed_point


def test_outcomes_show_errors_or_why_there_is_none() -> None:
    processor = Processor("narrow", BFLOAT16)
    found = {
        "tilt, °": [ProcessorResult(processor, np.array([0.25, 3.0]), "")],
        "tracker, m": [ProcessorResult(processor, np.array([math.inf]), "overflow in the gain at step 812")],
    }
    table = processor_tables.outcomes(found)
    assert table.header == ("processor", "tilt, °", "tracker, m")
    assert table.title == "1 processors"
    assert table.body == (("narrow", "0.25", "refused: overflow in the gain at step 812"),)


def test_variants_say_which_are_refused() -> None:
    ways = (Processor("first", BINARY32), Processor("second", BFLOAT16))
    table = processor_tables.variants(ways, {"tilt": np.array([[0.5, 1.0], [math.inf, math.inf]])})
    assert table.body == (("first", "0.5"), ("second", "refused"))
    assert table.header == ("arithmetic", "tilt")
    assert table.title == "2 ways to compute"


def test_integrators_show_scatter_and_mean() -> None:
    x = np.ones((4, 2))
    table = processor_tables.integrators([Sum("half too much", lambda y: y.sum(axis=0) + 0.5)], x)
    assert table.body == (("half too much", "0.5", "0.5"),)
    too_much_in_one_path = Sum("one path", lambda y: y.sum(axis=0) + np.array([3.0, 0.0]))
    table = processor_tables.integrators([too_much_in_one_path], x)
    assert table.title == "1 integrators"
    assert by_header(table) == [{"processor": "one path", "rms error": "2.1", "mean error": "1.5"}]


def test_formats_show_their_limits() -> None:
    table = processor_tables.formats({"BINARY32": BINARY32, "IBM_HEX32": IBM_HEX32, "free": FloatFormat(3, 5)})
    assert table.body[0] == ("BINARY32", "2", "24", "ties to even", r"$1.2\times10^{-38}$", r"$3.4\times10^{38}$")
    assert table.body[1][0] == "IBM HEX32"
    assert table.title == "number formats of processors"
    assert by_header(table)[1] == {
        "format": "IBM HEX32",
        "base": "16",
        "digits": "6",
        "rounding": "chopped",
        "least normal": r"$5.4\times10^{-79}$",
        "largest": r"$7.2\times10^{75}$",
    }
    assert table.body[2][-2:] == ("any", "any")


def test_fixed_point_bounds_stand_beside_what_was_observed() -> None:
    given = unscaled(biquad("0.3", "0.2", "0.1", "-0.5", "0.25"))
    z = np.random.default_rng(2).uniform(-1, 1, (60, 1))
    ways = [("nearest", 12, {"rounding": Rounding.NEAREST}), ("floor", 12, {"rounding": Rounding.DOWN})]
    table = processor_tables.fixed_point({"section": (given, z)}, ways)
    assert table.header == ("arithmetic", "section: observed", "guaranteed")
    assert table.title == "2 fixed-point ways"
    assert [row[0] for row in table.body] == ["nearest", "floor"]
    for _, observed, bound in table.body:
        assert 0 < float(observed) <= float(bound)
    assert float(table.body[1][2]) > 1.9 * float(table.body[0][2])
    # The last of 11 bits behind the sign; the bound of one rounding is half of it. The cell has two figures.
    unit = 2.0 ** (fixed_point.integer_bits(given, z) - 11)
    assert float(table.body[0][2]) == pytest.approx(fixed_point.bound_per_unit(given)[0] * unit / 2, rel=0.05)


def test_a_wide_sum_has_a_bound_of_its_own() -> None:
    given = unscaled(biquad("0.3", "0.2", "0.1", "-0.5", "0.25"))
    z = np.random.default_rng(2).uniform(-8, 8, (60, 1))
    options = {"rounding": Rounding.NEAREST, "wide": True}
    table = processor_tables.fixed_point({"section": (given, z)}, [("wide", 16, options)], state=1)
    before = fixed_point.integer_bits(given, z)
    fmt = FixedFormat(before, 15 - before, Rounding.NEAREST)
    observed = np.abs(fixed_point.emulated(given, z, fmt, wide=True)).max(axis=0)
    bound = fixed_point.bound_per_unit(given, wide=True) * 2.0 ** (before - 15) / 2
    assert before > 0
    assert [float(cell) for cell in table.body[0][1:]] == pytest.approx(
        [observed[1], bound[1]], rel=0.05
    )  # two figures


def test_guarantees_and_bits_have_their_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    row = guarantees.GuaranteeRow(
        "tilt filter", "3", "2", "27", "4", "1", "0.5", "0.94", "0.97", "6e-05", "0.68", "20", "18", "15", "17", "0.1"
    )
    empty = guarantees.GuaranteeRow("a PID controller", "3", "1", "", "", "2", *[""] * 10)
    monkeypatch.setattr(guarantees, "load", lambda: (row, empty))
    table, bits = guarantees.table(), guarantees.bits_table()
    assert table.title == "guarantees of some filters in binary32"
    assert by_header(table)[0] == {
        "filter": "tilt filter",
        "state, unit": "rate, °/s",
        "limit": "30",
        "bound": "0.5",
        "reached / bound": "0.94",
        "ceiling / bound": "0.97",
        "probable error": "6e-05",
        "scatter / probable": "0.68",
    }
    assert table.body[1] == ("a PID controller", "output", "input: 1", *["–"] * 5)
    assert bits.title == "bits that some filters need"
    assert by_header(bits)[0] == {
        "filter": "tilt filter",
        "guarantee": "20",
        "contraction bound": "18",
        "3 × probable error": "15",
        "emulation": "17",
        "seconds": "0.1",
    }
    assert bits.body[1] == ("a PID controller", *["–"] * 5)


def test_figures_draw_every_finite_point() -> None:
    fig, ax = plt.subplots()
    figures.changes(["a", "b", "c"], {("tilt", 8): [2.0, math.inf, 1.0]}, ax)
    assert ax.lines[0].get_xdata().tolist() == [1.0, 0.5]  # type: ignore[union-attr]
    fig.clear()
    ax = fig.subplots()
    figures.bands({"tilt": [(11, [1.0, 2.0, 3.0]), (12, [0.5, 1.0, 1.5])]}, ax)
    middle, most = (line.get_ydata() for line in ax.lines[:2])
    assert list(middle) == [2.0, 1.0]
    assert list(most) == [3.0, 1.5]
    plt.close(fig)


def test_bits_of_the_controller_are_those_that_meet_its_target(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sixty-fourth at the output, the last of its errors; a unit in the last place there costs E 2**-w."""
    coefficients = sum(fixif_longitudinal()["published_E"])
    judged = []

    def found(case: guarantees.GuaranteeCase, filter_: object, fmt: FloatFormat) -> SimpleNamespace:
        return SimpleNamespace(bound=np.array([9.0, 2.0 ** (14 - fmt.precision)]))

    def smallest(meets: Callable[[FloatFormat], bool], *_: object, **__: object) -> FloatFormat:
        judged.extend(meets(FloatFormat(2, bits)) for bits in (19, 20, 21))
        return FloatFormat(2, 20)

    monkeypatch.setattr(guarantees, "case_guarantee", found)
    monkeypatch.setattr(guarantees, "smallest_precision", smallest)
    fixed, floating = guarantees.fixed_and_floating_bits()
    assert coefficients / 2.0**fixed <= 1 / 64 < coefficients / 2.0 ** (fixed - 1)
    assert floating == 20
    assert judged == [False, True, True]


def test_names_of_processors_in_fixed_point_count_their_bits() -> None:
    fixed = [each for each in PROCESSORS if isinstance(each.fmt, FixedFormat)]
    assert fixed
    for each in fixed:
        before, after = each.fmt.integer_bits, each.fmt.fraction_bits
        assert each.name == f"{1 + before + after}-bit fixed point, {before} bits before the point"


def test_every_filter_with_a_guarantee_names_each_of_its_states():
    for case, row in zip(guarantees.CASES, guarantees.load(), strict=True):
        assert len(case.states) == int(row.n), row.name
        assert all(", " in state for state in case.states)
    assert by_header(guarantees.table())[2]["state, unit"] == "velocity, m/s"
