"""Find the smallest format that keeps a filter, a controller or a function of your own within a tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.selection import LARGEST_PRECISION
from gpbnb.arithmetic.named import BINARY32, BINARY64, arithmetic, digits, format_named
from gpbnb.arithmetic.rounding import Rounding, digit_unit, digits_text, rounding_named
from gpbnb.arithmetic.search import CHECKED, Search, largest_by_default, largest_compiled
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.forms import Form, form_with_program
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import whole_number
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.nonlinear_run import check_form, opened
from gpbnb.filters.system import LinearSystem, unobserved
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.answer import PROOFS, Basis, Kind, Requirement, evidence, joined, judgement, listed, share_text
from gpbnb.wordlength.asked import TASK_OF_KIND, Asked, checked_basis, checked_format, is_filter
from gpbnb.wordlength.fixed import MOST_COEFFICIENT_BITS, fixed_like, in_fixed_point, in_words
from gpbnb.wordlength.judges import Judge, for_ever_or_over, judge_for, slowest_response
from gpbnb.wordlength.models import ModelSource

_TASK_IN_WORDS: dict[str, str] = {
    **dict.fromkeys(PROOFS, "have a guarantee in fixed-point words"),
    "probable": "have a probable error in words",
}

_NOT_FOR = {
    "highest": (("fixed", "words", "blocks"), 'only kind "float" has a highest precision to set'),
    "coefficient_bits": (("float", "blocks"), 'kind="fixed" has coefficients of their own'),
    "base": (("fixed", "words"), "like=FixedFormat(...) sets integer bits"),
    "range": (("fixed", "words"), "like=FixedFormat(...) sets integer bits"),
    "like": (("words",), "the search sets all formats"),
}
"""Arguments that some kinds of search do not take, and why."""


def required_precision(
    model: ModelSource,
    z: Numbers | int,
    tolerance: Any,
    *,
    kind: Kind = "float",
    like: FloatFormat | FixedFormat | WordFormats | str | None = None,
    basis: Basis = "emulation",
    within: FilterLimits | None = None,
    form: Form | str | None = None,
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    range: tuple[int, int] | None = None,
    highest: int | None = None,
    coefficient_bits: int | None = None,
    seed: int = 0,
    progress: bool = False,
) -> Requirement:
    """Find the format with the fewest digits with which a filter or a function stays within a tolerance.

    The search is a bisection that checks its own assumption. It runs the answer, the next two precisions, and the
    precisions of binary32 and binary64 if they are higher (:data:`gpbnb.arithmetic.search.CHECKED`); all of these
    meet the tolerance. It also runs the next lower precision, which does not qualify. If a higher precision misses
    the tolerance, the search runs every precision up to the highest, and tries the other forms; the answer is then
    above the highest precision that misses. The text of an answer in bits also says what a run in binary32 itself, or
    in binary64, gives.

    Parameters
    ----------
    model : a Kalman filter, linear or nonlinear; a linear system; anything that :func:`gpbnb.read_model` reads, such as
        the path of a file or a ``scipy.signal.dlti``; a :class:`gpbnb.NonlinearSystem` or a
        :class:`gpbnb.FixedIntervalSmoother`; or a function of a format and `z`, written with arrays of the format,
        which returns an output for each step, or one result. It is traced once, see :class:`gpbnb.TracedFunction`. If
        covariances of a Kalman filter were repaired, the answer lists the repairs.
    z : (steps, m), measurements or inputs, or (steps,) if there is one in each step; NaN or masked if missing. Or the
        number of steps: a Kalman filter then simulates its measurements, rounded to
        :func:`gpbnb.filters.simulation.fine_resolution`, and a function takes the format alone.
    tolerance : largest acceptable error due to rounding of each state in any step, in the unit of the state; one
        number, or (n,). Give states whose accuracy does not matter an infinite tolerance. For a system or a function,
        it is the largest acceptable error of each output. Numbers may be text, such as "1/100".
    kind : "float" for floating point. "fixed" for fixed point, with as many integer bits as a run in the format needs.
        "words" for a linear system whose data, coefficients and sums each have a fixed-point format: data are lowered
        first, with 24 bits for each coefficient and exact sums that are rounded once when they are stored; then the
        significant bits of the coefficients; last the sums, which wrap around. "blocks" for a Kalman filter whose
        state, gain, covariance and innovation covariance each have a floating-point format, lowered one after the
        other, the block first that needs the fewest digits alone.
    like : a format with the range and the rounding of those to try, in place of `base`, `rounding` and `range`. In
        fixed point, it sets the integer bits, too, and may be :class:`gpbnb.WordFormats` for a linear system; their
        sums change with the data.
    basis : "emulation" compares a run in each format with a run in double-double of the model as given, so the
        errors include those of storing the model. The answer holds for these measurements. "bound" uses the
        contraction bound of :mod:`gpbnb.filters.contraction`, which is proved for the arithmetic of this run and
        requires more digits. "guarantee" bounds the error for every measurement sequence within limits; the bound
        holds for ever, or for the steps of `z` if the filter never forgets its errors. "probable" takes three standard
        deviations of the error that independent roundings would cause. A linear system has a bound for all inputs no
        larger than those given. Guarantees assume sums from left to right without fused multiply-add.
    within : limits on the filter without rounding, for "guarantee" and "probable" only; see :func:`gpbnb.limits`. The
        answer says if the given measurements leave them. A linear system has limits on its inputs, `measurement`.
    form : form of a Kalman filter, such as "Joseph" or "UD"; see :class:`gpbnb.Form`.
    base, rounding : 2, 10 or 16; and a value or its name, such as "chop".
    range : smallest and largest exponent of a normal number; by default unlimited. A format in which a number overflows
        does not meet the tolerance; the answer names the quantity and the step.
    highest : highest precision to try with kind="float". For a linear model, the default is also the maximum: the
        highest precision with compiled loops, which is 53 bits, 18 decimal digits or 13 hexadecimal digits, and lower
        for some roundings. A function or a nonlinear filter runs in any precision; its default is 200 bits, 60 decimal
        digits or 50 hexadecimal digits.
    coefficient_bits : significant bits of each coefficient of a linear system in fixed point, each with its own binary
        point; by default 15. With kind="words", the most to try, by default 24.
    seed : seed of simulated measurements.
    progress : show a progress bar that counts runs.

    Raises
    ------
    ValueError : a tolerance that is not positive; an unknown basis, kind, form or rounding; something that a model of
        this kind cannot do, where the message says what to use; limits for another filter, or for a basis that does not
        use them; a first estimate beyond its limit; a reference of a function that depends on its digits.
    TypeError : an unknown kind of model or format; a function that leaves the format.
    OverflowError : an output of a linear system, or its reference, leaves the range of float64; the entries of a model
        are too large or too small for compiled loops.
    ArithmeticError : the filter is degenerate even without rounding; see :func:`gpbnb.filters.run.reference`.

    Examples
    --------
    >>> from gpbnb import LinearModel, LinearSystem
    >>> walk = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[100]])
    >>> required_precision(walk, 50, 0.05)
    10 bits (binary32 is enough): 0.2 of the tolerance, observed in 50 steps
    >>> print(required_precision(walk, 50, 0.05, kind="blocks").format)
    state 5, gain 10, covariance 9, innovation 7 bits
    >>> smooth = LinearSystem.from_coefficients(["0.1"], [1, "-0.9"])
    >>> for part in str(required_precision(smooth, [1] * 50, 0.001, kind="fixed")).split("; "):
    ...     print(part)
    11 fraction bits in a word of 13 bits: 0.8 of the tolerance, observed in 50 steps
    10 fraction bits give 4.95 times the tolerance
    >>> def mean(fmt, values):
    ...     return sum(values[1:], values[0]) / fmt.array(len(values))
    >>> required_precision(mean, [1, 2, 4], "1/1000")
    11 bits (binary32 is enough): 0.65 of the tolerance, observed in 3 steps
    """
    if kind not in TASK_OF_KIND:
        raise ValueError(f"got kind {kind!r}; needed one of {', '.join(map(repr, TASK_OF_KIND))}")
    words = kind == "words" or (kind == "fixed" and not isinstance(format_named(like), FixedFormat))
    tasks = (TASK_OF_KIND[kind], _TASK_IN_WORDS.get(checked_basis(basis), "") if words else "")
    asked = Asked.of(
        model,
        z,
        *tasks,
        tolerance=tolerance,
        basis=basis,
        within=within,
        form=form,
        highest=highest,
        seed=seed,
    )
    options = {"base": base != 2, "rounding": rounding != Rounding.NEAREST, "range": range is not None}
    if like is not None and (names := [name for name, value in options.items() if value]):
        raise ValueError(f"got {' and '.join(names)} beside like; needed like alone, which sets them")
    given = {"highest": highest, "coefficient_bits": coefficient_bits, "range": range, "like": like}
    given["base"] = None if isinstance(base, int) and base == 2 else base
    for name, (kinds, why) in _NOT_FOR.items():
        if given[name] is not None and kind in kinds:
            raise ValueError(f'got {name}={given[name]} and kind "{kind}"; needed none: {why}')
    with tqdm(desc="precisions", unit="run", disable=not progress) as bar:
        asked = replace(asked, ran=bar.update)
        if kind in ("fixed", "words"):
            bits = None if coefficient_bits is None else whole_number("coefficient_bits", coefficient_bits, 1, 53)
            if kind == "words":
                return in_words(asked, rounding_named(rounding), bits or MOST_COEFFICIENT_BITS)
            return in_fixed_point(asked, fixed_like(like, asked.model), rounding_named(rounding), bits)
        kind_like = _float_like(like, base, rounding_named(rounding), range)
        return (_of_blocks if kind == "blocks" else _in_floating_point)(asked, kind_like)


def judge(
    model: Any,
    fmt: FloatFormat | FixedFormat | WordFormats | str,
    z: Any,
    tolerance: Any,
    *,
    form: Form | str | None = None,
    basis: Basis = "emulation",
    within: FilterLimits | None = None,
) -> Requirement:
    """Judge one format; for the arguments, see :func:`required_precision`."""
    chosen = checked_format(fmt, WordFormats)
    words = _TASK_IN_WORDS.get(checked_basis(basis), "") if isinstance(chosen, WordFormats) else ""
    asked = Asked.of(model, z, words, form=form, tolerance=tolerance, basis=basis, within=within)
    if isinstance(asked.model, LinearModel | LinearSystem) and not isinstance(chosen, WordFormats):
        chosen.check_compiled()
    precision = chosen.data.precision if isinstance(chosen, WordFormats) else chosen.precision
    found, judge = for_ever_or_over(
        asked,
        judge_for(asked, 2 if isinstance(chosen, WordFormats) else chosen.base, precision),
        lambda each: each.proof(chosen),
        lambda outcome: not math.isinf(outcome.ratio),
    )
    ends, notes = judge.steps is not None, judge.warnings() if found.ratio <= 1 else ()
    text = judgement(chosen, basis, asked.steps, found.ratio, found.why, ends)
    return asked.answer(chosen, found.ratio, (), ends, text, found.why, notes)


# -- floating point ---------------------------------------------------------------------------------------------------


def _float_like(like: Any, base: Any, rounding: Rounding, limits: tuple[int, int] | None) -> FloatFormat:
    found = format_named(like)
    if found is None:
        if isinstance(base, bool) or not isinstance(base, int) or base not in LARGEST_PRECISION:
            known = ", ".join(map(str, LARGEST_PRECISION))
            raise ValueError(f"got base {base!r}; needed one with compiled loops: {known}")
        return FloatFormat(base, 2, rounding, *((None, None) if limits is None else limits))
    if not isinstance(found, FloatFormat):
        raise TypeError(f'got like={like!r}; needed a FloatFormat or its name; kind="fixed" takes a FixedFormat')
    return replace(found, given_largest=None)


def _highest(asked: Asked, like: FloatFormat) -> int | None:
    """Return the highest precision to try; None stands for the largest with compiled loops."""
    highest, most = asked.highest, largest_compiled(like)
    if highest is not None:
        highest = whole_number("highest", highest, 2)
    if not isinstance(asked.model, LinearModel | LinearSystem):
        return largest_by_default(like.base) if highest is None else highest
    if highest is not None and highest > most:
        raise ValueError(
            f"got highest={highest} for a model; needed at most {digits_text(most, like.base)}, the most with compiled "
            f"loops, rounded {like.rounding.value}; a filter written as a function of a format runs in more"
        )
    return highest


def _in_floating_point(asked: Asked, like: FloatFormat) -> Requirement:
    base = like.base
    highest = _highest(asked, like)
    asked.check_sizes(like)
    lasting = is_filter(asked.model) and asked.basis in ("guarantee", "probable")
    bounds = asked.basis == "bound" or (asked.basis != "emulation" and not lasting)

    def search(each: Judge) -> Search[FloatFormat]:
        proof, checks = each.proof if each.proved else None, () if lasting else CHECKED[base]
        return Search(each.error, like, checks, asked.ran, bounds, highest, proof=proof)

    judge = judge_for(asked, base, highest or largest_compiled(like))
    found, judge = for_ever_or_over(asked, judge, search, Search.is_bounded)
    notes, cause = _advice(asked, judge, found, like, search)
    return _float_answer(asked, found, judge.steps is not None, notes, cause, like)


def _advice(
    asked: Asked,
    judge: Judge,
    found: Search[FloatFormat],
    like: FloatFormat,
    search: Callable[[Judge], Search[FloatFormat]],
) -> tuple[list[str], str]:
    """Return what else there is to say about the result of a search, and why no precision can be an answer."""
    model, notes, cause = asked.model, list[str](), ""
    last, ratio = found.tried[-1]
    give = f"{digits_text(last, like.base)} {'gives' if last == 1 else 'give'} {ratio:.3g} times the tolerance"
    remedy = _in_more_digits(asked, found, like)
    if found.undecided:
        undecided = digits_text(listed(found.undecided), like.base)
        notes.append(
            f"the proof does not cover {undecided}, in which no bound was found: {found.reasons[found.undecided[-1]]}"
        )
    if judge.of_form is not None:
        unseen = unobserved_part(judge.model) if found.fmt is None else ""
        better = _better_form(judge, search) if found.irregular or found.fmt is None else ""
        notes += [better] if better else []
        if remedy and not better and not unseen:
            notes += [give, remedy]
        notes += [f"{unseen}, so that its errors never decay"] if unseen else []
        notes += _repairs(model, judge.model, found.fmt, asked.form)
    elif isinstance(model, LinearModel):
        cause = unobserved_part(model) if found.fmt is None and judge.steps is None else ""
        cause += '; ask with basis "bound" for a number of steps instead' if cause else ""
        notes += _repairs(model, model, found.fmt, asked.form)
    elif isinstance(model, LinearSystem):
        notes_of, cause = _of_linear_system(asked, found, like, give)
        notes += notes_of + ([remedy] if remedy and not cause and not _is_long(model) and not notes_of[1:] else [])
    if judge.untraced:
        notes.append(f"the function ran operation by operation: {judge.untraced}")
    return notes + list(judge.warnings() if found.fmt is not None else ()), cause


def _of_linear_system(asked: Asked, found: Search[FloatFormat], like: FloatFormat, give: str) -> tuple[list[str], str]:
    """Return why no precision is enough for a linear system, and whether this is so in every precision."""
    system = asked.model
    if found.fmt is not None:
        return [], ""
    cause = system.unstable() if system.as_filter().program.is_linear else ""
    if not cause:
        notes = [] if math.isinf(found.tried[-1][1]) else [give]
        if _is_long(system):
            unit = digit_unit(like.base)
            notes.append(f"second-order sections usually need fewer {unit}: their coefficients move the poles less")
        elif asked.basis != "emulation" and (slow := slowest_response(system, asked.steps)):
            notes.append(f"errors add up because the system is slow: its {slow}")
        return notes, ""
    if asked.basis == "probable":
        return [], (
            f'{cause}, so that an error of rounding never decays; ask with basis "bound" or "guarantee" for a number '
            "of steps instead, or reset the state now and then"
        )
    grow = "grow with every step, whatever the precision" if asked.basis == "emulation" else "add up with every step"
    lost = (
        "; if its design is stable, b and a have lost it in their rounding to float64: take second-order sections from "
        'the design tool, as output="sos" of SciPy gives them'
    )
    return [f"{cause}, so that errors {grow}: take fewer steps{lost if _is_long(system) else ''}", ""], ""


def unobserved_part(model: Any) -> str:
    """Return in words that no measurement observes a part of the state of a filter that does not decay."""
    if not isinstance(model, LinearModel) or model.cycle != 1:
        return ""
    return unobserved(model.Phi[0], model.H[0], model.state_names)


def _is_long(system: LinearSystem) -> bool:
    """Whether one recursion of the structure has an order of 3 or more, so that its coefficients move its poles far."""
    return system.made is not None and "a3" in system.made.program.coefficient_names


def _in_more_digits(asked: Asked, found: Search[FloatFormat], like: FloatFormat) -> str:
    """Say what runs in more digits than a linear model, if the largest precision misses the tolerance."""
    ended = asked.highest in (None, largest_compiled(like)) and 1 < found.tried[-1][1] < math.inf
    linear = isinstance(asked.model, LinearModel | LinearSystem)
    if not linear or found.fmt is not None or asked.basis != "emulation" or not ended:
        return ""
    most = digits_text(largest_by_default(like.base), like.base)
    return (
        f"a filter written as a function f(fmt, z) of a format runs in more: required_precision(f, z, tolerance) tries "
        f"up to {most}, and more with highest="
    )


def _better_form(judge: Judge, search: Callable[[Judge], Search[FloatFormat]]) -> str:
    """Name the form that meets the tolerance with the fewest digits, as advice; empty if there is none."""
    if judge.of_form is None or (isinstance(judge.model, NonlinearModel) and judge.model.method == "unscented"):
        return ""
    others = [each for each in (Form.UD, Form.JOSEPH, Form.INNOVATION) if each is not judge.form]
    answers = [(other, search(judge.of_form(other)).fmt) for other in others]
    met = [(fmt.precision, str(other), digits(fmt)) for other, fmt in answers if fmt is not None]
    return f"the form {min(met)[1]} needs {min(met)[2]}" if met else ""


def _repairs(given: Any, sound: Any, fmt: FloatFormat | None, form: Form) -> list[str]:
    """Return the changes of the covariances of a model and, if there is an answer, of its run in the format."""
    more = [] if fmt is None else opened(sound, fmt, form).repairs[len(sound.repairs) :]
    return [str(each) for each in (*given.repairs, *more)]


def _float_answer(
    asked: Asked, found: Search[FloatFormat], ends: bool, notes: list[str], cause: str, like: FloatFormat
) -> Requirement:
    fmt, tried, base = found.fmt, dict(found.tried), like.base
    known, needed = evidence(asked.basis, asked.steps, ends)
    processors = list[tuple[str, float]]()
    for name, each in _processors_with(fmt):
        if each.precision <= found.largest and not any(ratio <= 1 for _, ratio in processors):
            processors.append((name, found.error(each).ratio))
    enough = next((name for name, ratio in processors if ratio <= 1), "")
    if found.irregular:
        missed = [each for each, ratio in found.tried if not ratio <= 1 and each > found.irregular[0]]
        notes.insert(0, f"{digits_text(listed(found.irregular), base)} meet it, but {listed(missed)} do not")
    why = found.why
    if fmt is None and cause:
        text = f"no precision meets the tolerance {needed}: {cause}"
    elif fmt is None:
        most = digits_text(found.tried[-1][0], base) + (f", {found.limit}," if found.limit else "")
        reliably = "reliably meets" if found.irregular else "meets"
        text = joined(f"no precision up to {most} {reliably} the tolerance {needed}", [why])
    else:
        misses = "is not proved to meet" if asked.basis in PROOFS else "misses"
        named = [f"{name} {misses} the tolerance: {ratio:.2g}" for name, ratio in processors if not ratio <= 1]
        named += [f"{enough} is enough"] if enough else []
        on_processors = f" ({'; '.join(named)})" if named else ""
        below = why if math.isinf(tried.get(fmt.precision - 1, 0.0)) else ""
        text = joined(f"{arithmetic(fmt)}{on_processors}: {share_text(tried[fmt.precision])}, {known}", [below])
    ratio = math.inf if fmt is None else tried[fmt.precision]
    more = {"irregular": found.irregular, "processor_format": enough}
    return asked.answer(fmt, ratio, found.tried, ends, text, cause or why, notes, **more)


def _processors_with(fmt: FloatFormat | None) -> tuple[tuple[str, FloatFormat], ...]:
    """Return the names and formats of processors that have the digits of a format and round to nearest as it does."""
    if fmt is None or fmt.base != 2 or fmt.limits is not None or not fmt.rounding.to_nearest:
        return ()
    return tuple((n, f) for n, f in (("binary32", BINARY32), ("binary64", BINARY64)) if f.precision >= fmt.precision)


# -- blocks of a Kalman filter ----------------------------------------------------------------------------------------


def _of_blocks(asked: Asked, like: FloatFormat) -> Requirement:
    """Lower each block of a Kalman filter to its smallest precision within a tolerance, and name the limiting block."""
    model, form = asked.model, form_with_program(asked.form)
    if asked.basis != "emulation":
        raise ValueError(f'got basis "{asked.basis}" for blocks; needed "emulation": bounds are for one format')
    if isinstance(model, NonlinearModel):
        check_form(model, form, blocks=True)
    asked.check_sizes(like)
    judge = judge_for(replace(asked, form=form))
    most = replace(like, precision=largest_compiled(like))
    found = Search(judge.error, like, CHECKED[like.base], asked.ran)

    def lowered(formats: BlockFormats, name: str) -> int | None:
        """Return the smallest precision of a block, up to that which it has; None if this is not enough."""
        top = getattr(formats, name).precision
        search = Search(lambda fmt: judge.error(formats.with_block(name, fmt)), like, (), asked.ran, largest=top)
        return None if search.fmt is None else search.fmt.precision

    alone = {name: lowered(BlockFormats.uniform(most), name) for name in BLOCKS}
    uniform = _float_answer(asked, found, False, [], "", like)
    if found.fmt is None:
        return replace(uniform, alone=alone)
    formats = BlockFormats.uniform(found.fmt)
    for name in sorted(alone, key=lambda name: alone[name] or math.inf):
        digits = lowered(formats, name)
        formats = formats.with_block(name, replace(like, precision=found.fmt.precision if digits is None else digits))
    answer = replace(uniform, format=formats, ratio=judge.error(formats).ratio, alone=alone, processor_format="")
    limits = " and ".join(f"the {name}" for name in answer.limiting)
    each = ", ".join(f"{name} {digits}" for name, digits in alone.items())
    text = (
        f"{formats}: {share_text(answer.ratio)}; {limits} limit{'s' * (len(answer.limiting) == 1)} the filter: lowered "
        f"one at a time, the blocks need {each}; one format for all needs {found.fmt.precision}"
    )
    return replace(answer, text=text)
