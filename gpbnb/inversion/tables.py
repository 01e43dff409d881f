"""Tables of the chapter on matrix inversion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gpbnb.display.tables import Table, digits, scientific
from gpbnb.inversion.example import PLACES, PRINTED, Claim, Column, Search
from gpbnb.inversion.existence import Possible
from gpbnb.inversion.experiment import Frozen, Trial


def table1(readings: Sequence[tuple[Column, Column]]) -> Table:
    """The six numbers of Table 1 in some readings, each with its ratio to the printed one."""
    header = ("wordlength", "reading", *(f"{name}, {p}" for name in ("bound", "error") for p in PLACES))
    values = (float(value) for name in ("bound", "error") for value in PRINTED[name])
    printed = ("as printed", "", *(scientific(value, 4) for value in values))
    body = [
        (
            str(bound.wordlength),
            in_math(bound.detail),
            *(
                f"{scientific(value, 4)} ({ratio:.3g})"
                for column in (bound, error)
                for value, ratio in zip(column.values, column.ratios, strict=True)
            ),
        )
        for bound, error in readings
    ]
    return Table(f"Table 1 in {len(body)} readings", header, (printed, *body))


def searches(found: Sequence[Search]) -> Table:
    """Agreements between readings and print, beside chance, and the reading that comes closest."""
    header = (
        "column",
        "readings",
        "numbers",
        "agree in four digits",
        "expected by chance",
        "closest reading",
        "its numbers",
        "over the print",
    )
    body = [
        (
            {"bound": "By proposed method", "error": "Actual value"}[one.column],
            str(one.readings),
            str(one.numbers),
            str(one.agreements),
            f"{one.expected:.2g}",
            _reading(one.closest),
            ", ".join(scientific(value, 4) for value in one.closest.values),
            ", ".join(f"{ratio:.3g}" for ratio in one.closest.ratios),
        )
        for one in found
    ]
    return Table(f"{len(body)} searches", header, tuple(body))


def claims(found: Sequence[Claim]) -> Table:
    """In how many readings each sentence about Table 1 holds."""
    body = [(one.name, f"{one.holds} of {one.readings}", in_math(one.exception) or "none") for one in found]
    return Table(f"{len(body)} claims", ("claim", "holds in", "first exception"), tuple(body))


def possibilities(found: Sequence[Possible]) -> Table:
    """Which of the printed errors some matrix of numbers of a wordlength has, in each norm."""
    lines: dict[tuple[str, str, str], list[str]] = {}
    for one in found:
        wordlength = one.wordlength.kind if one.reference == "given" else f"{one.wordlength}, matrix stored so"
        key = wordlength, one.norm, "relative" if one.relative else "absolute"
        lines.setdefault(key, []).append("no" if one.witness is None else "yes")
    header = (
        "wordlength",
        "norm",
        "error",
        *(f"{p} places: {v}" for p, v in zip(PLACES, PRINTED["error"], strict=True)),
    )
    return Table(f"{len(found)} searches", header, tuple((*key, *line) for key, line in lines.items()))


def violations(result: Frozen, bounds: Sequence[str], regular: bool = False) -> Table:
    """Violations of some bounds by family of matrices, of how many inversions; or of the regular matrices alone."""
    trials, counts = ("regular", "violations_regular") if regular else ("trials", "violations")
    families = [str(row["family"]) for row in result.select(format="all", bound=bounds[0])]
    body = []
    for family in families:
        rows = [result.select(family=family, format="all", bound=name)[0] for name in bounds]
        body.append((family, rows[0][trials], *(row[counts] for row in rows)))
    header = ("matrices", "inversions", *map(in_math, bounds))
    return Table(f"violations in {len(body)} families", header, tuple(body))


def summary(result: Frozen, bounds: Sequence[str]) -> Table:
    """Each bound over all inversions of a sweep: how often it says nothing, is violated, and how far it is off."""
    keys = ("trials", "absent", "violations", "smallest", "median", "largest")
    body = []
    for name in bounds:
        (row,) = result.select(family="all", format="all", bound=name)
        ratios = (scientific(float(row[key]), 4) if "e" in row[key] else row[key] for key in keys[3:])
        body.append((in_math(name), *(row[key] for key in keys[:3]), *ratios))
    names = (f"bound / error: {name}" for name in keys[3:])
    return Table(f"{len(body)} bounds", ("bound", "inversions", "says nothing", "exceeded", *names), tuple(body))


def worst(trials: Mapping[str, Trial]) -> Table:
    """For each bound the inverse whose error exceeds it the most."""
    body = [
        (
            in_math(name),
            f"{one.family}, {one.n} rows",
            f"{digits(one.matrix.format)}, {one.matrix.format.rounding.value}",
            "yes" if one.pivot else "no",
            f"{one.condition:.0f}",
            scientific(float(one.error), 4),
            scientific(one.bounds[name], 4),
            f"{one.overestimation(name):.3g}",
        )
        for name, one in trials.items()
    ]
    header = ("bound", "matrix", "format", "pivoting", "condition", "error", "its bound", "bound / error")
    return Table(f"{len(body)} inversions", header, tuple(body))


def worked(trials: Mapping[str, Trial], bounds: Sequence[str]) -> Table:
    """Single inverses: the matrix, what the format makes of it, its error, and each bound."""
    body = [
        (
            in_math(name),
            "; ".join(" ".join(map(str, row)) for row in one.matrix),
            digits(one.matrix.format),
            "; ".join(" ".join(map(str, row)) for row in one.computed),
            scientific(float(one.error), 4),
            *(scientific(one.bounds[bound], 4) if bound in one.bounds else "none" for bound in bounds),
        )
        for name, one in trials.items()
    ]
    header = ("example", "matrix, by rows", "format", "computed inverse", "error", *map(in_math, bounds))
    return Table(f"{len(body)} worked examples", header, tuple(body))


def _reading(one: Column) -> str:
    return f"{one.wordlength}; {in_math(one.detail)}; {one.norm}, {'relative' if one.relative else 'absolute'}"


def in_math(text: str) -> str:
    """Set the inverse in the name of a reading in mathematics."""
    words = text.split(", ")
    return ", ".join({"A": "$A^{-1}$", "A_T": "$A_T^{-1}$"}.get(word, word) for word in words)
