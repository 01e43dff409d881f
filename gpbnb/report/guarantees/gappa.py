"""Rounding errors of single steps of some filters: our bounds beside those of Gappa, for the same operations.

Both assume the same limits on the estimate and the measurement before the step, and on the exact estimate after it.

Gappa proves a bound for each operation from intervals. Where a rounding error reaches a state on several paths, it adds
their sizes; our bound adds their effects first.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import NamedTuple

import numpy as np

from gpbnb.bounds.guarantee import FilterGuarantee
from gpbnb.bounds.guess import FilterLimits, columns, float_errors, linear_steps, rounding_errors, value_sizes
from gpbnb.filters.program import ADD, MULTIPLY
from gpbnb.report.display.tables import Table, short
from gpbnb.report.guarantees.table import FORMAT, case_guarantee, case_named
from gpbnb.report.sweep import Number, Sweep
from gpbnb.report.sweep import columns as columns_of
from gpbnb.report.sweep import load as load_rows

FILTERS = ("tracker, 0 m from its origin", "PX4, landing target", "dynamax, tracking")
_RESULT = re.compile(r"v\d+ - e\d+ in \[(-?\d+)(?:b(-?\d+))?(?: \{[^}]*\})?, (-?\d+)(?:b(-?\d+))?")


class GappaRow(NamedTuple):
    """Bounds of the rounding error of one state after one step, in the unit of the state."""

    name: str
    state: int
    ours: Number
    gappa: Number


def single_step(found: FilterGuarantee) -> FilterGuarantee:
    """Return a guarantee whose limits are those of one step from any exact estimate and measurement."""
    H = np.abs(found.schedule.HPhi[-1, :, :, 0])
    X, V = found.limits.state, found.limits.innovation
    return replace(found, limits=FilterLimits(X, H @ X + H @ X + V, H @ X + V), bound=np.zeros(len(X)))


def ours(found: FilterGuarantee) -> list[float]:
    """Bound the rounding errors of one step by our columns."""
    given, program, b = found.schedule, found.schedule.program, found.bound
    step = linear_steps(given, np.array([given.steps - 1]))
    largest = float_errors(program, given.fmt, step)
    h = rounding_errors(program, step, value_sizes(step, found.limits), found.limits.state + b, b, largest)
    return [float(x) for x in np.abs(columns(program, step, h))[0].sum(axis=1)]


def script(found: FilterGuarantee) -> str:
    """Write the operations of the last step and the question of its rounding errors for Gappa."""
    program, X, Z = found.schedule.program, found.limits.state, found.limits.measurement
    c = [Fraction(float(high)) + Fraction(float(low)) for high, low in found.schedule.coefficients[-1]]
    limits = [Fraction(float(x)) for x in (*X, *Z)]
    lines = ["@r = float<24, -1000, ne>;"]
    lines += [f"v{i} = r(input{i});" for i in range(len(limits))]
    exact = [f"v{i}" for i in range(len(limits))]
    for v, (kind, a, b) in enumerate(program.operations.tolist(), len(limits)):
        sign = "*" if kind == MULTIPLY else "+" if kind == ADD else "-"
        left = [_binary(c[a])] * 2 if kind == MULTIPLY else [f"v{a}", exact[a]]
        lines += [f"v{v} = r({left[0]} {sign} v{b});", f"e{v} = {left[1]} {sign} {exact[b]};"]
        exact.append(f"e{v}")
    known = [*exact[: len(limits)], *(f"e{v}" for v in program.outputs.tolist())]
    sizes = zip(known, (*limits, *limits[: len(X)]), strict=True)
    inside = " /\\ ".join(f"{name} in [{_binary(-x)}, {_binary(x)}]" for name, x in sizes)
    goals = " /\\ ".join(f"v{v} - e{v} in ?" for v in program.outputs.tolist())
    return "\n".join([*lines, f"{{ {inside} -> {goals} }}", ""])


def _binary(x: Fraction) -> str:
    """Write an exact binary fraction for Gappa."""
    return f"{x.numerator}b-{x.denominator.bit_length() - 1}"


def gappa(text: str) -> list[float]:
    """Return the bounds that Gappa finds."""
    if shutil.which("gappa") is None:
        raise FileNotFoundError("got no program gappa; needed Gappa 1.4, for example from Debian's package gappa")
    done = subprocess.run(["gappa"], input=text, capture_output=True, text=True, check=False)
    found = _RESULT.findall(done.stdout + done.stderr)
    if done.returncode or not found:
        raise RuntimeError(f"got {done.stderr!r} from Gappa; needed bounds")
    sides = [[int(m) * 2.0 ** int(e or 0) for m, e in ((low, a), (high, b))] for low, a, high, b in found]
    return [max(map(abs, side)) for side in sides]


def _rows(name: str, bounds_of_gappa: Callable[[FilterGuarantee], Sequence[str]]) -> list[tuple[str, ...]]:
    case = case_named(name)
    found = single_step(case_guarantee(case, case.make(), FORMAT))
    pairs = zip(ours(found), bounds_of_gappa(found), strict=True)
    return [(name, str(i), f"{mine:.4g}", other) for i, (mine, other) in enumerate(pairs)]


def _computed(name: str) -> list[tuple[str, ...]]:
    return _rows(name, lambda found: [f"{bound:.4g}" for bound in gappa(script(found))])


def _sample(name: str, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Recompute the rows of a filter; without Gappa, keep its stored bounds."""
    if shutil.which("gappa"):
        return _computed(name)
    return _rows(name, lambda found: [row.gappa for row in load() if row.name == name])


SWEEP = Sweep("guarantees/gappa", columns_of(GappaRow), 2, lambda: FILTERS, _computed, sample=_sample)
load = partial(load_rows, SWEEP, GappaRow)


def table(rows: Sequence[GappaRow]) -> Table:
    """Tabulate both bounds."""
    header = ("filter", "state", "our bound for one step", "Gappa's", "Gappa's / ours")
    body = []
    for row in rows:
        mine, other = float(row.ours), float(row.gappa)
        state = case_named(row.name).states[row.state].removesuffix(", no unit")
        body.append((row.name, state, short(mine, 3), short(other, 3), short(other / mine, 3)))
    return Table("rounding errors of single steps", header, tuple(body))
