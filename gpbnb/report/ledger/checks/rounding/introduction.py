"""Section 1: statistics or bounds."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.ledger.checks.rounding.instances import FOUR, FOUR_CHOPPED, samples, surveyed_bounds
from gpbnb.report.ledger.checks.rounding.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, compare
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.rounding import experiment

COUNTS = {"four": 4, "four hundred": 400}


@cache
def beyond_the_law() -> tuple[float, float]:
    """Return the shares of sums of 1000 varied or equal terms that exceed a law meant to fail for 1 %."""
    varied, constant = (
        experiment.growth(FloatFormat(2, 11), kind, (1000,), 30, np.random.default_rng(1)).beyond_probabilistic()[0]
        for kind in ("like signs", "constant")
    )
    return float(varied), float(constant)


@CHECKS.add(*both("s1.approach"))
def approach(printed: Statement) -> Finding:
    varied, constant = beyond_the_law()
    strict = surveyed_bounds("dot")["strict"]
    statistics = "not sufficiently reliable" if max(varied, constant) > 0.01 else "sufficiently reliable"
    tight = "close to the actual error" if strict.median > 0.5 else "conservative though pessimistic"
    bounds = "violated" if strict.violations else tight
    return compare(
        printed.says("statistics") == statistics and printed.says("bounds") == bounds,
        f"a statistical bound designed to fail in 1 % of cases fails in {constant:.0%} of the rounded "
        f"sums of 1000 equal terms, and in {varied:.0%} if the terms vary; the strict bound for an "
        f"inner product fails in {strict.violations} of {strict.trials} trials, and the median error "
        f"is {strict.median:.1%} of the bound",
        note=(
            "the statistical bound fails where the mean of the rounding errors is not zero; the strict "
            "bounds hold but are pessimistic"
        ),
    )


@CHECKS.add(*both("s1.claim-not-easy"))
def not_easy(printed: Statement) -> Finding:
    varied, constant = beyond_the_law()
    easy = "not easy" if (varied > 0.01) != (constant > 0.01) else "easy"
    return compare(
        printed.says("statistics") == easy,
        "a statistical bound for independent rounding errors, designed to fail in 1 % of the sums, "
        f"fails in {varied:.0%} if the terms vary and in {constant:.0%} if they are equal",
        note="the statistics of the errors depend on the data",
    )


@CHECKS.add(*both("s1.claim-rounding-or-chopping"))
def rounding_or_chopping(printed: Statement) -> Finding:
    longer = [x for x in samples() if FOUR.round(x) != x and FOUR_CHOPPED.round(x) != x]
    products = [(x, y) for x in range(1000, 1030) for y in range(1001, 1031) if FOUR.round(x * y) != x * y]
    need = "requires" if longer and products else "works without"
    return compare(
        printed.says("need").startswith(need),
        f"{len(longer)} of {len(samples())} sampled numbers and {len(products)} of {30 * 30} products "
        "of four-digit numbers have more than four digits",
        note="other rules exist, such as ties to even, rounding up, or stochastic rounding; each of them "
        "returns a neighbouring number, so bound (8) or bound (13) holds",
    )


def scatter(n: int) -> float:
    """Return the relative standard deviation of the sample standard deviation of n normal numbers."""
    mean = math.sqrt(2 / (n - 1)) * math.exp(math.lgamma(n / 2) - math.lgamma((n - 1) / 2))
    return math.sqrt(1 - mean**2)


@CHECKS.add(*both("s1.claim-small-sample"))
def small_sample(printed: Statement) -> Finding:
    n = COUNTS[printed.says("gyros")]
    spread, mean = scatter(n), 1 / math.sqrt(n)
    deviation = "a good deal" if min(spread, mean) > 0.25 else "very little"
    return compare(
        printed.says("deviation") == deviation and deviation == "a good deal",
        f"for {n} normal deviates, the sample standard deviation scatters by {spread:.0%} of the true "
        f"standard deviation and the sample mean by {mean:.0%}; for 1000 deviates, by "
        f"{scatter(1000):.1%} and {1 / math.sqrt(1000):.1%}",
        note="the claim is true but no argument against statistics: a probabilistic bound concerns the "
        "many roundings of one run, not a sample of gyros",
    )


@CHECKS.add(*both("s1.claim-more-reliable"))
def more_reliable(printed: Statement) -> Finding:
    _, constant = beyond_the_law()
    strict = [surveyed_bounds(trial)["strict"] for trial in ("sum", "product", "dot", "chain")]
    violations, trials = (sum(getattr(each, name) for each in strict) for name in ("violations", "trials"))
    chain = surveyed_bounds("chain")["(31)"]
    found = "more reliable" if violations / trials < 0.01 < constant else "less reliable"
    return compare(
        printed.says("reliability") == found,
        f"the strict bounds of sums, products, inner products and chains fail in {violations} of "
        f"{trials} trials; a statistical bound designed to fail in 1 % of cases fails in "
        f"{constant:.0%} of the sums of equal terms",
        note=f"the claim is true of proved bounds; but the printed bound (31) fails in {chain.violations} "
        f"of {chain.trials} trials, and the report relies on it",
    )
