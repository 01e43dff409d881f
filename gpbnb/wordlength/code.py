"""C99 code of a filter that agrees with the emulation digit for digit: source, test vectors and a Makefile.

The statements are those of the list of operations that is emulated and bounded, see :mod:`gpbnb.filters.program`:
one for each operation, in the same order. So what is computed about a filter holds for
the code, if the compiler keeps the order and rounds each operation, as C99 demands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from math import lcm
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import NegativeRootError
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY32, BINARY64, format_text, rounding_text
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.bounds.guarantee import sized_limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.files import replace_file
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.forms import CONSTANT_GAIN, Form, form_named, form_with_program, plain_name
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.nonlinear_run import NonlinearRun, simulated
from gpbnb.filters.nonlinear_system import NonlinearSystem
from gpbnb.filters.opening import stored_start
from gpbnb.filters.program import without_exact
from gpbnb.filters.recording import kalman_program, program_states
from gpbnb.filters.run import Run
from gpbnb.filters.settled import settled_filter
from gpbnb.filters.simulation import simulated_measurements
from gpbnb.filters.steps import HUNG_FORMS
from gpbnb.filters.system import LinearSystem, system_inputs
from gpbnb.filters.words import WordFormats, integer_program
from gpbnb.wordlength.asked import admitted, checked_format, data_of
from gpbnb.wordlength.bounding import guarantee
from gpbnb.wordlength.c_files import Sections, Vectors, refuse_others, written_files
from gpbnb.wordlength.c_source import CodeFloats, CodeNumbers, CodeSource, CodeStep, checked_identifier, word_arithmetic
from gpbnb.wordlength.emulation import longest
from gpbnb.wordlength.judges import largest_inputs, system_pairs
from gpbnb.wordlength.models import ModelSource

VECTORS = 100
"""Steps of the test vectors."""

_WITH_INPUTS = ", whose input holds the measurements, then the known inputs"

STOPS = (OverflowError, ZeroDivisionError, NegativeRootError, DomainError)
"""Errors that end the emulation of a step, as the code ends it with its status."""

Filter = LinearSystem | LinearModel | FilterDesign | NonlinearSystem | NonlinearModel
"""What code is written for."""

AnyFormat = FloatFormat | FixedFormat | WordFormats
"""Formats that may have types in C."""


class Prepared(NamedTuple):
    """A filter with what is needed to write its code.

    Parameters
    ----------
    step, arithmetic : its operations, and how they are written.
    title : what it is.
    structure : its structure or form.
    emulate : function that returns the vectors for inputs, (steps, m), in a format.
    inputs : function that returns inputs for a number of steps.
    bounded, form : the linear model whose errors can be bounded, and its form; None if nothing bounds them.
    sections : those of a cascade, as stored; else empty.
    """

    step: CodeStep
    arithmetic: CodeNumbers
    title: str
    structure: str
    emulate: Callable[[Any, Any], Vectors]
    inputs: Callable[[int], NDArray[np.float64]]
    bounded: LinearModel | LinearSystem | None = None
    form: Form | None = None
    sections: Sections = ()


def write_code(
    model: Filter | ModelSource,
    fmt: AnyFormat | str,
    folder: str | Path,
    *,
    form: Form | str | None = None,
    name: str = "filter",
    inputs: Any = None,
    within: FilterLimits | None = None,
    overwrite: bool = False,
    exact: bool = True,
) -> tuple[Path, ...]:
    """Write a filter as C99 without dependencies; its results agree with the emulation digit for digit.

    Parameters
    ----------
    model : a linear system in its structure, a design, a Kalman filter, linear, extended or unscented, perhaps with
        known inputs, which follow the measurements in the code's input, or a nonlinear system, whose step is a function
        of your own; or what :func:`gpbnb.read_model` reads.
    fmt : BINARY32 or BINARY64; fixed point of at most 64 bits; a :class:`~gpbnb.filters.words.WordFormats`; or the name
        of a format, such as "float32" or "Q15".
    folder : folder for the files, which is created if necessary. Files that gpbnb has written are replaced, others not.
    form : for a Kalman filter, "innovation", "Joseph", "UD", or one of Hung's, or "constant gain"; for a
        :class:`gpbnb.filters.design.FilterDesign`, its structure. A Kalman filter takes words of at
        most 52 bits that do not wrap around, as its emulation does.
    name : name of the files, and prefix of every name that the header declares.
    inputs : (steps, m), inputs or measurements of the test vectors, or a number of steps of noise, or of simulated
        measurements; by default 100.
    within : limits from :func:`gpbnb.bounds.guarantee.limits`; the header states the error bound that holds
        within them.
    overwrite : whether to replace files of these names that gpbnb has not written.
    exact : whether each digit must be that of the emulation. If not, a step may have functions such as np.sin, which
        the code takes from C's library (``sinf``), whose last digits differ from one platform to another. The test
        then allows each state four times the largest difference that it makes to round every operation up, or every
        one down; the header says how much this is.

    Returns
    -------
    paths : header, source, test, test vectors and Makefile. The header of a cascade of second-order sections also has
        their coefficients in the order of CMSIS-DSP, unless words of 16 or 32 bits do not hold all of them.

    Raises
    ------
    TypeError : `model` or `fmt` is of another type.
    ValueError : a format without a type in C99; a structure or form that the filter does not have; a model that cannot
        be written in C, where the message says what to use; limits for another filter; a step with a function, such as
        np.sin, unless `exact` is False; a step that cannot be traced; inputs that do not fit; a name that is not an
        identifier in C; a file of another origin in the way.
    OverflowError : a coefficient or an initial state is beyond the range of the format.
    OSError : a file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from gpbnb import LinearSystem
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     paths = write_code(LinearSystem.smoother("1/8"), "float32", folder)
    ...     print(*(path.name for path in paths))
    filter.h filter.c test_filter.c filter_vectors.txt Makefile
    """
    given, target = admitted(model, "be written in C"), Path(folder)
    chosen = checked_format(fmt, WordFormats)
    checked_identifier(name)
    if not overwrite:
        refuse_others(target, name)
    if not exact and not isinstance(chosen, FloatFormat):
        raise ValueError("got exact=False in fixed point; needed BINARY32 or BINARY64, which C's functions take")
    found = prepared(given, chosen, form, exact)
    data = data_of(given, VECTORS if inputs is None else inputs)
    z = found.inputs(data.steps) if data.z is None else data.z
    if within is not None and found.bounded is None:
        raise ValueError(f"got limits for {given.name}; needed none: functions of your own have no bound")
    vectors = found.emulate(z, chosen)
    near = None if found.step.is_exact else _tolerances(found, z, chosen, vectors)
    bound = "" if within is None or found.bounded is None else _bound(found.bounded, found.form, chosen, within)
    what = ", ".join(dict.fromkeys(each for each in (found.title, found.structure) if each))
    source = CodeSource(found.step, found.arithmetic, name)
    text = f"{what}, in {format_words(chosen)}"
    files = written_files(source, text, bound, found.bounded is not None, found.sections, vectors, near)
    target.mkdir(parents=True, exist_ok=True)
    for file, text in files.items():
        replace_file(target / file, text.encode())
    return tuple(target / file for file in files)


def _tolerances(found: Prepared, z: Any, fmt: FloatFormat, vectors: Vectors) -> NDArray[np.float64]:
    """Return four times the largest change of each state if every operation is rounded up, or every one down."""
    moved = [found.emulate(z, replace(fmt, rounding=each)).states for each in (Rounding.UP, Rounding.DOWN)]
    steps = min(map(len, (vectors.states, *moved)))
    return 4 * np.max([np.abs(each[:steps] - vectors.states[:steps]).max(axis=0) for each in moved], axis=0)


def _bound(model: LinearModel | LinearSystem, form: Form | None, fmt: AnyFormat, within: FilterLimits) -> str:
    """Return in words what is proved about the errors within limits."""
    if isinstance(model, LinearSystem):
        most = ", ".join(f"{each:.6g}" for each in largest_inputs(model, within).tolist())
        proved = f"For inputs of at most {most} in size, each output stays within {{}} of that of the exact filter, "
        proved += "whose coefficients are not rounded, {}."
    else:
        sized_limits(within, model.n, model.m, model.x0)
        proved = (
            "Within the given limits on state, innovation and measurement, rounding moves the estimates by at most "
        )
        proved += "{}, {}."
    try:
        guaranteed = guarantee(model, fmt, within, form=form)
    except (ValueError, OverflowError) as error:
        return f"No bound: {error}"
    if guaranteed.steps == 0:
        return f"No bound: {guaranteed.why}"
    time = "for ever" if guaranteed.for_ever else f"for {guaranteed.steps} steps, since {guaranteed.why}"
    return proved.format(", ".join(f"{each:.3g}" for each in guaranteed.bound.tolist()), time)


def prepared(given: Filter, fmt: AnyFormat, form: Form | str | None, exact: bool = True) -> Prepared:
    """Return a filter with what is needed to write its code; for the arguments, see :func:`write_code`."""
    if isinstance(fmt, FloatFormat):
        _type_of(fmt)
    else:
        _words(fmt)
    if isinstance(given, LinearModel):
        if isinstance(form, str) and plain_name(form) == plain_name(CONSTANT_GAIN):
            found = _of_system(settled_filter(given), fmt, CONSTANT_GAIN)
            return found._replace(inputs=lambda steps: simulated_measurements(given, steps), title=given.name)
        return _of_model(given, fmt, Form.INNOVATION if form is None else form)
    if isinstance(given, NonlinearModel):
        return _of_nonlinear_model(given, fmt, form_named(Form.INNOVATION if form is None else form), exact)
    if isinstance(given, FilterDesign):
        structure = None if form is None else str(form)
        return _of_system(given.system(structure), fmt, given.usual if structure is None else structure)
    if form is not None:
        order = "choose the structure in LinearSystem.from_coefficients or from_sections"
        raise ValueError(
            f"got {form!r} for a {type(given).__name__}, which has its structure; needed None; "
            f"{order if isinstance(given, LinearSystem) else 'its step is its structure'}"
        )
    return _of_nonlinear(given, fmt, exact) if isinstance(given, NonlinearSystem) else _of_system(given, fmt, "")


def format_words(fmt: AnyFormat) -> str:
    """Describe a format for a header, with its rounding and what happens to overflows."""
    if isinstance(fmt, FloatFormat):
        return format_text(fmt)
    words = _words(fmt)
    text = f"fixed point, data of {_word(words.data)}; a number n stands for n / 2**{words.data.fraction_bits}"
    if isinstance(words.coefficients, FixedFormat) and words.coefficients != words.data:
        text += f"; coefficients of {_word(words.coefficients)}"
    elif isinstance(words.coefficients, int):
        text += f"; coefficients of {digits_text(words.coefficients, kind='significant')}"
    return text if words.sums is None else f"{text}; sums of {_word(words.sums)}"


def _word(fmt: FixedFormat) -> str:
    overflow = {"raise": "which must not overflow", "saturate": "saturated", "wrap": "wrapped around"}[fmt.overflow]
    rounding = "ties away from zero" if fmt.rounding is Rounding.NEAREST else rounding_text(fmt.rounding)
    return f"{1 + fmt.precision} bits with {fmt.fraction_bits} after the point ({rounding}, {overflow})"


def _type_of(fmt: Any) -> str:
    """Return the type of a floating-point format in C."""
    if fmt == BINARY32:
        return "float"
    if fmt == BINARY64:
        return "double"
    cure = "BINARY32 or BINARY64"
    if fmt.base == 2 and fmt.precision in (24, 53):
        cure = f"BINARY{32 if fmt.precision == 24 else 64}, which rounds ties to even and has a range"
    elif fmt.base == 2 and fmt.precision < 53:
        cure = f"BINARY{32 if fmt.precision < 24 else 64}, which has more bits"
    raise ValueError(f"got {format_text(fmt)}, for which C99 has no type; needed {cure}, or fixed point")


def _words(fmt: FixedFormat | WordFormats) -> WordFormats:
    words = WordFormats(fmt) if isinstance(fmt, FixedFormat) else fmt
    for each in (words.data, words.accumulator, words.coefficients):
        if isinstance(each, FixedFormat) and each.rounding is Rounding.STOCHASTIC:
            raise ValueError("got stochastic rounding; needed a rounding that code can repeat")
    return words


def _arithmetic(step: CodeStep, fmt: AnyFormat) -> CodeNumbers:
    """Return how the operations of a step are written."""
    return CodeFloats(_type_of(fmt)) if isinstance(fmt, FloatFormat) else word_arithmetic(step, _words(fmt))


def _start(fmt: Any, x0: Any) -> NDArray[Any]:
    """Return a first state as it is stored."""
    return np.asarray(stored_start(fmt, x0).to_fractions(), dtype=object)


def _stored(numbers: Any, fmt: FloatFormat | FixedFormat) -> NDArray[Any]:
    """Return numbers of a format as the code stores them: float64, or integers in units of the format."""
    if isinstance(fmt, FloatFormat):  # float64 holds the numbers of these formats exactly
        return np.asarray(numbers.to_float())
    return np.asarray(numbers.to_fractions() / fmt.unit, dtype=object).astype(np.int64)


# -- linear systems ---------------------------------------------------------------------------------------------------


def _of_system(system: LinearSystem, fmt: AnyFormat, structure: str) -> Prepared:
    made = system.as_filter()
    if isinstance(fmt, FloatFormat):
        stored = made.stored(fmt)[None]
        step = CodeStep(without_exact(made.program, stored), stored, _start(fmt, system.x0))
    else:
        words = _words(fmt)
        stored = integer_program(made, words).coefficients[None]
        # With sums of their own, also a sum with zero may round or overflow.
        program = made.program if words.sums is not None else without_exact(made.program, stored)
        step = CodeStep(program, stored, _start(words.data, system.x0))
    sections = made.cascade.sections(stored[0]) if made.cascade is not None else []

    def emulated(u: Any, fmt: Any) -> Vectors:
        u, data = system_inputs(system, u), fmt.data if isinstance(fmt, WordFormats) else fmt
        inputs = _stored(data.array(u), data)
        start = np.append(_stored(data.array(system.x0), data), np.zeros(system.p, inputs.dtype))
        done, pairs, _ = longest(lambda steps: system_pairs(system, u[:steps], fmt), len(u))
        exactly = np.zeros((0, len(start))) if pairs is None else exact(pairs[..., 0]) + exact(pairs[..., 1])
        return _ended(inputs, start, _stored(data.array(exactly), data), np.zeros(done, np.int64))

    return Prepared(
        step, _arithmetic(step, fmt), system.name, structure, emulated, _noise(fmt, system.m), system, sections=sections
    )


def _noise(fmt: AnyFormat, m: int) -> Callable[[int], NDArray[np.float64]]:
    """Return a function that returns inputs for a number of steps, a quarter of the range of fixed point in size."""
    level = 1.0 if isinstance(fmt, FloatFormat) else float(_words(fmt).data.largest) / 4
    return lambda steps: np.random.default_rng(0).uniform(-level, level, (steps, m))


def _ended(inputs: NDArray[Any], start: NDArray[Any], states: NDArray[Any], status: NDArray[np.int64]) -> Vectors:
    """Return the vectors of a run; if it has fewer steps than inputs, it ends in the step after its last."""
    done = len(states)
    if done < len(inputs):
        states = np.concatenate([states, states[-1:] if done else start[None]])
        status = np.append(status, -2)
    return Vectors(inputs[: len(states)], states, status)


# -- nonlinear systems ------------------------------------------------------------------------------------------------


def _of_nonlinear(system: NonlinearSystem, fmt: AnyFormat, exact: bool) -> Prepared:
    program, coefficients = system.program(_one_format(fmt))
    step = CodeStep(program, coefficients, _start(fmt, system.x0))
    step.refuse_functions(exact)
    return Prepared(
        step,
        _arithmetic(step, fmt),
        system.name,
        "",
        lambda u, fmt: _nonlinear_vectors(system, u, fmt, program.p),
        _noise(fmt, system.m),
    )


def _one_format(fmt: AnyFormat) -> FloatFormat | FixedFormat:
    if isinstance(fmt, WordFormats):
        raise ValueError(
            "got formats of words for a nonlinear system; needed BINARY32, BINARY64 or a FixedFormat: all operations "
            "of its step are in one format"
        )
    return fmt


def _of_nonlinear_model(model: NonlinearModel, fmt: AnyFormat, form: Form, exact: bool) -> Prepared:
    run = NonlinearRun(model, _one_format(fmt), form)  # type: ignore[arg-type]
    program, members = run.program()
    stored = _coefficients(members)
    step = CodeStep(
        without_exact(program, stored), stored, program_states(form, run.x[None], run.P[None])[0].to_fractions()
    )
    step.refuse_functions(exact)

    def emulated(z: Any, fmt: Any) -> Vectors:
        run = NonlinearRun(model, fmt, form)
        start = _stored(program_states(form, run.x[None], run.P[None])[0], fmt)
        states = [_stored(program_states(form, *each.states), fmt) for each in run.blocks(z)]
        inputs = fmt.array(z)
        if model.u is not None:
            inputs = np.concatenate([inputs, fmt.array(model.u[: len(z)])], axis=1)
        kept = np.concatenate([start[None][:0], *states])
        return _ended(_stored(inputs, fmt), start, kept, _statuses(len(kept), run.indefinite))

    return Prepared(
        step,
        _arithmetic(step, fmt),
        model.name,
        (f"{form} form" if model.method == "extended" else "unscented") + (_WITH_INPUTS if model.u is not None else ""),
        emulated,
        lambda steps: simulated(model, min(steps, model.steps or steps)),
    )


def _nonlinear_vectors(system: NonlinearSystem, u: Any, fmt: FloatFormat | FixedFormat, p: int) -> Vectors:
    inputs = system.inputs_in(fmt, u)
    given = _stored(inputs, fmt)
    start = np.append(_stored(fmt.array(system.x0), fmt), np.zeros(p, given.dtype))
    rows = [start[None][:0]]
    with suppress(*STOPS):
        rows += (_stored(each, fmt) for each in system.blocks(fmt, inputs))
    states = np.concatenate(rows)
    return _ended(given, start, states, np.zeros(len(states), np.int64))


# -- Kalman filters ---------------------------------------------------------------------------------------------------


def _of_model(model: LinearModel, fmt: AnyFormat, form: Form | str) -> Prepared:
    chosen = form_with_program(form)
    if isinstance(fmt, WordFormats):
        raise ValueError(
            f"got formats of words for the {chosen} form; needed BINARY32, BINARY64 or a FixedFormat, or the form "
            f"{CONSTANT_GAIN!r}"
        )
    if model.b is not None or model.d is not None:
        raise ValueError(f"got offsets of {model.name}; needed none in C: make each a known input that is always 1")
    p = 0 if model.u is None else model.u.shape[-1]
    if p and chosen in HUNG_FORMS:
        raise ValueError(f"got known inputs in the {chosen} form, which is not defined with them; needed another form")
    run = Run(model, fmt, chosen, ())  # type: ignore[arg-type]
    given = {letter: run.exactly(each) for letter, each in run.letters.items()}
    stored = _coefficients([each for letter, each in given.items() if letter != "u"])
    program = kalman_program(chosen, {letter: each.shape[1:] for letter, each in given.items()})
    start = program_states(chosen, run.exactly(run.x.T), run.exactly(run.P[None]))[0]
    step = CodeStep(without_exact(program, stored), stored, start)

    return Prepared(
        step,
        _arithmetic(step, fmt),
        model.name,
        f"{chosen} form" + (_WITH_INPUTS if p else ""),
        lambda z, fmt: _model_vectors(model, z, fmt, chosen),
        lambda steps: simulated_measurements(model, min(steps, model.steps or steps)),
        bounded=model,
        form=chosen,
    )


def _coefficients(members: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Return the coefficients of each step of a cycle, (p, c), from matrices that each have a cycle of their own."""
    period = lcm(*(len(each) for each in members))
    rows = [np.concatenate([each[k % len(each)].ravel() for each in members]) for k in range(period)]
    return np.concatenate([np.array(rows, dtype=object), np.full((period, 1), Fraction(1), dtype=object)], axis=1)


def _statuses(steps: int, indefinite: int | None) -> NDArray[np.int64]:
    """Return the status of each step, given the first step in which a variance is not positive."""
    status = np.zeros(steps, np.int64)
    if indefinite is not None:
        status[indefinite - 1 :] = -1
        status[indefinite - 1 : indefinite] = 1
    return status


def _model_vectors(model: LinearModel, z: Any, fmt: FloatFormat | FixedFormat, form: Form) -> Vectors:
    run = Run(model, fmt, form, ())  # type: ignore[arg-type]

    def stored(numbers: NDArray[np.float64]) -> NDArray[Any]:
        """Return numbers, exact in float64, as the code stores them."""
        return numbers if isinstance(fmt, FloatFormat) else np.ldexp(numbers, fmt.fraction_bits).astype(np.int64)

    start = stored(program_states(form, run.x.T, run.P[None]))
    states = np.concatenate(
        [start[:0], *(stored(program_states(form, each.x[:, :, 0], each.P)) for each in run.blocks(z))]
    )
    inputs = fmt.array(z).to_float()
    if model.u is not None:
        u = np.broadcast_to(model.u, (len(z), model.u.shape[-1])) if model.u.ndim == 1 else model.u[: len(z)]
        inputs = np.hstack([inputs, fmt.array(u).to_float()])
    return _ended(stored(inputs), start[0], states, _statuses(len(states), run.indefinite))
