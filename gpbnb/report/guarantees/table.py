"""Guarantees for every measurement and for all time, for filters of this package and of other projects.

``python -m gpbnb.report.guarantees.table`` recomputes ``guarantees.csv``. If words are given, it computes only the
filters whose names contain one of them.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import LARGEST_PRECISION
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.search import smallest_precision
from gpbnb.bounds.adversary import attack, ceiling, random_errors
from gpbnb.bounds.guarantee import BUDGET, Guarantee, from_schedule, guarantee, limits
from gpbnb.bounds.linear import LinearFilter, biquad, controller, state_space
from gpbnb.bounds.probable import probable_error
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.report.display.tables import Table
from gpbnb.report.guarantees.published import (
    dyer_mcreynolds,
    dynamax_tracking,
    elaenia_gold,
    filterpy_fusion,
    filterpy_velocity,
    fixif_longitudinal,
    nile_local_level,
    px4_landing_target,
)
from gpbnb.sweeps import Column, machine, read, write
from gpbnb.wordlength.examples import altimeter, tilt, tracker
from gpbnb.wordlength.precision import required_precision
from gpbnb.wordlength.requirement import Basis

FILE = Path(__file__).with_name("guarantees.csv")
COMMAND = "python -m gpbnb.report.guarantees.table"
FORMAT = FloatFormat(2, 24)
SHARE = 1e-4
"""Tolerance of each state, as a share of its limit."""
BASES: tuple[Basis, ...] = ("guarantee", "bound", "probable", "emulation")
RECORD = 2_000
"""Steps of the simulated record for the contraction bound and the emulation."""


@dataclass(frozen=True)
class Case:
    """A filter and its limits.

    Parameters
    ----------
    make : function that returns the filter.
    state, innovation : limits for a Kalman filter. measurement : limit for a linear filter.
    center : the state near which the adversary stays.
    steps : length of the adversary's runs. candidates : number of measurements to choose from at each step.
    aims : the states whose errors the adversary tries to make large; all states if empty.
    horizon : number of steps that the bound covers, for filters without process noise.
    form : form of a Kalman filter. budget : budget of the guarantee in binary32, for filters that settle slowly.
    """

    make: Callable[[], LinearModel | LinearFilter]
    state: tuple[float, ...] = ()
    innovation: float | tuple[float, ...] = math.inf
    measurement: float = math.inf
    center: tuple[float, ...] = ()
    steps: int = 2_000
    candidates: int = 200
    aims: tuple[int, ...] = ()
    horizon: int | None = None
    form: Form = Form.INNOVATION
    budget: float = BUDGET


def _longitudinal() -> LinearFilter:
    given = fixif_longitudinal()
    return state_space(given["A"], given["B"], given["C"], given["D"], name="FixIF, longitudinal controller")


CASES = (
    Case(nile_local_level, (1500,), 1200, center=(1000,)),
    Case(elaenia_gold, (1200,), 60, center=(1150,), steps=10, horizon=10),
    Case(tracker, (1000, 30), 8, center=(750, 0)),
    Case(filterpy_fusion, (1000, 30), 8, center=(750, 0)),
    Case(filterpy_velocity, (2000, 150), 150, center=(1500, 0), form=Form.JOSEPH),
    Case(px4_landing_target, (10, 3), 1, center=(9, 0)),
    Case(dyer_mcreynolds, (10, 10, 10), 0.02, steps=1, horizon=1),
    Case(dynamax_tracking, (100, 100, 10, 10), 8, center=(80, 80, 0, 0)),
    Case(lambda: altimeter("1e-12"), (50, 2, 0.5), 2, center=(37, 0, 0.4), steps=20_000, budget=2e9),
    Case(tilt, (60, 30, 2), (8, 8), center=(45, 0, 1.5), steps=30_000),
    Case(lambda: biquad("0.01", "0.02", "0.01", "-1.6", "0.7"), measurement=1.0),
    Case(lambda: controller("0.999", "0.01", "2", "5"), measurement=1.0),
    Case(_longitudinal, measurement=10.0, steps=1_000, candidates=100, aims=(10,)),
)
"""Filters with their limits."""


class Row(NamedTuple):
    """One row of the table, as text."""

    name: str
    n: str
    m: str
    repeat: str
    period: str
    bound: str
    ratio: str
    ceiling: str
    probable: str
    scatter: str
    guarantee: str
    contraction: str
    three_sigma: str
    emulation: str
    seconds: str


_WHOLE = {"n", "m", "repeat", "period", "guarantee", "contraction", "three_sigma", "emulation"}
COLUMNS = tuple(
    Column(name, "text")
    if name == "name"
    else Column(name, "integer" if name in _WHOLE else "number", 0, optional=True)
    for name in Row._fields
)
"""Columns of the stored table."""


def compute(case: Case) -> Row:
    """Compute the guarantee in binary32, an attack on it, and the precision that each basis requires."""
    made = case.make()
    begin = time.process_time()
    found = _found(case, made, FORMAT)
    seconds = time.process_time() - begin
    sizes = np.array(case.state) if case.state else found.limits.state
    worst = int((found.bound / sizes).argmax())
    center = case.center or None
    plans, ramp = 6 if case.measurement < math.inf else 3, min(case.steps / 2, 1_000) if case.horizon is None else 1
    outcome = attack(
        found, case.steps, case.candidates, states=case.aims or None, center=center, plans=plans, ramp=ramp
    )
    if not outcome.admissible or outcome.ratio > 1:
        raise RuntimeError(f"{made.name}: {outcome}")
    noise = scatter = ""
    known = {"guarantee": found.bound, "probable": found.bound, "bound": found.bound, "emulation": outcome.errors}
    if found.for_ever:
        known["probable"] = 3 * probable_error(found)
        expected = probable_error(found)[worst]
        errors = random_errors(found, 10 * case.steps, center)[5 * case.steps :, worst]
        noise, scatter = f"{expected:.2g}", f"{errors.std() / expected:.2f}"
    bits = {basis: _bits(case, made, basis, SHARE * sizes, known[basis]) for basis in BASES}
    schedule = found.schedule
    return Row(
        made.name,
        str(schedule.program.n),
        str(schedule.program.m),
        str(schedule.repeat or ""),
        str(schedule.period or ""),
        f"{found.bound[worst]:.3g}",
        f"{outcome.ratio:.2f}",
        f"{ceiling(found, outcome.z[: outcome.step], outcome.state) / found.bound[outcome.state]:.2f}",
        noise,
        scatter,
        bits["guarantee"],
        bits["bound"],
        bits["probable"],
        bits["emulation"],
        f"{seconds:.1f}",
    )


def _found(case: Case, made: LinearModel | LinearFilter, fmt: FloatFormat) -> Guarantee:
    if isinstance(made, LinearModel):
        within = limits(made.n, made.m, state=case.state, innovation=case.innovation)
        if case.horizon is not None:
            return guarantee(made, fmt, within, case.form, most=case.horizon, horizon=case.horizon)
        budget = case.budget if fmt == FORMAT else BUDGET
        return guarantee(made, fmt, within, case.form, most=100_000, horizon=1, budget=budget)
    schedule = made.schedule(fmt)
    return from_schedule(schedule, limits(schedule.program.n, schedule.program.m, measurement=case.measurement))


def _bits(
    case: Case,
    made: LinearModel | LinearFilter,
    basis: Basis,
    tolerance: NDArray[np.float64],
    known: NDArray[np.float64],
) -> str:
    """Return the bits that a basis requires, empty if it does not apply; `known` holds its errors in binary32."""
    finite = case.horizon is not None
    if basis == "bound" or (basis == "emulation" and isinstance(made, LinearModel)):
        if not isinstance(made, LinearModel):
            return ""
        answer = required_precision(made, case.horizon or RECORD, list(tolerance), basis=basis, form=case.form)
        return str(answer.fmt.precision) if answer.fmt else ""
    if basis == "probable" and finite:
        return ""

    def meets(fmt: FloatFormat) -> bool:
        try:
            found = _found(case, made, fmt)
        except ValueError:
            return False
        if basis == "emulation":
            errors = np.abs(random_errors(found, RECORD)).max(axis=0)
        elif basis == "guarantee":
            errors = found.bound if found.steps in (None, case.horizon) else np.full(len(tolerance), math.inf)
        else:
            errors = 3 * probable_error(found) if found.for_ever else np.full(len(tolerance), math.inf)
        return bool((errors <= tolerance).all())

    # Errors are nearly proportional to the unit roundoff, so first try near the precision that this predicts.
    near = FORMAT.precision + math.ceil(math.log2((known / tolerance).max()))
    least, largest = (min(max(near + more, 2), LARGEST_PRECISION[2]) for more in (-2, 3))
    fmt = smallest_precision(meets, 2, Rounding.NEAREST, least=least, largest=largest)
    if fmt is None or fmt.precision == least:
        fmt = smallest_precision(meets, 2, Rounding.NEAREST, least=2, largest=LARGEST_PRECISION[2])
    return str(fmt.precision) if fmt else ""


def fixed_and_floating_bits() -> tuple[int, int]:
    """Return the bits with which the output of FixIF's controller meets its target, in fixed and in floating point.

    In fixed point, all states have the same number of bits and the coefficients that FixIF printed bound the output.
    """
    given = fixif_longitudinal()
    target = 2.0**-6
    case = next(case for case in CASES if case.make is _longitudinal)

    def meets(fmt: FloatFormat) -> bool:
        return bool(_found(case, _longitudinal(), fmt).bound[-1] <= target)

    fmt = smallest_precision(meets, 2, Rounding.NEAREST, least=2, largest=LARGEST_PRECISION[2])
    if fmt is None:
        raise ArithmeticError(f"got no format whose guarantee is within {target}; needed one of at most 53 bits")
    return math.ceil(math.log2(sum(given["published_E"]) / target)), fmt.precision


def load(file: Path = FILE) -> tuple[Row, ...]:
    """Return the stored rows."""
    return tuple(Row(**line) for line in read(file, COLUMNS, COMMAND).records())


def table() -> Table:
    """Tabulate the bound of each filter and its sharpness."""
    header = (
        "filter", "n, m", "repeats from step", "period", "bound", "achieved / bound", "ceiling / bound",
        "probable error", "scatter / probable",
    )  # fmt: skip
    body = [
        tuple(
            cell or "–"
            for cell in (
                each.name, f"{each.n}, {each.m}", each.repeat, each.period, each.bound, each.ratio, each.ceiling,
                each.probable, each.scatter,
            )
        )
        for each in load()
    ]  # fmt: skip
    return Table("guarantees of some filters in binary32", header, tuple(body))


def bits_table() -> Table:
    """Tabulate the bits that each basis requires."""
    header = ("filter", "guarantee", "contraction bound", "3 × probable error", "emulation", "seconds")
    body = [
        tuple(
            cell or "–"
            for cell in (each.name, each.guarantee, each.contraction, each.three_sigma, each.emulation, each.seconds)
        )
        for each in load()
    ]
    return Table("bits that some filters need", header, tuple(body))


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the rows whose names contain one of the words, or all, and write them to a folder."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Compute a table of guarantees for some filters.")
    parser.add_argument(
        "words",
        nargs="*",
        help="recompute only the filters whose names contain one of these words; keep the other stored rows",
    )
    parser.add_argument("--output", type=Path, default=Path(".cache/guarantees"), help="folder for guarantees.csv")
    given = parser.parse_args(arguments)
    words, file = given.words, given.output / FILE.name
    given.output.mkdir(parents=True, exist_ok=True)
    rows = {row.name: row for row in load()} if words and FILE.exists() else {}
    for case in (CASES[0], CASES[-2]):  # time for compiling and loading must not count as time of a guarantee
        _found(case, case.make(), FORMAT)
    for case in CASES:
        name = case.make().name
        if not words or any(word in name for word in words):
            rows[name] = compute(case)
            print(*rows[name], flush=True)
            order = [each.make().name for each in CASES]
            found = [tuple(rows[each]) for each in order if each in rows]
            write(file, COLUMNS, found, {"command": COMMAND, **machine()})
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
