"""A check for each ledger entry of hung1984, ch. II, and hung1982, ch. III, sections 10-11."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.arithmetic.rational import column_sum_norm, exact, inverse_of
from gpbnb.inversion import derivation, example, experiment, procedure, theory
from gpbnb.inversion.theory import Reduction
from gpbnb.ledger.finding import Finding, Verdict, compare, unverifiable
from gpbnb.ledger.registry import Checks, both
from gpbnb.ledger.statements import load_statements, quote

CHECKS = Checks()

FOUR = FloatFormat(10, 4)
Matrix = NDArray[Any]


def in_brackets(key: str) -> str:
    """The number in brackets that an entry prints."""
    (found,) = re.findall(r"\((\d+)\)", quote(key))
    return str(found)


# -- material -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sample:
    """A matrix inverted in a format, and all that was computed on the way, exact."""

    matrix: FloatArray
    pivot: bool

    @property
    def beta(self) -> Fraction:
        """Unit roundoff of the format."""
        return self.matrix.format.unit_roundoff

    @cached_property
    def reduction(self) -> Reduction:
        """Stages, right sides and inverse, as Fractions."""
        stages, rights, solution = procedure.reduce(self.matrix, self.pivot)
        return Reduction([exact(s) for s in stages], [exact(r) for r in rights], exact(solution))

    @cached_property
    def general(self) -> list[Matrix]:
        """Stages of two right sides without zeros and ones, as Fractions."""
        n, fmt = len(self.matrix), self.matrix.format
        columns = np.random.default_rng((n, fmt.base, fmt.precision)).integers(101, 999, (n, 2))
        triangular = procedure.triangularize(self.matrix, self.pivot)
        return [exact(stage) for stage in procedure.transform(triangular, fmt.array(columns.tolist()))]

    @cached_property
    def lower(self) -> Matrix:
        """L, not rounded."""
        return theory.lower_factor(self.reduction.stages)

    @cached_property
    def inverse(self) -> Matrix:
        """The true inverse of the given matrix, its rows in the order of elimination."""
        return inverse_of(self.reduction.stages[0])

    @cached_property
    def error(self) -> Matrix:
        """The error of the computed inverse, not its size."""
        return np.asarray(self.reduction.solution - self.inverse @ self.reduction.rights[0])

    def step_errors(self, right: bool = False) -> list[Matrix]:
        """What each step adds to the exact step on computed numbers, of the matrix or of the right sides."""
        found = []
        parts = self.general if right else self.reduction.stages
        for k in range(1, len(parts)):
            step = exact(np.eye(len(parts), dtype=int))
            step[k:, k - 1] = -self.lower[k:, k - 1]
            found.append(np.asarray(parts[k] - step @ parts[k - 1]))
        return found


@cache
def samples() -> tuple[Sample, ...]:
    """Random matrices of two to four rows in three formats, with and without pivoting, and that of 11.4."""
    rng = np.random.default_rng(1984)
    found = [Sample(FOUR.array(example.MATRIX), False)]
    for fmt in (FOUR, FloatFormat(10, 7), FloatFormat(2, 11, Rounding.CHOP)):
        for n in (2, 3, 4):
            for i in range(8):
                found.append(Sample(fmt.array(rng.integers(-999, 1000, (n, n)).tolist()), pivot=i % 2 == 0))
    return tuple(found)


@dataclass(frozen=True)
class Held:
    """In how many of the samples an inequality fails, and the quotients of the others, least and largest."""

    count: int
    fails: int
    least: float
    largest: float

    def __str__(self) -> str:
        return f"exceeded in {self.fails} of {self.count} inversions"


def held(pairs: Callable[[Sample], Iterable[tuple[Any, Any]]]) -> Held:
    """Compare sizes with their bounds, entry by entry, in all samples."""
    fails, least, largest = 0, Fraction(1), Fraction(0)
    for sample in samples():
        exceeded = False
        for observed, bound in pairs(sample):
            for x, y in zip(np.ravel(np.asarray(observed)), np.ravel(np.asarray(bound)), strict=True):
                if abs(x) > abs(y):
                    exceeded = True
                elif y:
                    least, largest = min(least, abs(x / y)), max(largest, abs(x / y))
        fails += exceeded
    return Held(len(samples()), fails, float(least), float(largest))


def zero(expression: Any) -> bool:
    """Whether an expression, or each entry of a matrix, vanishes."""
    entries = list(expression) if isinstance(expression, sp.MatrixBase) else [expression]
    return all(bool(sp.simplify(sp.expand(entry)) == 0) for entry in entries)


def of_example(norm: Callable[[Matrix], Any] = column_sum_norm) -> tuple[Sample, float]:
    """The example of 11.4 in four digits, and the norm of its error."""
    sample = samples()[0]
    return sample, float(norm(sample.error))


# -- section 10 -----------------------------------------------------------------------------------


@CHECKS.add(*both("s10.inverse-definition"), "hung1984.II.eq33", "hung1984.II.s10.claim-n-solutions")
def columns_of_the_inverse() -> Finding:
    agree = all(
        (sample.reduction.stages[0] @ sample.inverse == exact(np.eye(len(sample.lower), dtype=int))).all()
        for sample in samples()
    )
    a = samples()[0].matrix
    one = linalg.solve(a, a.format.array([0, 1, 0]))
    same = bool((one == linalg.inv(a)[:, 1]).all())
    return compare(
        agree and same,
        f"$AA^{{-1}}=I$ exactly for {len(samples())} matrices; solving for $u_2$ alone gives the second column, "
        "digit by digit",
        note="a definition",
    )


@CHECKS.add(*both("s10.claim-partial-pivoting"))
def partial_pivoting() -> Finding:
    swap = FOUR.array([[0, 1], [1, 0]])
    try:
        linalg.inv(swap)
        without = True
    except np.linalg.LinAlgError:
        without = False
    with_pivots = bool((linalg.inv(swap, pivot=True) == swap).all())
    small = FOUR.array([["0.0001", 1], [1, 1]])
    errors = [float(column_sum_norm(Sample(small, pivot).error)) for pivot in (False, True)]
    return compare(
        with_pivots and not without and errors[0] > 100 * errors[1],
        f"rows (0, 1), (1, 0) have no first pivot; rows (.0001, 1), (1, 1) in four digits: error {errors[0]:.2g} "
        f"without, {errors[1]:.2g} with pivoting",
        note="section 11 goes on without pivoting, and its flow chart has none",
    )


@CHECKS.add("hung1982.III.s10.cross-reference-to-33")
def reference_33() -> Finding:
    numbers = in_brackets("hung1982.III.s10.cross-reference-to-33"), 33
    cited, meant = (CHECKS.get(f"hung1984.II.eq{number}") for number in numbers)
    return compare(
        cited is columns_of_the_inverse,
        "what is solved $n$ times is (33); (29) is a chain of matrix products",
        Verdict.MISPRINT if meant is columns_of_the_inverse else Verdict.WRONG,
        otherwise_note="(33) is meant, and printed in hung1984",
    )


@CHECKS.add("hung1984.II.eq34", "hung1984.II.eq35", "hung1984.II.eq36", "hung1984.II.eq37", "hung1984.II.eq38")
def residuals() -> Finding:
    def holds(sample: Sample) -> bool:
        x = sample.reduction.solution @ sample.reduction.rights[0].T
        residual = theory.residual(sample.reduction.stages[0], x)
        return bool((x - sample.inverse == sample.inverse @ residual).all())

    count = sum(map(holds, samples()))
    return compare(
        count == len(samples()) and derivation.first_approach().holds_at(0, 1),
        f"$E=A^{{-1}}R$ exactly, derived for every $n$ and computed for {count} of {len(samples())} inverses",
    )


@CHECKS.add("hung1984.II.eq39", "hung1984.II.eq40")
def residual_norms() -> Finding:
    def pairs(sample: Sample) -> Iterable[tuple[Any, Any]]:
        x = sample.reduction.solution @ sample.reduction.rights[0].T
        residual = theory.residual(sample.reduction.stages[0], x)
        error = column_sum_norm(x - sample.inverse)
        yield error, theory.printed_first_bound(sample.inverse, residual)
        yield error / column_sum_norm(sample.inverse), theory.printed_first_relative_bound(sample.inverse, residual)

    found = held(pairs)
    return compare(
        found.fails == 0 and derivation.first_approach_norms().holds_at(0),
        f"{found}; error over bound up to {found.largest:.2g}",
        note="strict",
    )


@CHECKS.add("hung1982.III.eq33-41")
def first_approach_1982() -> Finding:
    parts = (columns_of_the_inverse, residuals, residual_norms, changed_residue)
    found = [part() for part in parts]
    return compare(
        all(bool(each.agrees) for each in found),
        f"the checks of (33)-(41) of hung1984: {sum(bool(each.agrees) for each in found)} of {len(parts)} agree",
    )


@CHECKS.add("hung1984.II.eq41", *both("s10.residue-of-41"), "hung1984.II.s10.line-before-42")
def changed_residue() -> Finding:
    h, u_j, change = sp.symbols("h u Delta", commutative=False)
    a, hat = sp.symbols("A H", commutative=False)
    residue = (a + change) * hat - u_j
    line = hat + a**-1 * change * hat - a**-1 * u_j - a**-1 * residue
    second = (a**-1 * u_j).subs(u_j, a * h) - h
    return compare(
        zero(line) and zero(second),
        "both sides of the line agree, and $A^{-1}u_j=h_j$",
        note="(41) and the residue are definitions",
    )


@CHECKS.add("hung1984.II.eq42")
def changed_error() -> Finding:
    return compare(derivation.first_approach().holds_at(2), "the same, exactly, for every $n$")


@CHECKS.add("hung1982.III.eq42")
def changed_error_1982() -> Finding:
    numbers = in_brackets("hung1982.III.eq42"), 42
    numbered, cited = (CHECKS.get(f"hung1982.III.eq{number}") for number in numbers)
    right = derivation.first_approach().holds_at(2)
    return compare(
        numbered is changed_error_1982 and right,
        "the equation is right; (43) is the number of the next one, and the text below cites this one as (42)",
        Verdict.OCR if cited is changed_error_1982 and right else Verdict.WRONG,
        otherwise_note="the scan shows (43) twice",
    )


@CHECKS.add(*both("s10.unnumbered-e"))
def changed_matrix_error() -> Finding:
    return compare(
        derivation.first_approach().holds_at(3, 4),
        "exact with the computed inverse; what $\\approx$ drops is $A^{-1}\\Delta A\\,E$",
        note="to first order, as $\\approx$ says",
    )


def shrunk(by: Fraction) -> tuple[Fraction, Fraction, Fraction]:
    """Error, (43) and its strict form for the identity, of which the part `by` is taken away."""
    identity = exact(np.eye(2, dtype=int))
    change = -by * identity
    inexact = inverse_of(identity + change)
    residual = theory.residual(identity + change, inexact)
    return (
        column_sum_norm(inexact - identity),
        theory.printed_first_bound(identity, residual, change),
        theory.strict_first_bound(identity, residual, change),
    )


@CHECKS.add(*both("eq43"))
def changed_norm() -> Finding:
    error, printed, strict = shrunk(Fraction(1, 10))
    first_order = abs(shrunk(Fraction(1, 10**6))[0] / shrunk(Fraction(1, 10**6))[1] - 1) < Fraction(1, 10**5)
    return compare(
        bool(first_order) and error == strict,
        f"to first order; for $A=I$, $\\Delta A=-I/10$ the error is {error} and (43) {printed}; over "
        "$1-\\|A^{-1}\\|\\|\\Delta A\\|$ it is strict",
        note="to first order, as $\\approx$ before it says",
    )


def _relative_equality() -> tuple[int, int, int]:
    """In how many samples ‖E‖/‖A⁻¹‖ equals (44), and in how many it is at most that, for a change of 0.1 %."""
    equal = below = 0
    for sample in samples():
        a, n = sample.reduction.stages[0], len(sample.lower)
        change = a * Fraction(1, 1000)
        x = inverse_of(a + change)
        ratio = column_sum_norm(x - sample.inverse) / column_sum_norm(sample.inverse)
        printed = theory.printed_first_relative_bound(sample.inverse, exact(np.zeros((n, n), int)), change)
        equal += ratio == printed
        below += ratio <= printed
    return equal, below, len(samples())


@CHECKS.add("hung1984.II.eq44")
def relative_error() -> Finding:
    equal, below, count = _relative_equality()
    return compare(
        equal == count,
        f"equal in {equal} of {count} cases, at most in {below}",
        Verdict.MISPRINT if below == count else Verdict.WRONG,
        otherwise_note="$\\le$ is meant, as in (43) and in hung1982 (44)",
    )


@CHECKS.add("hung1982.III.eq44")
def relative_error_1982() -> Finding:
    _, below, count = _relative_equality()
    return compare(
        below == count and derivation.first_approach_norms().holds_at(0),
        f"at most in {below} of {count} cases",
        note="to first order in $\\Delta A$",
    )


@CHECKS.add(*both("s10.claim-special-case"))
def special_case() -> Finding:
    sample, _ = of_example()
    residual = theory.residual(sample.reduction.stages[0], sample.reduction.solution)
    with_zero = theory.printed_first_relative_bound(sample.inverse, residual, residual * 0)
    return compare(
        with_zero == theory.printed_first_relative_bound(sample.inverse, residual) == column_sum_norm(residual),
        "(44) with $\\Delta A=0$ is $\\|R\\|$",
    )


@CHECKS.add(*both("s10.practicality-of-44"))
def practicality() -> Finding:
    sample, _ = of_example()
    twice = FloatFormat(10, 2 * FOUR.precision)
    a, x = (twice.array(part.to_fractions()) for part in (sample.matrix, linalg.inv(sample.matrix)))
    computed = exact(a @ x - twice.array(np.eye(3, dtype=int)))
    true = theory.residual(sample.matrix, sample.reduction.solution)
    apart = column_sum_norm(computed - true) / column_sum_norm(true)
    trial = experiment.trial(sample.matrix, False, experiment.BETTER)
    tightest = min(trial.bounds, key=trial.ratio)
    easy = apart < Fraction(1, 100) and tightest == "a posteriori" and not trial.violates(tightest)
    return compare(
        not easy,
        f"one product in {twice.precision} digits gives $R$ of the example of 11.4 "
        f"{'exactly' if apart == 0 else f'to {float(apart):.0e}'}; the bound from it is {trial.ratio(tightest):.4g} "
        f"times the error, the tightest of {len(trial.bounds)}",
        Verdict.WRONG,
        otherwise_note="$R$ costs one matrix product with twice the digits; that β is not in (43) and (44) is their "
        "strength: they bound the error that was made, not the one that might have been",
    )


@CHECKS.add(*both("s11.claim-two-parts"))
def two_parts() -> Finding:
    def holds(sample: Sample) -> bool:
        inverse = linalg.inv(sample.matrix, sample.pivot)
        return bool((inverse == procedure.reduce(sample.matrix, sample.pivot).solution).all())

    count = sum(map(holds, samples()))
    return compare(
        count == len(samples()),
        f"triangularization, the same steps on the columns of the identity, and back substitution give all digits of "
        f"the inverse in {count} of {len(samples())} cases",
        note="the right sides, which are transformed in between, are counted to the first part",
    )


# -- section 11.1: one step -----------------------------------------------------------------------


def _printed_steps(sample: Sample, right: bool) -> Iterable[tuple[Matrix, Matrix, Matrix]]:
    """Each step's true errors, those of (48)-(52) with one ε = β, and the sizes 3|â(k)| + 2|â(k-1)|."""
    parts = sample.general if right else sample.reduction.stages
    for k, error in enumerate(sample.step_errors(right), start=1):
        new, old = (theory.trailing(parts[i], k, columns=not right) for i in (k, k - 1))
        yield error, sample.beta * (3 * new - 2 * old), sample.beta * (3 * abs(new) + 2 * abs(old))


@cache
def _steps(right: bool, corrected: bool, step: int | None = None) -> Held:
    """Whether errors of all steps, or of one, stay below the printed form or below its sizes."""

    def pairs(sample: Sample) -> Iterable[tuple[Any, Any]]:
        for k, (error, printed, sizes) in enumerate(_printed_steps(sample, right), start=1):
            if step is None or k == step:
                yield error, sizes if corrected else printed

    return held(pairs)


def _one_epsilon(printed: Held, corrected: Held, extra: str = "") -> Finding:
    return compare(
        printed.fails == 0,
        f"{printed}; with $3|\\cdot|+2|\\cdot|$ in {corrected.fails}, up to {corrected.largest:.2g} of it",
        Verdict.WRONG,
        otherwise_note="three roundings have three errors, $\\epsilon_3a(1)-(\\epsilon_1+\\epsilon_2)(a(0)-a(1))$: "
        f"one $\\epsilon$ with a sign lets $3a(1)$ and $2a(0)$ cancel, the errors do not{extra}",
    )


@CHECKS.add(*both("s11.claim-one-epsilon"))
def one_epsilon() -> Finding:
    found = derivation.entry()
    zero_there = zero(derivation.printed_entry_error().subs({found.old: 3, found.new: 2}))
    largest = max(
        abs(derivation.entry_error().subs({found.old: 3, found.new: 2, **dict(zip(found.errors, signs, strict=True))}))
        for signs in ((s, t, u) for s in (-1, 1) for t in (-1, 1) for u in (-1, 1))
    )
    printed = _steps(False, False)
    return compare(
        not (zero_there and largest > 0) and printed.fails == 0,
        f"for $a(0)=3$, $a(1)=2$ the one $\\epsilon$ gives no error, three of them up to ${largest}\\beta$; (48) and "
        f"(51) are {printed}",
        Verdict.WRONG,
        otherwise_note="the worst sizes of the errors may be added, not the errors with the sign of their coefficients",
    )


@CHECKS.add("hung1984.II.eq45", "hung1982.III.eq45", "hung1984.II.eq46", "hung1982.III.eq46")
def first_multiplier() -> Finding:
    sample, _ = of_example()
    a = sample.reduction.stages[0]
    m = -a[1, 0] / a[0, 0]
    return compare(
        m == -sample.lower[1, 0] and a[1, 0] + m * a[0, 0] == 0,
        f"$m_{{21}}={float(m):.4f}$ in the example of 11.4; it makes $a_{{21}}$ zero",
        note="(45) names the unknowns; that $m_{21}$ is rounded is counted in the $3\\epsilon$ of the next lines",
    )


@CHECKS.add(*both("s11-1.a-22-1-definition"))
def reduced_entry() -> Finding:
    found = derivation.stages(2)
    a = found.given
    printed = a[1, 1] - a[1, 0] / a[0, 0] * a[0, 1]
    exact_step = sp.solve(found.change[1, 1], found.upper[1, 1])
    return compare(
        len(exact_step) == 1 and zero(exact_step[0] - printed),
        f"${sp.latex(exact_step[0])}$",
        note="a definition: the entry that leaves no change",
    )


@CHECKS.add(
    "hung1984.II.s11-1.unnumbered-a22-1",
    "hung1984.II.s11-1.unnumbered-a23-a32-a33-1",
    "hung1982.III.s11-1.a22-1",
    "hung1984.II.s11-1.a-33-2",
)
def one_entry() -> Finding:
    found, eps = derivation.entry(), derivation.EPSILON
    one = derivation.entry_error().subs(dict.fromkeys(found.errors, eps))
    lines = (
        found.old * (1 + eps) - found.product * (1 + 3 * eps),
        (found.old - found.product) + found.old * eps - found.product * 3 * eps,
        found.new + derivation.printed_entry_error(),
    )
    return compare(
        zero(one - derivation.printed_entry_error())
        and derivation.one_step().holds_at(0)
        and all(zero(line - lines[0]) for line in lines[1:]),
        "the same, to first order, with one $\\epsilon$ for division, product and sum",
        note="with an error for each, $\\epsilon_3a(1)-(\\epsilon_1+\\epsilon_2)(a(0)-a(1))$",
    )


@CHECKS.add("hung1984.II.eq47")
def errors_of_the_first_step() -> Finding:
    return _one_epsilon(_steps(False, False, 1), _steps(False, True, 1))


@CHECKS.add("hung1982.III.eq47")
def errors_of_the_first_step_1982() -> Finding:
    found = derivation.entry()
    printed = derivation.EPSILON * (3 * found.new - 2 * found.new)
    meant = zero(derivation.printed_entry_error() - derivation.EPSILON * (3 * found.new - 2 * found.old))
    return compare(
        zero(printed - derivation.printed_entry_error()),
        "$3\\epsilon\\,a_{ij}(1)-2\\epsilon\\,a_{ij}(0)$, as its own (48) has it",
        Verdict.MISPRINT if meant else Verdict.WRONG,
        otherwise_note="the second (1) is a slip for (0), mended in hung1984; the formula meant has the fault of (48)",
    )


#: Where the blocks of the two steps of a 3 × 3 matrix have entries, and those of its right side, as printed.
BLOCKS = {
    1: ([[0, 0, 0], [0, 1, 1], [0, 1, 1]], [[0], [1], [1]]),
    2: ([[0, 0, 0], [0, 0, 0], [0, 0, 1]], [[0], [0], [1]]),
}


@CHECKS.add(
    *(f"hung1984.II.s11-1.{name}-definition" for name in ("a-1", "b-1", "a-2", "b-2")), "hung1982.III.s11-1.blocks"
)
def blocks() -> Finding:
    sample, _ = of_example()
    stages, rights = sample.reduction.stages, sample.general
    agree = True
    for k, (of_matrix, of_right) in BLOCKS.items():
        for i in (k - 1, k):
            agree &= bool((theory.trailing(stages[i], k) == stages[i] * exact(of_matrix)).all())
            agree &= bool((theory.trailing(rights[i], k, columns=False) == rights[i] * exact(of_right)).all())
        changed = np.asarray(stages[k] != stages[k - 1])
        agree &= bool((changed == (exact(of_matrix) != 0))[:, k:].all() and not changed[:, : k - 1].any())
    return compare(
        agree,
        "in the example of 11.4 each step changes these entries and no others, but for the column it clears",
        note="definitions; $\\hat A_1(0)$ has a hat and its entries none, by (55) the same",
    )


@CHECKS.add(*both("eq48"))
def error_matrix_of_the_first_step() -> Finding:
    return _one_epsilon(_steps(False, False, 1), _steps(False, True, 1))


@CHECKS.add(*both("s11-1.claim-available"))
def available() -> Finding:
    differences = []
    for sample in samples():
        n = len(sample.lower)
        first = sample.step_errors()[0]
        computed = theory.trailing(sample.reduction.stages[1], 1)
        before = computed - first
        apart = column_sum_norm(3 * computed - 3 * before)
        size = column_sum_norm(3 * abs(computed) + 2 * abs(theory.trailing(sample.reduction.stages[0], 1)))
        if n > 1 and size:
            differences.append(apart / (size * 3 * sample.beta))
    return compare(
        max(differences) <= 1,
        f"with $\\hat A$ for $A$ the bound changes by at most {float(max(differences)):.2g} times $3\\beta$ of "
        "itself: a second-order matter",
    )


@CHECKS.add("hung1984.II.s11-1.b-i-1-definition")
def right_side_definition() -> Finding:
    m, bi, b1 = sp.symbols("m b_i b_1")
    quotient = -m  # m = -a_i1/a_11, (46)
    first, second, meant = bi - m * bi, bi - quotient * bi, bi - quotient * b1
    return compare(
        zero(first - meant) and zero(second - meant),
        "$b_i(0)+m_{i1}b_1(0)=b_i(0)-\\frac{a_{i1}(0)}{a_{11}(0)}b_1(0)$",
        Verdict.MISPRINT if zero(meant - (bi + m * b1)) else Verdict.WRONG,
        otherwise_note="two slips: the sign of $m_{i1}$, which contains the minus of (46), and $b_i(0)$ for $b_1(0)$ "
        "in the product; the last line below is right for $b_1(0)$",
    )


@CHECKS.add("hung1982.III.s11-1.b-i-1-definition")
def right_side_definition_1982() -> Finding:
    follows = right_side_step_1982().agrees
    return unverifiable(
        f"the next line, with $b_1(0)$ in the product, is {'right' if follows else 'not right'}: hung1984 has not its "
        "slips from there",
        "the line is lost from the scan",
    )


@CHECKS.add("hung1984.II.s11-1.b-i-1")
def right_side_step() -> Finding:
    q, bi, b1 = sp.symbols("q b_i b_1")
    eps = derivation.EPSILON
    last = (bi - q * b1) * (1 + 3 * eps) - 2 * eps * bi
    printed, meant = (bi * (1 + eps) - q * factor * (1 + 3 * eps) for factor in (bi, b1))
    second = (bi - q * b1) + eps * bi - 3 * eps * q * b1
    return compare(
        zero(printed - last),
        "with $b_1(0)$ in the product the last form follows, with $b_i(0)$ it does not",
        Verdict.MISPRINT if zero(meant - last) and zero(second - last) else Verdict.WRONG,
        otherwise_note="$b_i(0)$ for $b_1(0)$ in the product, in two lines; hung1982 has it right",
    )


@CHECKS.add("hung1982.III.s11-1.b-i-1")
def right_side_step_1982() -> Finding:
    q, bi, b1 = sp.symbols("q b_i b_1")
    eps = derivation.EPSILON
    last = (bi - q * b1) * (1 + 3 * eps) - 2 * eps * bi
    return compare(
        zero(bi * (1 + eps) - q * b1 * (1 + 3 * eps) - last),
        "$=b_i(1)+3\\epsilon b_i(1)-2\\epsilon b_i(0)$",
        note="with one $\\epsilon$ for three roundings",
    )


@CHECKS.add(*both("eq49"))
def right_side_errors() -> Finding:
    return _one_epsilon(
        _steps(True, False, 1), _steps(True, True, 1), "; with β for $\\epsilon$ they are gone altogether"
    )


@CHECKS.add("hung1984.II.s11-1.matrix-after-first-step")
def after_the_first_step() -> Finding:
    sample, _ = of_example()
    first = sample.reduction.stages[1]
    same = (first[0] == sample.reduction.stages[0][0]).all() and not first[1:, 0].any()
    changed = (first[1:, 1:] != sample.reduction.stages[0][1:, 1:]).all()
    return compare(bool(same and changed), "so in the example of 11.4: first row unchanged, first column cleared")


@CHECKS.add("hung1982.III.s11-1.matrix-after-first-step")
def after_the_first_step_1982() -> Finding:
    sample, _ = of_example()
    zeroth, first = sample.reduction.stages[:2]
    return compare(
        bool((zeroth[1:, 1] == first[1:, 1]).all()),
        f"the second column of the example of 11.4 changes from {float(zeroth[1, 1]):g}, {float(zeroth[2, 1]):g} to "
        f"{float(first[1, 1]):g}, {float(first[2, 1]):g}",
        Verdict.MISPRINT if (zeroth[0] == first[0]).all() else Verdict.WRONG,
        otherwise_note="(0) for (1) in two entries, mended in hung1984",
    )


@CHECKS.add(*both("s11-1.claim-compounded"))
def compounded() -> Finding:
    def pairs(sample: Sample) -> Iterable[tuple[Any, Any]]:
        n = len(sample.lower)
        change = sample.lower @ sample.reduction.stages[-1] - sample.reduction.stages[0]
        yield change - sum(sample.step_errors(), start=exact(np.zeros((n, n), int))), exact(np.zeros((n, n), int))

    found = held(pairs)
    return compare(
        found.fails == 0 and derivation.reductions().holds,
        f"$L\\hat A_T-A=\\tilde A(1)+\\tilde A(2)+\\dots$ exactly in {found.count - found.fails} of {found.count} "
        "inversions",
        note="compounded in $\\hat A_T$; as changes of the given matrix the errors of the steps simply add up, which "
        "is why (53) may add them",
    )


# -- section 11.1: all steps ----------------------------------------------------------------------


@CHECKS.add("hung1984.II.eq50", *both("s11-1.a-33-2-definition"), "hung1984.II.s11-1.b-3-2-definition")
def second_step() -> Finding:
    sample, _ = of_example()
    stage, right = sample.reduction.stages[1], sample.general[1]
    m = -stage[2, 1] / stage[1, 1]
    residual = sample.step_errors()[1][2, 2], sample.step_errors(right=True)[1][2, 0]
    agree = (
        sample.reduction.stages[2][2, 2] - residual[0] == stage[2, 2] + m * stage[1, 2]
        and sample.general[2][2, 0] - residual[1] == right[2, 0] + m * right[1, 0]
    )
    return compare(
        bool(agree and stage[2, 1] + m * stage[1, 1] == 0), f"$m_{{32}}={float(m):.4f}$ in the example of 11.4"
    )


@CHECKS.add("hung1982.III.eq50")
def second_step_1982() -> Finding:
    parts = (second_step(), one_entry())
    return compare(all(bool(part.agrees) for part in parts), "as (50) and the lines after it in hung1984")


@CHECKS.add(*both("eq51"))
def errors_of_the_second_step() -> Finding:
    return _one_epsilon(_steps(False, False, 2), _steps(False, True, 2))


@CHECKS.add("hung1984.II.s11-1.b-3-2")
def right_side_second_step() -> Finding:
    found = derivation.entry()
    one = found.computed.subs(dict.fromkeys(found.errors, derivation.EPSILON))
    first = derivation.linear(one)
    hat = derivation.linear(one + 3 * derivation.EPSILON * found.new - 2 * derivation.EPSILON * found.old)
    meant = zero(first - derivation.printed_entry_error())
    return compare(
        zero(first - hat),
        "$b_3(2)+3\\epsilon b_3(2)-2\\epsilon\\hat b_3(1)$, without a hat on the first $b_3(2)$",
        Verdict.MISPRINT if meant else Verdict.WRONG,
        otherwise_note="as printed the error would be zero; hung1982 has no hat there",
    )


@CHECKS.add("hung1984.II.eq52")
def right_side_errors_of_the_second_step() -> Finding:
    return _one_epsilon(
        _steps(True, False, 2),
        _steps(True, True, 2),
        "; besides, $\\hat b_2(2)$ in the middle is a slip for $\\hat b_2(1)$",
    )


@CHECKS.add("hung1982.III.eq52")
def right_side_errors_of_the_second_step_1982() -> Finding:
    return _one_epsilon(_steps(True, False, 2), _steps(True, True, 2))


@cache
def _sums(right: bool, corrected: bool) -> Held:
    def pairs(sample: Sample) -> Iterable[tuple[Any, Any]]:
        stages, general = sample.reduction.stages, sample.general
        if right:
            bound = theory.right_side_bounds if corrected else theory.printed_right_side_error
            yield sample.lower @ general[-1] - general[0], bound(general, sample.beta)
        else:
            limit = theory.triangularization_bounds if corrected else theory.printed_triangularization_error
            yield sample.lower @ stages[-1] - stages[0], limit(stages, sample.beta)

    return held(pairs)


ADDS_UP = "; that the steps add up is right, as a change of the given matrix: $L\\hat A_T=A+\\tilde A$"


@CHECKS.add("hung1984.II.eq53", "hung1984.II.eq59")
def triangularization_error() -> Finding:
    return _one_epsilon(_sums(False, False), _sums(False, True), ADDS_UP)


@CHECKS.add("hung1984.II.eq54", "hung1984.II.eq60")
def right_side_error() -> Finding:
    return _one_epsilon(_sums(True, False), _sums(True, True), ADDS_UP)


@CHECKS.add("hung1982.III.eq53-54", "hung1982.III.eq59-60")
def triangularization_errors_1982() -> Finding:
    worse = max((_sums(right, False) for right in (False, True)), key=lambda found: found.fails)
    return _one_epsilon(
        worse, max((_sums(r, True) for r in (False, True)), key=lambda f: (f.fails, f.largest)), ADDS_UP
    )


@CHECKS.add("hung1984.II.eq55", "hung1984.II.eq56", "hung1984.II.eq57", "hung1982.III.eq55-57")
def stages_defined() -> Finding:
    agree = all((sample.reduction.stages[0][0] == exact(sample.reduction.stages[-1])[0]).all() for sample in samples())
    held_exactly = all(
        sorted(map(tuple, sample.reduction.stages[0])) == sorted(map(tuple, exact(sample.matrix)))
        for sample in samples()
    )
    return compare(
        bool(agree and held_exactly),
        "$\\hat A(0)$ is the given matrix, but for the order of its rows with pivoting",
        note="definitions; that $\\hat A(0)=A$ takes entries that fit into the format",
    )


def _partial_size(n: int, k: int) -> int:
    """Rows of the block that step k changes."""
    return sum(bool(theory.trailing(exact(np.ones((n, n), int)), k)[i].any()) for i in range(n))


@CHECKS.add("hung1984.II.eq58")
def partial_matrix() -> Finding:
    printed = quote("hung1984.II.eq58")
    right = all(_partial_size(n, k) == n - k for n in (3, 4, 5) for k in range(1, n))
    indices = set(re.findall(r"\$A_(\w)", printed)) | set(re.findall(r"n-(\w)", printed))
    return compare(
        len(indices) == 1,
        f"$A_i$ has a block of $n-i$ rows, {_partial_size(5, 2)} for $n=5$, $i=2$",
        Verdict.MISPRINT if right else Verdict.WRONG,
        otherwise_note="one index with two names, $j$ on the left and $i$ in the block",
    )


@CHECKS.add("hung1982.III.eq58")
def partial_matrix_1982() -> Finding:
    sizes = {(n, k): _partial_size(n, k) for n in (3, 4, 5) for k in range(1, n)}
    return compare(
        all(size == n - 1 for (n, _), size in sizes.items()),
        f"the block of $A_2$ has {sizes[5, 2]} rows for $n=5$, not 4",
        Verdict.OCR if all(size == n - k for (n, k), size in sizes.items()) else Verdict.WRONG,
        otherwise_note="the scan reads $(n-1)$ by $(n-i)$; hung1984 has $(n-i)$ twice, and $j$ for $i$ on the left",
    )


@CHECKS.add("hung1984.II.eq61")
def triangularization_norm() -> Finding:
    return _norm_finding(False, "; besides, the sum runs over $i$ and its terms are of $k$")


@CHECKS.add("hung1984.II.eq62")
def right_side_norm() -> Finding:
    return _norm_finding(True)


@CHECKS.add("hung1982.III.eq61-62")
def norms_1982() -> Finding:
    return _norm_finding(True, "; (61) is not legible")


def _norm_finding(right: bool, extra: str = "") -> Finding:
    def pairs(sample: Sample) -> Iterable[tuple[Any, Any]]:
        stages, general = sample.reduction.stages, sample.general
        if right:
            change = sample.lower @ general[-1] - general[0]
            yield abs(change).max(axis=0), theory.printed_right_side_norms(general, sample.beta)
        else:
            change = sample.lower @ stages[-1] - stages[0]
            yield column_sum_norm(change), theory.printed_triangularization_norm(stages, sample.beta)

    found = held(pairs)
    return compare(
        found.fails == 0 and found.least == 1,
        f"{found}; at most {found.largest:.2g} of it",
        Verdict.MISPRINT if found.fails == 0 else Verdict.WRONG,
        otherwise_note="$\\le$ is meant. Sizes are added here as they must be, and it is a bound to first order; but "
        f"the procedure of 11.3 does not use it{extra}",
    )


@CHECKS.add(*both("s11-1.claim-upper-triangular"), "hung1984.II.s11-1.a-t-a-n-1", "hung1982.III.s11-1.a-t")
def upper_triangular() -> Finding:
    count = sum(
        not np.tril(np.asarray(sample.reduction.stages[-1] != 0), -1).any()
        and len(sample.reduction.stages) == len(sample.lower)
        for sample in samples()
    )
    return compare(
        count == len(samples()), f"so in {count} of {len(samples())} inversions, with the computed $\\hat A(n-1)$"
    )


@CHECKS.add(*both("eq63"))
def triangular_matrix() -> Finding:
    def superscripts(printed: bool) -> bool:
        for sample in samples():
            stages = sample.reduction.stages
            n = len(stages)
            for i in range(n):
                for j in range(i, n):
                    stage = i if i == j or not printed else 0
                    if stages[-1][i, j] != stages[stage][i, j]:
                        return False
        return True

    return compare(
        superscripts(True),
        "row $k$ of $\\hat A_T$ is that of $\\hat A(k-1)$, off the diagonal too",
        Verdict.MISPRINT if superscripts(False) else Verdict.WRONG,
        otherwise_note="(0) for $(k-1)$ right of the diagonal; the diagonal is right, and nothing later uses the "
        "superscripts",
    )


@CHECKS.add(*both("eq64"))
def triangular_right_side() -> Finding:
    count = sum(
        all((sample.reduction.rights[-1][i] == sample.reduction.rights[i][i]).all() for i in range(len(sample.lower)))
        for sample in samples()
    )
    return compare(count == len(samples()), f"so in {count} of {len(samples())} inversions")


# -- section 11.2 ---------------------------------------------------------------------------------


@CHECKS.add("hung1984.II.eq65", "hung1984.II.eq66", "hung1984.II.eq67", "hung1982.III.eq65-67")
def perturbation_defined() -> Finding:
    def holds(sample: Sample) -> bool:
        a, right, hat_x = sample.reduction.stages[-1], sample.reduction.rights[-1], sample.reduction.solution
        x = inverse_of(a) @ right  # (65)
        hat_a = right @ inverse_of(hat_x)  # (66), with b not changed
        return bool((hat_x - x == -inverse_of(a) @ (hat_a - a) @ hat_x).all())  # by (67)

    return compare(
        all(map(holds, samples())),
        "$\\Delta A=\\hat A-A$, and so on",
        note="definitions of a backward error",
    )


@CHECKS.add(*both("s11-2.claim-transformed"))
def backward() -> Finding:
    def pairs(sample: Sample) -> Iterable[tuple[Any, Any]]:
        stages, rights, x = sample.reduction
        whole = theory.strict_perturbation_bounds(sample.reduction, sample.beta)
        yield rights[0] - stages[0] @ x, whole.right + whole.matrix @ abs(x)

    found = held(pairs)
    return compare(
        found.fails == 0,
        "each column of the inverse solves a system perturbed within the strict bounds, in "
        f"{found.count - found.fails} of {found.count} inversions (by the theorem of Oettli and Prager)",
    )


@CHECKS.add("hung1984.II.s11-2.line-before-68")
def before_68() -> Finding:
    return compare(
        zero(derivation.line_before_68(brackets=False)),
        "$(\\hat A-\\Delta A)(\\hat x-\\Delta x)=\\hat b-\\Delta b$",
        Verdict.MISPRINT if zero(derivation.line_before_68()) else Verdict.WRONG,
        otherwise_note="brackets are missing, which hung1982 has",
    )


@CHECKS.add("hung1982.III.s11-2.line-before-68")
def before_68_1982() -> Finding:
    return compare(zero(derivation.line_before_68()), "both sides are $Ax=b$")


@CHECKS.add(*both("eq68"))
def perturbed_solution() -> Finding:
    return compare(
        derivation.perturbed_system().holds,
        "exact with $A^{-1}$ and $\\hat x$, or with $\\hat A^{-1}$ and $x$",
        note="as printed to first order: it mixes the two, and lacks $\\hat A^{-1}\\Delta A\\,\\Delta x$",
    )


@CHECKS.add(*both("s11-2.claim-computed"))
def computed_inverse() -> Finding:
    sample, _ = of_example()
    change = theory.perturbation_bounds(sample.reduction, sample.beta).matrix
    hat = inverse_of(sample.reduction.stages[0] + change)
    computed = sample.reduction.solution
    apart = column_sum_norm(hat - computed) / column_sum_norm(computed)
    same = bool((hat == computed).all())
    # Each is that far from the true inverse, to first order.
    second_order = apart <= 2 * theory.bound(sample.reduction, sample.beta) / column_sum_norm(computed)
    return compare(
        same,
        f"the inverse of the perturbed matrix differs from the computed one: by {float(apart):.1e} in norm, in the "
        "example of 11.4 in four digits",
        Verdict.MISPRINT if second_order else Verdict.WRONG,
        otherwise_note="$\\hat A$ is not known, and one system gives one column; the computed inverse takes its "
        "place, at the price of a term of second order",
    )


@CHECKS.add(*both("s11-2.claim-only-back-substitution"))
def only_back_substitution() -> Finding:
    def holds(sample: Sample) -> bool:
        upper = procedure.triangularize(sample.matrix, sample.pivot).upper
        again = procedure.triangularize(upper)
        right = sample.matrix.format.array(np.arange(2, 2 + len(upper)))
        unchanged = all(bool((stage == upper).all()) for stage in again.stages)
        return unchanged and bool((procedure.transform(again, right[:, np.newaxis])[-1][:, 0] == right).all())

    count = sum(map(holds, samples()))
    return compare(
        count == len(samples()), f"elimination leaves {count} of {len(samples())} triangular systems as they are"
    )


@CHECKS.add(
    "hung1984.II.eq69",
    "hung1984.II.eq70",
    "hung1984.II.eq71",
    "hung1984.II.s11-2.x-3-line",
    "hung1984.II.s11-2.x-2-line",
    "hung1982.III.s11-2.x-3-x-2-lines",
)
def triangular_system() -> Finding:
    a, x, b, computed = derivation.triangle()
    true = a.LUsolve(sp.Matrix(b))
    lines = (b[2] / a[2, 2] - x[2], (b[1] - a[1, 2] * x[2]) / a[1, 1] - x[1])
    return compare(
        zero(true - sp.Matrix(x))
        and all(map(zero, lines))
        and all(zero(y.subs(derivation.EPSILON, 0) - t) for y, t in zip(computed, x, strict=True)),
        "rows (a) to (c), solved from below, give the solution where nothing is rounded",
        note="definitions",
    )


@CHECKS.add("hung1984.II.eq72", "hung1984.II.eq73", "hung1984.II.eq74")
def last_row() -> Finding:
    a, (_, _, x3), b, (_, _, y3) = derivation.triangle()
    eps = derivation.EPSILON
    return compare(
        zero(y3 - x3 * (1 + eps)) and zero(x3 - y3 / (1 + eps)) and zero(a[2, 2] * y3 - b[2] * (1 + eps)),
        "the same, exactly",
    )


@CHECKS.add("hung1984.II.eq75", "hung1984.II.eq76")
def second_row() -> Finding:
    a, (_, x2, x3), b, (_, y2, y3) = derivation.triangle()
    eps = derivation.EPSILON
    of_75 = [(b[1] - a[1, 2] * third) * (1 + 2 * eps) / a[1, 1] for third in (y3 * (1 + eps), x3 * (1 + 2 * eps))]
    of_76 = y2 - (2 * eps * b[1] - 4 * eps * a[1, 2] * x3) / a[1, 1]
    return compare(
        zero(derivation.linear(y2 - x2) - derivation.printed_75())
        and derivation.leftover(76) == 0
        and all(zero(derivation.linear(line - y2)) for line in of_75)
        and zero(derivation.linear(of_76 - x2)),
        "the same, to first order",
        note="with one $\\epsilon$: as a size, the two terms of (75) add up",
    )


@CHECKS.add("hung1982.III.eq69-76")
def second_row_1982() -> Finding:
    found = [part() for part in (triangular_system, last_row, second_row)]
    return compare(all(bool(each.agrees) for each in found), "as (69)-(76) of hung1984")


@CHECKS.add("hung1984.II.eq77")
def second_equation() -> Finding:
    return compare(
        derivation.leftover(77, hats=False) == 0,
        f"as printed it leaves ${sp.latex(derivation.leftover(77, hats=False))}$, with $\\hat x_3$ nothing",
        Verdict.MISPRINT if derivation.leftover(77) == 0 else Verdict.WRONG,
        otherwise_note="$\\hat x_3$ is meant, and printed in hung1982",
    )


@CHECKS.add("hung1982.III.eq77")
def second_equation_1982() -> Finding:
    return compare(derivation.leftover(77) == 0, "the same, to first order")


@CHECKS.add("hung1984.II.s11-2.x-1-line")
def first_row_with_hats() -> Finding:
    a, (x1, x2, x3), b, (_, y2, y3) = derivation.triangle()
    hats, plain = ((b[0] - a[0, 1] * second - a[0, 2] * third) / a[0, 0] for second, third in ((y2, y3), (x2, x3)))
    left = sp.simplify(derivation.linear(hats - x1))
    return compare(
        zero(left),
        f"without hats it is (71a), exactly; with them it differs from $x_1$ by ${sp.latex(sp.factor(left))}$",
        Verdict.MISPRINT if zero(plain - x1) and bool(first_row().agrees) else Verdict.WRONG,
        otherwise_note="the hats belong to the next line, what is computed; where $x_2$ is taken from (71b), above "
        "(75), there is none",
    )


@CHECKS.add("hung1984.II.s11-2.x-1-line.2", "hung1984.II.s11-2.x-1-expanded")
def first_row() -> Finding:
    a, (x1, _, _), _, (y1, _, _) = derivation.triangle()
    b1, s2, s3 = sp.symbols("b s_2 s_3")
    eps = derivation.EPSILON
    printed = b1 * (1 + 3 * eps) - a[0, 1] * s2 * (1 + 4 * eps) - a[0, 2] * s3 * (1 + 3 * eps)
    row = derivation.first_row(a, b1, s2, s3)
    return compare(
        zero(derivation.linear(row - printed))
        and zero(row.subs(eps, 0) - printed.subs(eps, 0))
        and zero(derivation.linear(y1 - x1) - derivation.printed_before_78()),
        "the same, to first order",
        note="with one $\\epsilon$; $b_1$ and $a_{13}\\hat x_3$ pass three roundings, $a_{12}\\hat x_2$ four",
    )


@CHECKS.add(*both("s11-2.claim-approximations"), "hung1984.II.eq78", "hung1984.II.eq79")
def first_equation() -> Finding:
    return compare(
        derivation.leftover(78) == 0 and derivation.leftover(79) == 0,
        "nothing of first order is left",
    )


def _assembled(hats: bool) -> bool:
    """Whether (80) holds to first order with the computed solution, or with the true one that is printed."""
    a, x, b, computed = derivation.triangle()
    eps = derivation.EPSILON
    change = sp.Matrix([[0, 4 * a[0, 1], 3 * a[0, 2]], [0, 0, 3 * a[1, 2]], [0, 0, 0]]) * eps
    right = [b[0] * (1 + 3 * eps), b[1] * (1 + 2 * eps), b[2] * (1 + eps)]
    solution = sp.Matrix(computed if hats else x)
    return all(zero(derivation.linear(left - r)) for left, r in zip((a + change) * solution, right, strict=True))


@CHECKS.add("hung1984.II.eq80")
def assembled() -> Finding:
    return compare(
        _assembled(hats=False),
        "it holds to first order with $\\hat x_1,\\hat x_2,\\hat x_3$",
        Verdict.MISPRINT if _assembled(hats=True) else Verdict.WRONG,
        otherwise_note="hats are missing in the vector, which is labelled $\\hat x$",
    )


@CHECKS.add("hung1982.III.eq78-80")
def assembled_1982() -> Finding:
    return compare(
        _assembled(hats=True) and bool(first_equation().agrees) and bool(first_row().agrees),
        "as (78)-(80) of hung1984",
        note="the scan does not show whether the vector of (80) has hats",
    )


def _factored(n: int, factor: sp.Expr) -> bool:
    """Whether A_D M_A times a factor is ΔA of (87)."""
    eps = derivation.EPSILON
    a = sp.Matrix(n, n, lambda k, j: sp.Symbol(f"a_{k + 1}{j + 1}") if k < j else sp.Integer(0))
    weights = theory.back_substitution_weights(n)
    change = sp.Matrix(n, n, lambda k, j: a[k, j] * int(weights[k, j]) * eps)
    diagonal = sp.diag(*(0 if j == 1 else n - j + 3 for j in range(1, n + 1)))
    return zero(change - a * diagonal * factor)


@CHECKS.add(*both("eq81"))
def factored_three() -> Finding:
    return compare(
        _factored(3, sp.Integer(1)),
        "$A_D\\,\\mathrm{diag}(0,4,3)\\,\\epsilon$",
        Verdict.MISPRINT if _factored(3, derivation.EPSILON) else Verdict.WRONG,
        otherwise_note="the second form lacks the $\\epsilon$ of the first",
    )


@CHECKS.add("hung1984.II.eq82")
def right_side_three() -> Finding:
    weights = theory.right_side_weights(3).tolist()
    return compare(weights == [3, 2, 1], f"weights {', '.join(map(str, weights))}, by (74), (77) and (79)")


@CHECKS.add("hung1984.II.eq83", "hung1984.II.eq84")
def triangular_n() -> Finding:
    pattern = theory.back_substitution_weights(5)
    above = all((pattern[k, j] > 0) == (k < j) for k in range(5) for j in range(5))
    return compare(above, "the perturbed matrix is triangular as well, its diagonal unchanged", note="definitions")


@CHECKS.add("hung1982.III.eq82-84")
def triangular_1982() -> Finding:
    return compare(bool(right_side_three().agrees and triangular_n().agrees), "as (82)-(84) of hung1984")


def _weights_counted() -> bool:
    """Whether the weights of theory are those counted in rows of 1 to 5 entries."""
    for n in range(1, 6):
        right, products = derivation.back_row_weights(n - 1)
        if (
            right != theory.right_side_weights(n)[0]
            or list(products) != theory.back_substitution_weights(n)[0, 1:].tolist()
        ):
            return False
    return derivation.back_substitution_weights().holds


def _cases_85(k: int, j: int, n: int) -> tuple[bool, bool]:
    """The first two conditions of (85), as printed in 1984."""
    return k == j, 1 <= k <= j <= n


@CHECKS.add("hung1984.II.eq85")
def weights() -> Finding:
    n = 4
    twice = sum(all(_cases_85(k, j, n)) for k in range(1, n + 1) for j in range(1, n + 1))
    return compare(
        twice == 0,
        f"$1\\le k<j\\le n$; as printed, {twice} entries have two values for $n={n}$, those of the diagonal",
        Verdict.MISPRINT if _weights_counted() else Verdict.WRONG,
        otherwise_note="$k<j$ is meant, and printed in (87) and in hung1982",
    )


@CHECKS.add(
    *both("s11-2.claim-generalization"),
    "hung1982.III.eq85",
    "hung1984.II.eq86",
    "hung1984.II.eq87",
    "hung1984.II.eq88",
    "hung1982.III.eq86-88",
)
def weights_counted() -> Finding:
    def pairs(sample: Sample) -> Iterable[tuple[Any, Any]]:
        stages, rights, x = sample.reduction
        change = abs(theory.printed_back_substitution_error(stages[-1], sample.beta))
        right = abs(theory.printed_back_substitution_right_error(rights[-1], sample.beta))
        yield rights[-1] - stages[-1] @ x, change @ abs(x) + right

    found = held(pairs)
    return compare(
        _weights_counted() and found.fails == 0,
        f"counted in rows of up to four terms, and for every $n$ by one more; as sizes {found}, at most "
        f"{found.largest:.2g} of it",
        note="for subtraction from left to right; each row and each right side has its own $\\epsilon$s",
    )


@CHECKS.add("hung1984.II.eq89")
def factored() -> Finding:
    sizes = (3, 4, 5)
    return compare(
        all(_factored(n, sp.Integer(1)) for n in sizes),
        "the first form is (87); the second is $A_DM_A\\,\\epsilon$",
        Verdict.MISPRINT if all(_factored(n, derivation.EPSILON) for n in sizes) else Verdict.WRONG,
        otherwise_note="the second form lacks the $\\epsilon$ of the first; hung1982 has β there",
    )


@CHECKS.add("hung1982.III.eq89-first-form")
def weights_1982() -> Finding:
    same = [n for n in range(2, 9) if (theory.printed_weights_1982(n) == theory.back_substitution_weights(n)).all()]
    four = theory.printed_weights_1982(4)[0, 1:].tolist()
    right = theory.back_substitution_weights(4)[0, 1:].tolist()
    return compare(
        same == list(range(2, 9)),
        f"$2n-j$ is right for $n={', '.join(map(str, same))}$ alone; for $n=4$ it gives {', '.join(map(str, four))} "
        f"in place of {', '.join(map(str, right))}",
        Verdict.INCONSISTENT,
        otherwise_note="contradicts (87) and its own second form; it also contradicts its last entries 4 and 3; "
        "mended in hung1984",
    )


@CHECKS.add("hung1982.III.eq89-factored-form")
def factored_1982() -> Finding:
    agree = all(_factored(n, derivation.EPSILON) for n in (3, 4, 5))
    return compare(agree, "the weights of (87), with β for $\\epsilon$", note="as sizes, with $|A_D|$")


@CHECKS.add(*both("eq90"))
def right_side_inequality() -> Finding:
    def worst(sample: Sample) -> tuple[Matrix, Matrix]:
        bound = theory.printed_back_substitution_right_error(sample.reduction.rights[-1], sample.beta)
        return -bound, bound  # ε = -β is allowed

    fails = sum(bool((change > bound).any()) for change, bound in map(worst, samples()))
    sizes = all((abs(change) <= abs(bound)).all() for change, bound in map(worst, samples()))
    return compare(
        fails == 0,
        f"with $\\epsilon=-\\beta$ not so in {fails} of {len(samples())} inversions; $|\\Delta b|\\le M_b|b|\\beta$ is",
        Verdict.WRONG if sizes else Verdict.INCONSISTENT,
        otherwise_note="bars are missing on both sides, and (95) takes $\\delta A\\,\\hat x$ away from it as if the "
        "signs were known",
    )


# -- section 11.3 ---------------------------------------------------------------------------------


def _left_out() -> tuple[float, float]:
    """What (91) and (92) leave out, as a part of what they should be: norms of sizes, in the example of 11.4."""
    sample, _ = of_example()
    whole, bare = (theory.perturbation_bounds(sample.reduction, sample.beta, transfer) for transfer in (True, False))
    parts = [column_sum_norm(w - b) / column_sum_norm(w) for w, b in zip(whole, bare, strict=True)]
    return float(parts[0]), float(parts[1])


def _adds() -> bool:
    """Whether Ã + ΔA, without L, is the change of the given matrix: (L - 1)ΔA = 0 for all L and ΔA of 3 × 3."""
    lower = derivation.stages(3).lower
    change = sp.Matrix(3, 3, lambda k, j: sp.Symbol(f"d_{k + 1}{j + 1}") if k < j else sp.Integer(0))
    return zero((lower - sp.eye(3)) * change)


NO_SUM = (
    "$\\tilde A$ and $\\tilde b$ change the given system, $\\Delta A$ and $\\Delta b$ the triangular one: to be "
    "added, these must be multiplied by $L$. As sizes, $L$ costs a factor of $(n+3)/2$ at most"
)


@CHECKS.add(*both("s11-3.claim-two-sets"), "hung1984.II.eq91", "hung1984.II.eq92", "hung1982.III.eq91-92")
def two_sets() -> Finding:
    matrix, right = _left_out()
    return compare(
        _adds(),
        "$\\delta A=\\tilde A+L\\,\\Delta A$, $\\delta b=\\tilde b+L\\,\\Delta b$, derived for every $n$; in the "
        f"example of 11.4 the print leaves out {matrix:.0%} and {right:.0%} of their sizes",
        Verdict.WRONG if derivation.two_systems().holds and derivation.transfer_cost().holds else Verdict.INCONSISTENT,
        otherwise_note=NO_SUM,
    )


@CHECKS.add("hung1984.II.eq93")
def columns_again() -> Finding:
    return compare(bool(columns_of_the_inverse().agrees), "the columns of the inverse, as in (33)", note="a definition")


@CHECKS.add("hung1984.II.eq94", "hung1982.III.eq93-94", *both("s11-3.claim-similar-to-68"), "hung1984.II.eq95")
def resultant_error() -> Finding:
    return compare(
        derivation.perturbed_system().holds and derivation.two_systems().holds_at(4),
        "right to first order, with the $\\delta A$ and $\\delta b_j$ of the system that was solved",
        note="each column has its own $\\Delta A$; with $A^{-1}$ for $\\hat A^{-1}$ it is exact",
    )


#: Matrices whose errors exceed what the printed procedure allows, by (96) and by the last box of its chart.
COUNTEREXAMPLES = {
    "(96)": ([[-1, 94], [-48, 10]], FloatFormat(10, 3), False),
    "chart": ([[-95, -15, 84], [53, 62, 75], [-43, 48, 162]], FloatFormat(10, 6), True),
}


@cache
def counterexample(form: str) -> tuple[experiment.Trial, str]:
    """A matrix whose error exceeds the printed bound in one of its forms, and the name of the bound."""
    rows, fmt, pivot = COUNTEREXAMPLES[form]
    name = str(procedure.Reading(form=form))
    return experiment.trial(fmt.array(rows), pivot, [name, str(procedure.Reading(False, form)), "corrected"]), name


@CHECKS.add("hung1984.II.eq96", "hung1982.III.eq95-97")
def error_norm() -> Finding:
    texts, violated, mended = [], [], []
    for form in COUNTEREXAMPLES:
        trial, name = counterexample(form)
        violated.append(trial.violates(name))
        mended += [not trial.violates(str(procedure.Reading(False, form))), not trial.violates("corrected")]
        rows = ", ".join("(" + ", ".join(f"{float(x):g}" for x in row) + ")" for row in trial.matrix.to_float())
        texts.append(
            f"for rows {rows}, {trial.matrix.format.precision} digits, {'with' if trial.pivot else 'without'} "
            f"pivoting, condition {trial.condition:.3g}, the error is "
            f"{1 / trial.ratio(name):.2g} times {'the last box of the chart' if form == 'chart' else '(96)'}"
        )
    return compare(
        not any(violated),
        "; ".join(texts),
        Verdict.WRONG if all(mended) else Verdict.INCONSISTENT,
        otherwise_note="the inequality follows from (95), but not with an $E$ whose terms cancel because one "
        "$\\epsilon$ carries a sign; with sizes neither example exceeds it. $E$ is called $D$ in hung1982; both "
        "letters were taken",
    )


def terms_of_96() -> tuple[float, float, float]:
    """The norms of error, computed inverse and bracket of (95), in the example of 11.4."""
    sample, error = of_example()
    bracket = theory.printed_bracket(sample.reduction, sample.beta)
    return error, float(column_sum_norm(sample.reduction.solution)), float(column_sum_norm(bracket))


@CHECKS.add("hung1984.II.s11-3.claim-e-defined")
def letter_e() -> Finding:
    error, inverse, bracket = terms_of_96()
    return compare(
        error <= inverse * error,
        f"the scan has one $E$ before, (36), the error itself: with it (96) would say that $\\|\\hat A^{{-1}}\\|$ is "
        f"at least 1, and it is {inverse:.2f} in the example of 11.4; with the bracket of (95) it says "
        f"{error:.1e} is at most {inverse * bracket:.1e}",
        Verdict.OCR if error <= inverse * bracket else Verdict.WRONG,
        otherwise_note="the bracket of (95) is meant, whose letter is not in this scan; that of hung1982 shows a D "
        "below it. As printed, $E$ has two meanings",
    )


@CHECKS.add("hung1984.II.eq97")
def relative_error_norm() -> Finding:
    sample, _ = of_example()
    reduction, beta = sample.reduction, sample.beta
    e = column_sum_norm(theory.printed_bracket(reduction, beta))
    ratio = column_sum_norm(sample.error) / column_sum_norm(reduction.solution)
    definition = theory.printed_bound(reduction, beta) / column_sum_norm(reduction.solution) == e
    return compare(
        ratio == e,
        f"$\\|\\delta(A^{{-1}})\\|/\\|\\hat A^{{-1}}\\|={float(ratio):.2g}$ and $\\|E\\|={float(e):.2g}$ in the "
        "example of 11.4",
        Verdict.MISPRINT if definition and ratio <= e else Verdict.WRONG,
        otherwise_note="the signs are interchanged: $\\epsilon=\\|\\delta(A^{-1})\\|/\\|\\hat A^{-1}\\|\\le\\|E\\|$, "
        "by (96)",
    )


def operations(n: int) -> tuple[int, int]:
    """Multiplications and divisions of the inverse, and of its bound (96)."""
    reduce = sum((n - k) * (1 + (n - k) + n) for k in range(1, n))
    solve = n * sum(n - k + 1 for k in range(1, n + 1))
    sums = 2 * sum((n - k) ** 2 + (n - k) * n for k in range(1, n))  # by 3 and by 2, (59) and (60)
    return reduce + solve, sums + n * (n - 1) // 2 + n * n + n**3 + 1  # (89), (90), (95), (96)


@CHECKS.add(*both("s11-3.computation"))
def computation() -> Finding:
    three, twenty = operations(3), operations(20)
    return compare(
        min(three[1] / three[0], twenty[1] / twenty[0]) > 1,
        f"{three[1]} multiplications for the bound beside {three[0]} for the inverse, $n=3$; {twenty[1]:,} beside "
        f"{twenty[0]:,}, $n=20$",
        note="more than the inverse itself",
    )


def _by_boxes() -> tuple[Any, Any, Any]:
    """The bound of the chart for the example of 11.4: box by box, as one function, and by (95)."""
    a = FOUR.array(example.MATRIX)
    beta = FOUR.unit_roundoff
    triangular = procedure.triangularize(a)
    rights = procedure.transform(triangular, FOUR.array(np.eye(3, dtype=int)))
    reduction = Reduction(triangular.stages, rights, procedure.substitute(triangular.upper, rights[-1]))
    errors = procedure.resultant_errors(
        procedure.triangularization_errors(reduction, beta), procedure.back_substitution_errors(reduction, beta)
    )
    e = procedure.bracket(errors, reduction.solution)
    whole = procedure.run(a)
    by_95 = column_sum_norm(exact(reduction.solution) @ theory.printed_bracket(reduction, beta))
    return procedure.error_norm(procedure.inverse_error(reduction.solution, e)), whole.bound, by_95


@CHECKS.add("hung1984.II.s11-3.figure-iii-1-flow-chart")
def flow_chart() -> Finding:
    boxes, whole, by_95 = _by_boxes()
    return compare(
        boxes == whole == by_95,
        f"its boxes, carried out one after the other, give {float(boxes):.4g} for the matrix of 11.4 in four digits",
        note="the picture is lost from the scan; the texts of its boxes are in that of hung1982. They follow (59), "
        "(60) and (89)-(95), faults included",
    )


@CHECKS.add("hung1982.III.s11-3.figure-iii-1")
def flow_chart_1982() -> Finding:
    of_a = of_triangle = 0
    for sample in samples():
        stages = sample.reduction.stages
        change = sum(sample.step_errors(), start=stages[0] * 0)
        of_a += bool((sample.lower @ stages[-1] - stages[0] == change).all())
        of_triangle += bool((stages[-1] - inverse_of(sample.lower) @ stages[0] == change).all())
    boxes, whole, by_95 = _by_boxes()
    return compare(
        of_triangle == len(samples()) and boxes == whole == by_95,
        f"$\\tilde A$ is the error in $A$ in {of_a} of {len(samples())} inversions, that in $A_T$ in {of_triangle}",
        Verdict.INCONSISTENT if of_a == len(samples()) else Verdict.WRONG,
        otherwise_note="the box that generates $\\tilde A$ calls it the error in $A_T$ and contradicts (91), where "
        "it is one of $A$; else the boxes follow the equations",
    )


@CHECKS.add("hung1982.III.s11-3.claim-d-defined")
def letter_d() -> Finding:
    error, inverse, bracket = terms_of_96()
    return compare(
        error <= inverse * bracket < inverse * 3,
        f"with the bracket of (95), (96) says for the example of 11.4 that {error:.1e} is at most "
        f"{inverse * bracket:.1e}; with the $D$ below (27), whose norm is $n$, at most {inverse * 3:.2g}",
        note="the letter has two more meanings, below (27) and in the examples of 9.2",
    )


@CHECKS.add("hung1984.II.s11-3.figure-number")
def number_of_the_chart() -> Finding:
    figures = [e for e in load_statements() if e.document == "hung1984" and e.kind == "figure"]
    chapters = list(dict.fromkeys(e.chapter for e in figures if e.item.startswith("Figure III-1")))
    return compare(
        len(chapters) == 1,
        f"chapters {' and '.join(chapters)} have a Figure III-1",
        Verdict.MISPRINT if "II" in chapters else Verdict.INCONSISTENT,
        otherwise_note="Figure II-1 is meant: in hung1982, from which it was taken over, this was chapter III",
    )


# -- section 11.4 ---------------------------------------------------------------------------------


@CHECKS.add("hung1984.II.s11-4.matrix-a", "hung1982.III.s11-4.matrix-a")
def matrix() -> Finding:
    a = exact(np.array(example.MATRIX))
    inverse = inverse_of(a)
    condition = float(column_sum_norm(a) * column_sum_norm(inverse))
    places = all((a * 10**3)[i, j].denominator == 1 for i in range(3) for j in range(3))
    return compare(
        places and (a @ inverse == exact(np.eye(3, dtype=int))).all().item() and condition < 10,
        f"entries of four digits, $\\|A^{{-1}}\\|={float(column_sum_norm(inverse)):.5f}$, condition {condition:.2f}",
        note="in three digits the matrix itself would be rounded",
    )


@CHECKS.add(*both("s11-4.claim-actual-norms"))
def actual_norms() -> Finding:
    longer = FloatFormat(10, 20).array(example.MATRIX)
    reference = exact(linalg.inv(longer))
    apart = []
    for places in example.PLACES:
        sample = Sample(FloatFormat(10, places + 1).array(example.MATRIX), False)
        true = column_sum_norm(sample.error)
        apart.append(float(abs(column_sum_norm(sample.reduction.solution - reference) / true - 1)))
    return compare(
        max(apart) < 1e-6,
        f"against an inverse of 20 digits in place of the true one, the norms change by at most {max(apart):.0e} of "
        "themselves",
    )


def _agreement(column: str, places: int | None = None) -> tuple[int, int]:
    """How many readings give a printed number to its four digits, and of how many; or each number of a column."""
    readings = example.bound_readings() if column == "bound" else example.error_readings()
    if places is None:
        return sum(one.agreements == len(example.PLACES) for one in readings), len(readings)
    i = example.PLACES.index(places)
    return sum(example.agree(one.values[i], example.PRINTED[column][i]) for one in readings), len(readings)


def _proposed(places: int | None) -> Finding:
    found, readings = _agreement("bound", places)
    search = example.search("bound")
    values = search.closest.values if places is None else (search.closest.values[example.PLACES.index(places)],)
    return compare(
        found > 0,
        f"{found or 'none'} of {readings} readings of the procedure gives all digits; the closest, "
        f"{', '.join(f'{v:.3e}' for v in values)}, is off by {search.closest.distance - 1:.1%} "
        f"({search.closest.wordlength}; {search.closest.detail})",
        Verdict.WRONG,
        otherwise_note="not reproduced; what the procedure gives in each reading is in Table 1 of this chapter",
    )


def _actual(places: int | None) -> Finding:
    found, readings = _agreement("error", places)
    search = example.search("error")
    here = [
        one
        for one in example.all_possible()
        if places in (None, one.places) and one.wordlength.kind != "t = places + 2"
    ]
    can = sum(one.witness is not None for one in here)
    return compare(
        found > 0,
        f"{found or 'none'} of {readings} readings gives all digits, the closest column is off by a factor of "
        f"{search.closest.distance:.2f}; {can or 'none'} of {len(here)} searches through all matrices of so many "
        "places, or of one digit more, finds one whose error has this norm",
        Verdict.WRONG,
        otherwise_note="not the error of any inverse of that wordlength, however it was computed"
        if can == 0
        else "not the error of elimination in that wordlength",
    )


@CHECKS.add("hung1984.II.s11-4.table-1-proposed-3-places")
def proposed_three() -> Finding:
    return _proposed(3)


@CHECKS.add("hung1984.II.s11-4.table-1-proposed-5-places")
def proposed_five() -> Finding:
    return _proposed(5)


@CHECKS.add("hung1984.II.s11-4.table-1-proposed-8-places")
def proposed_eight() -> Finding:
    return _proposed(8)


@CHECKS.add("hung1984.II.s11-4.table-1-actual-3-places")
def actual_three() -> Finding:
    return _actual(3)


@CHECKS.add("hung1984.II.s11-4.table-1-actual-5-places")
def actual_five() -> Finding:
    return _actual(5)


@CHECKS.add("hung1984.II.s11-4.table-1-actual-8-places")
def actual_eight() -> Finding:
    return _actual(8)


def _row(places: int | None) -> Finding:
    bound, error = _proposed(places), _actual(places)
    return compare(
        bool(bound.agrees and error.agrees),
        f"proposed: {bound.recomputed}; actual: {error.recomputed}",
        Verdict.WRONG,
        otherwise_note="neither number is reproduced",
    )


@CHECKS.add("hung1984.II.s11-4.table-1", "hung1982.III.s11-4.table-i")
def table_1() -> Finding:
    return _row(None)


@CHECKS.add("hung1982.III.s11-4.table-i-row-3-places")
def row_three() -> Finding:
    return _row(3)


@CHECKS.add("hung1982.III.s11-4.table-i-row-5-places")
def row_five() -> Finding:
    return _row(5)


@CHECKS.add("hung1982.III.s11-4.table-i-row-8-places")
def row_eight() -> Finding:
    return _row(8)


def _claim(word: str) -> tuple[example.Claim, str]:
    (found,) = (claim for claim in example.claims() if word in claim.name)
    return found, f"{found.name} in {found.holds} of {found.readings} readings"


@CHECKS.add("hung1984.II.s11-4.table-1-claim-conservative")
def conservative() -> Finding:
    found, text = _claim("above")
    printed = [float(b) > 10 * float(e) for b, e in zip(*example.PRINTED.values(), strict=True)]
    return compare(
        found.holds == found.readings and all(printed),
        text,
        note="for this matrix; for others the printed procedure can be exceeded, see (96)",
    )


@CHECKS.add("hung1984.II.s11-4.table-1-claim-same-mantissa")
def same_mantissa() -> Finding:
    _, text = _claim("same digits")
    printed = len({number.split("e")[0] for number in example.PRINTED["bound"]}) == 1
    more = [one for one in example.bound_readings() if one.detail.endswith("more digits")]
    same = sum(one.same_digits for one in more)
    return compare(
        printed and same == len(more),
        f"{text}: in {same} of the {len(more)} whose quantities are computed with more digits",
        note="the bound is $\\beta$ times a number that does not depend on the wordlength; if that number is "
        "computed in the wordlength itself, as the chart says, its digits change with it",
    )


@CHECKS.add("hung1984.II.s11-4.table-1-claim-decreasing")
def decreasing() -> Finding:
    found, text = _claim("decreases")
    columns = [[float(number) for number in column] for column in example.PRINTED.values()]
    return compare(
        found.holds == found.readings and all(a > b > c for a, b, c in columns),
        text,
        note="worklength is a slip for wordlength",
    )


@CHECKS.add("hung1982.III.s11-4.claims-on-table-i")
def claims_1982() -> Finding:
    parts = (conservative(), same_mantissa(), decreasing())
    return compare(all(bool(part.agrees) for part in parts), "; ".join(part.recomputed for part in parts))


@CHECKS.add(*both("s11-4.reference-to-figure-1"))
def reference_to_figure() -> Finding:
    there = {one.item.split(" (")[0] for one in load_statements() if one.kind == "figure" and one.id in CHECKS}
    return compare(
        any(quote(place).endswith(figure) for place in both("s11-4.reference-to-figure-1") for figure in there),
        f"the one flow chart of these sections is {', '.join(there)}",
        Verdict.MISPRINT if len(there) == 1 else Verdict.INCONSISTENT,
        otherwise_note="Figure III-1 is meant",
    )
