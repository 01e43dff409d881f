"""Section 11.4: the numerical example and its Table 1."""

from __future__ import annotations

from functools import cache

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact
from gpbnb.report.inversion import example, existence
from gpbnb.report.ledger.checks.inversion.registry import CHECKS
from gpbnb.report.ledger.checks.inversion.samples import Sample
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.formula import Number
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, load_statements, statement


@CHECKS.add(*both("s11-4.reference-to-figure-1"))
def reference_to_figure(printed: Statement) -> Finding:
    charts = {
        each.item.split(" (")[0]
        for each in load_statements()
        if each.kind == "figure" and each.document == printed.document and each.id in CHECKS
    }
    return compare(
        printed.says("figure") in charts,
        f"the only flow chart of these sections is {', '.join(charts)}",
        Verdict.MISPRINT if len(charts) == 1 else Verdict.INCONSISTENT,
        otherwise_note="Figure III-1 is meant",
    )


@cache
def _reference_norms() -> tuple[float, ...]:
    """Return the relative changes of the error norms if an inverse of 20 digits replaces the true one."""
    reference = exact(linalg.inv(FloatFormat(10, 20).array(example.MATRIX)))
    apart = []
    for places in example.PLACES:
        sample = Sample(FloatFormat(10, places + 1).array(example.MATRIX), False)
        true = column_sum_norm(sample.error)
        apart.append(float(abs(column_sum_norm(sample.reduction.solution - reference) / true - 1)))
    return tuple(apart)


@CHECKS.add(*both("s11-4.claim-actual-norms"))
def actual_norms(printed: Statement) -> Finding:
    apart = max(_reference_norms())
    true = "exactly" if apart == 0 else "approximately" if apart < 1e-6 else "not"
    return compare(
        printed.says("how") == true,
        (
            "with an inverse computed in 20 digits in place of the true inverse, the norms change by at "
            f"most {apart:.0e}, relatively"
        ),
    )


# -- Table 1 --------------------------------------------------------------------------------------


@cache
def readings(column: str) -> tuple[example.PrintedColumn, ...]:
    """Return every reading of a column of Table 1, "proposed" or "actual"."""
    return tuple(example.bound_readings() if column == "proposed" else example.error_readings())


def _numbers(printed: Statement, column: str) -> dict[int, str]:
    """Return the printed numbers of a column, by the number of places."""
    found = [part for part in printed.parts if isinstance(part, Number) and part.label.startswith(column)]
    return {int(part.label.split()[1]): part.literal for part in found}


def _reproduced(printed: Statement, column: str) -> tuple[int, int]:
    """Count the readings that give all printed numbers of a column to four digits, and all readings."""
    numbers = _numbers(printed, column)
    count = sum(
        all(example.agree(one.values[example.PLACES.index(places)], literal) for places, literal in numbers.items())
        for one in readings(column)
    )
    return count, len(readings(column))


@cache
def _closest(column: str) -> example.Agreements:
    return example.search("bound" if column == "proposed" else "error")


@cache
def _possible(places: tuple[int, ...]) -> tuple[int, int]:
    """Count the searches through all matrices of `places` places that find the printed error norm, and all searches."""
    here = [p for p in existence.all_possible() if p.places in places and p.wordlength.kind != "t = places + 2"]
    return sum(p.witness is not None for p in here), len(here)


def _proposed(printed: Statement) -> tuple[bool, str]:
    found, count = _reproduced(printed, "proposed")
    search = _closest("proposed")
    values = [search.closest.values[example.PLACES.index(places)] for places in _numbers(printed, "proposed")]
    return found > 0, (
        f"of {count} readings of the procedure, {found or 'none'} gives all printed digits; the closest one gives "
        f"{', '.join(f'{v:.3e}' for v in values)}, which is off by {search.closest.distance - 1:.1%}"
    )


def _actual(printed: Statement) -> tuple[bool, str]:
    found, count = _reproduced(printed, "actual")
    can, searches = _possible(tuple(_numbers(printed, "actual")))
    return found > 0, (
        f"of {count} readings of the procedure, {found or 'none'} gives all printed digits; the closest column is "
        f"off by a factor of {_closest('actual').closest.distance:.2f}; "
        f"{can or 'none'} of {searches} searches through all matrices with this number of places, or "
        "with one digit more, finds a matrix whose error has the printed norm"
    )


@CHECKS.add(*(f"hung1984.II.s11-4.table-1-proposed-{places}-places" for places in example.PLACES))
def proposed(printed: Statement) -> Finding:
    agrees, text = _proposed(printed)
    return compare(
        agrees,
        text,
        Verdict.NOT_REPRODUCED,
        otherwise_note="Table 1 of the chapter shows the result of each way of reading the procedure",
    )


@CHECKS.add(*(f"hung1984.II.s11-4.table-1-actual-{places}-places" for places in example.PLACES))
def actual(printed: Statement) -> Finding:
    agrees, text = _actual(printed)
    return compare(
        agrees,
        text,
        Verdict.NOT_REPRODUCED,
        otherwise_note="elimination in that wordlength has a different error",
    )


@CHECKS.add(
    "hung1984.II.s11-4.table-1",
    "hung1982.III.s11-4.table-i",
    *(f"hung1982.III.s11-4.table-i-row-{places}-places" for places in example.PLACES),
)
def table(printed: Statement) -> Finding:
    (bound, of_bound), (error, of_error) = _proposed(printed), _actual(printed)
    return compare(
        bound and error,
        f"proposed: {of_bound}; actual: {of_error}",
        Verdict.NOT_REPRODUCED,
        otherwise_note="neither column is reproduced"
        if not bound and not error
        else "one of the columns is not reproduced",
    )


# -- claims on the table --------------------------------------------------------------------------


def _claim(word: str) -> tuple[example.SectionClaim, str]:
    (found,) = (claim for claim in _claims() if word in claim.name)
    return found, f"{found.name} in {found.holds} of {found.readings} ways of reading the procedure"


@cache
def _claims() -> tuple[example.SectionClaim, ...]:
    return tuple(example.claims())


def _columns() -> tuple[list[str], list[str]]:
    """Return the printed columns of Table 1."""
    printed = statement("hung1984.II.s11-4.table-1")
    return tuple(list(_numbers(printed, column).values()) for column in ("proposed", "actual"))  # type: ignore[return-value]


@cache
def _margin() -> tuple[str, str]:
    found, text = _claim("above")
    printed = all(float(bound) > 10 * float(error) for bound, error in zip(*_columns(), strict=True))
    right = found.holds == found.readings and printed
    return "are indeed very conservative" if right else "are not conservative", text


@cache
def _mantissa() -> tuple[str, str]:
    _, text = _claim("same digits")
    printed = len({number.split("e")[0] for number in _columns()[0]}) == 1
    more = [one for one in readings("proposed") if one.detail.endswith("more digits")]
    same = sum(one.same_digits for one in more)
    right = printed and same == len(more)
    return (
        "the same mantissa" if right else "different mantissas",
        (
            f"{text}; the mantissa is the same in {same} of the {len(more)} ways that compute the "
            "quantities with more digits"
        ),
    )


@cache
def _trend() -> tuple[str, str]:
    found, text = _claim("decreases")
    falling = all(a > b > c for a, b, c in ([float(number) for number in column] for column in _columns()))
    return "decreases" if found.holds == found.readings and falling else "increases", text


@CHECKS.add("hung1984.II.s11-4.table-1-claim-conservative")
def conservative(printed: Statement) -> Finding:
    phrase, text = _margin()
    return compare(
        printed.says("verb") == phrase,
        text,
        note=(
            "the bounds are conservative for this matrix; for other matrices the error exceeds the bound "
            "of the printed procedure, see (96)"
        ),
    )


@CHECKS.add("hung1984.II.s11-4.table-1-claim-same-mantissa")
def same_mantissa(printed: Statement) -> Finding:
    phrase, text = _mantissa()
    return compare(
        printed.says("mantissa") == phrase,
        text,
        note="the bound is $\\beta$ times a number that does not depend on the wordlength; if this number "
        "is computed in the wordlength under study, as the chart says, its digits change with the "
        "wordlength",
    )


@CHECKS.add("hung1984.II.s11-4.table-1-claim-decreasing")
def decreasing(printed: Statement) -> Finding:
    phrase, text = _trend()
    return compare(printed.says("verb") == phrase, text, note="'worklength' is a misprint for 'wordlength'")


@CHECKS.add("hung1982.III.s11-4.claims-on-table-i")
def claims_1982(printed: Statement) -> Finding:
    found = {"margin": _margin(), "trend": _trend(), "mantissa": _mantissa()}
    return compare(
        all(printed.says(label) == phrase for label, (phrase, _) in found.items()),
        "; ".join(text for _, text in found.values()),
    )
