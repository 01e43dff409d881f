"""Tables of the chapter on matrix inversion."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from gpbnb.arithmetic.named import arithmetic
from gpbnb.report.display.tables import Table, scientific, short
from gpbnb.report.inversion.costs import Price
from gpbnb.report.inversion.example import PLACES, PRINTED, Agreements, PrintedColumn, SectionClaim
from gpbnb.report.inversion.existence import Possible
from gpbnb.report.inversion.experiment import Frozen, InverseTrial


def table1(found: Sequence[Agreements]) -> Table:
    """Show the six numbers of Table 1 as printed, and beside each the number of the reading that comes closest."""
    names = {"bound": "By proposed method", "error": "Actual value"}
    header = ["places after decimal point"]
    columns = []
    for one in found:
        header += [f"{names[one.column]}, printed", f"{names[one.column]}, closest reading"]
        columns += [[float(value) for value in PRINTED[one.column]], one.closest.values]
    body = [(str(places), *(scientific(column[i], 4) for column in columns)) for i, places in enumerate(PLACES)]
    return Table("Table 1 as printed and as computed", tuple(header), tuple(body))


def searches(found: Sequence[Agreements]) -> Table:
    """Count the numbers of all readings that agree with the printed ones, and show the closest reading."""
    header = (
        "column",
        "readings",
        "numbers that agree in four digits",
        "expected by chance",
        "closest reading",
        "its numbers / printed numbers",
    )
    body = [
        (
            {"bound": "By proposed method", "error": "Actual value"}[one.column],
            str(one.readings),
            f"{one.agreements} of {one.numbers}",
            f"{one.expected:.2g}",
            _reading(one.closest),
            ", ".join(f"{ratio:.3g}" for ratio in one.closest.ratios),
        )
        for one in found
    ]
    return Table(f"{len(body)} searches", header, tuple(body))


def claims(found: Sequence[SectionClaim]) -> Table:
    """Count the readings in which each sentence about Table 1 holds."""
    body = [(one.name, f"{one.holds} of {one.readings}", in_math(one.exception) or "none") for one in found]
    return Table(f"{len(body)} claims", ("claim", "holds in", "first exception"), tuple(body))


def possibilities(found: Sequence[Possible]) -> Table:
    """Show, for each wordlength and norm, which printed errors some matrix of that wordlength has."""
    lines: dict[tuple[str, str, str], list[str]] = {}
    for one in found:
        wordlength = (
            one.wordlength.kind if one.reference == "given" else f"{one.wordlength}, matrix rounded to this format"
        )
        key = wordlength, one.norm, "relative" if one.relative else "absolute"
        lines.setdefault(key, []).append("no" if one.witness is None else "yes")
    header = (
        "wordlength",
        "norm",
        "kind of error",
        *(f"{p} places: {v}" for p, v in zip(PLACES, PRINTED["error"], strict=True)),
    )
    return Table(
        "settings that could give the printed errors", header, tuple((*key, *line) for key, line in lines.items())
    )


def violations(result: Frozen, bounds: Sequence[str]) -> Table:
    """Count the regular matrices of all families whose inverse has an error above a bound, one line for each bound."""
    body = []
    for name in bounds:
        (row,) = result.select(family="all", format="all", bound=name)
        exceeded, regular = int(row["violations_regular"]), int(row["regular"])
        body.append((in_math(name), f"{regular:,}", f"{exceeded:,}", f"{exceeded / regular:.1%}"))
    header = ("bound", "inverses", "error above the bound", "share")
    return Table(f"{len(body)} bounds", header, tuple(body))


def summary(result: Frozen, bounds: Sequence[str]) -> Table:
    """Show how often each bound of a sweep does not exist or fails, and its ratio to the error."""
    keys = ("absent", "violations", "smallest", "median", "largest")
    body = []
    for name in bounds:
        (row,) = result.select(family="all", format="all", bound=name)
        ratios = (scientific(float(row[key]), 4) if "e" in row[key] else row[key] for key in keys[2:])
        body.append((in_math(name), *(f"{int(row[key]):,}" for key in keys[:2]), *ratios))
    header = ("bound", "gives no bound", "error above the bound", *(f"bound / error, {name}" for name in keys[2:]))
    return Table(f"{len(body)} bounds", header, tuple(body))


def prices(found: Sequence[Price], sizes: Sequence[int]) -> Table:
    """Tabulate sharpness and cost of each bound: median of bound / error by number of rows, operations, digits."""
    body = [
        (one.bound, *(short(ratio, 3) for ratio in one.ratios), f"{one.operations:.2g}", one.digits) for one in found
    ]
    header = ("bound", *(f"bound / error, n = {n}" for n in sizes), "operations / those of the inverse", "digits")
    return Table(f"Sharpness and cost of {len(body)} bounds", header, tuple(body))


def worst(trials: Mapping[str, InverseTrial]) -> Table:
    """Show, for each bound, the inverse whose error exceeds it the most."""
    body = [
        (
            in_math(name),
            f"{one.family}, {one.n} rows, {'with' if one.pivot else 'without'} pivoting",
            arithmetic(one.matrix.format),
            f"{one.condition:.0f}",
            f"{one.ratio(name):.3g}",
        )
        for name, one in trials.items()
    ]
    header = ("bound", "matrix", "format", "condition number", "error / bound")
    return Table(f"{len(body)} inversions", header, tuple(body))


def worked(trials: Mapping[str, InverseTrial], bounds: Sequence[str]) -> Table:
    """Show single inverses: the matrix, its computed inverse, the error and each bound."""
    body = [
        (
            in_math(name),
            "; ".join(" ".join(map(str, row)) for row in one.matrix),
            "; ".join(" ".join(map(str, row)) for row in one.computed),
            scientific(float(one.error), 4),
            *(scientific(one.bounds[bound], 4) if bound in one.bounds else "none" for bound in bounds),
        )
        for name, one in trials.items()
    ]
    header = ("example", "matrix, by rows", "computed inverse", "error norm", *map(in_math, bounds))
    return Table(f"{len(body)} worked examples", header, tuple(body))


def _reading(one: PrintedColumn) -> str:
    return f"{one.wordlength}; {in_math(one.detail)}; {one.norm}, {'relative' if one.relative else 'absolute'}"


def in_math(text: str) -> str:
    """Spell out the name of a reading or bound, with mathematics."""
    return "".join(_WORDS.get(word, word) for word in re.split("(, |: )", text))


_WORDS = {
    "A": "$A^{-1}$",
    "A_T": "$A_T^{-1}$",
    "signed": "with signs",
    "sizes": "absolute values",
    "chart": "norm of (95)",
    "(96)": "product (96)",
    "a posteriori": "residual",
}
