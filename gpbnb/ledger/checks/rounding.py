"""A check for each ledger entry of hung1984, ch. II, and hung1982, ch. III, sections 1-9."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from fractions import Fraction
from functools import cache

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.arithmetic.rational import column_sum_norm, exact, max_norm, row_sum_norm
from gpbnb.display.derivation import first_order
from gpbnb.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.ledger.registry import Checks, both
from gpbnb.ledger.statements import quote
from gpbnb.rounding import derivation, experiment, theory

CHECKS = Checks()

FOUR = FloatFormat(10, 4)
FOUR_CHOPPED = FloatFormat(10, 4, Rounding.CHOP)
CHAPTER = "chapter *Rounding bounds*"


# -- material -------------------------------------------------------------------------------------


@cache
def samples() -> tuple[Fraction, ...]:
    """Numbers of nine decimal digits of either sign, exponents -6 to 6, and some of four digits."""
    rng = np.random.default_rng(1982)
    digits = rng.integers(10**8, 10**9, 300).tolist()
    few = [d * 10**5 for d in rng.integers(10**3, 10**4, 100).tolist()]
    signs = rng.choice([-1, 1], 400).tolist()
    powers = rng.integers(-6, 7, 400).tolist()
    return tuple(s * d * Fraction(10) ** (e - 9) for s, d, e in zip(signs, digits + few, powers, strict=True))


@cache
def tallies(trial: str) -> dict[str, experiment.Tally]:
    """The survey of one sort of computation, by bound."""
    return {each.bound: each for each in experiment.tally(experiment.survey(trial))}


def surveyed(trial: str, bound: str) -> tuple[bool, str]:
    """Whether a survey found no violation of a bound, and what it found."""
    found = tallies(trial)[bound]
    return found.violations == 0, (
        f"{found.violations} violations in {found.trials} random trials, largest error over bound {found.largest:.3g}"
    )


def all_samples(holds: Callable[[Fraction], bool]) -> tuple[bool, str]:
    """Whether a statement holds for each of :func:`samples`, and of how many."""
    count = sum(map(holds, samples()))
    return count == len(samples()), f"holds for {count} of {len(samples())} numbers, $b=10$, $t=4$"


def power(x: Fraction, digits: int = 4) -> str:
    r"""A number as the reports write it, ``$.7655\times10^{3}$``."""
    u, _, e = FloatFormat(10, digits).split(x)
    return rf"${'-' if u < 0 else ''}.{int(abs(u) * 10**digits):0{digits}d}\times10^{{{e}}}$"


def pieces(x: str, t: int = 4) -> str:
    """The split (2) of a decimal number, as the reports write it."""
    u, v, e = FloatFormat(10, t).split(x)
    return rf"$u={float(u):g}$, $v={float(v):g}$, $e={e}$"


def split_is(x: str, head: str, tail: str, e: int) -> bool:
    """Whether (2) splits `x` into the printed ``head * 10**e`` and `tail`."""
    u, v, exponent = FOUR.split(x)
    scale = Fraction(10) ** e
    return exponent == e and u == Fraction(head) and v * scale / 10**4 == Fraction(tail)


def splits(x: str) -> list[tuple[Fraction, Fraction]]:
    """Some u of four digits and v that make up the decimal number `x` with the exponent of (2)."""
    u, v, _ = FOUR.split(x)
    return [(u + Fraction(k, 10**4), v - k) for k in range(-3, 4)]


# -- section 1 ------------------------------------------------------------------------------------


def beyond_the_law() -> tuple[float, float]:
    """Share of sums of a thousand terms that break a law meant to fail in 1 %: of varied terms, and of equal ones."""
    varied, constant = (
        experiment.growth(FloatFormat(2, 11), kind, (1000,), 30, np.random.default_rng(1)).beyond_probabilistic()[0]
        for kind in ("like signs", "constant")
    )
    return float(varied), float(constant)


@CHECKS.add(*both("s1.approach"), *both("s1.claim-not-easy"))
def approach() -> Finding:
    varied, constant = beyond_the_law()
    strict = tallies("dot")["strict"]
    return compare(
        bool(constant > 0.01 and strict.violations == 0 and strict.median < 0.1),
        f"a law that should fail in 1 % fails in {constant:.0%} of rounded sums of one number a thousand times, and in "
        f"{varied:.0%} where the numbers vary; the strict bound of an inner product fails in "
        f"{strict.violations} of {strict.trials}, at a median error of {strict.median:.1%} of it",
        note="right about statistics where errors have a mean; bounds are pessimistic indeed",
    )


@CHECKS.add(*both("s1.claim-only-rounding"))
def only_rounding() -> Finding:
    return unverifiable(
        "", "a statement about the computers of 1982, without a source; section 4 treats chopping all the same"
    )


@CHECKS.add(*both("s1.claim-background"), *both("s1.claim-main-activity"))
def background() -> Finding:
    return unverifiable("", "a statement about the literature, or about the data reduction, without a source")


@CHECKS.add(*both("s1.claim-rounding-or-chopping"))
def rounding_or_chopping() -> Finding:
    def holds(x: Fraction) -> bool:
        u, v, e = FOUR.split(x)
        inward = u * Fraction(10) ** e
        outward = inward + (0 if v == 0 else Fraction(10) ** (e - 4) * (1 if u > 0 else -1))
        errors = [abs(y / x - 1) for y in (inward, outward)]
        return min(errors) <= FOUR.unit_roundoff and max(errors) <= FOUR_CHOPPED.unit_roundoff

    agrees, text = all_samples(holds)
    return compare(
        agrees,
        f"the nearer neighbour is within $\\beta$, the other within $\\beta_c$: {text}",
        note="there are other rules, such as ties to even, always up, or at random; as each takes a neighbour, (8) or "
        "(13) is true of it",
    )


#: Gyros of the experiment.
GYROS = 4


def scatter(n: int) -> float:
    """Standard deviation of the sample standard deviation of n normal deviates, over the true one."""
    mean = math.sqrt(2 / (n - 1)) * math.exp(math.lgamma(n / 2) - math.lgamma((n - 1) / 2))
    return math.sqrt(1 - mean**2)


@CHECKS.add(*both("s1.claim-small-sample"))
def small_sample() -> Finding:
    spread, mean = scatter(GYROS), 1 / math.sqrt(GYROS)
    return compare(
        min(spread, mean) > 0.25,
        f"of {GYROS} normal deviates the standard deviation scatters by {spread:.0%} of the true one and the mean by "
        f"{mean:.0%}; of a thousand by {scatter(1000):.1%} and {1 / math.sqrt(1000):.1%}",
        note="true, but no reason against statistics: a law that gives a probability of failure needs no sample of "
        "gyros, it is about the many roundings of one run",
    )


@CHECKS.add(*both("s1.claim-more-reliable"))
def more_reliable() -> Finding:
    _, constant = beyond_the_law()
    strict = [tallies(trial)["strict"] for trial in ("sum", "product", "dot", "chain")]
    violations, trials = (sum(getattr(each, name) for each in strict) for name in ("violations", "trials"))
    printed = tallies("chain")["(31)"]
    return compare(
        violations == 0 and constant > 0.01,
        f"the strict bounds of sums, products, inner products and chains fail in {violations} of {trials} trials; a "
        f"law that should fail in 1 % fails in {constant:.0%} of sums of equal terms",
        note=f"of bounds that are proved; the printed (31) fails in {printed.violations} of {printed.trials}, and this "
        "report builds on it",
    )


# -- section 2: splitting and rounding ------------------------------------------------------------


@CHECKS.add(*both("eq1"))
def representation() -> Finding:
    def holds(x: Fraction) -> bool:
        u, v, e = FloatFormat(10, 12).split(x)
        return v == 0 and Fraction(1, 10) <= abs(u) < 1 and u * Fraction(10) ** e == x

    agrees, text = all_samples(holds)
    return compare(agrees, text.replace("t=4", "t=12"), note="zero has no such form with $d_1 \\ne 0$")


#: The square of the number that is to have infinitely many digits.
RADICAND = 2


@CHECKS.add(*both("s2.claim-infinite-digits"))
def infinite_digits() -> Finding:
    places, bases = range(40), (2, 10, 16)
    finite = [
        (b, k) for b in bases for k in places if math.isqrt(RADICAND * b ** (2 * k)) ** 2 == RADICAND * b ** (2 * k)
    ]
    return compare(
        not finite and not sp.sqrt(RADICAND).is_rational,
        f"a number of finitely many digits is rational, and $\\sqrt{{{RADICAND}}}$ is not; no number of less than "
        f"{len(places)} places in base {', '.join(map(str, bases))} has the square {RADICAND}",
    )


@CHECKS.add("hung1984.II.eq2")
def split() -> Finding:
    def strict(x: Fraction) -> bool:
        u, v, e = FOUR.split(x)
        return (u + v / 10**4) * Fraction(10) ** e == x and Fraction(1, 10) <= abs(u) < 1 and 0 < abs(v) < 1

    def mended(x: Fraction) -> bool:
        u, v, e = FOUR.split(x)
        return (u + v / 10**4) * Fraction(10) ** e == x and Fraction(1, 10) <= abs(u) < 1 and 0 <= abs(v) < 1

    agrees, text = all_samples(strict)
    mends, mended_text = all_samples(mended)
    return compare(
        agrees,
        f"with $0<|v|$ {text}; with $0\\le|v|$ {mended_text}",
        Verdict.MISPRINT if mends else Verdict.WRONG,
        otherwise_note="$v=0$ is left out, the case of a number that has no more than $t$ digits; "
        "nothing later uses $v \\ne 0$",
    )


@CHECKS.add("hung1982.III.eq2")
def split_1982() -> Finding:
    admitted = [v for u, v in splits("765.4567") if Fraction(1, 10) <= abs(u) < 1 and 0 < abs(u) < 1]
    return compare(
        all(abs(v) < 1 for v in admitted),
        f"as printed, $v={float(max(admitted)):g}$ would do for 765.4567; the second condition bounds $v$, not $u$",
        Verdict.OCR,
        otherwise_note="the first condition already bounds $u$; hung1984 prints $v$, so the scan's letter is at fault",
    )


@CHECKS.add(*both("s2.example-2a"))
def example_2a() -> Finding:
    return compare(split_is("12.3456", ".1234", ".56e-2", 2), pieces("12.3456"))


@CHECKS.add("hung1984.II.s2.example-2b")
def example_2b() -> Finding:
    return compare(split_is("-.0123456", "-.1234", "-.56e-5", -1), pieces("-.0123456"))


@CHECKS.add("hung1982.III.s2.example-2b")
def example_2b_1982() -> Finding:
    return compare(
        split_is("-.0123456", "-.1234", "-.56e-5", -2),
        pieces("-.0123456"),
        Verdict.MISPRINT,
        otherwise_note="the first power is $10^{-1}$, in keeping with the printed $e=-1$; mended in hung1984",
    )


@CHECKS.add(*both("s2.claim-t-digit-mantissa"))
def carry() -> Finding:
    x = Fraction("99.996")
    _, _, before = FOUR.split(x)
    _, _, after = FOUR.split(FOUR.round(x))
    return compare(
        before == after,
        f"99.996 has $e={before}$ and rounds to {power(FOUR.round(x))}, which has $e={after}$",
        Verdict.MISPRINT,
        otherwise_note="a carry past the first digit raises the exponent; (3) and (5) hold all the same",
    )


@CHECKS.add(*both("eq3"), *both("s2.claim-conventional"))
def rounding_rule() -> Finding:
    def holds(x: Fraction) -> bool:
        u, v, e = FOUR.split(x)
        step = Fraction(10) ** (e - 4)
        rounded = u * Fraction(10) ** e + (step if 2 * v >= 1 else -step if 2 * v <= -1 else 0)
        return FOUR.round(x) == rounded and 2 * abs(rounded - x) <= step

    return compare(
        *all_samples(holds),
        note="a tie goes away from zero; IEEE 754 of 1985 sends it to the even neighbour, with the same (5)",
    )


@CHECKS.add(*both("s2.claim-u-v-same-sign"))
def same_sign() -> Finding:
    def holds(x: Fraction) -> bool:
        u, v, _ = FOUR.split(x)
        return u * v >= 0

    other = [(u, v) for u, v in splits("765.4567") if Fraction(1, 10) <= abs(u) < 1 and abs(v) < 1 and u * v < 0]
    also = "".join(f"; (2) alone would allow $u={float(u):g}$, $v={float(v):g}$ for 765.4567" for u, v in other)
    return compare(*all_samples(holds), note=f"or $v=0${also}")


@CHECKS.add("hung1984.II.s2.example-3a")
def example_3a() -> Finding:
    rounded = FOUR.round("765.4567")
    return compare(
        split_is("765.4567", ".7654", ".567e-1", 3) and rounded == Fraction(".7655e3"),
        f"{pieces('765.4567')}; $\\hat x=$ {power(rounded)}",
    )


@CHECKS.add("hung1984.II.s2.example-3b")
def example_3b() -> Finding:
    rounded = FOUR.round("123.426")
    return compare(
        split_is("123.426", ".1234", ".26e-1", 3) and rounded == Fraction(".1234e3"),
        f"{pieces('123.426')}; $\\hat x=$ {power(rounded)}",
    )


@CHECKS.add("hung1984.II.s2.example-3c")
def example_3c() -> Finding:
    rounded = FOUR.round("-765.4567")
    return compare(
        split_is("-765.4567", "-.765", "-.567e-1", 3),
        f"{pieces('-765.4567')}; $\\hat x=$ {power(rounded)}",
        Verdict.MISPRINT if rounded == Fraction("-.7655e3") else Verdict.WRONG,
        otherwise_note="the digit 4 of $-.7654\\times10^3$ is lost in the first line and back in the next",
    )


@CHECKS.add("hung1982.III.s2.examples-3a-3c")
def examples_3_1982() -> Finding:
    printed = {"765.4567": ".7655e3", "123.426": ".1234e3", "-765.4567": "-.7655e3"}
    rounded = all(FOUR.round(x) == Fraction(result) for x, result in printed.items())
    others = split_is("765.4567", ".7654", ".567e-1", 3) and split_is("123.426", ".1234", ".26e-1", 3)
    return compare(
        rounded and others and split_is("-765.4567", "-.765", "-.567e-1", 3),
        "; ".join(f"{pieces(x)}, $x_R=$ {power(FOUR.round(x))}" for x in printed),
        Verdict.MISPRINT if rounded and others else Verdict.WRONG,
        otherwise_note="the digit 4 of $-.7654\\times10^3$ is lost in the first line of (3c), in both reports, and "
        "back in the next; $-.7685$ for the result is the scan's",
    )


# -- sections 3 and 4: the error of one rounding --------------------------------------------------


@CHECKS.add(*both("eq4"), "hung1984.II.eq7")
def errors_defined() -> Finding:
    _, printed, numbers = _example_8()
    return compare(printed, f"{numbers} for 765.4567, as printed", note="a definition; (7) needs $x\\ne0$")


@CHECKS.add("hung1984.II.eq5")
def absolute_bound() -> Finding:
    return compare(*all_samples(lambda x: abs(FOUR.round(x) - x) <= Fraction(10) ** (FOUR.split(x)[2] - 4) / 2))


def forms_of_1(x: Fraction) -> list[tuple[Fraction, int]]:
    """Some mantissas and exponents with which (1) can write a number: its first digit may be 0."""
    _, _, e = FOUR.split(x)
    return [(x / Fraction(10) ** k, k) for k in range(e, e + 3)]


@CHECKS.add(*both("s3.cross-reference-to-1"))
def reference_1() -> Finding:
    x = Fraction("765.4")
    forms = forms_of_1(x)
    by_1 = [abs(x) >= Fraction(10) ** (e - 1) for _, e in forms]
    by_2 = [abs(x) >= Fraction(10) ** (e - 1) for u, e in forms if abs(u) >= Fraction(1, 10)]
    u, e = forms[-1]
    return compare(
        all(by_1),
        f"by (1) alone 765.4 is also ${float(u):g}\\times10^{{{e}}}$, and less than $10^{{e-1}}$ in "
        f"{by_1.count(False)} of {len(forms)} forms; in {by_2.count(False)} with $|u|\\ge1/b$, which stands below (2)",
        Verdict.MISPRINT if by_2 and all(by_2) else Verdict.WRONG,
        otherwise_note="(2) is meant: (1) has no $u$, and does not say that $d_1\\ne0$",
    )


@CHECKS.add(*both("s3.claim-before-6"))
def claim_before_6() -> Finding:
    literal, text = all_samples(lambda x: FOUR.split(x)[0] >= Fraction(1, 10))
    meant, meant_text = all_samples(lambda x: abs(FOUR.split(x)[0]) >= Fraction(1, 10))
    return compare(
        literal,
        f"$u\\ge1/b$ {text}; $|u|\\ge1/b$ {meant_text}",
        Verdict.MISPRINT if meant else Verdict.WRONG,
        otherwise_note="bars are missing: $u$ is negative for negative numbers",
    )


@CHECKS.add("hung1984.II.eq6")
def least_size() -> Finding:
    def holds(x: Fraction) -> bool:
        u, _, e = FOUR.split(x)
        return abs(x) >= abs(u) * Fraction(10) ** e >= Fraction(10) ** (e - 1)

    return compare(*all_samples(holds))


@CHECKS.add("hung1984.II.eq8")
def unit_error() -> Finding:
    beta = FOUR.unit_roundoff
    agrees, text = all_samples(lambda x: abs(FOUR.round(x) / x - 1) <= beta)
    return compare(
        agrees and derivation.one_rounding().holds and beta == Fraction(1, 2000),
        text,
        note="never reached: the largest error is $\\beta/(1+\\beta)$",
    )


@CHECKS.add(*both("s3.claim-meaning-of-beta"))
def meaning_of_beta() -> Finding:
    error = abs(FOUR.round("765.4567") - Fraction("765.4567"))
    relative, _ = all_samples(lambda x: abs(FOUR.round(x) / x - 1) <= FOUR.unit_roundoff)
    return compare(
        error <= FOUR.unit_roundoff,
        f"the absolute error of 765.4567 is {float(error):g}, above $\\beta={float(FOUR.unit_roundoff):g}$; "
        "the relative errors are below it",
        Verdict.MISPRINT if relative else Verdict.WRONG,
        otherwise_note="a word is missing: β bounds the absolute value of the *relative* error, as (7) and (8) say",
    )


@CHECKS.add("hung1984.II.s3.example-8-beta")
def example_8_beta() -> Finding:
    return compare(FOUR.unit_roundoff == Fraction(1, 2) / 10**3, f"${float(FOUR.unit_roundoff):g}$")


def _example_8() -> tuple[bool, bool, str]:
    """Whether 767.4567 splits as printed, whether the rest of the example is of 765.4567, and the numbers."""
    x = Fraction("765.4567")
    error = abs(FOUR.round(x) - x)
    rest = error == Fraction(".0433") and FloatFormat(10, 5).round(error / x) == Fraction(".56568e-4")
    numbers = f"$|\\tilde x|={float(error):g}$, $\\epsilon=$ {power(FloatFormat(10, 5).round(error / x), 5)}"
    return split_is("767.4567", ".7654", ".567e-1", 3), rest, numbers


@CHECKS.add("hung1984.II.s3.example-8-x")
def example_8_x() -> Finding:
    as_printed, rest, numbers = _example_8()
    return compare(
        as_printed,
        f"$.7654\\times10^3+.567\\times10^{{-1}}$ is 765.4567; with it {numbers}",
        Verdict.MISPRINT if rest else Verdict.WRONG,
        otherwise_note="767 for 765; the lines that follow use 765",
    )


@CHECKS.add("hung1982.III.s3.example-8-numbers")
def example_8_1982() -> Finding:
    as_printed, rest, numbers = _example_8()
    rest = rest and FOUR.round("765.4567") == Fraction(".7655e3") and FOUR.unit_roundoff == Fraction(1, 2000)
    return compare(
        as_printed and rest,
        numbers,
        Verdict.MISPRINT if rest else Verdict.WRONG,
        otherwise_note="767 for 765, as in hung1984; the other numbers are those of 765.4567",
    )


@CHECKS.add("hung1984.II.s3.example-8-xhat")
def example_8_rounded() -> Finding:
    rounded = FOUR.round("765.4567")
    return compare(rounded == Fraction(".7655e3"), power(rounded))


@CHECKS.add("hung1984.II.s3.example-8-abs-err", "hung1984.II.s3.example-8-eps")
def example_8_errors() -> Finding:
    _, rest, numbers = _example_8()
    return compare(rest, numbers, note="for 765.4567")


@CHECKS.add("hung1984.II.eq9")
def chopping_rule() -> Finding:
    return compare(*all_samples(lambda x: FOUR_CHOPPED.round(x) == FOUR.split(x)[0] * Fraction(10) ** FOUR.split(x)[2]))


@CHECKS.add("hung1984.II.eq12")
def chopping_error_defined() -> Finding:
    printed, numbers = _example_13()
    return compare(printed, f"{numbers} for 765.4567, as printed", note="a definition; it needs $x\\ne0$")


@CHECKS.add("hung1984.II.eq10", "hung1984.II.eq11")
def chopping_error() -> Finding:
    def holds(x: Fraction) -> bool:
        _, v, e = FOUR.split(x)
        step = Fraction(10) ** (e - 4)
        return abs(FOUR_CHOPPED.round(x) - x) == abs(v) * step < step

    return compare(*all_samples(holds))


@CHECKS.add("hung1984.II.eq13")
def unit_chopping_error() -> Finding:
    beta = FOUR_CHOPPED.unit_roundoff
    agrees, text = all_samples(lambda x: abs(FOUR_CHOPPED.round(x) / x - 1) < beta)
    return compare(agrees and derivation.one_rounding().holds and beta == Fraction(1, 1000), text)


@CHECKS.add("hung1984.II.eq14")
def chopping_doubles() -> Finding:
    pairs = [
        (FloatFormat(b, t, Rounding.CHOP).unit_roundoff, FloatFormat(b, t).unit_roundoff)
        for b in (2, 3, 10, 16)
        for t in range(1, 20)
    ]
    return compare(all(c == 2 * r for c, r in pairs), "$\\beta_c/\\beta=2$ in every base and precision")


@CHECKS.add("hung1984.II.s4.example-13-parameters")
def example_13_parameters() -> Finding:
    _, _, e = FOUR.split("765.4567")
    with_t = FOUR_CHOPPED.unit_roundoff == Fraction(1, 10**3)
    return compare(
        e == 4,
        f"the example's number has $e={e}$; $\\beta_c=10^{{1-4}}$ has $t=4$",
        Verdict.MISPRINT if with_t else Verdict.WRONG,
        otherwise_note="$t=4$ is meant",
    )


@CHECKS.add("hung1984.II.s4.example-13-beta-c")
def example_13_beta() -> Finding:
    return compare(FOUR_CHOPPED.unit_roundoff == Fraction(1, 10**3), f"${float(FOUR_CHOPPED.unit_roundoff):g}$")


@CHECKS.add("hung1984.II.s4.example-13-x")
def example_13_x() -> Finding:
    chopped = FOUR_CHOPPED.round("765.4567")
    return compare(
        split_is("765.4567", ".7654", ".567e-1", 3) and chopped == Fraction(".7654e3"),
        f"{pieces('765.4567')}; $x_c=$ {power(chopped)}",
    )


def _example_13() -> tuple[bool, str]:
    x = Fraction("765.4567")
    error = abs(FOUR_CHOPPED.round(x) - x)
    relative = FloatFormat(10, 5).round(error / x)
    agrees = error == Fraction(".567e-1") and relative == Fraction(".74073e-4")
    return agrees, f"$|\\tilde x_c|={float(error):g}$, $\\epsilon_c=$ {power(relative, 5)}"


@CHECKS.add("hung1984.II.s4.example-13-abs-err", "hung1984.II.s4.example-13-eps-c")
def example_13_errors() -> Finding:
    return compare(*_example_13())


@CHECKS.add("hung1982.III.s4.example-13-numbers")
def example_13_1982() -> Finding:
    agrees, text = _example_13()
    chopped = Fraction(".7654e3")
    agrees = agrees and FOUR_CHOPPED.round("765.4567") == chopped == Fraction("765.4567") - Fraction(".567e-1")
    agrees = agrees and FOUR_CHOPPED.unit_roundoff == Fraction(1, 10**3)
    _, _, e = FOUR.split("765.4567")
    return compare(
        agrees and e == 4,
        f"$e={e}$; {text}",
        Verdict.MISPRINT if agrees else Verdict.WRONG,
        otherwise_note="$t=4$ is meant, not $e=4$, which the scan reads as 6 = 4 and hung1984 repeats; $.7650$ is the "
        "scan's, since the next line has $.7654$; the other numbers are right",
    )


# -- section 5: one operation ---------------------------------------------------------------------


@cache
def _one_operation() -> tuple[int, Fraction]:
    """Operations on all pairs of two-digit decimal numbers, and the largest relative error over β."""
    fmt = FloatFormat(10, 2)
    x = fmt.array([sign * m for m in range(10, 100) for sign in (1, -1)])
    y = fmt.array([m * Fraction(10) ** e for m in range(10, 100) for e in (0, -1)])
    a, b = x.to_fractions()[:, np.newaxis], y.to_fractions()
    largest, count = Fraction(0), 0
    for name in ("add", "subtract", "multiply", "divide"):
        function = getattr(np, name)
        computed = function(x[:, np.newaxis], y).to_fractions()
        true = {"add": a + b, "subtract": a - b, "multiply": a * b, "divide": a / b}[name]
        some = true != 0
        count += true.size
        if not np.all(computed[~some] == 0):
            raise ArithmeticError("a result that should be zero is not")
        error = abs(computed - true)
        inexact = some & (error != 0)
        largest = max(largest, max(error[inexact] / abs(true[inexact]), default=Fraction(0)))
    return count, largest / fmt.unit_roundoff


@CHECKS.add("hung1984.II.eq15", "hung1984.II.eq16")
def one_operation() -> Finding:
    count, largest = _one_operation()
    return compare(
        largest <= 1,
        f"in {count} operations, every pair of two-digit numbers, the largest error is {float(largest):.4f} β",
        note="where the exact result is zero, so is the computed one; the exponent is taken as unbounded",
    )


@CHECKS.add("hung1982.III.eq5-16")
def as_1984() -> Finding:
    same = (
        absolute_bound,
        least_size,
        unit_error,
        chopping_rule,
        chopping_error,
        chopping_error_defined,
        unit_chopping_error,
        chopping_doubles,
        errors_defined,
        one_operation,
    )
    findings = [check() for check in same]
    agreeing = sum(finding.agrees is True for finding in findings)
    return compare(agreeing == len(same), f"{agreeing} of {len(same)} checks of the twins in hung1984 agree")


# -- section 6: sums and products -----------------------------------------------------------------


@CHECKS.add(*both("s6.order-of-4-terms"), *both("s6.unnumbered-4-term-sum"))
def four_terms() -> Finding:
    total, x, (e1, e2, e3) = derivation.rounded_sum(4)
    printed = ((x[0] + x[1]) * (1 + e1) + x[2]) * (1 + e2) + x[3]
    second = (x[0] + x[1]) * (1 + e1) * (1 + e2) * (1 + e3) + x[2] * (1 + e2) * (1 + e3) + x[3] * (1 + e3)
    linear = (x[0] + x[1]) * (e1 + e2 + e3) + x[2] * (e2 + e3) + x[3] * e3
    same = sp.expand(total - printed * (1 + e3)) == 0 and sp.expand(total - second) == 0
    return compare(bool(same and sp.expand(first_order(total, (e1, e2, e3)) - linear) == 0), "the same, by expansion")


@CHECKS.add(*both("s6.unnumbered-s"))
def four_terms_error() -> Finding:
    error, x, (e1, e2, e3) = derivation.sum_error(4)
    first = (x[0] + x[1]) * (e1 + e2 + e3) + x[2] * (e2 + e3) + x[3] * e3
    second = derivation.printed_sum_error(4)
    agrees = all(sp.expand(error - form) == 0 for form in (first, second))
    return compare(bool(agrees), "both forms are the first-order error")


@CHECKS.add("hung1984.II.s6.unnumbered-4-term-bound", "hung1984.II.eq18")
def sum_bound_1984() -> Finding:
    holds, text = surveyed("sum", "1984 (18)")
    tie = experiment.tie_sum(FOUR, 100)
    # The last member of (18), with the largest term for each, is no smaller.
    wider = all(
        theory.printed_sum_bound_coarse(trial.inputs[0], trial.fmt.unit_roundoff) >= trial.bounds["1984 (18)"]
        for trial in experiment.survey("sum")
    )
    return compare(
        holds and wider and derivation.sums().holds,
        f"derived to first order for every $n$; {text}",
        note="not strict: 100 terms in four digits, "
        f"$1, \\beta, -\\beta, \\dots, -\\beta$, exceed it by {tie.ratio('1984 (18)') - 1:.1%}",
    )


@CHECKS.add("hung1982.III.s6.unnumbered-4-term-bound", "hung1982.III.eq18")
def sum_bound_1982() -> Finding:
    found = tallies("sum")["1982 (18)"]
    like = [
        trial
        for fmt in experiment.SURVEYED
        for trial in (
            experiment.sum_trial(experiment.random_numbers(np.random.default_rng(s), fmt, (5,), "like signs"))
            for s in range(20)
        )
    ]
    like_holds = not any(trial.violates("1982 (18)") for trial in like)
    return compare(
        found.violations == 0,
        f"{found.violations} violations in {found.trials} random sums, by a factor of up to {found.largest:.2g}; "
        f"{'none' if like_holds else 'some'} in {len(like)} sums of terms of one sign",
        Verdict.WRONG,
        otherwise_note="drops $-x_3\\epsilon_1-x_4(\\epsilon_1+\\epsilon_2)$ as if it could only help, which takes "
        "terms of one sign; mended in hung1984 (18)",
    )


@CHECKS.add(*both("eq17"))
def sum_defined() -> Finding:
    x = FloatFormat(10, 12).array(["1.25", "-3.5", "7", "0.125"])
    return compare(
        x.sum().to_fractions() == sum(x.to_fractions()),
        f"{float(x.sum()):g} for a sum without rounding",
        note="a definition; the order is from left to right",
    )


@CHECKS.add(*both("s6.unnumbered-q-example"))
def quotient_example() -> Finding:
    error, eps = derivation.quotient_error(2, 1)
    return compare(bool(sp.expand(error - sum(eps)) == 0 and len(eps) == 2), f"${sp.latex(error)}$, at most $2\\beta$")


@CHECKS.add(*both("eq19"))
def quotient_defined() -> Finding:
    fmt = FloatFormat(10, 12)
    trial = experiment.product_trial(fmt.array([3, 7, "2.5"]), fmt.array([4, 5]))
    return compare(
        trial.computed.to_fractions() == Fraction(3 * 7 * 5, 2 * 20),
        f"{float(trial.computed):g} for 3·7·2.5/(4·5)",
        note="a definition",
    )


def _count_of(n: int, m: int) -> int:
    return len(derivation.quotient_error(n, m)[1])


@cache
def worst_twenty() -> experiment.Trial:
    """Twenty factors of two digits whose product has the largest relative error."""
    return experiment.worst_product(FloatFormat(10, 2), 20)


@CHECKS.add("hung1984.II.eq20")
def product_bound_1984() -> Finding:
    counts = {(n, m): _count_of(n, m) for n in range(1, 6) for m in range(4)}
    worst = worst_twenty()
    return compare(
        all(count == n + m + 1 for (n, m), count in counts.items()),
        f"${sp.latex(derivation.product_operations())}$ roundings; 2 for $x_1x_2/y_1$, not 4",
        Verdict.INCONSISTENT,
        otherwise_note="contradicts its own example above it and hung1982 (20); too large by 2β, and yet no strict "
        f"bound: 20 factors of two digits exceed it {worst.ratio('1984 (20)'):.2f} times",
    )


@CHECKS.add("hung1982.III.eq20")
def product_bound_1982() -> Finding:
    counted = all(_count_of(n, m) == n + m - 1 for n in range(1, 6) for m in range(4))
    holds, text = surveyed("product", "1982 (20)")
    worst = worst_twenty()
    return compare(
        counted and holds,
        f"${sp.latex(derivation.product_operations())}$ roundings; {text}",
        note=f"to first order; 20 factors of two digits can exceed it {worst.ratio('1982 (20)'):.2f} times",
    )


# -- section 7: norms -----------------------------------------------------------------------------


@cache
def _matrices() -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    rng = np.random.default_rng(7)
    return tuple(
        (exact(rng.integers(-9, 10, (3, 3)).astype(object)), exact(rng.integers(-9, 10, (3, 3)).astype(object)))
        for _ in range(200)
    )


def _norm_axioms(norm: Callable[[np.ndarray], Fraction], pairs: list[tuple[np.ndarray, np.ndarray]]) -> bool:
    zero = norm(pairs[0][0] * 0) == 0
    return zero and all(
        norm(a) > 0 and norm(a + b) <= norm(a) + norm(b) and norm(-3 * a) == 3 * norm(a) for a, b in pairs
    )


@CHECKS.add(*both("eq21"), *both("s7.vector-norm-properties-i-iv"))
def vector_norm() -> Finding:
    pairs = [(a[0], b[0]) for a, b in _matrices() if a[0].any()]
    return compare(
        _norm_axioms(max_norm, pairs) and max_norm([1, -7, 3]) == 7,
        f"(i)-(iv) hold for {len(pairs)} pairs; $\\|(1,-7,3)\\|={max_norm([1, -7, 3])}$",
    )


@CHECKS.add("hung1982.III.eq22")
def matrix_norm_1982() -> Finding:
    a, x = exact([[1, 1], [0, 0]]), exact([1, 1])
    by_columns, by_rows = (norm(a) * max_norm(x) for norm in (column_sum_norm, row_sum_norm))
    return compare(
        min(by_columns, by_rows) < max_norm(a @ x) == max(by_columns, by_rows)
        and column_sum_norm([[1, 2], [-3, 4]]) == row_sum_norm([[1, -3], [2, 4]]) == 6,
        "by either reading a norm: the largest sum over a column, or over a row",
        note="only the row sums go with (21): for rows (1, 1), (0, 0) and $x=(1,1)$, "
        f"$\\|Ax\\|={max_norm(a @ x)}$, $\\|A\\|\\|x\\|={by_rows}$ by rows and {by_columns} by columns, the reading of "
        "hung1984",
    )


@CHECKS.add("hung1984.II.eq22")
def matrix_norm() -> Finding:
    a, x = exact([[1, 1], [0, 0]]), exact([1, 1])
    compatible = max_norm(a @ x) <= column_sum_norm(a) * max_norm(x)
    return compare(
        column_sum_norm([[1, 2], [-3, 4]]) == 6,
        "the largest column sum, 6 for rows (1, 2), (-3, 4)",
        note=""
        if compatible
        else "does not go with (21): for rows (1, 1), (0, 0) and $x=(1,1)$, "
        f"$\\|Ax\\|={max_norm(a @ x)}$ but $\\|A\\|\\|x\\|={column_sum_norm(a) * max_norm(x)}$; (21) needs row sums",
    )


def _submultiplicative() -> tuple[int, int, int]:
    products = [(column_sum_norm(a @ b), column_sum_norm(a) * column_sum_norm(b)) for a, b in _matrices()]
    return sum(p <= q for p, q in products), sum(p == q for p, q in products), len(products)


@CHECKS.add("hung1984.II.s7.matrix-norm-properties-i-v", "hung1982.III.s7.matrix-norm-properties-i-iv")
def matrix_norm_properties() -> Finding:
    at_most, _, count = _submultiplicative()
    return compare(
        _norm_axioms(column_sum_norm, list(_matrices())) and at_most == count,
        f"(i)-(v) hold for {count} pairs of 3 × 3 matrices",
    )


@CHECKS.add("hung1982.III.s7.norm-property-v")
def norm_property_v() -> Finding:
    at_most, equal, count = _submultiplicative()
    return compare(
        equal == count,
        f"equal for {equal} of {count} pairs, at most for {at_most}",
        Verdict.OCR if at_most == count else Verdict.WRONG,
        otherwise_note="$\\le$ is meant, and printed in hung1984; the scan reads the $\\le$ of (13) as = too",
    )


# -- section 8: matrix sums -----------------------------------------------------------------------


@CHECKS.add(*both("eq23"), *both("eq25"), *both("s8.claim-same-as-16"), "hung1984.II.eq24")
def matrix_sum() -> Finding:
    return compare(*surveyed("matrix sum", "(24)"), note="strict: it holds for each entry, by (16)")


@CHECKS.add("hung1982.III.eq24")
def matrix_sum_1982() -> Finding:
    holds, text = surveyed("matrix sum", "(24)")
    beta = all(FloatFormat(b, t).unit_roundoff == Fraction(b) ** (1 - t) / 2 for b in (2, 10) for t in (1, 8))
    return compare(holds and beta, text, note="strict: it holds for each entry, by (16)")


@CHECKS.add("hung1984.II.s8.text-after-24")
def beta_after_24() -> Finding:
    beta = FOUR.unit_roundoff
    factor = beta * 10**3
    return compare(
        factor >= 1 / beta,  # the least that 1/epsilon can be, by (16)
        f"$\\beta={factor}\\,b^{{1-t}}$",
        Verdict.OCR,
        otherwise_note="hung1982 prints $\\frac12$; this scan reads other figures and letters as $\\epsilon$ too, "
        "such as the l of $fl$ in section 11",
    )


# -- section 9: inner products, matrix products, chains -------------------------------------------


@CHECKS.add(*both("s9-1.unnumbered-3-vector-inner-product"), "hung1984.II.s9-1.unnumbered-i")
def three_products() -> Finding:
    return compare(derivation.dots().holds, "the same, by expansion")


@CHECKS.add("hung1982.III.s9-1.unnumbered-i")
def three_products_1982() -> Finding:
    error, (p1, p2, p3), (e1, e2, e3, e4, e5) = derivation.dot_error(3)
    right = p1 * (e1 + e3 + e5) + p2 * (e2 + e3 + e5) + p3 * (e4 + e5)
    return compare(
        bool(sp.expand(error - right - p2) == 0),
        "$a_2b_2(\\epsilon_2+\\epsilon_3+\\epsilon_5)$",
        Verdict.MISPRINT if sp.expand(error - right) == 0 else Verdict.WRONG,
        otherwise_note="a 1 left over from the line above; the bound that follows is right",
    )


def _dot_weights(n: int) -> list[int]:
    error, products, eps = derivation.dot_error(n)
    return [derivation.roundings_of(error, product, eps) for product in products]


@CHECKS.add(*both("s9-1.unnumbered-3-vector-bound"), *both("eq26"))
def dot_bound() -> Finding:
    three, weights = (_dot_weights(n) for n in (3, 6))
    holds, text = surveyed("dot", "(26)")
    worst = experiment.worst_sum(FloatFormat(2, 3), 12, range(-5, 4), products=True)
    return compare(
        holds and three == [3, 3, 2] and weights == theory.dot_weights(6) and derivation.dots().holds,
        f"weights {', '.join(map(str, weights))} for six products; {text}",
        note=f"to first order; 12 products in three bits can exceed it {worst.ratio('(26)'):.3f} times",
    )


@CHECKS.add(*both("s9-1.relative-inner-product-error"))
def relative_dot() -> Finding:
    rng = np.random.default_rng(26)
    fmt = FloatFormat(10, 6)
    holds = True
    for _ in range(200):
        a, b = experiment.random_numbers(rng, fmt, (2, 5))
        true = sum(a.to_fractions() * b.to_fractions())
        bound = theory.relative_dot_bound(a, b, fmt.unit_roundoff)
        holds &= abs((a @ b).to_fractions() / true - 1) <= bound
    return answer(
        bool(holds),
        "$|\\tilde I/I|\\le\\gamma_n\\,|a|^T|b|\\,/\\,|a^Tb|$, $\\gamma_n=n\\beta/(1-n\\beta)$",
        f"{CHAPTER}, section on inner products",
    )


@CHECKS.add("hung1984.II.eq27")
def lost_page() -> Finding:
    return unverifiable("", "the page is missing from the scan; hung1982 (27), its twin, is verified")


@cache
def _entry_bounds() -> tuple[bool, str]:
    """Whether every entry of random products obeys (27)."""
    rng, fmt, count, largest = np.random.default_rng(27), FloatFormat(10, 4), 0, Fraction(0)
    for _ in range(100):
        a, b = experiment.random_numbers(rng, fmt, (2, 4, 4))
        error = abs((a @ b).to_fractions() - theory.product([a, b]))
        bound = theory.matmul_entry_bounds(a, b, fmt.unit_roundoff)
        count += error.size
        largest = max(largest, (error / bound).max())
    return largest <= 1, f"{count} entries, largest error over bound {float(largest):.3g}"


@CHECKS.add("hung1982.III.eq27", "hung1982.III.s9-2.unnumbered-c")
def entry_bound() -> Finding:
    holds, text = _entry_bounds()
    d = np.diag(theory.dot_weights(5))
    return compare(
        holds and derivation.dots().holds and column_sum_norm(d) == 5,
        f"{text}; for $n=5$, $D$ has the diagonal {', '.join(map(str, np.diag(d)))} and norm {column_sum_norm(d)}",
        note="to first order",
    )


@CHECKS.add(*both("eq28"))
def matmul_bound() -> Finding:
    rng, fmt = np.random.default_rng(28), FloatFormat(2, 11)
    trials = [
        experiment.chain_trial(list(experiment.random_numbers(rng, fmt, (2, n, n))))
        for n in (1, 2, 3, 5)
        for _ in range(50)
    ]
    violations = sum(trial.violates("(32)") for trial in trials)
    norms = all(max(theory.dot_weights(n)) == n for n in range(1, 20))
    return compare(
        violations == 0 and norms and fmt.unit_roundoff == Fraction(1, 2) * Fraction(2) ** (1 - 11),
        f"{violations} violations in {len(trials)} random products",
        note="strict, as Jeannerod and Rump proved in 2013",
    )


@CHECKS.add(*both("eq29"), *both("s9-2.partial-products"))
def chain_defined() -> Finding:
    fmt = FloatFormat(10, 12)
    matrices = [fmt.array([[1, 2]]), fmt.array([[3], [4]]), fmt.array([[5, 6, 7]])]
    return compare(
        theory.interfaces(matrices) == [2, 1] and np.shape(theory.product(matrices)) == (1, 3),
        "interface dimensions 2, 1 for 1 × 2, 2 × 1, 1 × 3",
        note="a definition; the product is taken from left to right",
    )


def cancelling_product() -> experiment.Trial:
    """The smallest counterexample to (30): a row and a column whose product cancels; 4 digits."""
    return experiment.chain_trial([FOUR.array([["1.001", "-1.002"]]), FOUR.array([["1.001"], ["1"]])])


def _chain_claim(note: str) -> Finding:
    found, worst = tallies("chain")["(31)"], cancelling_product()
    return compare(
        found.violations == 0 and derivation.chain_shortcut() == 0 and not worst.violates("(31)"),
        f"{found.violations} violations in {found.trials} random chains; $1.001\\cdot1.001-1.002\\cdot1$ in four "
        f"digits exceeds it {worst.ratio('(31)'):.0f} times",
        Verdict.WRONG,
        otherwise_note=note,
    )


@CHECKS.add(*both("s9-2.claim-28-implies"), *both("s9-2.unnumbered-p2-p3"), "hung1984.II.eq30")
def chain_shortcut() -> Finding:
    return _chain_claim(
        "(28) bounds a norm; it does not make the error a multiple of the product, which may cancel while the "
        "error stays"
    )


@CHECKS.add("hung1984.II.eq31", "hung1982.III.eq30-31")
def chain_error() -> Finding:
    return _chain_claim("as (30); a tilde is meant on the left of (31)")


@CHECKS.add("hung1982.III.s9-2.cross-reference-to-28")
def reference_28() -> Finding:
    (number,) = re.findall(r"\((\d+)\)", quote("hung1982.III.s9-2.cross-reference-to-28"))
    cited, meant = CHECKS.get(f"hung1982.III.eq{number}"), CHECKS.get("hung1982.III.eq28")
    return compare(
        cited is matmul_bound,
        "the bound of a matrix product is (28); (38) is an equation of section 10",
        Verdict.MISPRINT if meant is matmul_bound else Verdict.WRONG,
        otherwise_note="(28) is meant, and printed in hung1984",
    )


@CHECKS.add(*both("eq32"))
def chain_bound() -> Finding:
    holds, text = surveyed("chain", "(32)")
    worst = worst_twenty()
    matrices = [worst.inputs[0].format.array([[x]]) for x in worst.inputs[0].to_fractions()]
    return compare(
        holds and derivation.chains().holds,
        f"derived to first order for every $N$; {text}",
        note="right although (30) and (31) are not: errors add up in norm; not strict, since 20 matrices of size "
        f"1 × 1 in two digits exceed it {experiment.chain_trial(matrices).ratio('(32)'):.2f} times",
    )


def _examples_fail() -> tuple[bool, str]:
    found = tallies("example")["Examples"]
    a = FOUR.array([["1.001", "-1.002"], [0, 0]])
    b, one = FOUR.array([["1.001", 0], [1, 0]]), FOUR.array(np.eye(2, dtype=int))
    trial = experiment.example_trial(a, b, one, one * 0)
    corrected = tallies("example")["corrected"].violations
    return found.violations == 0 and not trial.violates("Examples"), (
        f"{found.violations} violations in {found.trials} random trials, a worked one by a factor of "
        f"{trial.ratio('Examples'):.0f}; {corrected} of the corrected bound "
        "$\\beta[(m+r)\\|A\\|\\|B\\|\\|C\\|+\\|ABC+D\\|]$"
    )


@CHECKS.add(
    *both("s9-2.claim-24-and-31"),
    "hung1984.II.s9-2.example-1",
    "hung1984.II.s9-2.example-2",
    "hung1982.III.s9-2.examples-1-2",
)
def examples() -> Finding:
    agrees, text = _examples_fail()
    return compare(
        agrees,
        text,
        Verdict.WRONG,
        otherwise_note="built on (31): $\\|ABC\\|$ stands where $\\|A\\|\\|B\\|\\|C\\|$ must; chapter II takes the "
        "same step from (102) on",
    )


@CHECKS.add(*both("s9-2.closing-remark"))
def closing_remark() -> Finding:
    beta = FOUR.unit_roundoff
    matrices = [exact(np.full(shape, 1)) for shape in ((2, 3), (3, 5), (5, 2))]
    ratio = theory.chain_bound(matrices, beta) / (beta * math.prod(map(column_sum_norm, matrices)))
    wide, narrow = exact(np.full((1, 9), 1)), exact(np.full((1, 2), 1))
    same = theory.matrix_sum_bound(wide, wide, beta) == theory.matrix_sum_bound(narrow, narrow, beta)
    return compare(
        bool(ratio == 3 + 5 and same), f"for 2 × 3, 3 × 5, 5 × 2 the factor of (32) is $3+5={ratio}$; (24) has none"
    )
