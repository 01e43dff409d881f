"""Guarantees for every measurement and for ever, for filters of this package and of other projects."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.selection import LARGEST_PRECISION
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.search import smallest_precision
from gpbnb.bounds.gains import filter_schedule
from gpbnb.bounds.guarantee import FilterGuarantee, from_schedule, guarantee, limits
from gpbnb.bounds.probable import probable_error
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.structures import LinearFilter, state_space
from gpbnb.filters.system import LinearSystem
from gpbnb.report.display.tables import Table
from gpbnb.report.examples import TILT_STATES, altimeter, tilt, tracker
from gpbnb.report.guarantees.adversary import attack, ceiling, random_errors
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
from gpbnb.report.sweep import Number, Whole, sweep_of_rows
from gpbnb.report.sweep import load as load_rows
from gpbnb.wordlength.answer import Basis
from gpbnb.wordlength.required import required_precision

FORMAT = FloatFormat(2, 24)
SHARE = 1e-4
"""Tolerance of each state, as a share of its limit."""
BASES: tuple[Basis, ...] = ("guarantee", "bound", "probable", "emulation")
RECORD = 2_000
"""Steps of the simulated record for the contraction bound and the emulation."""


@dataclass(frozen=True)
class GuaranteeCase:
    """A filter and its limits.

    Parameters
    ----------
    make : function that returns the filter.
    state, innovation : limits for a Kalman filter.
    measurement : limit for a linear filter.
    center : the state near which the adversary stays.
    steps : length of the adversary's runs.
    candidates : number of measurements to choose from at each step.
    aims : the states whose errors the adversary tries to make large; all states if empty.
    horizon : number of steps that the bound covers, for filters without process noise.
    states : name and unit of each state.
    form : form of a Kalman filter.
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
    states: tuple[str, ...] = ()


def _second_order() -> LinearFilter:
    b, a = ["0.01", "0.02", "0.01"], [1, "-1.6", "0.7"]
    return LinearSystem.from_coefficients(b, a, name="a second-order section").as_filter()


def _longitudinal() -> LinearFilter:
    given = fixif_longitudinal()
    return state_space(given["A"], given["B"], given["C"], given["D"], name="FixIF, longitudinal controller")


_MOTION = ("position, m", "velocity, m/s")

CASES = (
    GuaranteeCase(nile_local_level, (1500,), 1200, center=(1000,), states=("level, 10⁸ m³",)),
    GuaranteeCase(elaenia_gold, (1200,), 60, center=(1150,), steps=10, horizon=10, states=("constant, no unit",)),
    GuaranteeCase(tracker, (1000, 30), 8, center=(750, 0), states=_MOTION),
    GuaranteeCase(filterpy_fusion, (1000, 30), 8, center=(750, 0), states=("position, no unit", "velocity, no unit")),
    GuaranteeCase(
        filterpy_velocity,
        (2000, 150),
        150,
        center=(1500, 0),
        form=Form.JOSEPH,
        states=("position, no unit", "velocity, no unit"),
    ),
    GuaranteeCase(px4_landing_target, (10, 3), 1, center=(9, 0), states=_MOTION),
    GuaranteeCase(
        dyer_mcreynolds,
        (10, 10, 10),
        0.02,
        steps=1,
        horizon=1,
        states=("constant 1, no unit", "constant 2, no unit", "constant 3, no unit"),
    ),
    GuaranteeCase(
        dynamax_tracking,
        (100, 100, 10, 10),
        8,
        center=(80, 80, 0, 0),
        states=("position x, no unit", "position y, no unit", "velocity x, no unit", "velocity y, no unit"),
    ),
    GuaranteeCase(
        lambda: altimeter("1e-12"),
        (50, 2, 0.5),
        2,
        center=(37, 0, 0.4),
        steps=20_000,
        states=("height, m", "speed, m/s", "bias, m/s²"),
    ),
    GuaranteeCase(
        tilt, (60, 30, 2), (8, 8), center=(45, 0, 1.5), steps=30_000, states=tuple(map(", ".join, TILT_STATES))
    ),
    GuaranteeCase(
        _second_order,
        measurement=1.0,
        states=("state 1, no unit", "state 2, no unit", "output, no unit"),
    ),
    GuaranteeCase(
        lambda: LinearSystem.pid("2", "0.01", "5", "0.999").as_filter(),
        measurement=1.0,
        states=("integral, no unit", "last error, no unit", "output, no unit"),
    ),
    GuaranteeCase(
        _longitudinal,
        measurement=10.0,
        steps=1_000,
        candidates=100,
        aims=(10,),
        states=(*(f"state {i}, no unit" for i in range(1, 11)), "output, no unit"),
    ),
)
"""Filters with their limits."""


class GuaranteeRow(NamedTuple):
    """One row of the table, as text."""

    name: str
    n: Whole
    m: Whole
    repeat: Whole
    period: Whole
    worst: Whole
    bound: Number
    ratio: Number
    ceiling: Number
    probable: Number
    scatter: Number
    guarantee: Whole
    contraction: Whole
    three_sigma: Whole
    emulation: Whole
    seconds: Number


def compute(case: GuaranteeCase) -> GuaranteeRow:
    """Compute the guarantee in 24 bits, an attack on it, and the precision that each basis requires."""
    made = case.make()
    begin = time.process_time()
    found = case_guarantee(case, made, FORMAT)
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
    return GuaranteeRow(
        made.name,
        str(schedule.program.n),
        str(schedule.program.m),
        str(schedule.repeat or ""),
        str(schedule.period or ""),
        str(worst),
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


def case_guarantee(
    case: GuaranteeCase, made: LinearModel | LinearFilter, fmt: FloatFormat, proved: bool = True
) -> FilterGuarantee:
    """Compute the guarantee of a case, whose filter is `made`, in a format; or only guess it."""
    if isinstance(made, LinearModel):
        within = limits(state=case.state, innovation=case.innovation)
        if case.horizon is not None:
            return guarantee(made, fmt, within, case.form, case.horizon, case.horizon, proved)
        return guarantee(made, fmt, within, case.form, 100_000, 1, proved)
    return from_schedule(filter_schedule(made, fmt), limits(measurement=case.measurement), proved=proved)


def _bits(
    case: GuaranteeCase,
    made: LinearModel | LinearFilter,
    basis: Basis,
    tolerance: NDArray[np.float64],
    known: NDArray[np.float64],
) -> str:
    """Return the bits that a basis requires, empty if it does not apply; `known` holds its errors in 24 bits."""
    finite = case.horizon is not None
    if basis == "bound" or (basis == "emulation" and isinstance(made, LinearModel)):
        if not isinstance(made, LinearModel):
            return ""
        answer = required_precision(made, case.horizon or RECORD, list(tolerance), basis=basis, form=case.form)
        return str(answer.digits) if answer.met else ""
    if basis == "probable" and finite:
        return ""

    def meets(fmt: FloatFormat) -> bool:
        try:
            found = case_guarantee(case, made, fmt, proved=False)
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


# -- the stored table -------------------------------------------------------------------------------------------------


def case_named(name: str) -> GuaranteeCase:
    """Return the filter of a name with its limits."""
    return next(case for case in CASES if case.make().name == name)


def compute_named(name: str) -> GuaranteeRow:
    """Compute the row of the filter of a name."""
    _compile()
    return compute(case_named(name))


@cache
def _compile() -> None:
    """Compile and load everything once, so that this time does not count as time of a guarantee."""
    for case in (CASES[0], CASES[-2]):
        case_guarantee(case, case.make(), FORMAT)


def _same(stored: Sequence[str], computed: Sequence[str]) -> bool:
    """Whether two rows agree, apart from the seconds."""
    return stored[:-1] == computed[:-1]


SWEEP = sweep_of_rows(
    "guarantees/guarantees",
    GuaranteeRow,
    lambda: tuple(case.make().name for case in CASES),
    compute_named,
    optional=True,
    same=_same,
)
load = partial(load_rows, SWEEP, GuaranteeRow)


def table() -> Table:
    """Tabulate the bound of each filter and its sharpness."""
    header = (
        "filter", "state, unit", "limit", "bound", "reached / bound", "ceiling / bound", "probable error",
        "scatter / probable",
    )  # fmt: skip
    cases = {case.make().name: case for case in CASES}
    body = []
    for each in load():
        case, worst = cases[each.name], int(each.worst)
        limit = f"{case.state[worst]:g}" if case.state else f"input: {case.measurement:g}"
        numbers = (cell or "–" for cell in (each.bound, each.ratio, each.ceiling, each.probable, each.scatter))
        body.append((each.name, case.states[worst].removesuffix(", no unit"), limit, *numbers))
    return Table("guarantees of some filters in 24 bits", header, tuple(body))


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
