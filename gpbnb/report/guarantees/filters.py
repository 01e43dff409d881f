"""Random Kalman filters against their guarantees, in the run that a user gets from the model as given.

A seed determines a model, a format, a form, limits and inputs. The guarantee of the filter is compared with runs of the
same model; errors are differences from the exact filter of the stored model. Inputs are random, constant, or chosen by
an adversary. A run counts until the exact filter leaves the limits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.named import rounding_text
from gpbnb.arithmetic.rounding import rounding_named
from gpbnb.bounds.guarantee import FilterGuarantee, closed_loops, guarantee
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.run import Run, reference_states
from gpbnb.report.display.tables import Table
from gpbnb.report.guarantees.adversary import attack, responses, shares_of
from gpbnb.report.guarantees.random_filters import (
    DETERMINISTIC,
    KINDS,
    LIMITED,
    RANGES,
    STEPS,
    Drawn,
    draw,
    innovations,
)
from gpbnb.report.sweep import Number, sweep_of_rows
from gpbnb.report.sweep import load as load_rows

FILTERS = 3_000
MOST, CANDIDATES = 1_000, 8
"""Steps until a gain must have settled; measurements that the adversary tries at each step."""
INPUTS = ("random", "constant", "chosen")


class FilterRow(NamedTuple):
    """A filter in a format, what its guarantee says, and the largest error / bound for each kind of input.

    `steps` counts the steps of all runs in which the exact filter was within its limits, `stopped` the runs that ended
    there although the filter was within them, and `gains` the steps in which the gain of a run is not the one for which
    the guarantee holds. The `result` is "for ever", "some steps", "no bound", "refused", or "failed" for an error that
    does not say what is wrong with the filter.
    """

    seed: int
    kind: str
    n: int
    m: int
    base: int
    precision: int
    rounding: str
    range: str
    form: str
    limited: str
    result: str = "refused"
    reason: str = "another"
    runs: int = 0
    steps: int = 0
    stopped: int = 0
    gains: int = 0
    random: Number = "0"
    constant: Number = "0"
    chosen: Number = "0"

    @property
    def largest(self) -> float:
        """Largest error / bound of all runs."""
        return max(float(self.random), float(self.constant), float(self.chosen))

    @property
    def wrong(self) -> bool:
        """Whether a run exceeds its bound or has other gains, or the answer fails without a reason."""
        return self.largest > 1 or self.gains > 0 or self.result == "failed"


def errors(drawn: Drawn, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], bool]:
    """Return errors of a user's run, (steps, n), until the exact filter leaves its limits, and whether it stopped."""
    run = Run(drawn.model, drawn.fmt, drawn.form, ())
    stored = run.exactly(run.pack_measurements(z))[:, :, 0]
    true = reference_states(drawn.stored, stored)
    at = first_outside(drawn, true[:, :, 0], stored.astype(np.float64), z)
    x = run.states(z[:at])
    off = x - true[: len(x)]
    return np.asarray(off[..., 0] + off[..., 1]), bool(run.stopped)


def first_outside(drawn: Drawn, true: NDArray[np.float64], stored: NDArray[np.float64], z: NDArray[np.float64]) -> int:
    """Return the number of steps after which the exact filter first leaves its limits, or all steps.

    Parameters
    ----------
    true : (steps, n), its estimates.
    stored, z : (steps, m), measurements as stored, and as given, for which their limits hold.
    """
    X = drawn.within
    innovation = innovations(drawn.stored, true, stored)
    inside = np.ones(len(z), dtype=bool)
    for values, limit in ((true, X.state), (innovation, X.innovation), (z, X.measurement)):
        inside &= (np.abs(values) <= limit).all(axis=1)
    return len(z) if inside.all() else int(inside.argmin())


def other_gains(drawn: Drawn, found: FilterGuarantee) -> int:
    """Return the number of steps in which a user's run has another gain than those for which the guarantee holds."""
    given = found.schedule
    steps = STEPS if found.steps is None else min(STEPS, found.steps)
    run = Run(drawn.model, drawn.fmt, drawn.form, range(1, steps + 1))
    run.take(np.zeros((steps, drawn.model.m)))
    same = run.coefficients() == given.packed[given.rows(np.arange(run.steps))]
    return int((~same.reshape(run.steps, -1).all(axis=1)).sum())


def inputs(drawn: Drawn, found: FilterGuarantee, rng: np.random.Generator) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Give the inputs of each run, (steps, m), and their kind."""
    n, m = drawn.model.n, drawn.model.m
    steps = STEPS if found.steps is None else min(STEPS, found.steps)
    F = closed_loops(found.schedule)
    for part in range(3):
        course = rng.uniform(-1, 1, (steps, m)) if part else rng.choice((-1.0, 1.0), (steps, m))
        yield "random", _admissible(drawn, found, course)
    if drawn.limited == "reached":
        yield "constant", np.broadcast_to(drawn.level, (steps, m))
    for _ in range(2 - (drawn.limited == "reached")):
        level = rng.choice((-1.0, 1.0), m) * rng.choice((1.0, rng.uniform()))
        yield "constant", _admissible(drawn, found, np.broadcast_to(level, (steps, m)))
    state = int(rng.integers(n))
    back = responses(found.schedule, F, state, steps)
    at = found.schedule.rows(np.arange(steps))
    course = np.sign(np.einsum("ki,kim->km", back, found.schedule.exact[at][..., 0]))
    yield "chosen", _admissible(drawn, found, course)
    for part in range(2):
        seed, center = int(rng.integers(2**31)), None
        if drawn.limited != "measurement":
            center = rng.choice((-1.0, 0.0, 1.0), n) * drawn.within.state
        try:
            outcome = attack(found, steps, CANDIDATES, seed, [(state + part) % n], center, 3 + 3 * part, steps / 4)
        except OverflowError:
            continue  # the format has a number that float64 cannot hold
        yield "chosen", outcome.z


_FACTORS = np.array([[0.999], [0.5], [0.0], [-0.5], [-0.999]])


def _admissible(drawn: Drawn, found: FilterGuarantee, course: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return measurements with a course of shares of their limits, or of the innovations' limits.

    An innovation that takes the state out of its limits is reduced or reversed.
    """
    if drawn.limited == "measurement":
        return course * drawn.within.measurement
    given, at = found.schedule, found.schedule.rows(np.arange(len(course)))
    X, V, Z = drawn.within
    of_state, of_innovation = (np.where(limit > 0, 1 / np.maximum(limit, 1e-300), 1e300) for limit in (X, V))
    x, z = given.x0.astype(np.float64), np.zeros(course.shape)
    for k, share in enumerate(course):
        seen, predicted, K = given.HPhi[at[k], :, :, 0] @ x, given.Phi[at[k], :, :, 0] @ x, given.exact[at[k], :, :, 0]
        tried = np.clip(seen + _FACTORS * share * V, -Z, Z)
        following = predicted + (tried - seen) @ K.T
        excess = np.maximum(
            (np.abs(following) * of_state).max(axis=1), (np.abs(tried - seen) * of_innovation).max(axis=1)
        )
        best = int(np.maximum(excess, 1 - 1e-6).argmin())  # the first of those that are admissible
        x, z[k] = following[best], tried[best]
    return z


def examine(
    seed: int, drawn: Drawn | None = None, bounded: Callable[..., FilterGuarantee] = guarantee, smaller: float = 1.0
) -> FilterRow:
    """Compute one row; its seed determines all random numbers.

    Parameters
    ----------
    drawn : the filter; by default the one of the seed.
    bounded : function that computes the guarantee.
    smaller : factor of the bound, below 1 for a guarantee that promises too much.
    """
    given = draw(seed) if drawn is None else drawn
    row = _unexamined(seed, given)
    try:
        found = bounded(given.model, given.fmt, given.within, given.form, most=MOST, horizon=STEPS)
    except (ValueError, ArithmeticError) as error:
        reason = reason_of(str(error))
        return row._replace(result="failed" if reason == "another" else "refused", reason=reason)
    row = row._replace(
        result="for ever" if found.for_ever else "some steps" if found.steps else "no bound",
        reason="" if found.for_ever else reason_of(found.why),
    )
    if row.result == "no bound":
        return row
    row = row._replace(gains=other_gains(given, found))
    rng, worst = np.random.default_rng([36, seed]), dict.fromkeys(INPUTS, 0.0)
    for kind, z in inputs(given, found, rng):
        try:
            off, ended = errors(given, z)
        except ArithmeticError:
            continue  # the format cannot store a measurement, or the exact filter needs too many digits
        off = off[: found.steps]
        row = row._replace(runs=row.runs + (len(off) > 0), steps=row.steps + len(off), stopped=row.stopped + ended)
        reached = shares_of(np.abs(off).max(axis=0, initial=0.0), smaller * found.bound)
        worst[kind] = max(worst[kind], float(reached.max()))
    # No rounding may hide that a bound is exceeded.
    ratios = (f"{worst[kind]:.4g}" if worst[kind] <= 1 else f"{worst[kind]:.17g}" for kind in INPUTS)
    return FilterRow(*row[: -len(INPUTS)], *ratios)  # type: ignore[arg-type]


def _unexamined(seed: int, drawn: Drawn) -> FilterRow:
    """Return the row of a filter whose guarantee refuses an answer."""
    fmt, model, form = drawn.fmt, drawn.model, drawn.form.name.lower()
    kind = "unlimited" if fmt.emin is None else "subnormal" if fmt.subnormal else "flushed"
    about = drawn.kind, model.n, model.m, fmt.base, fmt.precision, fmt.rounding.value, kind, form, drawn.limited
    return FilterRow(seed, *about)


def reason_of(text: str) -> str:
    """Return the short name of the reason why there is no bound that holds for ever."""
    known = {
        "with compiled loops": "no compiled loops",
        "range": "beyond the range",
        "normal numbers": "beyond the range",
        "largest": "beyond the range",
        "at most": "beyond the range",
        "definite": "indefinite covariance",
        "singular": "indefinite covariance",
        "settle": "gain not settled",
        "not stable": "unstable loop",
        "as large as itself": "too few digits",
        "not proved": "not proved",
    }
    return next((name for part, name in known.items() if part in text), "another")


# -- the stored survey ------------------------------------------------------------------------------------------------


def _wrong(file: Path) -> list[str]:
    return [" ".join(map(str, row)) for row in load(file) if row.wrong]


SWEEP = sweep_of_rows("guarantees/filters", FilterRow, lambda: range(FILTERS), examine, faults=_wrong)
load = partial(load_rows, SWEEP, FilterRow)


_VALUES: dict[str, Sequence[Any]] = {
    "form": [form.name.lower() for form in WITH_PROGRAM],
    "rounding": [rounding.value for rounding in DETERMINISTIC],
    "kind": KINDS,
    "range": RANGES,
    "limited": LIMITED,
}


def groups(rows: Sequence[FilterRow], name: str) -> dict[Any, list[FilterRow]]:
    """Return the filters with each value of a column, in the order in which they are drawn, or of their size."""
    values = _VALUES.get(name) or sorted({getattr(row, name) for row in rows})
    found = {value: [row for row in rows if getattr(row, name) == value] for value in values}
    return {value: chosen for value, chosen in found.items() if chosen}


def table(rows: Sequence[FilterRow]) -> Table:
    """Count results and runs by form, base, rounding, kind of model, range and limits, with the largest ratios."""
    header = ("group", "filters", "for ever", "some steps", "no answer", "runs", *(f"{kind} inputs" for kind in INPUTS))
    body = []
    for name in ("form", "base", "rounding", "kind", "range", "limited"):
        for value, chosen in groups(rows, name).items():
            label = value
            if name == "form":
                label = str(Form[value.upper()])
            elif name == "rounding":
                label = rounding_text(rounding_named(value))
            elif name == "base":
                label = f"base {value}"
            results, runs = Counter(row.result for row in chosen), sum(row.runs for row in chosen)
            known = results["for ever"], results["some steps"]
            worst = (max(float(getattr(row, kind)) for row in chosen) for kind in INPUTS)
            cells = (*map(str, (len(chosen), *known, len(chosen) - sum(known), runs)),)
            body.append((label, *cells, *(f"{ratio:.3f}" if runs else "–" for ratio in worst)))
    return Table("random filters against their guarantees", header, tuple(body))


def reasons(rows: Sequence[FilterRow]) -> Table:
    """Tabulate why filters have no guarantee for ever."""
    found = Counter((row.result, row.reason) for row in rows if row.result != "for ever")
    body = tuple((*pair, str(found[pair])) for pair in sorted(found, key=lambda pair: -found[pair]))
    return Table("reasons why there is no guarantee for ever", ("answer", "reason", "filters"), body)
