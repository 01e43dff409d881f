"""Compare nonlinear filters and systems with plain loops over fractions: ``python -m benchmarks.nonlinear``.

Each filter follows a vehicle that passes a beacon, with noises that differ by powers of two. Each system takes a step
of 25 random operations. A run that overflows, or divides by zero, must do so in both at the same step.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.nonlinear_run import NonlinearRun
from tests.plain_nonlinear import MOTIONS, STEPS, UNSCENTED, PlainFilter, PlainUnscented, case, drawn
from tests.plain_structures import fixed, floating, limited

Rounds = Callable[[Fraction], Fraction]


def _word(integer: int, fraction: int, rounding: str, overflow: str = "raise") -> tuple[FixedFormat, Rounds]:
    r, keep = fixed(fraction, rounding), limited(fraction, integer, overflow)
    return FixedFormat(integer, fraction, rounding, overflow), lambda x: keep(r(x))


FORMATS: dict[str, tuple[Any, Rounds]] = {
    f"{digits} digits of base {base}, {rounding}": (
        FloatFormat(base, digits, rounding),
        floating(base, digits, rounding),
    )
    for base, digits, rounding in (
        (2, 8, "even"),
        (2, 11, "nearest"),
        (2, 24, "even"),
        (2, 24, "chop"),
        (2, 53, "even"),
        (2, 13, "up"),
        (2, 60, "odd"),
        (10, 7, "nearest"),
        (10, 12, "down"),
        (16, 6, "chop"),
    )
} | {
    "Q9.30, nearest": _word(9, 30, "nearest"),
    "Q7.24, odd": _word(7, 24, "odd"),
    "Q5.10, chop": _word(5, 10, "chop"),
}
LIMITED = {
    "Q10.14, odd, saturate": _word(10, 14, "odd", "saturate"),
    "Q8.9, up, wrap": _word(8, 9, "up", "wrap"),
}
"""Formats that change a number beyond their range, of systems only."""

KINDS: dict[str, tuple[Form, int, bool]] = {
    "innovation": (Form.INNOVATION, 1, False),
    "Joseph": (Form.JOSEPH, 1, False),
    "UD": (Form.UD, 1, False),
    "innovation, iterated": (Form.INNOVATION, 3, False),
    "UD, iterated": (Form.UD, 2, False),
    "unscented": (Form.INNOVATION, 1, True),
}
SEEDS = 10
SYSTEMS = 200  # for each format
SYSTEM_STEPS = 20


class Count(NamedTuple):
    """Numbers compared in runs of one kind in one format, runs that stopped early, and runs that differ."""

    fmt: str
    kind: str
    compared: int
    stopped: int
    different: int


def filtered(kind: str, n: int, seed: int, fmt: Any, r: Rounds) -> tuple[list[Any], list[Any]]:
    """Estimates and last covariance of a filter by the package, and by plain loops; after a failure, its step."""
    form, iterations, unscented = KINDS[kind]
    options = UNSCENTED if unscented else {"iterations": iterations}
    model, z, sight, given, u = case(MOTIONS[n], seed, 4, **options)
    run = NonlinearRun(model, fmt, form, range(1, STEPS + 1))
    run.take(z)
    found = [*run.checkpoints().x.tolist(), run.stopped or run.P.to_fractions().tolist()]
    if unscented:
        plain = PlainUnscented(MOTIONS[n], sight, given, form, r)
    else:
        plain = PlainFilter(MOTIONS[n], sight, given, form, r, iterations=iterations)
    expected: list[Any] = []
    try:
        for measured, known in zip(z.tolist(), u.tolist(), strict=True):
            plain.step(measured, known)
            expected.append(list(plain.x))
    except (ZeroDivisionError, OverflowError, ValueError):
        return found, [*expected, len(expected) + 1]
    return found, [*expected, plain.P]


def stepped(seed: int, fmt: Any, r: Rounds) -> tuple[list[Any], list[Any]]:
    """States and outputs of a random system by the package, and by plain steps; after a failure, nothing."""
    system, plain = drawn(seed)
    u = np.random.default_rng([seed, 2]).uniform(-1, 1, (SYSTEM_STEPS, system.m))
    try:
        found = system.states(fmt, u).to_fractions().tolist()
    except (OverflowError, ZeroDivisionError):
        found = []
    expected: list[Any] = []
    try:
        x = [r(each) for each in system.x0]
        for row in u.tolist():
            x, outputs = plain(r, x, [r(Fraction(each)) for each in row])
            expected.append([*x, *outputs])
    except (OverflowError, ZeroDivisionError):
        expected = []
    return found, expected


def compare(fmt: str, kind: str, seeds: range) -> Count:
    """Compare filters of one kind, or systems, for some seeds."""
    given = (FORMATS | LIMITED)[fmt]
    if kind == "systems":
        pairs = [stepped(seed, *given) for seed in seeds]
    else:
        pairs = [filtered(kind, n, seed, *given) for seed in seeds for n in MOTIONS]
    compared = sum(len(row) for _, expected in pairs for row in expected if isinstance(row, list))
    stopped = sum(not expected or isinstance(expected[-1], int) for _, expected in pairs)
    return Count(fmt, kind, compared, stopped, sum(found != expected for found, expected in pairs))


def run(seeds: range, systems: range, formats: Any = FORMATS | LIMITED, kinds: Any = KINDS) -> Iterator[Count]:
    """Compare filters of each kind and systems, in all formats or some."""
    for fmt in formats:
        if fmt in FORMATS:
            yield from (compare(fmt, kind, seeds) for kind in kinds)
        yield compare(fmt, "systems", systems)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.nonlinear", description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, help=f"seeds of each kind of filter, {SEEDS} by default")
    parser.add_argument("--systems", type=int, default=SYSTEMS, help=f"systems in each format, {SYSTEMS} by default")
    options = parser.parse_args()
    total = len(FORMATS) * len(KINDS) + len(FORMATS | LIMITED)
    counts = list(tqdm(run(range(options.seeds), range(options.systems)), total=total))
    for fmt in FORMATS | LIMITED:
        mine = [count for count in counts if count.fmt == fmt]
        compared, stopped, different = (sum(each[at] for each in mine) for at in (2, 3, 4))
        print(f"{fmt:30}{compared:>12,} numbers{stopped:>8,} runs stopped{different:>6,} differ")
    compared, different = sum(count.compared for count in counts), sum(count.different for count in counts)
    print(f"{compared:,} numbers compared, {different or 'no'} runs different")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
