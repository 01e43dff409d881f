"""Guarantees for every measurement and for all time, for filters of this package and of other projects.

``python -m gpbnb.wordlength.guarantees`` computes ``guarantees.csv`` anew.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.display.tables import Table
from gpbnb.kalman.guarantee.adversary import attack
from gpbnb.kalman.guarantee.bound import Guarantee, from_schedule, guarantee, limits
from gpbnb.kalman.guarantee.linear import LinearFilter, biquad, controller, state_space
from gpbnb.kalman.guarantee.probable import probable_error
from gpbnb.kalman.guarantee.published import (
    dynamax_tracking,
    filterpy_fusion,
    fixif_longitudinal,
    nile_local_level,
    px4_landing_target,
)
from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.precision import required_precision
from gpbnb.kalman.requirement import Basis
from gpbnb.wordlength.examples import tracker

FILE = Path(__file__).with_name("guarantees.csv")
FORMAT = FloatFormat(2, 24)
SHARE = 1e-4
"""Tolerance of each state, as a share of its limit."""
BASES: tuple[Basis, ...] = ("guarantee", "probable", "emulation")


@dataclass(frozen=True)
class Case:
    """A filter and its limits.

    Parameters
    ----------
    make : the filter.
    state, innovation : limits, for a Kalman filter. measurement : limit, for a linear filter.
    center : where the adversary keeps the state.
    """

    make: Callable[[], LinearModel | LinearFilter]
    state: tuple[float, ...] = ()
    innovation: float = math.inf
    measurement: float = math.inf
    center: tuple[float, ...] = ()


def _longitudinal() -> LinearFilter:
    given = fixif_longitudinal()
    return state_space(given["A"], given["B"], given["C"], given["D"], name="FixIF, longitudinal controller")


CASES = (
    Case(nile_local_level, (1500,), 1200, center=(1000,)),
    Case(tracker, (1000, 30), 8, center=(750, 0)),
    Case(filterpy_fusion, (1000, 30), 8, center=(750, 0)),
    Case(px4_landing_target, (10, 3), 1, center=(9, 0)),
    Case(dynamax_tracking, (100, 100, 10, 10), 8, center=(80, 80, 0, 0)),
    Case(lambda: biquad("0.01", "0.02", "0.01", "-1.6", "0.7"), measurement=1.0),
    Case(lambda: controller("0.999", "0.01", "2", "5"), measurement=1.0),
    Case(_longitudinal, measurement=10.0),
)
"""Filters with their limits."""


class Row(NamedTuple):
    """One line of the table; text as printed."""

    name: str
    n: str
    m: str
    repeat: str
    bound: str
    probable: str
    ratio: str
    guarantee: str
    three_sigma: str
    emulation: str
    seconds: str


def compute(case: Case) -> Row:
    """Guarantee in binary32, an attack on it, and the precision that each basis asks for."""
    made = case.make()
    begin = time.perf_counter()
    found = _found(case, made, FORMAT)
    seconds = time.perf_counter() - begin
    noise = probable_error(found)
    worst = attack(found, 2000, 200, center=case.center or None, plans=3)
    worst_state = int((found.bound / _size(case, found)).argmax())
    program, bits = found.schedule.program, dict[Basis, str]()
    for basis in BASES:
        if isinstance(made, LinearModel):
            within = limits(made.n, made.m, state=case.state, innovation=case.innovation)
            tolerance = [SHARE * x for x in case.state]
            answer = required_precision(made, 2000, tolerance, basis=basis, within=within)
            bits[basis] = str(answer.fmt.precision) if answer.fmt else "–"
        else:
            bits[basis] = "–"
    return Row(
        made.name,
        str(program.n),
        str(program.m),
        "–" if found.schedule.repeat is None else str(found.schedule.repeat),
        f"{found.bound[worst_state]:.3g}",
        f"{noise[worst_state]:.2g}",
        f"{worst.ratio:.2f}",
        bits["guarantee"],
        bits["probable"],
        bits["emulation"],
        f"{seconds:.1f}",
    )


def _found(case: Case, made: LinearModel | LinearFilter, fmt: FloatFormat) -> Guarantee:
    if isinstance(made, LinearModel):
        return guarantee(made, fmt, limits(made.n, made.m, state=case.state, innovation=case.innovation))
    schedule = made.schedule(fmt)
    return from_schedule(schedule, limits(schedule.program.n, schedule.program.m, measurement=case.measurement))


def _size(case: Case, found: Guarantee) -> Any:
    return case.state if case.state else found.limits.state


def load(file: Path = FILE) -> tuple[Row, ...]:
    """The stored rows."""
    with file.open(encoding="utf-8", newline="") as stream:
        return tuple(Row(**line) for line in csv.DictReader(stream))


def table() -> Table:
    """Bound, sharpness and bits of each filter."""
    header = (
        "filter", "n", "m", "gain repeats from step", "bound", "probable error", "achieved / bound",
        "bits: guarantee", "3 × probable error", "emulation",
    )  # fmt: skip
    return Table("guarantees of some filters", header, tuple(row[:-1] for row in load()))


def main() -> int:
    """Compute all rows and store them."""
    with FILE.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(Row._fields)
        for case in CASES:
            row = compute(case)
            writer.writerow(row)
            stream.flush()
            print(*row)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
