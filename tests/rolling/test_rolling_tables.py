"""gpbnb.report.rolling.tables: every number in a cell is that of theory or experiment."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tabulated import by_header

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import experiment, tables, theory


def test_registers():
    formats = [FloatFormat(10, 6), FloatFormat(10, 10, Rounding.CHOP), FloatFormat(2, 24)]
    body = tables.registers(600.0, formats).body
    assert [cells[:2] for cells in body] == [
        (name, case)
        for name in ("6 decimal digits", "10 decimal digits, chopped", "24 bits")
        for case in ("worst", "actual rounding")
    ]
    for i, fmt in enumerate(formats):
        for j, error in enumerate(
            (float(theory.worst_rate_error(600.0, fmt)), abs(experiment.rounded_rate_error(600.0, fmt)))
        ):
            *shown, lost, size = body[2 * i + j][2:]
            assert list(map(float, shown)) == pytest.approx([error, error * theory.YEAR], rel=6e-3, abs=0)
            across = theory.off_tuned_drift(6600.0, error)
            assert float(size.replace(",", "")) == pytest.approx(across, rel=6e-3, abs=0)
            loss = theory.off_tuned_loss(error)
            assert (lost == "all") == (loss >= 1)  # no signal loses more than itself
            assert lost == "all" or float(lost) == pytest.approx(loss, rel=6e-3, abs=0)


def test_each_cost_of_a_register_has_its_column():
    table = tables.registers(600.25, [FloatFormat(10, 6), FloatFormat(10, 10, Rounding.CHOP)])
    assert table.title == "What rounding the roll rate of 600.25 s costs"
    assert table.body[-1][-1] == "1.28"
    assert by_header(table)[0] == {
        "register": "6 decimal digits",
        "case": "worst",
        "$\\Delta\\omega$ (rad/s)": "5.000e-08",
        "phase after a year (rad)": "1.577e+00",
        "share of the signal lost, one dimension": "all",
        "false drift at right angles, two dimensions (mas a year)": "7,285",
    }


def test_phase_costs():
    table = tables.phase_costs({"one degree": math.radians(1)})
    assert table.title == "What a phase error costs"
    assert by_header(table) == [
        {
            "phase error": "one degree",
            "power lost, one dimension": "0.0305 %",
            "geodetic (mas a year)": "-1.7",
            "frame dragging (mas a year)": "115",
        }
    ]
    (cells,) = table.body
    x, y = theory.phase_error_cost(theory.DRIFTS, math.radians(1))
    assert cells[0] == "one degree"
    assert float(cells[1].removesuffix(" %")) == pytest.approx(100 * math.sin(math.radians(1)) ** 2, rel=5e-3)
    assert [float(cells[2]), float(cells[3])] == pytest.approx([x, y], rel=5e-3)


def test_simulated_and_computed_drift_errors_have_their_columns():
    """A hundred errors of the same size, whose root mean square has a standard error of a fourteenth."""
    errors = np.stack([np.full((50, 2), 30.0), np.full((50, 2), 0.1)])
    study = experiment.DriftStudy((None, 600.5), 100.0, 3155760, 10.0, errors)
    table = tables.drift_errors(study)
    assert table.title == "Standard error of a drift rate (mas a year)"
    assert by_header(table) == [
        {
            "roll period": "none",
            "simulated": "30 ± 2",
            "closed form": "28.3",
            "difference / standard error": "+0.9",
            "gain over no roll": "1",
        },
        {
            "roll period": "600.5 s",
            "simulated": "0.100 ± 0.007",
            "closed form": "0.107",
            "difference / standard error": "-0.9",
            "gain over no roll": "265",
        },
    ]


def test_drift_errors():
    study = experiment.survey()
    body = tables.drift_errors(study).body
    assert [cells[0] for cells in body] == ["none", "6000 s", "600 s", "200 s", "77.5 s"]
    plain = theory.drift_error_unrolled(study.level, at_rest=True)
    for i, cells in enumerate(body):
        closed = plain
        if i:
            closed = theory.drift_error_rolled(study.level, study.periods[i], theory.YEAR, study.interval)
        found = study.standard_error()[i]
        value, spread = cells[1].split(" ± ")
        places = len(spread.partition(".")[2])
        assert len(value.partition(".")[2]) == places  # as exact as its uncertainty, and no more
        assert abs(float(value) - found) <= 0.5001 * 10**-places
        assert float(spread) == pytest.approx(found * study.uncertainty(), abs=0.5001 * 10**-places)
        assert float(cells[2]) == pytest.approx(closed, rel=6e-3)
        assert float(cells[3]) == pytest.approx((found / closed - 1) / study.uncertainty(), abs=0.06)
        assert float(cells[4]) == pytest.approx(plain / closed, rel=6e-3)


def test_filters():
    named = {"pole": theory.single_pole(500.0), "turn": theory.moving_average(1200.0)}
    table = tables.filters(named, 6600.0, 10.0, 600.0, 9000, 10.0)
    body = table.body
    assert table.title == "What filters leave, in mas at the end of the record"
    assert by_header(table)[0] == {
        "filter": "pole",
        "lag": "0.104",
        "noise in the band": "1.73",
        "slow noise let through": "2.1",
        "total noise, exact": "2.38",
        "image, one dimension": "1.8",
    }
    assert by_header(table)[1]["slow noise let through"] == "0"
    for (name, weights), cells in zip(named.items(), body, strict=True):
        assert cells[0] == name
        image = experiment.image_behind(weights, 6600.0, 600.0, 9000)
        density = theory.flicker_density(10.0, 1 / 600, 10.0)
        expected = [
            6600.0 / theory.YEAR * theory.filter_lag(weights),
            math.sqrt(density * theory.noise_bandwidth(weights)),
            math.sqrt(theory.pedestal(weights, 10.0, 9000, 600.0)),
            math.sqrt(theory.filtered_variance(weights, 10.0, 9000, 600.0)),
            np.max(abs(image)),
        ]
        assert [float(cell) for cell in cells[1:]] == pytest.approx(expected, rel=0.05, abs=1e-9)


def test_needed():
    steps = [100, 1000, 4000]
    table = tables.needed([600.0], [10], 6600.0, steps, 1e-4)
    body = table.body
    assert table.title == "Digits for 0.0001 mas"
    assert by_header(table)[0] == {
        "roll period": "600 s",
        "base": "10",
        "method": "recursion",
        "digits, observed": "9",
        "digits, by the bound": "10",
    }
    assert [cells[2] for cells in body] == ["recursion", "direct"]
    # The bound covers all 4000 steps, four times as many as the entry before.
    limit = 1e-4 / (6600.0 * 4000 * theory.INTERVAL / YEAR)
    for row in by_header(tables.needed([600.0], [2], 6600.0, steps, 1e-4)):
        bound = theory.rotation_bound(row["method"], 600.0, 4000)
        assert row["digits, by the bound"] == str(theory.digits_needed(bound, 2, limit))
        assert theory.digits_needed(bound, 2, 4 * limit) == theory.digits_needed(bound, 2, limit) - 2
    assert tables.needed([600.0], [10], 6600.0, [100, 1000]).title == "Digits for 1 mas"
    for cells in body:
        observed = experiment.digits_needed_observed(cells[2], 10, 6600.0, 600.0, steps, 1e-4)
        assert int(cells[3]) == observed <= int(cells[4]) <= observed + 4
