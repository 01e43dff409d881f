"""How far a filter in four digits exceeds the report's bounds."""

from __future__ import annotations

from functools import cache

from gpbnb.arithmetic.rational import exact
from gpbnb.kalman import exact_step, report_bounds, smallest
from gpbnb.ledger.checks.kalman.registry import FOUR
from gpbnb.ledger.finding import Finding, Verdict, compare


@cache
def excess(statement: str) -> float:
    """Return error / bound for a printed statement and a filter in four digits; see the code."""
    scalar, beta = smallest.scalar(FOUR), FOUR.unit_roundoff
    fl = FOUR.round
    if statement in ("(105)", "(108)", "(125)"):
        place = ("(105)", "(108)", "(125)").index(statement)
        return smallest.ratios(FOUR, scalar, second=statement == "(108)")[place]
    if statement in ("(119)", "(124)"):
        return smallest.ratios(FOUR, scalar, steps={"(119)": 3, "(124)": 4}[statement]).state
    if statement == "(102)":
        A, B = FOUR.array([["1.001", 1], [1, 0]]), FOUR.array(smallest.correlated().P)
        product = exact(A) @ exact(B) @ exact(A.T)
        error = abs((A @ B @ A.T).to_fractions() - product)
        allowed = beta * report_bounds.prediction_count(2) * abs(product)
        return float(max(e / a for e, a in zip(error.flat, allowed.flat, strict=True) if a))
    if statement == "(106)":
        case = smallest.correlated()
        first = (case.P @ case.H.T)[0, 0]
        return float(abs(fl(fl(case.P[0, 0] * case.H[0, 0]) + case.P[0, 1]) - first) / (beta * (2 + 1) * abs(first)))
    if statement in ("(104)", "(107)"):
        case = smallest.scalar(FOUR, ".004", "7.5")
        true = exact_step.exact_step(*case)
        _, K, P = smallest.rounded_step(FOUR, case, second=True)
        if statement == "(104)":
            allowed = (1 + 1 + 1 + report_bounds.prediction_count(1)) * true.P + true.predicted
            return float(abs(P - true.P)[0, 0] / (beta * allowed[0, 0]))
        rest = abs(true.predicted @ case.H.T)[0, 0] / case.R[0, 0]
        return float(abs(K - true.gain)[0, 0] / (beta * (report_bounds.gain_count(1, 1) * abs(true.gain)[0, 0] + rest)))
    true = exact_step.exact_step(*scalar)
    F, K = true.transition[0, 0], true.gain[0, 0]
    x, rounded, _ = smallest.rounded_step(FOUR, scalar, second=statement != "(114)")
    if statement == "(112)":  # 5n + 3m + 4 and 4n + 3m + 3
        return float(abs(fl(1 - rounded[0, 0]) - F) / (beta * (12 * F + 10)))
    if statement == "(113)":  # 4n + 3m + 3, for z = 1
        return float(abs(rounded[0, 0] - K) / (beta * 10 * K))
    if statement == "(114)":
        return float(abs(x[0] - true.x[0]) / (beta * report_bounds.transition_count(1, 1) * F))
    raise KeyError(statement)


def exceeded(place: str, algebra: bool, note: str, root: str, name: str = "") -> Finding:
    """Judge a printed step by the report's own algebra and by a rounded filter.

    Parameters
    ----------
    place : the equation whose bound is compared with the filter.
    algebra : whether the printed terms follow by the report's own algebra.
    note, root : why it is wrong.
    name : name of the statement, if it differs.
    """
    times = excess(place)
    right = "follow" if algebra else "do not follow"
    return compare(
        algebra and times <= 1,
        f"the printed terms {right} from the report's own algebra; in four digits, the error of an "
        f"example filter is {times:.3g} times what {name or place} allows",
        Verdict.WRONG,
        otherwise_note=note,
        root=root,
    )
