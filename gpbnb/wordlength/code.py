"""C99 code of a filter that agrees with the emulation digit for digit: source, test vectors and a Makefile.

The statements are those of the list of operations that is emulated, see :mod:`gpbnb.filters.program`: one for each
operation, in the same order; bounds follow those that depend on the measurements. So what is computed about a filter
holds for the code, if the compiler keeps the order and rounds each operation, as C99 demands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import lcm
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY32, BINARY64, arithmetic, format_text
from gpbnb.arithmetic.rational import exact as exactly
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.bounds.guarantee import sized_limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.files import replace_file
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.forms import CONSTANT_GAIN, Form, form_named, form_with_program, plain_name
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.nonlinear_run import opened, simulated
from gpbnb.filters.nonlinear_system import NonlinearSystem
from gpbnb.filters.opening import stored_start
from gpbnb.filters.program import Program, without_exact
from gpbnb.filters.recording import filter_program, program_states
from gpbnb.filters.run import Run
from gpbnb.filters.settled import settled_filter
from gpbnb.filters.steps import HUNG_FORMS
from gpbnb.filters.system import LinearSystem, SystemRun, system_inputs
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.asked import admitted, checked_format, data_of
from gpbnb.wordlength.bounding import guarantee
from gpbnb.wordlength.c_files import CodeSource, Sections, Vectors, checked_identifier, refuse_others, written_files
from gpbnb.wordlength.c_numbers import CodeFloats, CodeNumbers, CodeStep, CodeWords
from gpbnb.wordlength.judges import largest_inputs
from gpbnb.wordlength.models import ModelSource

VECTORS = 100
"""Steps of the test vectors."""

STOPS = (OverflowError, ZeroDivisionError, DomainError)
"""Errors that end the emulation of a step, as the code ends it with its status."""

AnyFormat = FloatFormat | FixedFormat | WordFormats
"""Formats that may have types in C."""


class Prepared(NamedTuple):
    """A filter with what is needed to write its code.

    Parameters
    ----------
    step : its operations.
    title : what it is.
    emulate : function that returns the vectors for inputs, (steps, m), in a format.
    inputs : function that returns inputs for a number of steps.
    structure : its structure or form.
    bounded, form : the linear model whose errors can be bounded, and its form; None if nothing bounds them.
    sections : those of a cascade, as stored; else empty.
    """

    step: CodeStep
    title: str
    emulate: Callable[[Any, Any], Vectors]
    inputs: Callable[[int], NDArray[np.float64]]
    structure: str = ""
    bounded: LinearModel | LinearSystem | None = None
    form: Form | None = None
    sections: Sections = ()


def write_code(
    model: ModelSource,
    fmt: AnyFormat | str,
    folder: str | Path,
    *,
    form: Form | str | None = None,
    name: str = "filter",
    inputs: Any = None,
    within: FilterLimits | None = None,
    exact: bool = True,
) -> tuple[Path, ...]:
    """Write a filter as C99 without dependencies; its results agree with the emulation digit for digit.

    Parameters
    ----------
    model : a linear system in its structure, a design, a Kalman filter, linear, extended or unscented, perhaps with
        known inputs, which follow the measurements in the code's input, or a nonlinear system, whose step is a function
        of your own; or what :func:`gpbnb.read_model` reads.
    fmt : BINARY32 or BINARY64; fixed point of at most 64 bits; a :class:`gpbnb.WordFormats`; or the name of a format,
        such as "float32" or "Q15".
    folder : folder for the files, which is created if necessary. Files that gpbnb has written are replaced, others not.
    form : for a Kalman filter, "innovation", "Joseph", "UD", or one of Hung's, or "constant gain"; for a
        :class:`gpbnb.filters.design.FilterDesign`, its structure. A Kalman filter takes words of at
        most 52 bits that do not wrap around, as its emulation does.
    name : name of the files, and prefix of every name that the header declares.
    inputs : (steps, m), inputs or measurements of the test vectors, or a number of steps of noise, or of simulated
        measurements; by default 100.
    within : limits from :func:`gpbnb.bounds.guarantee.limits`; the header states the error bound that holds
        within them.
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
    refuse_others(target, name)
    if not exact and not isinstance(chosen, FloatFormat):
        raise ValueError("got exact=False in fixed point; needed BINARY32 or BINARY64, which C's functions take")
    found = prepared(given, chosen, form, exact)
    source = CodeSource(numbers_for(found.step, chosen), name)
    z, steps = data_of(given, VECTORS if inputs is None else inputs)
    z = found.inputs(steps) if z is None else z
    if within is not None and found.bounded is None:
        raise ValueError(f"got limits for {given.name}; needed none: functions of your own have no bound")
    vectors = found.emulate(z, chosen)
    near = None if found.step.is_exact else _tolerances(found, z, chosen, vectors)
    bound = "" if within is None or found.bounded is None else _bound(found.bounded, found.form, chosen, within)
    what = ", ".join(dict.fromkeys(each for each in (found.title, found.structure) if each))
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
        proved = (
            f"For inputs of at most {most} in size, each output stays within {{}} of that of the exact filter, whose "
            "coefficients are not rounded, {}."
        )
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


def format_words(fmt: AnyFormat) -> str:
    """Describe a format for a header, with its rounding and what happens to overflows."""
    if isinstance(fmt, FloatFormat):
        return format_text(fmt)
    words = fmt if isinstance(fmt, WordFormats) else WordFormats(fmt)
    text = f"{arithmetic(words.data)}; a number n stands for n / 2**{words.data.fraction_bits}"
    if isinstance(words.coefficients, int):
        text += f"; coefficients of {digits_text(words.coefficients, kind='significant')}"
    others = {"coefficients": words.coefficients, "sums": words.sums}
    return text + "".join(
        f"; {name} in {arithmetic(each)}" for name, each in others.items() if isinstance(each, FixedFormat)
    )


def numbers_for(step: CodeStep, fmt: AnyFormat) -> CodeNumbers:
    """Return how the operations of a step are written."""
    if isinstance(fmt, FloatFormat):
        return CodeFloats(step, _type_of(fmt))
    return CodeWords(step, fmt if isinstance(fmt, WordFormats) else WordFormats(fmt))


def _type_of(fmt: FloatFormat) -> str:
    """Return the type of a floating-point format in C."""
    types = {"float": BINARY32, "double": BINARY64}
    for name, each in types.items():
        if fmt == each:
            return name
    enough = [each for each in types.values() if fmt.base == 2 and fmt.precision <= each.precision]
    cure = f"{format_text(enough[0])} ({arithmetic(enough[0])})" if enough else "BINARY32 or BINARY64"
    raise ValueError(f"got {format_text(fmt)}, for which C99 has no type; needed {cure}, or fixed point")


def prepared(given: Any, fmt: AnyFormat, form: Form | str | None, exact: bool = True) -> Prepared:
    """Return a filter with what is needed to write its code; for the arguments, see :func:`write_code`."""
    if isinstance(fmt, FloatFormat):
        _type_of(fmt)
    if isinstance(given, LinearModel | NonlinearModel):
        if isinstance(given, LinearModel) and isinstance(form, str) and plain_name(form) == plain_name(CONSTANT_GAIN):
            found = _of_system(settled_filter(given), fmt, CONSTANT_GAIN)
            return found._replace(inputs=partial(simulated, given), title=given.name)
        found = _of_filter(given, fmt, Form.INNOVATION if form is None else form)
    elif isinstance(given, FilterDesign):
        structure = given.usual if form is None else str(form)
        found = _of_system(given.system(None if form is None else structure), fmt, structure)
    elif form is not None:
        order = "choose the structure in LinearSystem.from_coefficients or from_sections"
        raise ValueError(
            f"got {form!r} for a {type(given).__name__}, which has its structure; needed None; "
            f"{order if isinstance(given, LinearSystem) else 'its step is its structure'}"
        )
    else:
        found = _of_nonlinear(given, fmt) if isinstance(given, NonlinearSystem) else _of_system(given, fmt, "")
    found.step.refuse_functions(exact)
    return found


def _of_system(system: LinearSystem, fmt: AnyFormat, structure: str) -> Prepared:
    made, program = system.as_filter(), system.as_filter().program
    data: Any = fmt.data if isinstance(fmt, WordFormats) else fmt
    stored = made.stored(fmt)[None]
    if not (isinstance(fmt, WordFormats) and fmt.sums):  # with sums of their own, a sum with zero may round or overflow
        program = without_exact(program, stored)
    start = stored_start(data, system.x0).to_fractions()

    def emulated(u: Any, fmt: Any) -> Vectors:
        inputs = system_inputs(system, u)
        pairs = SystemRun(system, fmt).states(inputs)
        states = [exactly(pairs[..., 0]) + exactly(pairs[..., 1])]
        return _vectors(data, data.array(inputs).to_fractions(), np.append(start, exactly([0] * system.p)), states)

    return Prepared(
        CodeStep(program, stored, start),
        system.name,
        emulated,
        _noise(data, system.m),
        structure,
        system,
        sections=made.cascade.sections(stored[0]) if made.cascade is not None else [],
    )


def _of_nonlinear(system: NonlinearSystem, fmt: AnyFormat) -> Prepared:
    one = _one_format(fmt, "a nonlinear system")
    program, coefficients = system.program(one)
    start = stored_start(one, system.x0).to_fractions()

    def blocks(fmt: Any, inputs: Any) -> Iterator[NDArray[Any]]:
        with suppress(*STOPS):
            for each in system.blocks(fmt, inputs):
                yield each.to_fractions()

    def emulated(u: Any, fmt: Any) -> Vectors:
        inputs = system.inputs_in(fmt, u)
        before = np.append(fmt.array(system.x0).to_fractions(), exactly([0] * program.p))
        return _vectors(fmt, inputs.to_fractions(), before, blocks(fmt, inputs))

    return Prepared(CodeStep(program, coefficients, start), system.name, emulated, _noise(one, system.m))


def _of_filter(model: LinearModel | NonlinearModel, fmt: AnyFormat, form: Form | str) -> Prepared:
    linear = model if isinstance(model, LinearModel) else None
    chosen = form_named(form) if linear is None else form_with_program(form)
    one: Any = _one_format(fmt, "a nonlinear filter" if linear is None else f"the {chosen} form")
    if linear is not None and (linear.b is not None or linear.d is not None):
        raise ValueError(f"got offsets of {model.name}; needed none in C: make each a known input that is always 1")
    if model.u is not None and chosen in HUNG_FORMS:
        raise ValueError(f"got known inputs in the {chosen} form, which is not defined with them; needed another form")
    run = opened(model, one, chosen)
    program, members = _program(run) if isinstance(run, Run) else run.program()
    period = lcm(*(len(each) for each in members))
    rows = [np.concatenate([each[k % len(each)].ravel() for each in members]) for k in range(period)]
    stored = np.concatenate([np.array(rows, dtype=object), np.full((period, 1), Fraction(1), dtype=object)], axis=1)

    def emulated(z: Any, fmt: Any) -> Vectors:
        run, inputs = opened(model, fmt, chosen), fmt.array(z).to_fractions()
        if model.u is not None:
            u = np.broadcast_to(model.u, (len(z), model.u.shape[-1])) if model.u.ndim == 1 else model.u[: len(z)]
            inputs = np.concatenate([inputs, fmt.array(u).to_fractions()], axis=1)
        first, *states = _states(run, chosen, z)
        return _vectors(fmt, inputs, first[0], states, run.indefinite)

    method = "unscented" if getattr(model, "method", "") == "unscented" else f"{chosen} form"
    return Prepared(
        CodeStep(without_exact(program, stored), stored, next(_states(run, chosen))[0]),
        model.name,
        emulated,
        lambda steps: simulated(model, min(steps, model.steps or steps)),
        method + (", whose input holds the measurements, then the known inputs" if model.u is not None else ""),
        bounded=linear,
        form=chosen,
    )


def _program(run: Run) -> tuple[Program, list[NDArray[Any]]]:
    """Return the operations of a step of a linear filter, and its coefficients but 1, each with its cycle."""
    members = [run.exactly(each) for letter, each in run.letters.items() if letter != "u"]
    return filter_program(run.form, run.recorded().step, run.letters, []), members


def _states(run: Any, form: Form, z: Any = ()) -> Iterator[NDArray[Any]]:
    """Give the exact states of a program, (k, n), before the first step, then after each, some at a time."""
    linear = isinstance(run, Run)
    exact: Any = run.exactly if linear else FloatArray.to_fractions
    yield program_states(form, exact(run.x.T if linear else run.x[None]), exact(run.P[None]))
    for each in run.blocks(z):
        yield program_states(form, *map(exact, (each.x[:, :, 0], each.P) if linear else each.states))


def _one_format(fmt: AnyFormat, what: str) -> FloatFormat | FixedFormat:
    if isinstance(fmt, WordFormats):
        raise ValueError(
            f"got formats of words for {what}; needed BINARY32, BINARY64 or a FixedFormat: all operations of its step "
            f"are in one format; or, for a linear filter, the form {CONSTANT_GAIN!r}"
        )
    return fmt


def _noise(fmt: FloatFormat | FixedFormat, m: int) -> Callable[[int], NDArray[np.float64]]:
    """Return a function that returns inputs for a number of steps, a quarter of the range of fixed point in size."""
    level = 1.0 if isinstance(fmt, FloatFormat) else float(fmt.largest) / 4
    return lambda steps: np.random.default_rng(0).uniform(-level, level, (steps, m))


def _vectors(
    fmt: Any, inputs: Any, before: Any, blocks: Iterable[NDArray[Any]], indefinite: int | None = None
) -> Vectors:
    """Return the vectors of a run from its exact numbers; with fewer steps than inputs, it ends in the next step.

    `before` are states and outputs before the first step, `indefinite` the first step with a variance that is not
    positive.
    """
    states = np.concatenate([before[None], *blocks])
    status = np.zeros(len(states) - 1, np.int64)
    if indefinite is not None:
        status[indefinite - 1 :] = -1
        status[indefinite - 1 : indefinite] = 1
    if len(status) < len(inputs):
        states, status = np.concatenate([states, states[-1:]]), np.append(status, -2)
    return Vectors(_stored(inputs[: len(status)], fmt), _stored(states[1:], fmt), status)


def _stored(numbers: NDArray[Any], fmt: FloatFormat | FixedFormat) -> NDArray[Any]:
    """Return exact numbers of a format as the code stores them: float64, or integers in units of the format."""
    return numbers.astype(np.float64) if isinstance(fmt, FloatFormat) else (numbers / fmt.unit).astype(np.int64)
