"""A bound up to a stated step, in blocks, for a filter that settles too slowly.

Gravity Probe B's filter is an example: its drift rates have a time constant of months. Gains and disturbances of a year
would fill 10 GB, so this module keeps only those of one cycle of the model at a time. Several limits share a pass. The
two choices of states, drift or deviations from the predicted drift, have the same gains.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.bounds.gains import check_deterministic, packed_coefficients
from gpbnb.bounds.guarantee import limits, sized_limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.bounds.units import stored_sizes
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.opening import widened_array
from gpbnb.filters.program import Program
from gpbnb.filters.run import Run
from gpbnb.report.display.tables import Table
from gpbnb.report.gravity_probe_b.error_sets import (
    GAIN,
    LOOP,
    ROUNDING,
    Disturbances,
    FilterSteps,
    Reach,
    columns,
    disturbances,
    forward,
    nothing,
    units,
    units_of_trace,
)
from gpbnb.report.gravity_probe_b.model import YEAR
from gpbnb.report.gravity_probe_b.year import MODELS
from gpbnb.report.gravity_probe_b.year import model as year_model
from gpbnb.sweeps import Column, Sweep, read_record, write_record

FILE = Path(__file__).with_name("horizon.csv")
COLUMNS = (
    Column("precision", "integer", 2, 53),
    Column("steps", "integer", 1),
    Column("states", "text", choices=("absolute", "deviation")),
    *(Column(f"bound {i}", low=0) for i in range(10)),
    *(Column(f"gain part {i}", low=0) for i in range(10)),
)
"""Columns of the stored table."""
SAVE_EVERY = 50
"""Blocks between two saved states of a long run."""


@dataclass
class _Carried:
    """State that is carried from block to block for one choice of limits."""

    within: FilterLimits
    assumed: NDArray[np.float64]
    last: NDArray[np.float64]
    worst: NDArray[np.float64]
    parts: NDArray[np.float64]
    reach: Reach | None = None
    used: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    size: NDArray[np.float64] = field(default_factory=lambda: np.ones(1))


class HorizonBounds(NamedTuple):
    """HorizonBounds of the error of each state at any step so far, (n,), for one choice of limits."""

    worst: NDArray[np.float64]
    last: NDArray[np.float64]
    #: (n, 4), of the step where the bound was largest.
    parts: NDArray[np.float64]


def bounds_in_blocks(
    model: LinearModel,
    fmt: FloatFormat,
    within: Sequence[FilterLimits],
    assumed: Sequence[Any],
    steps: int,
    form: Form | str = Form.INNOVATION,
    block: int | None = None,
    window: int = 8,
    saved: Path | None = None,
) -> Iterator[tuple[int, list[HorizonBounds]]]:
    """Bound the effect of rounding on the estimates of the first steps, block by block.

    Parameters
    ----------
    model, fmt, form : the filter, as for :func:`gpbnb.bounds.guarantee.guarantee`.
    within : limits on state and innovation, one for each bound.
    assumed : for each bound, (n,), an error that is assumed not to be exceeded. It enters the size of the computed
        estimate; a bound above it ends the iteration with an ``ArithmeticError``.
    steps : number of steps.
    block : number of steps at a time; by default a cycle of the model.
    saved : file for the state of the run, written now and then. If it exists, the run continues from there; the
        arguments must be the same.

    Yields
    ------
    done, bounds : after each block.
    """
    check_deterministic(fmt)
    model.refuse_inputs("bounds in blocks")
    model.check_steps(steps)
    stored = model.rounded(fmt)
    within = _sized(stored, within, assumed)
    block = stored.cycle if block is None else block
    run, true = (
        Run(model, fmt, form, range(1, block + 1)),
        Run(stored, None, Form.INNOVATION, range(1, block + 1), bounded=True),
    )
    silence = ((run, fmt.array(np.zeros((block, stored.m)))), (true, np.zeros((block, stored.m))))
    wide = _wide(stored)
    done, each = 0, _begun(fmt, within, assumed)
    if saved is not None and saved.exists():
        done, each = _restored(saved, run, true)
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
        program, numbers = _of_block(run, true, wide, done, count)
        caps = np.full(len(program.operations), np.inf)
        part = np.array([ROUNDING] * len(program.roots) + [LOOP] * stored.n + [GAIN] * stored.m)
        for one in each:
            found = Disturbances(*disturbances(program.compiled, numbers, units(fmt), one.within, one.assumed, caps))
            _follow(one, found, part, done, count, window)
            if not (one.worst <= one.assumed).all():
                raise ArithmeticError(f"the bound {one.worst} exceeds the assumed {one.assumed} by step {done + count}")
        done += count
        if saved is not None and (done // block) % SAVE_EVERY == 0:
            _save(saved, done, run, true, each)
        yield done, [HorizonBounds(one.worst, one.last, one.parts) for one in each]


def _sized(stored: LinearModel, within: Sequence[FilterLimits], assumed: Sequence[Any]) -> list[FilterLimits]:
    """Return limits with one entry each; reject those that are not finite, and assumed errors of another shape."""
    found = [sized_limits(limit, stored.n, stored.m, stored.x0) for limit in within]
    for limit, error in zip(found, assumed, strict=True):
        if not (np.isfinite(limit.state).all() and np.isfinite(limit.innovation).all()):
            raise ValueError(
                f"got limits {limit.state} on the state and {limit.innovation} on the innovation; needed finite ones: "
                "bounds in blocks do not derive them from limits on the measurements"
            )
        if np.shape(error) != (stored.n,):
            raise ValueError(f"got assumed errors of shape {np.shape(error)}; needed ({stored.n},), one for each state")
    return found


def _begun(fmt: FloatFormat, within: Sequence[FilterLimits], assumed: Sequence[Any]) -> list[_Carried]:
    """Return the state before the first step, for each choice of limits."""
    found = []
    for limit, error in zip(within, assumed, strict=True):
        none, most = np.zeros(len(error)), limit._replace(measurement=stored_sizes(fmt, limit.measurement))
        found.append(_Carried(most, np.asarray(error, dtype=np.float64), none, none, np.zeros((len(error), 4))))
    return found


def _wide(stored: LinearModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the cycles of Phi and of H Phi in double-double."""
    products = [stored.H[k % len(stored.H)] @ stored.Phi[k % len(stored.Phi)] for k in range(stored.cycle)]
    return double_doubles(stored.Phi), double_doubles(np.array(products))


def _of_block(
    run: Run, true: Run, wide: tuple[NDArray[np.float64], NDArray[np.float64]], done: int, count: int
) -> tuple[Program, FilterSteps]:
    """Return the program of a step, and the numbers of a block that its disturbances follow from."""
    (Phi, HPhi), rows = wide, np.arange(count)
    at = (done + rows) % len(HPhi)
    program, packed = packed_coefficients(run, rows, done)
    coefficients = widened_array(packed)
    return program, FilterSteps(
        coefficients,
        np.zeros(coefficients.shape[:2]),
        np.ascontiguousarray(Phi[at % len(Phi)]),
        np.ascontiguousarray(HPhi[at]),
        np.ascontiguousarray(true.G[:count].reshape(count, program.n, program.m, 2)),
        true.bounds.gain[:count],
    )


def _save(file: Path, done: int, run: Run, true: Run, each: list[_Carried]) -> None:
    """Write the state that the next block needs; an existing file is replaced as a whole."""
    draft = file.with_suffix(".draft")
    runs = [(given.x, given.P, given.notes) for given in (run, true)]
    draft.write_bytes(pickle.dumps((done, runs, true.bound, each)))
    draft.replace(file)


def _restored(file: Path, run: Run, true: Run) -> tuple[int, list[_Carried]]:
    """Restore both runs from a file written by :func:`_save`; return the rest of it."""
    done, runs, true.bound, each = pickle.loads(file.read_bytes())
    for given, state in zip((run, true), runs, strict=True):
        for array, value in zip((given.x, given.P, given.notes), state, strict=True):
            array[...] = value
    return done, each


def _follow(one: _Carried, found: Disturbances, part: NDArray[np.int64], done: int, count: int, window: int) -> None:
    sizes = columns(found)
    if one.reach is None:
        one.used = sizes.max(axis=(0, 1)) > 0
        one.size = units_of_trace((sizes.sum(axis=2) + found.slack).max(axis=0))
        one.reach = nothing(window, part[one.used], len(one.last))
    slack = found.slack + sizes[:, :, ~one.used].sum(axis=2) * (1 + 2.0**-40)
    G, limits_of = (np.ascontiguousarray(each[..., one.used]) for each in (found.G, found.limits))
    bounds, parts = forward(found.F, found.spread, G, limits_of, slack, one.reach, done, count, one.last, one.size)
    bounds = np.where(np.isnan(bounds), np.inf, bounds)
    at = bounds.argmax(axis=0)
    for i, k in enumerate(at):
        if bounds[k, i] > one.worst[i]:
            one.parts[i] = parts[k, i]
    one.worst, one.last = np.maximum(one.worst, bounds.max(axis=0)), bounds[-1].copy()


# -- Gravity Probe B --------------------------------------------------------------------------------------------------

ABSOLUTE = (7000.0, 500.0, 7000.0, 100.0, 200.0, 200.0, 200.0, 200.0, 200.0, 20.0)
"""Limits of the states if they are the drift itself; units as in :data:`gpbnb.report.gravity_probe_b.model.STATES`."""

DEVIATION = (500.0, 500.0, 100.0, 100.0, 200.0, 200.0, 200.0, 200.0, 200.0, 20.0)
"""Limits of the states if they are deviations from the predicted drift, which reaches 6606 mas in the year."""

INNOVATION = (1000.0, 200.0)
"""Limits of the innovations in mas. They are 20 standard deviations of gyro and telescope noise, with some margin."""


class HorizonRow(NamedTuple):
    """HorizonBounds after some steps of the year for one choice of states."""

    precision: int
    steps: int
    states: str
    bounds: tuple[float, ...]
    gain_parts: tuple[float, ...]


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


def bits(row: HorizonRow, tolerance: float = 1.0) -> int:
    """Return the bits for which the bound of each drift and rate, scaled with the unit roundoff, meets a tolerance.

    The bounds are nearly proportional to the unit roundoff, so this extrapolates; it is not a guarantee by itself.
    """
    return math.ceil(row.precision + math.log2(max(row.bounds[:4]) / tolerance))


def gravity_probe_b_bounds(
    precision: int, steps: int = YEAR, saved: Path | None = None
) -> Iterator[tuple[int, list[HorizonBounds]]]:
    """Yield bounds for a year of Gravity Probe B in a binary format, first for absolute states, then for deviations."""
    within = [limits(state=state, innovation=INNOVATION) for state in (ABSOLUTE, DEVIATION)]
    assumed = [1e-2 * np.array(state) for state in (ABSOLUTE, DEVIATION)]
    fmt = FloatFormat(2, precision)
    return bounds_in_blocks(year_model(MODELS[0], 2), fmt, within, assumed, steps, saved=saved)


# -- the stored table -------------------------------------------------------------------------------------------------


def year_of_bounds(precision: int, directory: Path | None = None, steps: int = YEAR) -> list[list[str]]:
    """Return two rows after each hundredth of the year and at the end; they hold for the steps done so far.

    Parameters
    ----------
    directory : folder that holds the state of the run and its rows, from which it continues; None saves nothing.
    """
    saved = record = None
    rows: list[list[str]] = []
    if directory is not None:
        saved, record = directory / f"state_{precision}.pickle", directory / f"rows_{precision}.json"
        if saved.exists() and record.exists():
            rows = read_record(record, SWEEP.command)["rows"]
    every = int(rows[-1][1]) + YEAR // 100 if rows else 0
    with tqdm(total=steps, unit="step", disable=directory is None) as bar:
        for done, found in gravity_probe_b_bounds(precision, steps, saved):
            bar.update(done - bar.n)
            if done == steps or done >= every:
                every = done + YEAR // 100
                rows = [row for row in rows if int(row[1]) < done]
                for name, each in zip(("absolute", "deviation"), found, strict=True):
                    bounds, parts = (f"{b:.6g}" for b in each.worst), (f"{b:.3g}" for b in each.parts[:, GAIN])
                    rows.append([str(precision), str(done), name, *bounds, *parts])
                if record is not None:
                    write_record(record, {"rows": rows})
    return rows


def first_cycle(precision: int, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the rows after the first cycle of the model."""
    return [tuple(row) for row in year_of_bounds(precision, steps=year_model(MODELS[0], 2).cycle)]


SWEEP: Sweep[int] = Sweep(
    name="gravity_probe_b/horizon",
    file=FILE,
    columns=COLUMNS,
    key=3,
    cells=lambda: (53,),
    compute=year_of_bounds,
    command="python -m gpbnb.report.stored recompute gravity_probe_b/horizon",
    seed=0,
    sample=first_cycle,
)


def load(file: Path = FILE) -> tuple[HorizonRow, ...]:
    """Return the stored rows."""
    return tuple(
        HorizonRow(int(line[0]), int(line[1]), line[2], tuple(map(float, line[3:13])), tuple(map(float, line[13:])))
        for line in SWEEP.load(file).rows
    )
