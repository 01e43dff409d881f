"""What is asked, the strategies that answer it, and the required number of digits with the basis of this answer."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.selection import LARGEST_PRECISION
from gpbnb.arithmetic.named import BINARY32, BINARY64, arithmetic
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.arithmetic.search import Outcome, Search, largest_by_default, largest_compiled
from gpbnb.filters.array_forms import AnyForm
from gpbnb.filters.words import WordFormats

ANY_BINARY = FloatFormat(2, 2)
"""A binary format; its precision does not matter."""

Found = TypeVar("Found")

Basis = Literal["emulation", "bound", "guarantee", "probable"]

PROOFS: tuple[Basis, ...] = ("bound", "guarantee")
"""Bases on which an error has a proved bound; one above the tolerance does not prove that the error is, too."""


@dataclass(frozen=True)
class WordlengthAnswer(ABC):
    """The smallest format that meets a tolerance, or whether one does, with the basis of this answer.

    Parameters
    ----------
    fmt : the format; None if no format that was tried meets the tolerance.
    basis : "emulation", for the observed errors with these measurements; or "bound", for the largest possible errors.
    steps : steps of the filter.
    tried : digits, and largest error or bound / tolerance over states and steps; infinite if the run stopped, a number
        overflowed, a variance was no longer positive, or no bound exists.
    why : the reason why an error is infinite, or why the next smaller format was rejected.
    warnings : reasons why an observed answer may not hold for other inputs; see
        :func:`gpbnb.wordlength.system.weak_evidence`.
    """

    fmt: FloatFormat | FixedFormat | MaybeNone
    basis: Basis
    steps: int | None
    tried: tuple[tuple[int, float], ...]
    why: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def met(self) -> bool:
        """Whether the format meets the tolerance."""
        return self.fmt is not None

    def __bool__(self) -> bool:
        """Whether the format meets the tolerance, as :attr:`met`."""
        return self.met

    @property
    def digits(self) -> int | None:
        """Digits of the format, as `tried` counts them; None without a format."""
        return None if self.fmt is None else self.fmt.precision

    @property
    def stored(self) -> FloatFormat | FixedFormat | WordFormats | None:
        """The format or formats in which the answer stores a filter."""
        return self.fmt

    @abstractmethod
    def __str__(self) -> str:
        """Say the answer in words."""

    def __repr__(self) -> str:
        return str(self)


@dataclass(frozen=True, repr=False)
class Requirement(WordlengthAnswer):
    """The smallest precision that meets a tolerance, and the basis of this answer.

    Parameters
    ----------
    fmt : None if no precision up to the limit of the search meets the tolerance.
    basis : "emulation", for the observed errors with these measurements; or "bound", for the largest possible errors.
    steps : steps of the filter.
    tried : digits, and largest error or bound / tolerance over states and steps; infinite if the run stopped, a number
        overflowed, a variance was no longer positive, or no bound exists.
    warnings : reasons why an observed answer may not hold for other inputs.
    why : the reason why an error is infinite, for the largest precision at which it is infinite; empty if all errors
        are finite. The answer shows this reason if it prevented a smaller answer.
    form : form of the filter.
    irregular : precisions that meet the tolerance although a higher one that was run misses it; usually empty.
    advice : a form that meets the tolerance, if a precision fails although a lower one does not; the higher precisions
        in which no bound was found, and why; or what else helps.
    repairs : changes of the model's covariances, each as text.
    cause : the reason why no precision can be an answer; the limit of the search then does not matter.
    limit : the reason why the search ended at the last precision of `tried`. It is shown if there is no answer.
    ends : whether the guarantee holds only for the steps asked for, because no precision has a guarantee for ever.
    untraced : why a function ran operation by operation, and not in compiled code; empty if it did not.
    processors : the largest error or bound / tolerance in binary32, and in binary64 if binary32 has too few bits or
        does not meet the tolerance. Empty in another base, with directed rounding or a given range.
    base : base of the formats tried.
    remedy : what runs in more digits than the search tried, if no precision meets the tolerance.
    """

    fmt: FloatFormat | MaybeNone
    steps: int
    form: AnyForm | None = None
    irregular: tuple[int, ...] = ()
    advice: str = ""
    repairs: tuple[str, ...] = ()
    limit: str = ""
    cause: str = ""
    ends: bool = False
    untraced: str = ""
    processors: tuple[tuple[str, float], ...] = ()
    base: int = 2
    remedy: str = ""

    @property
    def precision(self) -> int | MaybeNone:
        """Digits of the answer, or None."""
        return self.digits

    def __str__(self) -> str:
        notes, base = [*self.repairs], self.base if self.fmt is None else self.fmt.base
        if self.irregular:
            missed = [digits for digits, ratio in self.tried if not ratio <= 1 and digits > self.irregular[0]]
            notes.insert(0, f"{digits_text(listed(self.irregular), base)} meet it, but {listed(missed)} do not")
        if self.advice:
            notes.append(self.advice)
        notes += self.warnings
        if self.remedy:
            notes.append(self.remedy)
        if self.untraced:
            notes.append(f"the function ran operation by operation: {self.untraced}")
        end = "".join(f"; {note}" for note in notes)
        evidence, by_evidence = (text.format(_steps(self.steps)) for text in _evidence(self.basis, self.ends))
        if self.fmt is None and self.cause:
            return f"no precision meets the tolerance {by_evidence}: {self.cause}{end}"
        if self.fmt is None:
            most, why = digits_text(self.tried[-1][0], base), f"; {self.why}" if self.why else ""
            if self.limit:
                most += f", {self.limit},"
            met = "reliably meets the tolerance" if self.irregular else "meets the tolerance"
            return f"no precision up to {most} {met} {by_evidence}{why}{end}"
        tried = dict(self.tried)
        why = f"; {self.why}" if self.why and math.isinf(tried.get(self.fmt.precision - 1, 0.0)) else ""
        misses = "is not proved to meet" if self.basis in PROOFS else "misses"
        named = [f"{name} {misses} the tolerance: {ratio:.2g}" for name, ratio in self.processors if not ratio <= 1]
        named += [f"{self.processor_format} is enough"] if self.processor_format else []
        on_processors = f" ({'; '.join(named)})" if named else ""
        share = f"{tried[self.fmt.precision]:.2g} of the tolerance"
        return f"{arithmetic(self.fmt)}{on_processors}: {share}, {evidence}{why}{end}"

    @property
    def processor_format(self) -> str:
        """Name of the smaller format of binary32 and binary64 that meets the tolerance; empty if none is known.

        It rests on a run or a bound in this format itself, with ties to even, its range and its subnormal numbers.
        There is no name in other bases, with directed rounding, or with a given range.
        """
        return next((name for name, ratio in self.processors if ratio <= 1), "")


def _processors_with(fmt: FloatFormat | None) -> tuple[tuple[str, FloatFormat], ...]:
    """Return the names and formats of processors that have the digits of a format and round to nearest as it does."""
    if fmt is None or fmt.base != 2 or fmt.limits is not None or fmt.rounding not in (Rounding.NEAREST, Rounding.EVEN):
        return ()
    return tuple((n, f) for n, f in (("binary32", BINARY32), ("binary64", BINARY64)) if f.precision >= fmt.precision)


_EVIDENCE = {
    "emulation": ("observed in {}", "in a run of {}"),
    "bound": ("proved for this run of {}", "by a bound on this run of {}"),
    "guarantee": ("guaranteed for ever", "by a guarantee for ever"),
    "probable": ("as three times the probable error", "by three times the probable error"),
}
"""For each basis, how the error of an answer is known, and what had to meet the tolerance."""


_GUARANTEED_FOR_STEPS = "guaranteed for {}", "by a guarantee for {}"


def _evidence(basis: Basis, ends: bool) -> tuple[str, str]:
    return _GUARANTEED_FOR_STEPS if ends and basis == "guarantee" else _EVIDENCE[basis]


def evidence(basis: Basis, steps: int, ends: bool = False) -> str:
    """Describe the evidence for an error, as "observed in 60 steps"; `ends` is that of a :class:`Requirement`."""
    return _evidence(basis, ends)[0].format(_steps(steps))


def without_evidence(basis: Basis, steps: int, ends: bool = False) -> str:
    """Describe that an error has no number, as "in a run of 60 steps" or "without a guarantee for ever"."""
    text = _evidence(basis, ends)[1].format(_steps(steps))
    return text if basis == "emulation" else f"without {text.removeprefix('by ')}"


def bound_in_words(basis: Basis, steps: int, ends: bool = False) -> str:
    """Name a bound, or three times the probable error, as in "the bound on this run of 60 steps"."""
    if basis == "guarantee":
        return f"the guaranteed bound for {_steps(steps) if ends else 'ever'}"
    text = _evidence(basis, ends)[1].format(_steps(steps)).removeprefix("by ")
    return f"the {text.removeprefix('a ')}" if basis == "bound" else text


def _steps(count: int) -> str:
    return f"{count} step{'s' if count != 1 else ''}"


class Strategy(Protocol):
    """One way to find out how well a format does: by emulation, or by one of the bounds."""

    def error(self, fmt: FloatFormat) -> Outcome:
        """Return the largest error or bound as a multiple of the tolerance; or infinity, with the reason."""


def proved(strategy: Strategy, fmt: FloatFormat) -> Outcome:
    """Return what a strategy proves of a format, or what it says of it if it proves nothing."""
    return (getattr(strategy, "proof", None) or strategy.error)(fmt)


class LastingBound(ABC):
    """A strategy that bounds errors for ever or, with `steps`, over these steps."""

    steps: int | None

    @abstractmethod
    def error(self, fmt: FloatFormat) -> Outcome:
        """Return the largest bound as a multiple of the tolerance; or infinity, with the reason."""

    def over(self, steps: int) -> LastingBound | None:
        """Return what bounds the errors over some steps where nothing bounds them for ever; None if nothing does."""
        return None


def for_ever_or_over(
    steps: int, strategy: Strategy, ask: Callable[[Strategy], Found], has_bound: Callable[[Found], bool]
) -> tuple[Found, bool]:
    """Ask a strategy for a bound for ever and, if it has none, for one over some steps.

    Parameters
    ----------
    ask : returns what a strategy finds, such as the result of a search.
    has_bound : whether anything that was found is bounded.

    Returns
    -------
    found : what was found.
    ends : whether it holds only for the steps.
    """
    found, ends = ask(strategy), isinstance(strategy, LastingBound) and strategy.steps is not None
    if isinstance(strategy, LastingBound) and not has_bound(found) and (later := strategy.over(steps)) is not None:
        ended = ask(later)
        if has_bound(ended):
            return ended, True
    return found, ends


def some_bound(found: Search[FloatFormat]) -> bool:
    """Whether a precision that was tried has a finite error."""
    return not all(math.isinf(ratio) for _, ratio in found.tried)


class Asked(NamedTuple):
    """What is asked about a filter, apart from the filter and its tolerance.

    Parameters
    ----------
    steps : number of steps of the filter.
    basis : what counts as an error.
    like : a format of any precision, with base, rounding and range of those to try.
    largest : highest precision to try; by default the largest with compiled loops.
    progress : whether to show a progress bar that counts precisions.
    """

    steps: int
    basis: Basis
    like: FloatFormat = ANY_BINARY
    largest: int | None = None
    progress: bool = False

    @contextmanager
    def search(
        self, checks: Sequence[int], bounds: bool = False
    ) -> Iterator[Callable[[Strategy], Search[FloatFormat]]]:
        """Return a function that searches with a strategy, given `checks` and `bounds` as in ``Search``."""
        with tqdm(desc="precisions", unit="run", disable=not self.progress) as bar:
            yield lambda strategy: Search(
                strategy.error, self.like, checks, bar.update, bounds, self.largest,
                proof=getattr(strategy, "proof", None),
            )  # fmt: skip

    def answer(
        self,
        found: Search[FloatFormat],
        form: AnyForm | None = None,
        advice: str = "",
        repairs: tuple[str, ...] = (),
        cause: str = "",
        ends: bool = False,
        untraced: str = "",
        warnings: tuple[str, ...] = (),
        remedy: str = "",
    ) -> Requirement:
        """Return the result of a search as the answer."""
        if found.undecided and not advice:
            reason = found.reasons[found.undecided[-1]]
            undecided = digits_text(listed(found.undecided), self.like.base)
            advice = f"the proof does not cover {undecided}, in which no bound was found: {reason}"
        return Requirement(
            found.fmt,
            self.basis,
            self.steps,
            found.tried,
            found.why,
            warnings,
            form,
            found.irregular,
            advice,
            repairs,
            found.limit,
            cause,
            ends,
            untraced,
            self._on_processors(found),
            self.like.base,
            remedy,
        )

    def in_more_digits(self, found: Search[FloatFormat]) -> str:
        """Say what runs in more digits than a model, if the largest precision misses the tolerance in an emulation."""
        ended = self.largest in (None, largest_compiled(self.like)) and 1 < found.tried[-1][1] < math.inf
        if found.fmt is not None or self.basis != "emulation" or not ended:
            return ""
        most = digits_text(largest_by_default(self.like.base), self.like.base)
        return (
            "a filter written as a function of a format runs in more: required_precision(f, steps, tolerance, z=z), "
            f"with f(fmt, z), tries up to {most}, and more with largest="
        )

    def _on_processors(self, found: Search[FloatFormat]) -> tuple[tuple[str, float], ...]:
        """Return the error or bound / tolerance in binary32, and in binary64 if that is not enough."""
        ratios = list[tuple[str, float]]()
        for name, fmt in _processors_with(found.fmt):
            if fmt.precision <= found.largest and not any(each <= 1 for _, each in ratios):
                ratio, _ = found.error(fmt)
                ratios.append((name, ratio))
        return tuple(ratios)


def listed(numbers: Sequence[int]) -> str:
    """Format ascending whole numbers as text, with three or more in a row as ranges: "2, 5–8"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    texts = [f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return ", ".join(texts)


def checked_tolerance(tolerance: Any, count: int, what: str, basis: str) -> NDArray[np.float64]:
    """Check tolerance and basis, and return the tolerance of each of `count` states or outputs.

    Raises
    ------
    ValueError : a check fails; the message states what is needed.
    """
    needed = f"needed an error above 0 for each of the {count} {what}, one finite"
    try:
        if isinstance(tolerance, (str, bool)):
            raise ValueError("text and truth values are no numbers")
        tolerances = np.asarray(tolerance)
        if tolerances.dtype.kind not in "iufO":
            raise ValueError("no real numbers")
        tolerances = -all_above(-tolerances)  # rounded down
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"got tolerance {tolerance!r}; {needed}") from None
    if tolerances.shape not in ((), (count,)):
        got = f"tolerance {tolerance}" if tolerances.size <= 2 * count else "a tolerance"
        raise ValueError(f"got {got} of shape {tolerances.shape}; {needed}: one number, or {count} in a row")
    if not (tolerances > 0).all() or not np.isfinite(tolerances).any():
        raise ValueError(f"got tolerance {tolerance}; {needed}")
    if not isinstance(basis, str) or basis not in get_args(Basis):
        raise ValueError(f"got basis {basis!r}; needed one of {', '.join(map(repr, get_args(Basis)))}")
    return np.broadcast_to(tolerances, (count,))


def format_like(
    base: Any, rounding: Rounding, emin: int | None = None, emax: int | None = None, subnormal: bool = True
) -> FloatFormat:
    """Return a format with base, rounding and range of those to try; its precision does not matter.

    Raises
    ------
    ValueError : a base without compiled loops; a range that ``FloatFormat`` refuses.
    """
    if isinstance(base, bool) or not isinstance(base, int) or base not in LARGEST_PRECISION:
        raise ValueError(f"got base {base!r}; needed one with compiled loops: {', '.join(map(str, LARGEST_PRECISION))}")
    return FloatFormat(base, 2, rounding, emin, emax, subnormal)


def largest_ratio(errors: NDArray[np.float64], tolerances: NDArray[np.float64]) -> float:
    """The largest error over its tolerance; infinite beyond the range of float64."""
    with np.errstate(over="ignore"):
        return float((errors / tolerances).max())
