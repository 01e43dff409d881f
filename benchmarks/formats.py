"""Compare the short formats with gfloat, word for word and at each rounding boundary: ``python -m benchmarks.formats``.

Every word of a finite number is decoded. Every number is converted, as are five numbers in each gap between neighbours,
among them the tie and two numbers beside it, and numbers beyond the range, which saturate. Both signs and five
roundings.

It needs gfloat, which ``make bench`` installs, takes a few seconds, and leaves its counts in ``benchmarks/results``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import named
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.report.display.tables import Table

RESULTS = Path(__file__).parent / "results"

FORMATS: dict[str, tuple[Any, str]] = {
    "FP8 E4M3": (named.FP8_E4M3, "e4m3"),
    "FP8 E5M2": (named.FP8_E5M2, "e5m2"),
    "FP6 E3M2": (named.FP6_E3M2, "e3m2"),
    "FP6 E2M3": (named.FP6_E2M3, "e2m3"),
    "FP4 E2M1": (named.FP4_E2M1, "e2m1"),
    "INT8": (FixedFormat(1, 6), "int8"),
}
"""Each format, and the end of its name in gfloat."""

ROUNDINGS = {
    "even": "TiesToEven",
    "nearest": "TiesToAway",
    "chop": "TowardZero",
    "up": "TowardPositive",
    "down": "TowardNegative",
}


def arguments(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each number, five in each gap, and some beyond the range."""
    gaps = np.diff(numbers)
    within = [numbers[:-1] + gaps * share for share in (0.25, 0.5 - 2.0**-30, 0.5, 0.5 + 2.0**-30, 0.75)]
    beyond = [end + outward * share for end, outward in ((numbers[-1], gaps[-1]), (numbers[0], -gaps[0]))
              for share in (0.25, 0.5 - 2.0**-30, 0.5, 0.5 + 2.0**-30, 0.75, 1, 2, 1e9)]  # fmt: skip
    return np.concatenate([numbers, *within, beyond])


def compared(fmt: Any, info: Any, gfloat: Any) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield what was compared, and whether each result is the same."""
    words = np.arange(2**info.k)
    values = np.array([gfloat.decode_float(info, int(word)).fval for word in words])
    finite = np.isfinite(values)
    yield "words", fmt.from_bits(words[finite]).to_float() == values[finite]
    given = arguments(np.unique(values[finite]))
    for name, mode in ROUNDINGS.items():
        ours = replace(fmt, rounding=name, overflow="saturate").array(given).to_float()
        theirs = [gfloat.round_float(info, float(x), gfloat.RoundMode[mode], True) for x in given]
        yield name, ours == np.array(theirs)


def measure() -> tuple[list[tuple[str, ...]], list[str]]:
    """Return the rows of the table, and what differs."""
    import gfloat
    import gfloat.formats

    rows, faults = [], []
    for name, (fmt, end) in FORMATS.items():
        info, counts, wrong = getattr(gfloat.formats, f"format_info_ocp_{end}"), [0, 0], 0
        for what, agree in compared(fmt, info, gfloat):
            counts[what != "words"] += len(agree)
            wrong += int((~agree).sum())
            if not agree.all():
                faults.append(f"{name}, {what}: {int((~agree).sum())} of {len(agree)} differ")
        rows.append((name, *(f"{count:,}" for count in counts), str(wrong)))
    return rows, faults


def main() -> int:
    rows, faults = measure()
    table = Table("formats", ("format", "words", "conversions", "different"), tuple(rows))
    text = f"{table.markdown()}\n\nCompared with gfloat {version('gfloat')}.\n"
    print(text, *faults, sep="\n")
    (RESULTS / "formats.md").write_text(text, encoding="utf-8")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
