r"""The guarantee: a bound on the effect of rounding for all measurements within their limits.

Let the program of a step compute, with coefficients that are known exactly, the linear function
:math:`\hat F_k x + \hat K_k z` up to its roundings, and let the exact filter be
:math:`x_k = F_k x_{k-1} + K_k z_k`, :math:`F_k = (I - K_kH_k)\Phi_k`, with innovation
:math:`\nu_k = z_k - H_k\Phi_kx_{k-1}`. Then :math:`e_k = \hat x_k - x_k` obeys, exactly,

.. math:: e_k = \hat F_k e_{k-1} + \Delta F_k x_{k-1} + (\hat K_k - K_k)\nu_k + \Gamma_k\rho_k, \qquad
    \Delta F_k = \hat F_k - (I - \hat K_kH_k)\Phi_k,

where ρ holds the rounding errors of the operations, and the columns of Γ their effects on the result. See
:func:`gpbnb.report.guarantees.derivation.recursion` for the algebra and :mod:`gpbnb.bounds.envelope` for the
sums over all earlier steps.

A guarantee assumes, and checks where it can, that

* the rounding is deterministic; a linear filter with fixed coefficients may also round at random;
* sums run from left to right, each product and each sum is rounded in the format, and none is fused or compensated: the
  run is ``Run(model, fmt, form)``, without its further options;
* the run opens with the model as given, see :mod:`gpbnb.filters.opening`, and the exact filter has the stored model and
  the stored measurements;
* the first estimate, as stored, is within the limits on the state;
* exponents suffice. With a limited range, underflow is part of the bound, and no bound exists if a number of a step
  might exceed the largest. A covariance beyond the range ends the emulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.certificate import written
from gpbnb.bounds.envelope import (
    GAIN,
    LOOP,
    ROUNDING,
    START,
    Columns,
    Disturbances,
    End,
    FilterLimits,
    Sizes,
    Steps,
    certify,
    columns,
    disturbances,
    peaks,
    units,
)
from gpbnb.bounds.gains import MOST, Schedule, schedule
from gpbnb.bounds.reach import forward, nothing, onward, units_of_trace
from gpbnb.bounds.storing import stored_sizes
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LARGEST_EXPONENT, LinearModel
from gpbnb.filters.named import whole_number
from gpbnb.filters.poles import eigenvalues
from gpbnb.filters.program import functionals

PARTS = ("roundings of the estimate", "roundings of the closed loop", "errors of the gain", "older errors")
"""Names of the parts of a bound, in the order in which a guarantee lists them."""

_AT_ONCE = 64
"""Number of steps whose columns are multiplied at a time."""

BUDGET = 3e8
"""Approximate number of multiplications for the steps before the gain settles, a few seconds."""

MOST_LAGS = 2**20
"""Largest number of steps over which the errors of a filter add up in a bound that holds for ever."""

PER_BUDGET = 3
"""Largest number of multiplications that derive limits on states from those on measurements, per unit of a budget."""

MOST_LIMITS = 2**16
"""Largest number of states, and of measurements, that have limits."""


@dataclass(frozen=True, eq=False)
class Guarantee:
    """A bound on the effect of rounding on an estimate.

    Parameters
    ----------
    bound : (n,), bound of the error of each state after every step; infinite if there is none.
    steps : None if the bound holds for ever; otherwise the number of steps for which it holds.
    why : why the bound does not hold for ever; empty if it does.
    history : (k, n), bounds after each of the first steps. If the bound holds for ever, the last rows are one for each
        phase of the period, and also hold for all later steps in this phase.
    parts : (n, 4), the parts of each state's bound at the step where it is largest: roundings of the estimate,
        roundings of the closed loop, errors of the gain, older errors.
    limits : limits on the filter without rounding: those given, and those that follow from them.
    schedule : the filter's coefficients.
    lags : number of earlier steps that the sums include.
    radius : growth of an error per step, averaged over a period.
    asked : limits as given.
    """

    bound: NDArray[np.float64]
    steps: int | None
    why: str
    history: NDArray[np.float64]
    parts: NDArray[np.float64]
    limits: FilterLimits
    schedule: Schedule
    lags: int
    radius: float
    asked: FilterLimits

    @property
    def for_ever(self) -> bool:
        """Whether the bound holds for any number of steps."""
        return self.steps is None

    def certificate(self) -> str:
        """Return the guarantee as JSON, which :mod:`gpbnb.bounds.check` verifies without the rest of this package.

        Raises
        ------
        ValueError : there is no bound, the gain never repeats, or the schedule does not hold the filter.
        """
        loops = closed_loops(self.schedule)
        return written(self.schedule, self.asked, self.limits, self.bound, self.steps, loops)

    def __str__(self) -> str:
        numbers = ", ".join(f"{b:.3g}" for b in self.bound)
        fmt = arithmetic(self.schedule.fmt)
        if self.steps is not None:
            return f"within {numbers} for {self.steps} steps only, because {self.why}; in {fmt}"
        at = ""
        if self.schedule.repeat is not None:
            at = f"; the gain repeats from step {self.schedule.repeat}"
        if self.schedule.enclosed is not None:
            at = f"; the gain stays within known limits from step {self.schedule.enclosed}"
        return f"within {numbers} for ever, in {fmt}{at}"

    __repr__ = __str__  # the fields have thousands of numbers


def limits(
    n: int, m: int, state: Any = math.inf, innovation: Any = math.inf, measurement: Any = math.inf
) -> FilterLimits:
    """Set limits on the states, innovations or measurements of the exact filter.

    Each limit is one number for all entries, or one number per entry; those that float64 does not hold are rounded up.

    Raises
    ------
    ValueError : a limit is negative or NaN; a limit is neither one number nor one number per entry; or too few limits
        are finite.
    """
    found = []
    n, m = (whole_number(name, size, most=MOST_LIMITS) for name, size in (("states", n), ("measurements", m)))
    for name, each, size in (("state", state, n), ("innovation", innovation, m), ("measurement", measurement, m)):
        try:
            given = all_above(each)
        except (TypeError, ValueError):
            raise ValueError(f"got {each!r} on the {name}; needed numbers, one or {size}") from None
        if given.shape not in ((), (1,), (size,)):
            raise ValueError(f"got limits {given} on the {name}; needed one number, or {size}")
        found.append(np.array(np.broadcast_to(given, (size,))))
    X, V, Z = found
    for name, each in (("state", X), ("innovation", V), ("measurement", Z)):
        if np.isnan(each).any() or (each < 0).any():
            raise ValueError(f"got a limit {each} on the {name}; needed numbers that are not negative")
    if not np.isfinite(Z).all() and not (np.isfinite(X).all() and np.isfinite(V).all()):
        raise ValueError(
            f"got limits {X} on the state, {V} on the innovation and {Z} on the measurement; needed a finite limit for "
            "each measurement, or for each state and each innovation"
        )
    least, most = 2.0**-LARGEST_EXPONENT, 2.0**LARGEST_EXPONENT
    for name, each in (("state", X), ("innovation", V), ("measurement", Z)):
        if (((each > 0) & (each < least)) | (np.isfinite(each) & (each > most))).any():
            raise ValueError(
                f"got a limit {each} on the {name}; needed 0, infinity, or 2**-{LARGEST_EXPONENT} to "
                f"2**{LARGEST_EXPONENT}, or sums leave the range of float64; scale the model by powers of two"
            )
    return FilterLimits(X, V, Z)


def check_limits(within: Any, n: int, m: int, x0: Sequence[Any] | NDArray[Any] = ()) -> None:
    """Reject limits that are for another filter, or that the first estimate exceeds.

    Parameters
    ----------
    n, m : number of states and of measurements.
    x0 : (n,), the exact first estimate; the exact filter must be within its limits from the beginning.

    Raises
    ------
    TypeError : `within` is not a result of :func:`limits`.
    ValueError : limits for another number of states or measurements, or a first estimate beyond its limit.
    """
    if not isinstance(within, FilterLimits):
        raise TypeError(f"got within={within!r}; needed the result of limits(...)")
    for name, size in (("state", n), ("innovation", m), ("measurement", m)):
        shape = np.shape(getattr(within, name))
        if shape != (size,):
            raise ValueError(
                f"got limits of shape {shape} on the {name}; needed ({size},): this filter has {n} states and {m} "
                f"measurements, so write limits({n}, {m}, ...)"
            )
    limits(n, m, *within)
    for i, (value, most) in enumerate(zip(x0, within.state, strict=False)):
        if abs(value) > most:
            raise ValueError(
                f"got a first estimate {float(value)!r} of state {i}, beyond its limit {float(most)!r}; needed a first "
                "estimate within its limit, from which the exact filter starts; raise the limit, or change x0"
            )


def check_within(within: Any, basis: str) -> None:
    """Reject limits for an answer that does not use them, or limits that are none.

    Raises
    ------
    TypeError : `within` is not a result of :func:`limits`.
    ValueError : limits with the basis "emulation" or "bound".
    """
    if within is not None and not isinstance(within, FilterLimits):
        raise TypeError(f"got within={within!r}; needed the result of limits(...)")
    if within is not None and basis in ("emulation", "bound"):
        raise ValueError(
            f'got limits and basis "{basis}", which takes the measurements as they are; needed no limits; leave out '
            'within=, or ask with basis "guarantee" or "probable"'
        )


def guarantee(
    model: LinearModel,
    fmt: FloatFormat | FixedFormat,
    within: FilterLimits,
    form: Form | str = Form.INNOVATION,
    most: int | None = None,
    horizon: int = 1_000,
    budget: float = BUDGET,
) -> Guarantee:
    """Bound the effect of rounding on the estimates of a Kalman filter, for every admissible measurement sequence.

    The bound is for a run of the model as given, with sums from left to right and no fused multiply-add. Its parts and
    assumptions are listed in :mod:`gpbnb.bounds.guarantee`.

    Parameters
    ----------
    model, fmt, form : the filter. The bound covers the distance of its estimates from those of the exact filter with
        the same stored model and measurements. If the model has a number of `steps`, the bound holds for these steps.
    within : limits on the exact filter, from :func:`limits`; limits on the measurements apply to the values before they
        are stored.
    most : the largest number of steps to emulate while the gain settles, 20,000 by default, and fewer for more than 17
        states.
    horizon : the number of steps that the bound covers if no bound holds for ever.
    budget : approximate number of multiplications to spend on the steps before the gain settles. For a filter that
        settles slowly, a larger budget gives a smaller bound. Limits on the measurements alone may take
        :data:`PER_BUDGET` times as many, and are refused if they need more.

    Raises
    ------
    TypeError : `within` is not a result of :func:`limits`, or `fmt` is not a format.
    ValueError : the format has no compiled loops, or rounds stochastically; a covariance is not definite when the
        format stores it; limits for another filter; a first estimate beyond its limit; limits on the measurements that
        need more than the budget.
    """
    if not isinstance(model, LinearModel):
        raise TypeError(
            f"got a {type(model).__name__}; needed a LinearModel; for a linear system, ask required_precision(..., "
            'basis="guarantee", within=limits(...))'
        )
    if not isinstance(fmt, (FloatFormat, FixedFormat)):
        raise TypeError(f"got the format {fmt!r}; needed a FloatFormat or a FixedFormat")
    model.refuse_inputs("a guarantee")
    check_limits(within, model.n, model.m)
    if model.steps is not None:
        most, horizon = min(MOST if most is None else most, model.steps), min(horizon, model.steps)
    found = from_schedule(schedule(model, fmt, form, most, horizon), within, horizon, budget)
    if model.steps is not None and found.steps in (None, model.steps):
        found = replace(found, steps=model.steps, why=f"{model.name} describes no more")
    return found


def from_schedule(given: Schedule, within: FilterLimits, horizon: int = 1_000, budget: float = BUDGET) -> Guarantee:
    """Compute a guarantee for a linear filter of any origin whose coefficients are known; see :func:`guarantee`.

    Raises
    ------
    TypeError, ValueError : for a reason given in :func:`check_limits`.
    """
    n = given.program.n
    check_limits(within, n, given.program.m, given.x0)
    asked = within
    within = within._replace(measurement=stored_sizes(given.fmt, within.measurement))
    why, radius = given.why, _radius(given)
    for_ever = given.settled and radius < 1
    if given.settled and radius >= 1:
        why = f"the closed loop is not stable: an error grows by a factor of {radius:.6g} a step"
    steps = min(horizon, given.steps) if not given.settled else horizon
    period = given.steps - given.first
    most = _enough_lags(radius, period) if for_ever else steps
    if for_ever and most > MOST_LAGS:
        why = (
            f"an error decays too slowly for a bound for ever, by a factor of {radius:.9g} a step: it adds up over "
            f"{most:,} steps, more than {MOST_LAGS:,}; ask for a number of steps"
        )
        for_ever, most = False, steps
    b, known, caps = np.zeros(n), within, None
    if not np.isfinite(within.state).all() or not np.isfinite(within.innovation).all():
        known = _from_measurements(given, within, most, for_ever, steps, budget)
        caps = _caps(given, known, most) if for_ever and given.first == 0 else None
    for _ in range(40):
        found = _disturbances(given, known, b, caps)
        history, parts, lags = _sums(given, found, b, most, radius if for_ever else None, steps, budget)
        new = history.max(axis=0)
        if (new <= b).all() or not np.isfinite(new).all():
            break
        b = new * (1 + 2.0**-30)
    else:
        new = np.full(n, math.inf)
    ended = None if for_ever else (steps if np.isfinite(new).all() else 0)
    if ended is None and not np.isfinite(new).all():
        ended, why = 0, "no bound was found: in this precision, an error causes rounding errors as large as itself"
        if given.fmt.limits is not None:
            why = f"no bound was found within the range of {arithmetic(given.fmt)}: a number may exceed the largest"
    at = history.argmax(axis=0)
    worst = np.array([parts[at[i], i] for i in range(n)])
    return Guarantee(
        b if np.isfinite(new).all() else new, ended, why, history, worst, known, given, lags, radius, asked
    )


def _disturbances(
    given: Schedule,
    within: FilterLimits,
    b: NDArray[np.float64],
    caps: NDArray[np.float64] | None = None,
    rows: slice = slice(None),
) -> Disturbances:
    """Compute closed loops and disturbances of some steps."""
    program = given.program
    if caps is None:
        caps = np.full(len(program.operations), math.inf)
    all_steps = (given.coefficients, given.offsets, given.Phi, given.HPhi, given.exact, given.dK)
    numbers = Steps(*(each[rows] for each in all_steps))
    return Disturbances(*disturbances(program.compiled, numbers, units(given.fmt), within, b, caps))


def disturbances_of(found: Guarantee) -> Disturbances:
    """Return the closed loops and disturbances behind a guarantee that holds for ever."""
    return _disturbances(found.schedule, found.limits, found.bound)


def _parts_of(given: Schedule) -> NDArray[np.int64]:
    """Return the part of the bound to which each column of the disturbances belongs."""
    n, m, groups = given.program.n, given.program.m, len(given.program.roots)
    return np.array([ROUNDING] * groups + [LOOP] * n + [GAIN] * m)


def closed_loops(given: Schedule) -> NDArray[np.float64]:
    """Return the closed loop of each step of a schedule, (steps, n, n), in float64."""
    return unit_disturbances(given).F


def unit_disturbances(given: Schedule, rows: slice = slice(None)) -> Disturbances:
    """Return closed loops and disturbances of some steps of a schedule, for limits of one."""
    ones = FilterLimits(np.ones(given.program.n), np.ones(given.program.m), np.ones(given.program.m))
    return _disturbances(given, ones, np.zeros(given.program.n), None, rows)


def _radius(given: Schedule) -> float:
    """Estimate the spectral radius of the closed loop over a period, as a factor per step; proofs do not use it."""
    if not given.settled:
        return math.nan
    F = unit_disturbances(given, slice(given.first, None)).F
    whole = np.eye(given.program.n)
    for each in F:
        whole = each @ whole
    return float(np.abs(eigenvalues(whole)).max() ** (1 / len(F)))


def _enough_lags(radius: float, period: int) -> int:
    lags = math.ceil(math.log(1e-8) / math.log(max(radius, 1e-3))) + 16
    return -(-lags // period) * period


def _window(given: Schedule, columns: int, steps: int, budget: float) -> int:
    """Return the number of steps whose disturbances are kept separate, all steps if that is cheap."""
    n = given.program.n
    return int(np.clip(budget / (max(steps, 1) * (columns + n) * n * n), 8, max(steps, 1)))


class _Effects(NamedTuple):
    """What the columns of some steps do to the states."""

    #: (g,), which columns change a state in any step.
    used: NDArray[np.bool_]
    #: whether every change is finite.
    finite: bool
    #: (n,), the largest change of each state in a step.
    size: NDArray[np.float64]


def _effects(found: Disturbances) -> _Effects:
    used, size, finite = np.zeros(found.G.shape[2], dtype=np.bool_), np.zeros(found.G.shape[1]), True
    for k in range(0, len(found.G), _AT_ONCE):
        some = slice(k, k + _AT_ONCE)
        sizes = columns(found._replace(G=found.G[some], limits=found.limits[some]))
        used |= (sizes > 0).any(axis=(0, 1))
        finite = finite and bool(np.isfinite(sizes).all())
        size = np.maximum(size, (sizes.sum(axis=2) + found.slack[some]).max(axis=0))
    return _Effects(used, finite, size)


def _scale(size: NDArray[np.float64], radius: float) -> tuple[NDArray[np.float64], float]:
    """Return the largest contribution of a lag, and a negligible one; the proof does not use them."""
    grown = size / (1 - radius) if radius < 1 else size
    positive = size[size > 0]
    return grown, 1e-7 * float(positive.min()) if len(positive) else 0.0


def _sums(
    given: Schedule,
    found: Disturbances,
    b: NDArray[np.float64],
    most: int,
    radius: float | None,
    steps: int,
    budget: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return bounds after each step, their parts, and the number of steps in the sums.

    If there is a radius, there is a last row for each phase of the period, which holds for all later steps in it, too.
    """
    n, part, for_ever = given.program.n, _parts_of(given), radius is not None
    used, finite, size = _effects(found)
    if for_ever and not finite:  # a number may leave the range of the format
        return np.full((1, n), math.inf), np.full((1, n, 4), math.inf), most
    arrays = Columns(
        found.F,
        found.spread,
        np.ascontiguousarray(found.G[:, :, used]),
        np.ascontiguousarray(found.limits[:, used]),
        found.slack,
        part[used],
    )
    scale, small = _scale(size, math.nan if radius is None else radius)
    size = units_of_trace(scale)
    window = _window(given, int(used.sum()), given.first if for_ever else steps, budget)
    if not for_ever:
        at = np.arange(steps)
        at = np.where(at < given.steps, at, given.first + (at - given.first) % max(given.steps - given.first, 1))
        each_step = [np.ascontiguousarray(each[at]) for each in arrays[:5]]
        history, parts = forward(*each_step, nothing(window, part[used], n), 0, steps, np.zeros(n), size)
        return np.where(np.isnan(history), math.inf, history), parts, steps
    period, sums = given.steps - given.first, []
    for phase in range(1, period + 1):
        sums.append(certify(arrays, np.eye(n), phase, given.first, True, End(most, scale, small)))
    lags = max(certificate.lags for certificate in sums)
    reach = nothing(window, part[used], n)
    begin, parts = forward(*arrays[:5], reach, 0, given.first, np.zeros(n), size)
    largest = np.maximum(b, begin.max(axis=0, initial=0.0))
    rows, row_parts = list[NDArray[np.float64]](), list[NDArray[np.float64]]()
    for _ in range(200):  # the error of the last steps persists, so raise the bound until it bounds itself
        rows, row_parts = [], []
        if not np.isfinite(largest).all():
            break
        for certificate in sums:
            with np.errstate(over="ignore", invalid="ignore"):
                carried = (certificate.residual + certificate.tail) @ largest
            each = np.array(certificate.sums)
            each[:, START] += carried
            row_parts.append(each)
            rows.append(each.sum(axis=1) * (1 + (n + 31) * 2.0**-53))  # n + 7 roundings
        new = np.max(rows, axis=0)
        if not (new <= largest).all():
            with np.errstate(over="ignore", invalid="ignore"):
                largest = np.maximum(largest, new * (1 + 2.0**-40))
            continue
        if not given.first:  # without a separate start, sums have fewer terms
            return np.array(rows), np.array(row_parts), lags
        after, after_parts = onward(arrays, given.first, lags, reach, size, largest)
        new = after.max(axis=0)
        if (new <= largest).all():
            turn = -(len(after) % period)  # so that the first of them is for the next step
            rows, row_parts = [*rows[-turn:], *rows[:-turn]], [*row_parts[-turn:], *row_parts[:-turn]]
            return np.concatenate([begin, after, rows]), np.concatenate([parts, after_parts, row_parts]), lags
        largest = np.maximum(largest, new * (1 + 2.0**-30))
    return np.full((1, n), math.inf), np.full((1, n, 4), math.inf), lags


def _from_measurements(
    given: Schedule, within: FilterLimits, most: int, for_ever: bool, steps: int, budget: float
) -> FilterLimits:
    r"""Derive limits on state and innovation of the exact filter from those on the measurements.

    The exact filter obeys :math:`x_k = \hat F x_{k-1} + \hat K z_k - \Delta F x_{k-1} - (\hat K - K)\nu_k`, where
    the last terms are small. The certificate of the error bound gives its worst-case peak gain.
    """
    n, m = given.program.n, given.program.m
    found = unit_disturbances(given)
    G = np.concatenate([found.K, found.loop, found.gain], axis=2)
    part = np.array([ROUNDING] * m + [LOOP] * n + [GAIN] * m)
    X, V = np.zeros(n), np.array(within.measurement)
    x0 = np.abs(given.x0.astype(np.float64)) * (1 + 2.0**-50)
    tiny = _product_share(n)
    HPhi = np.ascontiguousarray(given.HPhi[..., 0])
    early = steps if not for_ever else given.first + most if given.first or x0.any() else 0
    work = float(early + given.steps) * most * n * (n + G.shape[2])
    if work > PER_BUDGET * budget:
        raise ValueError(
            f"got limits on the measurements alone, and a filter that settles in {given.first:,} steps and whose "
            f"errors add up over {most:,}: limits on its states follow from about {work:.1g} multiplications; needed "
            f"at most {PER_BUDGET * budget:.1g}; give limits on the states and innovations, or budget="
            f"{work / PER_BUDGET:.1g} of guarantee(...)"
        )
    for _ in range(60):
        if not all(np.isfinite(each).all() for each in (X, V, given.dK)):
            break
        limit = np.concatenate([np.tile(a, (given.steps, 1)) for a in (within.measurement, X, V)], axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            slack = tiny * (np.abs(found.K) @ within.measurement + np.abs(found.gain) @ V) + given.dK @ V
            slack += (tiny * np.abs(found.loop) + found.spread) @ X
            scale = (np.abs(G) * limit[:, None, :]).sum(axis=2).max(axis=0) + 1e-300
        arrays = Columns(found.F, found.spread, G, limit, slack, part)
        end = End(most, scale, 1e-9 * float(scale.max()))
        peak_x, peak_v = peaks(arrays, HPhi, Sizes(X, within.measurement, x0), given.first, early, for_ever, end)
        peak_x, peak_v = np.minimum(peak_x, within.state), np.minimum(peak_v, within.innovation)
        if (peak_x <= X).all() and (peak_v <= V).all():
            return FilterLimits(X, V, within.measurement)
        X, V = np.maximum(X, peak_x * (1 + 2.0**-30)), np.maximum(V, peak_v * (1 + 2.0**-30))
    return FilterLimits(np.full(n, math.inf), np.full(m, math.inf), within.measurement)


def _product_share(n: int) -> float:
    """Largest relative error in float64 of the products of a row with n columns, low parts included."""
    return (2 * n + 30) * 2.0**-53


def _caps(given: Schedule, within: FilterLimits, most: int) -> NDArray[np.float64]:
    """Bound each operation's own linear function, more tightly than the peaks of the states do.

    The coefficients of the filter must never change, and its first estimate must be zero. The exact filter is then the
    program without roundings, and every number of it follows from the measurements alone.
    """
    program, first = given.program, given.program.n + given.program.m
    if given.steps != 1 or given.HPhi.any() or given.x0.any():
        return np.full(len(program.operations), math.inf)
    rows = np.empty((first + len(program.operations), first, 2))
    sizes = np.empty(rows.shape[:2])
    functionals(program.operations, given.coefficients[0], first, rows, sizes)
    of_state, of_input = rows[first:, : program.n, 0], np.abs(rows[first:, program.n :, 0])
    found = _disturbances(given, within, np.zeros(program.n))
    limit = np.array(within.measurement)[None, :]
    tiny = _product_share(program.n)
    slack = tiny * np.abs(found.K) @ within.measurement + found.spread @ within.state
    size = np.abs(found.K[0]) @ within.measurement + 1e-300
    part = np.zeros(program.m, dtype=np.int64)
    arrays = Columns(found.F, found.spread, found.K, limit, slack, part)
    peak = certify(arrays, np.ascontiguousarray(of_state), 1, 0, True, End(most, size, 1e-9 * float(size.max())))
    total = peak.sums.sum(axis=1) + (peak.residual + peak.tail) @ within.state + of_input @ within.measurement
    total += 2.0**-50 * sizes[first:] @ np.concatenate([within.state, within.measurement])
    return np.asarray(total * (1 + 2.0**-40))
