"""Tables of the chapters on the year of Gravity Probe B."""

from __future__ import annotations

from collections.abc import Sequence

from gpbnb.arithmetic.named import arithmetic
from gpbnb.filters.forms import Form
from gpbnb.report.display.tables import Table
from gpbnb.report.gravity_probe_b import threshold
from gpbnb.report.gravity_probe_b.answers import Moved
from gpbnb.report.gravity_probe_b.mission import PARAMETERS
from gpbnb.report.gravity_probe_b.threshold import Share


def shares(found: Sequence[Share]) -> Table:
    """Tabulate the share of records within the tolerance for a year, with its 95 % limits, and quantiles."""
    rows = [
        (
            in_words(each.states),
            in_words(each.form),
            arithmetic(each.fmt),
            f"{each.within} of {each.records}",
            f"{each.low:.3f} to {each.high:.3f}",
            *(f"{each.quantile(p):.2g}" for p in (0.5, 0.9, 1.0)),
            f"{each.quantile_limit:.2g}",
        )
        for each in found
    ]
    head = (
        "state",
        "form",
        "arithmetic",
        "within tolerance",
        "probability",
        "median",
        "90 %",
        "largest",
        "upper limit for 99 % of records",
    )
    return Table("records that stay within a milliarcsecond for a year", head, tuple(rows))


def parameters() -> Table:
    """Tabulate the numbers of the mission model with their sources."""
    rows = tuple((each.name, f"{each.value:g}", each.unit, each.source) for each in PARAMETERS)
    return Table("parameters of the mission model", ("parameter", "value", "unit", "source"), rows)


_WORDS = {"hung": str(Form.HUNG), "ud": str(Form.UD), "joseph": str(Form.JOSEPH)} | {
    "nearest": "rounded to nearest",
    "chop": "chopped",
    "absolute": "absolute angles",
    "deviation": "deviations",
}


def in_words(name: str) -> str:
    """Return the words that a reader knows for a stored name of a form, a rounding or a choice of states."""
    return _WORDS.get(name, name)


def sensitivity(moved: Sequence[Moved]) -> Table:
    """Tabulate by how many bits each choice changes the answer."""
    rows = tuple(
        (
            each.choice,
            in_words(each.before),
            in_words(each.after),
            f"{each.bits:+.1f}".replace("-", "−"),
            str(each.records),
        )
        for each in moved
    )
    return Table("what moves the answer", ("choice", "from", "to", "bits", "records (at least)"), rows)


def needed_precisions(found: Sequence[Share]) -> Table:
    """Tabulate the smallest precisions that meet the tolerance with a probability of 99 %, and the records used.

    There is a row for each kind of formats. The counts and the 95 % limits are those of the smallest precision at which
    99 % of the records stay within the tolerance.
    """
    groups: dict[tuple[str, ...], list[Share]] = {}
    for each in found:
        fmt = each.fmt
        unit = "bits" if fmt.base == 2 else "decimal digits"
        groups.setdefault((each.setting, each.states, each.form, fmt.rounding.value, unit), []).append(each)
    rows = []
    for (setting, states, form, rounding, unit), group in groups.items():
        answer = threshold.needed(group)
        observed, lognormal, shown = ("none" if each is None else f"{each} {unit}" for each in answer)
        at = next((each for each in group if each.fmt.precision == answer.observed), None)
        passed, limits = (f"{at.within} of {at.records}", f"{at.low:.3f} to {at.high:.3f}") if at else ("–", "–")
        rows.append(
            (
                f"{setting}, {in_words(states)}",
                f"{in_words(form)}, {in_words(rounding)}",
                observed,
                passed,
                limits,
                lognormal,
                shown,
            )
        )
    head = (
        "model and states", "form and rounding", "99 % of the records", "passed", "probability", "99 %, lognormal",
        "99 %, proved with 95 % confidence",
    )  # fmt: skip
    return Table("smallest precision that stays within a milliarcsecond", head, tuple(rows))
