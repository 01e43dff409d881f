r"""Fixed point: how to scale a filter, how accurate each fraction bit makes it, and how many it needs.

A signal processor computes with integers. Sums are exact. Only products are rounded, or sums when they are stored, each
to a multiple of one unit, whatever its size; see :mod:`gpbnb.filters.words`. So the error has a bound that needs no
limit on the measurements; see :mod:`gpbnb.bounds.words`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding, digits_text, rounding_named
from gpbnb.arithmetic.search import Outcome, Search, largest_compiled
from gpbnb.bounds.words import WordGuarantee, bounded_rounding, largest_rounding
from gpbnb.filters.array_forms import AnyForm
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import form_named
from gpbnb.filters.nonlinear import AnyModel, NonlinearModel
from gpbnb.filters.program import innovation_program, matrices
from gpbnb.filters.run import log_spaced, reference
from gpbnb.filters.sections import scaled
from gpbnb.filters.system import LinearFilter, LinearSystem, is_stable, system_inputs
from gpbnb.filters.words import (
    WordFormats,
    integer_program,
    integers_of,
    largest_values,
    run_integers,
    run_words,
)
from gpbnb.wordlength.precision import checked_question, recorded_strategy
from gpbnb.wordlength.recursion import Recursion, recursion_strategy
from gpbnb.wordlength.requirement import Strategy, WordlengthAnswer, checked_tolerance, largest_ratio
from gpbnb.wordlength.system import slowest_response, weak_evidence

Basis = Literal["emulation", "guarantee"]
LARGEST_FRACTION = 60  # bits
COEFFICIENT_BITS = 15
"""Significant bits of a coefficient if none are given, as in a word of 16 bits."""
LONGEST_COEFFICIENT = 53
"""Significant bits of a coefficient up to which more of them are tried where the coefficients limit a filter."""
_SCALED = "with its sections scaled by powers of two (scale=True; in a TOML file, scale = true beside sos)"
_MORE_INTEGER_BITS = 16
"""Integer bits beyond those of a run without rounding that a run in a format, or a guarantee, may need."""


@dataclass(frozen=True, eq=False)
class ScaledFilter:
    """A filter in units that are powers of two, so that one binary point serves all its states.

    Parameters
    ----------
    filter : the filter for scaled states and measurements, with exact coefficients.
    state, measurement : (n,) and (m,), exponents; a state x is stored as x / 2**exponent.
    gain : (n, m), the constant gain in the units of the model; empty if there is none.
    """

    filter: LinearFilter
    state: NDArray[np.int64]
    measurement: NDArray[np.int64]
    gain: NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class FixedAnswer(WordlengthAnswer):
    """The smallest number of fraction bits that meets a tolerance.

    Parameters
    ----------
    steps : number of steps for which a guarantee holds, if the system never forgets its errors; None if it holds for
        ever.
    tried : fraction bits, and largest error or bound / tolerance.
    words : the formats of data, coefficients and sums; None for a function or a Kalman filter, or if there is no
        answer.
    advice : what scaling the sections of a cascade would save; empty if it saves nothing.
    """

    fmt: FixedFormat | MaybeNone
    words: WordFormats | None = None
    advice: str = ""

    @property
    def digits(self) -> int | None:
        """Fraction bits of the format; None without a format."""
        return None if self.fmt is None else self.fmt.fraction_bits

    @property
    def stored(self) -> WordFormats | None:
        """The formats in which the answer stores a filter."""
        return self.words

    def __str__(self) -> str:
        end = "".join(f"; {note}" for note in (self.advice, *self.warnings) if note)
        basis = self.basis if self.steps is None else f"{self.basis} for {self.steps} steps"
        if self.fmt is None:
            return f"no format, by {basis}: {self.why}{end}"
        word = 1 + self.fmt.precision
        fraction = digits_text(self.fmt.fraction_bits, kind="fraction")
        return f"{fraction} in a word of {word} bits, by {basis}; {self.why}{end}"


def constant_gain(model: LinearModel, z: Any, margin: float = 2.0) -> ScaledFilter:
    """Return the filter in its steady state, scaled by the ranges that occur in a reference run.

    The gain is that of the last step. In the scaled units, states and measurements times the margin stay
    below 1.

    Parameters
    ----------
    model : a model with constant matrices.
    z : (steps, m), typical measurements.
    margin : factor by which later numbers may exceed those of this run.

    Raises
    ------
    ValueError : a model whose matrices change.
    """
    model.refuse_inputs("fixed point")
    if model.cycle != 1:
        raise ValueError(f"got {model.name} with a cycle of {model.cycle} steps; needed constant matrices")
    measured = np.asarray(z)
    steps = log_spaced(len(measured), 64)
    run = reference(model, measured, steps)
    largest_state = abs(run.x.astype(np.float64)).max(axis=0)
    largest_seen = np.maximum(abs(measured.astype(np.float64)).max(axis=0), 1e-30)
    state, seen = (_exponents(margin * each) for each in (largest_state, largest_seen))
    gain = run.K[-1]
    Phi, H = model.Phi[0], model.H[0]
    D = np.array([Fraction(2) ** int(k) for k in state], dtype=object)
    E = np.array([Fraction(2) ** int(k) for k in seen], dtype=object)
    parts = (Phi * D / D[:, None], H * D / E[:, None], gain * E / D[:, None])
    coefficients = np.concatenate([np.asarray(part).reshape(-1) for part in parts])
    program = innovation_program(model.n, model.m)
    made = LinearFilter(program, coefficients, f"{model.name}, constant gain")
    return ScaledFilter(made, state, seen, gain.astype(np.float64))


def integer_bits(given: ScaledFilter, z: Any) -> int:
    """Return the number of integer bits that all intermediate values of a run need, as advice for scaling."""
    scaled = np.asarray(z, dtype=np.float64) / 2.0 ** given.measurement.astype(float)
    return _bits_for(float(largest_values(given.filter, scaled).max()))


def emulated(
    given: ScaledFilter, z: Any, fmt: FixedFormat, coefficient_bits: int = COEFFICIENT_BITS, wide: bool = False
) -> NDArray[np.float64]:
    """Return the error of each state after each step, (steps, n), in the units of the model, due to rounding.

    Parameters
    ----------
    z : (steps, m), measurements in the units of the model; the converter rounds them into the format for both filters.
    coefficient_bits : significant bits of each coefficient; each coefficient has its own binary point.
    wide : whether sums of products are kept exactly in a long accumulator and rounded once.

    Raises
    ------
    OverflowError : a number overflows and the format neither saturates nor wraps; names operation and step.
    """
    made = integer_program(given.filter, _words(given.filter, fmt, coefficient_bits, wide))
    program, unit = given.filter.program, float(fmt.unit)
    scaled = np.asarray(z, dtype=np.float64) / 2.0 ** given.measurement.astype(float)
    seen = integers_of(scaled, replace(fmt, rounding=Rounding.NEAREST, overflow="saturate"))
    states = run_integers(made, seen, np.zeros(program.n, np.int64)).astype(np.float64) * unit
    A, B = (each.astype(np.float64) for each in matrices(program, made.coefficients))
    true, errors = np.zeros(program.n), np.empty(states.shape)
    for k, row in enumerate(seen.astype(np.float64) * unit):
        true = A @ true + B @ row
        errors[k] = states[k] - true
    return errors * 2.0 ** given.state.astype(float)


def bound_per_unit(
    given: ScaledFilter, coefficient_bits: int = COEFFICIENT_BITS, wide: bool = False
) -> NDArray[np.float64]:
    """Bound the error of each state, (n,), in the units of the model, for ever, if no rounding errs by more than one.

    The bound is proportional to the largest error of a rounding. It holds for all measurements, as long as nothing
    overflows. For the parameters, see :func:`emulated`.

    Raises
    ------
    ValueError : the filter is not stable.
    """
    ones = FixedFormat(1, 0, Rounding.DOWN)
    found = bounded_rounding(given.filter, _words(given.filter, ones, coefficient_bits, wide))
    return np.asarray(found * 2.0 ** given.state.astype(float))


def required_fraction_bits(
    given: ScaledFilter | LinearSystem | AnyModel | Recursion,
    z: Any,
    tolerance: Sequence[float] | float,
    basis: Basis = "emulation",
    rounding: Rounding | str | None = None,
    coefficient_bits: int | None = None,
    wide: bool = False,
    like: FixedFormat | WordFormats | None = None,
    form: AnyForm | str = Form.INNOVATION,
) -> FixedAnswer:
    """Find the smallest number of fraction bits with which errors stay within a tolerance.

    As in floating point, a format qualifies only if the format with one more bit also meets the tolerance. Without
    `like`, the word has as many integer bits as the run in the format needs; for a guarantee, as many as every
    admissible run needs.

    Parameters
    ----------
    given : a linear system in any structure; a function of a format and `z`, as in
        :func:`gpbnb.wordlength.recursion.required_recursion_precision`; a Kalman filter, linear or nonlinear, all of
        whose operations are rounded into one format; or a scaled filter. The error of a system is the difference
        between its outputs and those of the system as given. It includes the error of storing coefficients and
        inputs, and the error of a Kalman filter does so, too. The error of a scaled filter is due only to rounding its
        states.
    z : (steps, m), inputs or measurements.
    tolerance : largest acceptable error of each output, or of each state of a filter, in its unit; infinite if its
        accuracy does not matter.
    basis : "emulation" of these measurements; or "guarantee", for a system for all inputs that are never larger than
        the largest of `z`, with a proof that nothing overflows, and for a scaled filter for all measurements that do
        not overflow. For a linear Kalman filter, call :func:`gpbnb.bounds.guarantee.guarantee` instead.
    rounding : rounding of each operation, by default "nearest".
    coefficient_bits : significant bits of each coefficient, which has its own binary point; by default 15.
    wide : whether sums of products are kept exactly and rounded once.
    like : formats for a system or a function, in place of `rounding`, `coefficient_bits` and `wide`, which are then
        refused. They set the
        integer bits, the rounding and the overflow. The search changes the fraction bits of the data, and those of the
        sums by the same number. Coefficients change with the data if they have the format of the data; otherwise they
        keep their own format. A function or a Kalman filter requires a `FixedFormat`.
    form : the form of a Kalman filter, or its name, as in :func:`gpbnb.wordlength.precision.required_precision`.

    Raises
    ------
    TypeError : another kind of filter.
    ValueError : a tolerance is not above 0, no tolerance is finite, or the basis is neither of the two; inputs that do
        not fit; a guarantee for a function or a Kalman filter; a function or a Kalman filter without `like`; a `form`
        for anything but a Kalman filter; for a linear Kalman filter, more integer bits than compiled loops have.
    OverflowError : an output of a system as given is beyond the range of float64.

    Examples
    --------
    >>> import numpy as np
    >>> from gpbnb import LinearSystem
    >>> system = LinearSystem.from_coefficients(["0.1"], [1, "-0.9"])
    >>> print(required_fraction_bits(system, np.ones((50, 1)), 0.001))
    11 fraction bits in a word of 13 bits, by emulation; 10 fraction bits give 4.95 times the tolerance
    """
    if basis not in ("emulation", "guarantee"):
        raise ValueError(f'got basis {basis!r}; needed "emulation" or "guarantee"')
    options = {"rounding": rounding, "coefficient_bits": coefficient_bits, "wide": wide or None}
    if like is not None and (names := [name for name, value in options.items() if value is not None]):
        raise ValueError(f"got {' and '.join(names)} beside like; needed like alone: its formats set them")
    rounding, form = rounding_named(Rounding.NEAREST if rounding is None else rounding), form_named(form)
    coefficient_bits = COEFFICIENT_BITS if coefficient_bits is None else coefficient_bits
    if form is not Form.INNOVATION and not isinstance(given, LinearModel | NonlinearModel):
        raise ValueError(f"got the {form} form; needed none: only a LinearModel or a NonlinearModel has forms")
    strategy: _Strategy
    if not isinstance(given, ScaledFilter | LinearSystem | LinearModel | NonlinearModel) and not callable(given):
        raise TypeError(f"got a {type(given).__name__}; needed a LinearSystem, a model or a function")
    if isinstance(given, ScaledFilter):
        goal = checked_tolerance(tolerance, given.filter.program.n, "states", basis)
        strategy = _States(given, z, goal, rounding, (coefficient_bits, wide), basis)
    elif isinstance(given, LinearSystem):
        words = WordFormats(like) if isinstance(like, FixedFormat) else like
        goal = checked_tolerance(tolerance, given.p, "outputs", basis)
        strategy = _of_system(given, z, goal, basis, rounding, (coefficient_bits, wide), words)
    elif not isinstance(like, FixedFormat):
        kind = "function" if callable(given) else type(given).__name__
        raise ValueError(f"got like={like!r} for a {kind}; needed a FixedFormat, with integer bits for its numbers")
    else:
        strategy = _Runs(_of_runs(given, z, tolerance, basis, form, like).error, like)
    largest = LARGEST_FRACTION - 1
    most = f"{largest} fraction bits are the most tried"
    if isinstance(given, LinearModel):
        replace(strategy.like, fraction_bits=strategy.least).check_compiled()
        if (compiled := largest_compiled(strategy.like)) < largest:
            largest = max(compiled, strategy.least)
            most = f"{digits_text(largest, kind='fraction')} are the most with compiled loops"
    found = Search(strategy.error, strategy.like, (), largest=largest, least=strategy.least, proof=strategy.proof)
    ratios = dict(found.tried)
    if cause := strategy.cause():
        return FixedAnswer(None, basis, None, (), cause)

    def rejection(bits: int) -> str:
        refused = found.reasons[bits]
        give = "gives" if bits == 1 else "give"
        return f"{digits_text(bits, kind='fraction')} {refused or f'{give} {ratios[bits]:.3g} times the tolerance'}"

    if found.fmt is None:
        blame = strategy.blame(largest)
        why = blame or f"{rejection(largest)}; {most}"
        advice = "" if blame else strategy.advice(None)
        return FixedAnswer(None, basis, strategy.steps, found.tried, why, advice=advice)
    bits = found.fmt.fraction_bits
    why = rejection(bits - 1 if bits > strategy.least else min(bits + 1, largest))
    words, warnings = strategy.words(found.fmt), strategy.warnings()
    fmt = found.fmt if words is None else words.data
    return FixedAnswer(fmt, basis, strategy.steps, found.tried, why, warnings, words, strategy.advice(fmt))


def words_error(
    system: LinearSystem, z: Any, tolerance: Any, basis: Basis = "emulation"
) -> Callable[[WordFormats], Outcome]:
    """Return the function from formats of a system's words to its largest error or bound over the tolerance."""
    made: dict[str, _Outputs] = {}

    def error(words: WordFormats) -> Outcome:
        if not made:
            goal = checked_tolerance(tolerance, system.p, "outputs", basis)
            made["known"] = _of_system(system, z, goal, basis, words.data.rounding, (1, False), words)
        return made["known"].of_words(words)

    return error


def exact_sums(system: LinearSystem, data: FixedFormat, coefficient_bits: int) -> WordFormats:
    """Return formats whose sums are exact and are rounded once, when they are stored."""
    return _words(system.as_filter(), data, coefficient_bits, wide=True)


class _Strategy:
    """How an error follows from a format: the base of the classes below.

    Parameters
    ----------
    like : a format with the integer bits, the rounding and the overflow of those to try.
    goal : tolerances.
    least : lowest number of fraction bits.
    widens : whether a format in which a number overflows gets more integer bits.
    steps : number of steps for which a guarantee holds; None if it holds for ever.
    """

    steps: int | None = None

    def __init__(self, like: FixedFormat, goal: NDArray[np.float64], widens: bool = False) -> None:
        self.like, self.goal, self._widens = like, goal, widens
        self.least = max(0, 1 - like.integer_bits)
        self._more = dict[int, int]()  # integer bits that a number of fraction bits needs beyond those of `like`

    def error(self, fmt: FixedFormat) -> Outcome:
        """Return the largest error over its tolerance, or infinity and why a run is refused."""
        refused = ""
        for more in range(1 + _MORE_INTEGER_BITS if self._widens else 1):
            try:
                errors = self.errors(replace(fmt, integer_bits=fmt.integer_bits + more))
            except OverflowError as error:
                refused = refused or str(error)
            except ValueError as error:
                return Outcome(math.inf, f"are refused: {error}")
            else:
                self._more[fmt.fraction_bits] = more
                return Outcome(largest_ratio(errors, self.goal))
        return Outcome(math.inf, f"are refused: {refused}")

    def wide_enough(self, fmt: FixedFormat) -> FixedFormat:
        """Return a format with the integer bits that its fraction bits needed."""
        return replace(fmt, integer_bits=fmt.integer_bits + self._more.get(fmt.fraction_bits, 0))

    def proof(self, fmt: FixedFormat) -> Outcome:
        """Return what is proved of the error, or infinity and why nothing is."""
        return self.error(fmt)

    def errors(self, fmt: FixedFormat) -> NDArray[np.float64]:
        """Return the largest error of each state or output."""
        raise NotImplementedError

    def words(self, fmt: FixedFormat) -> WordFormats | None:
        """Return the formats of data, coefficients and sums for a format of the data."""
        return None

    def cause(self) -> str:
        """Return in words why there is no answer in any format; empty if there may be one."""
        return ""

    def blame(self, fraction: int) -> str:
        """Return in words what limits the filter where so many fraction bits are not enough; empty if these do."""
        return ""

    def warnings(self) -> tuple[str, ...]:
        """Return why the errors of the run may say little about other runs."""
        return ()

    def advice(self, fmt: FixedFormat | None) -> str:
        """Return in words what makes a format shorter than this answer enough, or any if there is none."""
        return ""


class _States(_Strategy):
    """Errors of a scaled filter in a run, or with `bounds` their bound, to which every other is proportional."""

    def __init__(
        self,
        given: ScaledFilter,
        z: Any,
        goal: NDArray[np.float64],
        rounding: Rounding,
        options: tuple[int, bool],
        basis: Basis,
    ) -> None:
        super().__init__(FixedFormat(integer_bits(given, z), LARGEST_FRACTION, rounding), goal, widens=True)
        self._given, self._z, self._options = given, z, options
        self._bounds: NDArray[np.float64] | None = None
        self._cause = ""
        if basis == "guarantee":
            try:
                self._bounds = bound_per_unit(given, *options)
            except ValueError as error:
                self._cause = _without_bound(given, options[0], error)
                self._bounds = np.full(len(goal), math.inf)

    def errors(self, fmt: FixedFormat) -> NDArray[np.float64]:
        if self._bounds is not None:
            return self._bounds * (float(fmt.unit) * largest_rounding(fmt.rounding))
        return np.asarray(abs(emulated(self._given, self._z, fmt, *self._options)).max(axis=0))

    def words(self, fmt: FixedFormat) -> WordFormats | None:
        return _words(self._given.filter, self.wide_enough(fmt), *self._options)

    def cause(self) -> str:
        return self._cause


class _Outputs(_Strategy):
    """Errors of the outputs of a system in a run, or with a proof of its range their bounds.

    `scaled` makes the strategy for the system with its sections scaled; None if they cannot be.
    """

    def __init__(
        self,
        system: LinearSystem,
        inputs: NDArray[Any],
        goal: NDArray[np.float64],
        words_of: Callable[[FixedFormat], WordFormats],
        like: FixedFormat,
        basis: Basis,
        widens: bool,
        scaled: Callable[[], _Outputs | None],
    ) -> None:
        super().__init__(like, goal, widens)
        self._system, self._inputs, self._words_of = system, inputs, words_of
        self._true = system.outputs(inputs)
        largest = all_above(np.abs(inputs).max(axis=0))
        if basis == "guarantee" and not is_stable(system.A):
            self.steps = len(inputs)
        self._proof = WordGuarantee(system, largest, self.steps) if basis == "guarantee" else None
        self._scaled = scaled

    def errors(self, fmt: FixedFormat) -> NDArray[np.float64]:
        if self._proof is None:
            found = run_words(self._system, self._inputs, self._words_of(fmt)).outputs(self._system.p)
            error = (found[..., 0] - self._true[..., 0]) + (found[..., 1] - self._true[..., 1])
            return np.asarray(np.abs(error).max(axis=0))
        return self._proof.guessed(self._words_of(fmt))

    def proof(self, fmt: FixedFormat) -> Outcome:
        """Return the bound over its tolerance that is proved, or infinity and why none is."""
        found = self.error(fmt)
        if self._proof is None or not found.ratio <= 1:
            return found
        try:
            return Outcome(largest_ratio(self._proof.errors(self._words_of(self.wide_enough(fmt))), self.goal))
        except (OverflowError, ValueError) as error:
            return Outcome(math.inf, f"are refused: {error}")

    def of_words(self, words: WordFormats) -> Outcome:
        """Return the largest error or bound over its tolerance in these formats, or infinity and the reason."""
        self._words_of = lambda fmt: words
        return self.proof(words.data)

    def words(self, fmt: FixedFormat) -> WordFormats | None:
        return self._words_of(self.wide_enough(fmt))

    def warnings(self) -> tuple[str, ...]:
        return () if self._proof is not None else weak_evidence(self._system, self._true, self.goal)

    def blame(self, fraction: int) -> str:
        """Return in words that the coefficients limit the filter, and how many of their bits are enough."""
        fmt = replace(self.like, fraction_bits=fraction)
        given, words_of = self._words_of(fmt).coefficients, self._words_of
        if given is None:
            return ""

        def error(bits: FloatFormat) -> Outcome:
            self._words_of = lambda each: replace(words_of(each), coefficients=bits.precision)
            return self.error(fmt)

        found = Search(error, FloatFormat(2, 2), (), largest=LONGEST_COEFFICIENT)
        self._words_of = words_of
        if found.fmt is None:
            return ""
        stored = digits_text(given, kind="significant") if isinstance(given, int) else arithmetic(given)
        ratio, refused = self.error(fmt)
        misses = refused and f"words are refused: {refused.removeprefix('are refused: ')}"
        named = "coefficient_bits, or --coefficients in the command" if self._widens else "coefficients of WordFormats"
        return (
            f"the coefficients limit the filter, whatever the fraction bits of the data: stored in {stored}, "
            f"{misses or f'they give {ratio:.3g} times the tolerance'}; "
            f"{digits_text(found.fmt.precision, kind='significant')} of each coefficient are enough ({named})"
        )

    def advice(self, fmt: FixedFormat | None) -> str:
        """Return in words that scaled sections need a shorter word, or what limits these; empty if neither helps."""
        largest = LARGEST_FRACTION - 1 if fmt is None else fmt.fraction_bits - 1
        other = self._scaled()
        if other is None or largest < other.least:
            slow = "" if fmt is not None or self._proof is None else slowest_response(self._system, len(self._inputs))
            return slow and f"errors add up because the system is slow: its {slow}"
        found = Search(other.error, other.like, (), largest=largest, least=other.least)
        words = None if found.fmt is None else other.words(found.fmt)
        if words is None:
            limit = "" if fmt is not None else other.blame(largest)
            return limit and f"{_SCALED}, {limit}"
        if fmt is not None and words.data.precision >= fmt.precision:
            return ""
        fraction, word = digits_text(words.data.fraction_bits, kind="fraction"), 1 + words.data.precision
        return f"{_SCALED}, {fraction} in a word of {word} bits are enough"


class _Runs(_Strategy):
    """Errors of the runs of a function or a Kalman filter, against a reference in floating point."""

    def __init__(self, error: Callable[[Any], Outcome], like: FixedFormat) -> None:
        super().__init__(like, np.ones(1))
        self._error = error

    def error(self, fmt: FixedFormat) -> Outcome:
        ratio, why = self._error(fmt)
        return Outcome(ratio, why and f"fail: {why}")


def _of_runs(
    given: AnyModel | Recursion, z: Any, tolerance: Any, basis: Basis, form: AnyForm, like: FixedFormat
) -> Strategy:
    if callable(given):
        most = LARGEST_FRACTION + max(like.integer_bits, 0)
        return recursion_strategy(given, None, tolerance, z, 2, basis, most)
    tolerances = checked_question(given, [like], tolerance, basis)
    if basis != "emulation":
        raise ValueError(f'got basis "{basis}" for {given.name}; needed "emulation"; for a LinearModel, use guarantee')
    return recorded_strategy(given, z, tolerances, form, basis)


def _of_system(
    system: LinearSystem,
    z: Any,
    goal: NDArray[np.float64],
    basis: Basis,
    rounding: Rounding,
    options: tuple[int, bool],
    like: WordFormats | None,
) -> _Outputs:
    """Return the strategy for a system: in formats such as `like`, or with integer bits that its numbers need."""
    inputs, made = system_inputs(system, z), system.as_filter()

    def of_scaled() -> _Outputs | None:
        found = scaled_sections(system)
        return None if found is None else _of_system(found, z, goal, basis, rounding, options, like)

    if like is not None:
        given = like

        def moved(fmt: FixedFormat) -> WordFormats:
            return with_fraction_bits(given, fmt.fraction_bits)

        return _Outputs(system, inputs, goal, moved, like.data, basis, False, of_scaled)
    start = np.concatenate([system.x0.astype(np.float64), np.zeros(system.p)])
    before = _bits_for(_largest_stored(made, inputs.astype(np.float64), start, options[1]))
    fmt = FixedFormat(before, LARGEST_FRACTION, rounding)
    return _Outputs(system, inputs, goal, lambda fmt: _words(made, fmt, *options), fmt, basis, True, of_scaled)


def scaled_sections(system: LinearSystem) -> LinearSystem | None:
    """Return a cascade with its sections scaled as by ``scale=True``; None if it is none at rest, or scaled already."""
    made = system.made
    if made is None or made.cascade is None or any(system.x0):
        return None
    try:
        found = scaled(made.cascade.sections(made.coefficients), made.cascade.form)
    except ValueError:  # the filter does not decay
        return None
    coefficients = exact([each for b, a in found for each in (*b, *a)])
    if (coefficients == made.coefficients).all():
        return None
    return LinearSystem.from_filter(replace(made, coefficients=coefficients))


def with_fraction_bits(words: WordFormats, fraction: int) -> WordFormats:
    """Return formats whose data have other fraction bits; those of the sums move by the same number."""
    moved = fraction - words.data.fraction_bits
    sums = words.sums
    return replace(
        words,
        data=replace(words.data, fraction_bits=fraction),
        sums=None if sums is None else replace(sums, fraction_bits=sums.fraction_bits + moved),
    )


def _words(made: LinearFilter, fmt: FixedFormat, coefficient_bits: int, wide: bool) -> WordFormats:
    """Return formats for coefficients with a binary point each, and with `wide` for sums without roundings."""
    if not wide:
        return WordFormats(fmt, coefficient_bits)
    longest = max(each.denominator.bit_length() - 1 for each in stored_coefficients(made, coefficient_bits))
    fraction = fmt.fraction_bits + longest
    return WordFormats(
        fmt, coefficient_bits, FixedFormat(max(63 - fraction, fmt.integer_bits + 8), fraction, overflow="wrap")
    )


def _largest_stored(made: LinearFilter, z: NDArray[np.float64], start: NDArray[np.float64], wide: bool) -> float:
    """Return the largest value of a run that must fit the data; with `wide`, sums need not."""
    sizes = largest_values(made, z, start)
    kept = np.concatenate([np.ones(made.program.n + made.program.m, np.bool_), ~made.program.wide])
    return float(sizes[kept].max() if wide else sizes.max())


def _without_bound(given: ScaledFilter, coefficient_bits: int, error: ValueError) -> str:
    """Return in words why a filter has no bound that holds for ever."""
    program, coefficients = given.filter.program, given.filter.coefficients
    if not is_stable(matrices(program, coefficients)[0]):
        return "the filter as given is not stable, so that errors of rounding never decay, whatever the word"
    if not is_stable(matrices(program, stored_coefficients(given.filter, coefficient_bits))[0]):
        stored = f"stored in {coefficient_bits} bits"
        return f"the filter is stable, but not with its coefficients {stored}; raise coefficient_bits"
    return f"the filter is stable, but {error}"


def stored_coefficients(made: LinearFilter, bits: int) -> NDArray[Any]:
    """Round coefficients to `bits` significant bits, to nearest; (c,) Fractions."""
    return FloatFormat(2, bits).array(made.coefficients).to_fractions()


def _exponents(sizes: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the smallest k with size < 2**k for each size; 0 for zero."""
    return np.where(sizes > 0, np.frexp(sizes)[1], 0).astype(np.int64)


def _bits_for(largest: float) -> int:
    return int(_exponents(np.array([largest]))[0])
