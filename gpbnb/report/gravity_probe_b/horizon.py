"""A bound up to a stated step, in blocks, for a filter that settles too slowly.

Gravity Probe B's filter is an example: its drift rates have a time constant of months. Gains and disturbances of a year
would fill 10 GB, so this module keeps only those of one cycle of the model at a time. Several limits share a pass. The
two choices of states, drift or deviations from the predicted drift, have the same gains.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.bounds.gains import Schedule
from gpbnb.bounds.guarantee import limits, sized_limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.pairs import nearest_double_doubles
from gpbnb.filters.run import Run
from gpbnb.report.display.tables import Table
from gpbnb.report.gravity_probe_b.error_sets import GAIN, Disturbances, Reach, disturbances, functions
from gpbnb.report.gravity_probe_b.model import YEAR
from gpbnb.report.gravity_probe_b.year import MODELS
from gpbnb.report.gravity_probe_b.year import model as year_model
from gpbnb.report.stored_table import Column
from gpbnb.report.sweep import Sweep

COLUMNS = (
    Column("precision", "integer", 2, 53),
    Column("steps", "integer", 1),
    Column("states", "text", choices=("absolute", "deviation")),
    *(Column(f"bound {i}", low=0) for i in range(10)),
    *(Column(f"gain part {i}", low=0) for i in range(10)),
)
"""Columns of the stored table."""


@dataclass
class HorizonBounds:
    """Bounds of the error of each state for one choice of limits, (n,), as they are after the latest step."""

    within: FilterLimits
    assumed: NDArray[np.float64]
    worst: NDArray[np.float64]
    #: (n, 2), of the step where the bound was largest.
    parts: NDArray[np.float64]
    #: known from the first disturbances on.
    reach: Reach | None = None

    def follow(self, found: Disturbances, window: int) -> None:
        """Take in the disturbances of the next steps."""
        self.reach = self.reach or Reach.nothing(found, window)
        for F, spread, G, slack in zip(*found[:4], strict=True):
            parts = self.reach.advance(F, spread, G, slack)
            more = ~(self.reach.last <= self.worst)
            self.parts[more], self.worst[more] = parts[more], self.reach.last[more]


def bounds_in_blocks(
    model: LinearModel,
    precision: int,
    within: Sequence[FilterLimits],
    assumed: Sequence[Any],
    steps: int,
    block: int | None = None,
    window: int = 8,
) -> Iterator[tuple[int, list[HorizonBounds]]]:
    """Bound the effect of rounding on the estimates of the innovation form in its first steps, block by block.

    Parameters
    ----------
    model, precision : the filter and its bits; it rounds to nearest.
    within : finite limits on state and innovation, one for each bound.
    assumed : for each bound, (n,), an error that is assumed not to be exceeded. It enters the size of the computed
        estimate; a bound above it ends the iteration with an ``ArithmeticError``.
    block : number of steps at a time; by default a cycle of the model.
    window : number of steps whose disturbances are kept one by one.

    Yields
    ------
    done, bounds : after each block.
    """
    fmt = FloatFormat(2, precision)
    stored = model.rounded(fmt)
    block = stored.cycle if block is None else block
    run = Run(model, fmt, Form.INNOVATION, range(1, block + 1))
    true = Run(stored, None, Form.INNOVATION, range(1, block + 1), bounded=True)
    silence = ((run, fmt.array(np.zeros((block, stored.m)))), (true, np.zeros((block, stored.m))))
    products = [stored.H[k % len(stored.H)] @ stored.Phi[k % len(stored.Phi)] for k in range(stored.cycle)]
    Phi, HPhi = double_doubles(stored.Phi), double_doubles(np.array(products))
    x0, done, each = stored.x0, 0, [_begun(stored, *given) for given in zip(within, assumed, strict=True)]
    while done < steps:
        count = min(block, steps - done)
        for filter_run, z in silence:
            filter_run.save_at(np.arange(done + 1, done + count + 1))
            filter_run.take(z[:count])
            if filter_run.stopped or filter_run.indefinite:
                raise ArithmeticError(
                    f"{model.name} in {fmt}: the filter stopped or its covariance lost definiteness by "
                    f"step {done + count}"
                )
        program, packed = run.linear_program(), run.coefficients()
        at = done + np.arange(count)
        exact = true.G[:count].reshape(count, program.n, program.m, 2)
        of_model = Phi[at % len(Phi)], HPhi[at % len(HPhi)]
        given = Schedule(
            program, fmt, nearest_double_doubles(packed), packed, *of_model, exact, x0, 0, False, None, None
        )
        known = functions(given)
        for one in each:
            one.follow(disturbances(given, known, true.bounds.gain[:count], one.within, one.assumed), window)
            if not (one.worst <= one.assumed).all():
                raise ArithmeticError(f"the bound {one.worst} exceeds the assumed {one.assumed} by step {done + count}")
        done += count
        yield done, [replace(one, worst=one.worst.copy(), parts=one.parts.copy()) for one in each]


def _begun(stored: LinearModel, within: FilterLimits, assumed: Any) -> HorizonBounds:
    """Return the state before the first step."""
    limit, n = sized_limits(within, stored.n, stored.m, stored.x0), stored.n
    return HorizonBounds(limit, np.asarray(assumed, dtype=float), np.zeros(n), np.zeros((n, 2)))


# -- Gravity Probe B --------------------------------------------------------------------------------------------------

ABSOLUTE = (7000.0, 500.0, 7000.0, 100.0, 200.0, 200.0, 200.0, 200.0, 200.0, 20.0)
"""Limits of the states if they are the drift itself; units as in :data:`gpbnb.report.gravity_probe_b.model.STATES`."""

DEVIATION = (500.0, 500.0, 100.0, 100.0, 200.0, 200.0, 200.0, 200.0, 200.0, 20.0)
"""Limits of the states if they are deviations from the predicted drift, which reaches 6606 mas in the year."""

INNOVATION = (1000.0, 200.0)
"""Limits of the innovations in mas. They are 20 standard deviations of gyro and telescope noise, with some margin."""


class HorizonRow(NamedTuple):
    """Bounds after some steps of the year for one choice of states."""

    precision: int
    steps: int
    states: str
    bounds: tuple[float, ...]


def table() -> Table:
    """Tabulate bounds of the drift and its rates for the longest time computed, for both choices of states."""
    header = (
        "states",
        "days",
        "drift φ2, mas",
        "drift φ3, mas",
        "drift rate 2, mas/yr",
        "drift rate 3, mas/yr",
        "bits",
    )
    last = {row.states: row for row in load()}
    names = {"absolute": "drift itself", "deviation": "deviations from the predicted drift"}
    body = [
        (names[row.states], f"{row.steps / 8640:.0f}", *(f"{b:.2g}" for b in row.bounds[:4]), str(bits(row)))
        for row in last.values()
    ]
    return Table("Gravity Probe B in binary64", header, tuple(body))


def bits(row: HorizonRow) -> int:
    """Return the bits for which the bound of each drift and rate, scaled with the unit roundoff, is at most 1.

    The bounds are nearly proportional to the unit roundoff, so this extrapolates; it is not a guarantee by itself.
    """
    return math.ceil(row.precision + math.log2(max(row.bounds[:4])))


def gravity_probe_b_bounds(precision: int, steps: int = YEAR) -> Iterator[tuple[int, list[HorizonBounds]]]:
    """Yield bounds for a year of Gravity Probe B in a binary format, first for absolute states, then for deviations."""
    within = [limits(state=state, innovation=INNOVATION) for state in (ABSOLUTE, DEVIATION)]
    assumed = [1e-2 * np.array(state) for state in (ABSOLUTE, DEVIATION)]
    return bounds_in_blocks(year_model(MODELS[0], 2), precision, within, assumed, steps)


# -- the stored table -------------------------------------------------------------------------------------------------


def year_of_bounds(precision: int, steps: int = YEAR) -> list[tuple[str, ...]]:
    """Return two rows after each hundredth of the year and at the end; they hold for the steps done so far."""
    rows: list[tuple[str, ...]] = []
    every = 0
    with tqdm(total=steps, unit="step", disable=None) as bar:
        for done, found in gravity_probe_b_bounds(precision, steps):
            bar.update(done - bar.n)
            if done == steps or done >= every:
                every = done + YEAR // 100
                for name, each in zip(("absolute", "deviation"), found, strict=True):
                    bounds, parts = (f"{b:.6g}" for b in each.worst), (f"{b:.3g}" for b in each.parts[:, GAIN])
                    rows.append((str(precision), str(done), name, *bounds, *parts))
    return rows


def first_cycle(precision: int, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the rows after the first cycle of the model."""
    return year_of_bounds(precision, year_model(MODELS[0], 2).cycle)


SWEEP = Sweep("gravity_probe_b/horizon", COLUMNS, 3, lambda: (53,), year_of_bounds, sample=first_cycle)


def load() -> tuple[HorizonRow, ...]:
    """Return the stored rows."""
    return tuple(
        HorizonRow(int(line[0]), int(line[1]), line[2], tuple(map(float, line[3:13]))) for line in SWEEP.load().rows
    )
