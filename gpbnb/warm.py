"""``python -m gpbnb warm``: compile all that the command ``wordlength`` needs, so that later runs start at once."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

BASES = (2, 10, 16)
"""Bases of the formats."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(
        prog="python -m gpbnb.warm",
        description="Compile all that python -m gpbnb wordlength needs, so that later runs start at once. This takes "
        "several minutes; what is compiled already is only loaded.",
    )
    made.add_argument(
        "--base", type=int, choices=BASES, action="append", help="only formats of this base; default: all"
    )
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Compile for each kind of run, show which and how many, and return the exit status."""
    given = parser().parse_args(arguments)
    runs = list(kinds(given.base or BASES))
    began = time.monotonic()
    for number, (name, run) in enumerate(runs, start=1):
        print(f"{number} of {len(runs)}, after {time.monotonic() - began:.0f} s: {name}", flush=True)
        run()
    print(f"all {len(runs)} kinds of runs are compiled, after {time.monotonic() - began:.0f} s", flush=True)
    return 0


def kinds(bases: Sequence[int]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield the name of each kind of run, and a short run of this kind.

    Kinds differ in the base, the range, the rounding and the basis: to nearest and chopped, as in the reports, have
    loops of their own, and the other roundings share one.
    """
    # These imports take a second, and the help needs none of them.
    from gpbnb.arithmetic.fixed import FixedFormat
    from gpbnb.arithmetic.formats import FloatFormat
    from gpbnb.bounds.guarantee import limits
    from gpbnb.filters.model import LinearModel
    from gpbnb.filters.system import LinearSystem
    from gpbnb.wordlength.judging import judge
    from gpbnb.wordlength.precision import required_precision

    model = LinearModel([[1, "0.1"], [0, "0.9"]], [[1, 0]], [["0.01", 0], [0, "0.01"]], [[1]], [0, 0], [[1, 0], [0, 1]])
    system, z, within = LinearSystem([["0.9"]], [["0.1"]]), [[1], [2], [1]], limits(2, 1, 10, 10)
    yield "simulated measurements and the reference", partial(required_precision, model, 3, 1, largest=12)
    yield "bounds of a linear system", partial(required_precision, system, 3, 1, basis="bound", z=z, largest=24)
    for base in bases:
        digits = 8 if base == 2 else 4
        for limited, rounding in ((False, "nearest"), (False, "chop"), (False, "even"), (True, "even")):
            span = (-20, 20) if limited else (None, None)
            fmt = FloatFormat(base, digits, rounding, *span)
            name = f"base {base}, {rounding}{', limited range' if limited else ''}"
            yield f"{name}: linear system", partial(judge, system, fmt, 3, 1, z=z)
            for form in ("innovation", "UD"):
                for basis in ("emulation", "bound"):
                    yield f"{name}: {form}, {basis}", partial(judge, model, fmt, 3, 1, form, basis, z)
            yield f"{name}: guarantee", partial(judge, model, fmt, 3, 1, "innovation", "guarantee", None, within)
    yield "fixed point: linear system", partial(judge, system, FixedFormat(6, 9), 3, 1, z=z)
    yield "fixed point: Kalman filter", partial(judge, model, FixedFormat(6, 9), 3, 1, z=z)


if __name__ == "__main__":
    sys.exit(main())
