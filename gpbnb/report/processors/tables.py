"""Tables of the chapter on processors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import rounding_text
from gpbnb.bounds.words import largest_rounding
from gpbnb.report.display.tables import Table, short
from gpbnb.report.processors.experiment import Processor, ProcessorResult, Sum
from gpbnb.report.processors.scaled import ScaledFilter, bound_per_unit, emulated, integer_bits


def outcomes(found: Mapping[str, Sequence[ProcessorResult]], state: int = 0) -> Table:
    """Tabulate the largest error of one state on each processor, or why the filter fails there.

    Parameters
    ----------
    found : for each problem, named with its unit, the outcome on each processor, in the same order.
    """
    columns = [[_error(each, state) for each in outcomes] for outcomes in found.values()]
    names = [each.processor.name for each in next(iter(found.values()))]
    body = tuple(zip(names, *columns, strict=True))
    return Table(f"{len(body)} processors", ("processor", *found), body)


def _error(found: ProcessorResult, state: int) -> str:
    return f"refused: {found.refused}" if found.refused else short(float(found.error[state]))


def variants(processors: Sequence[Processor], errors: Mapping[str, NDArray[np.float64]], state: int = 0) -> Table:
    """Tabulate typical errors of one state, one row for each way of computing."""
    body = []
    for k, each in enumerate(processors):
        cells = [float(error[k, state]) for error in errors.values()]
        body.append((each.name, *("refused" if math.isinf(cell) else short(cell) for cell in cells)))
    return Table(f"{len(body)} ways to compute", ("arithmetic", *errors), tuple(body))


def integrators(sums: Sequence[Sum], x: NDArray[np.float64]) -> Table:
    """Tabulate root mean square and mean error of sums of increments (samples, paths), relative to float64."""
    body, true = [], x.sum(axis=0)
    for each in sums:
        error = each.add(x) - true
        body.append((each.name, short(float(np.sqrt((error**2).mean()))), short(float(error.mean()))))
    return Table(f"{len(body)} integrators", ("processor", "rms error", "mean error"), tuple(body))


def fixed_point(
    given: Mapping[str, tuple[ScaledFilter, Any]], ways: Sequence[tuple[str, int, Mapping[str, Any]]], state: int = 0
) -> Table:
    """Tabulate observed error and guarantee of one state in fixed point.

    Parameters
    ----------
    given : for each problem, named with its unit, the scaled filter and its measurements.
    ways : name, bits of the word, and the options `rounding` and `wide`.
    """
    body = []
    peaks = {
        (name, wide): bound_per_unit(scaled, wide=wide)[state]
        for wide in {options.get("wide", False) for *_, options in ways}
        for name, (scaled, _) in given.items()
    }
    for way, bits, options in ways:
        row, wide = [way], options.get("wide", False)
        for name, (scaled, z) in given.items():
            before = integer_bits(scaled, z)
            fmt = FixedFormat(before, bits - 1 - before, options["rounding"])
            share = largest_rounding(options["rounding"])
            row.append(short(float(np.abs(emulated(scaled, z, fmt, wide=wide))[:, state].max())))
            row.append(short(float(peaks[name, wide] * float(fmt.unit) * share)))
        body.append(tuple(row))
    header = ["arithmetic"]
    for name in given:
        header += [f"{name}: observed", "guaranteed"]
    return Table(f"{len(body)} fixed-point ways", tuple(header), tuple(body))


def formats(found: Mapping[str, FloatFormat]) -> Table:
    """Tabulate formats with rounding, unit roundoff and range."""
    body = []
    for name, fmt in found.items():
        low, high = fmt.limits.emin if fmt.limits else 0, fmt.limits.largest if fmt.limits else 0
        largest = _power(Decimal(high.numerator) / Decimal(high.denominator)) if high else "any"
        least = _power(Decimal(fmt.base) ** low) if high else "any"
        body.append(
            (name.replace("_", " "), str(fmt.base), str(fmt.precision), rounding_text(fmt.rounding), least, largest)
        )
    header = ("format", "base", "digits", "rounding", "least normal", "largest")
    return Table("number formats of processors", header, tuple(body))


def _power(x: Decimal) -> str:
    mantissa, _, power = f"{x:.1e}".partition("e")
    return f"${mantissa}\\times10^{{{int(power)}}}$"
