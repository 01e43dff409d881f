"""Tables of the chapter on wordlength."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic, digits
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.tables import Table, short
from gpbnb.report.examples import NORMAL_RANGE
from gpbnb.report.integration.precision import best_rate, needed_precision, stall_rate
from gpbnb.report.wordlengths.ranges import BinaryRange
from gpbnb.report.wordlengths.study import InversePrecision, UpdateStagnation


def update_stagnation(found: Sequence[UpdateStagnation], tolerance: float) -> Table:
    """Tabulate the effect of few digits on a state that hardly changes."""
    body = tuple(
        (arithmetic(each.fmt), short(each.variance, 3), f"{100 * each.unchanged:.0f} %", short(each.error / tolerance))
        for each in found
    )
    header = ("arithmetic", "variance, computed / true", "steps without a change", "error / tolerance")
    return Table(f"{len(body)} formats", header, body)


def binary_ranges(found: Sequence[BinaryRange]) -> Table:
    """Tabulate the ranges of a filter's numbers, and the standard formats in which they are normal."""
    body = []
    for each in found:
        suitable = [name for name, (low, high) in NORMAL_RANGE.items() if low <= each.least and each.largest <= high]
        body.append((each.name, f"$2^{{{each.least}}}$", f"$2^{{{each.largest}}}$", ", ".join(suitable) or "none"))
    return Table(f"{len(body)} kinds of numbers", ("numbers", "smallest", "largest", "normal in"), tuple(body))


def integrator(omega_bw: float, f_c: float, durations: Mapping[str, float], fmt: FloatFormat) -> Table:
    """Tabulate bits at which rounding is a tenth of the discretization error, and the rates that a format allows."""
    body = []
    for name, duration in durations.items():
        needed = [needed_precision(omega_bw, f_c, duration, 2, rounding) for rounding in Rounding.documented()]
        rates = best_rate(omega_bw, duration, fmt), stall_rate(omega_bw, duration, fmt)
        body.append((name, *map(str, needed), *(f"{rate:,.3g}" for rate in rates)))
    kind = digits(fmt)
    header = ("duration", "bits, rounded", "bits, chopped", f"best rate with {kind}, Hz", "increments vanish at, Hz")
    return Table(f"{len(body)} durations", header, tuple(body))


def inverse_precisions(found: Sequence[InversePrecision]) -> Table:
    """Tabulate the bits that inverses need, by the rule of thumb and in fact."""
    body = tuple(
        (each.name, short(each.condition), short(each.scaled), str(each.expected), str(each.needed)) for each in found
    )
    header = ("matrix", "condition $\\kappa_1$", "$\\kappa_1$, scaled", "bits, rule of thumb", "bits needed")
    return Table(f"{len(body)} inverses", header, body)
