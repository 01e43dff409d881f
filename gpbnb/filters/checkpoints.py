"""What a run has computed after some of its steps, and how it differs from a reference."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.loop import drop_decayed
from gpbnb.filters.forms import Form
from gpbnb.filters.stepping import Repeats, StepsTaken, Stop
from gpbnb.filters.steps import FACTORED, combined_gain


def exactly(packed: NDArray[Any], fmt: FloatFormat | FixedFormat | None) -> NDArray[Any]:
    """Return numbers as compiled loops compute them, in a format or in double-double if that is None, as Fractions."""
    if fmt is None:
        high, low = (part.astype(object) for part in (packed[..., 0], packed[..., 1]))
        return np.asarray(np.frompyfunc(_exact_sum, 2, 1)(high, low), dtype=object)
    return np.asarray(FloatArray.from_packed(packed, fmt).to_fractions(), dtype=object)


class Progress(ABC):
    """A run of a filter or of a system: how far it has come, which of its steps are saved, and why it has ended.

    Checkpoint steps are 1 or more, in ascending order.
    """

    model: Any

    def __init__(self, checkpoint_steps: Sequence[int]) -> None:
        self.checkpoint_steps = _ascending(checkpoint_steps)
        #: Number of steps done, and of checkpoints saved.
        self.steps, self.saved = 0, 0
        #: The first step at which a variance or a pivot of the innovation covariance was not positive.
        self.indefinite: int | None = None
        #: The step that has no result and ended the run, and why.
        self.stopped: int | None = None
        self.reason = ""
        self._kept = list[tuple[Any, ...]]()

    @abstractmethod
    def blocks(self, z: Any) -> Iterator[Any]:
        """Continue by as many steps as there are measurements, (steps, m), and give their results some at a time."""

    @abstractmethod
    def estimates(self, found: Any) -> NDArray[np.float64]:
        """Return the estimates of some steps, (steps, n, 2), as double-double."""

    @property
    def _width(self) -> int:
        """Number of entries of an estimate, n."""
        return int(self.model.n)

    def take(self, z: Any) -> None:
        """Continue by as many steps as there are measurements, (steps, m); a run that has stopped does not continue."""
        for _ in self.blocks(z):
            pass

    def states(self, z: Any) -> NDArray[np.float64]:
        """Continue as :meth:`take` does, and return all estimates, (steps done, n, 2), as double-double."""
        none = np.zeros((0, self._width, 2))
        return np.concatenate([none, *(self.estimates(each) for each in self.blocks(z))])

    def repeat(
        self,
        steps: Repeats,
        states: Sequence[NDArray[Any]],
        own: NDArray[Any],
        fault: Callable[[Stop], tuple[str, str]],
        unlimited: bool = True,
    ) -> Iterator[StepsTaken]:
        """Take a step for each row of packed numbers, (steps, entries, ...), and give the results of some at a time.

        Formats without a range run in float64. Where a step would leave it, for example because an estimate decays
        below 2**-960, entries of the estimate below 2**-700 become zero first. A step that has no result ends the run.

        Parameters
        ----------
        states : arrays that hold the states before and after the steps; the first is the estimate, the second, if there
            is one, does not decay.
        fault : returns in words what ends the run, and a cure.
        unlimited : whether the format of the estimate has no range.
        """
        at = 0
        while at < len(own) and self.stopped is None:
            found = steps.take(self.steps, states, own[at : at + steps.longest])
            at += len(found.definite)
            for i, state in enumerate(states):
                found.given[i] = found.given[i].reshape(-1, *state.shape)
                if len(found.definite):
                    state[:] = found.given[i][-1]
            self.done(found.definite, *found.given, *found.shared)
            resumes = found.stop is not None and found.stop.fault.overflows and unlimited
            if found.stop is not None and not (resumes and drop_decayed(states[0], *states[2:])):
                self.stop(*fault(found.stop))
            yield found

    def done(self, definite: NDArray[np.bool_], *results: Any) -> None:
        """Count some steps, all definite or not, and keep their results, (steps, ...), at the checkpoint steps."""
        first, saved = self.steps, self.saved
        self.steps += len(definite)
        if self.indefinite is None and not definite.all():
            self.indefinite = first + 1 + int(np.argmin(definite))
        self.saved = int(np.searchsorted(self.checkpoint_steps, self.steps, side="right"))
        rows = self.checkpoint_steps[saved : self.saved] - first - 1
        if len(rows):
            self._kept.append(tuple(each[rows] for each in results))

    def kept(self) -> tuple[Any, ...]:
        """Return the results at the checkpoint steps that were reached, each (c, ...); nothing before the first."""
        if len(self._kept) > 1:
            self._kept = [tuple(np.concatenate(each) for each in zip(*self._kept, strict=True))]
        return self._kept[0] if self._kept else ()

    def stop(self, fault: str, cure: str = "") -> None:
        """End the run because the next step has no result."""
        self.stopped = self.steps + 1
        self.reason = f"{fault} at step {self.stopped}{cure}"


class Checkpoints(NamedTuple):
    """Exact values after some steps, object arrays of Fractions."""

    steps: tuple[int, ...]
    x: NDArray[Any]  # (c, n), estimates
    K: NDArray[Any]  # (c, n, m), gains
    P: NDArray[Any]  # (c, n, n), covariances

    def to_float(self, letter: str) -> NDArray[np.float64]:
        """Return the nearest float64 of "x", "K" or "P"."""
        values: NDArray[Any] = getattr(self, letter)
        return values.astype(np.float64)

    def minus(self, true: Checkpoints) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return x, K and P minus those of a reference with at least as many checkpoints, correctly rounded."""
        count = len(self.steps)
        if self.steps != true.steps[:count]:
            raise ValueError(
                f"got checkpoint steps {self.steps} for the runs and {true.steps} for the reference; needed equal steps"
            )
        pairs = ((self.x, true.x), (self.K, true.K), (self.P, true.P))
        x, K, P = ((a - b[:count]).astype(np.float64) for a, b in pairs)
        return x, K, P


def without_factors(
    form: Form, K: NDArray[Any], P: NDArray[Any], H: NDArray[Any], R: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return gains and covariances of steps in a form with factors or roots, all as Fractions.

    Given are the gains of one measurement after the other, the factors or roots, and H and the factors of R.
    """
    gains = np.array([combined_gain(*each) for each in zip(K, H, R, strict=True)], dtype=object)
    covariances = np.array([FACTORED[form].covariance(each) for each in P], dtype=object)
    return gains.reshape(K.shape), covariances.reshape(P.shape)


def _ascending(checkpoint_steps: Sequence[int]) -> NDArray[np.int64]:
    """Return checkpoint steps as an array; reject those that are no whole numbers or do not ascend."""
    steps = np.array(checkpoint_steps).reshape(-1)
    if steps.size and steps.dtype.kind not in "iu":
        raise ValueError(f"got checkpoint steps {list(checkpoint_steps)[:5]} …; needed whole numbers")
    if steps.size and (steps[0] <= 0 or np.any(steps[1:] <= steps[:-1])):
        raise ValueError(f"got checkpoint steps {list(checkpoint_steps)[:5]} …; needed increasing steps of 1 or more")
    return steps.astype(np.int64)


def _exact_sum(high: float, low: float) -> Fraction:
    # Both denominators are powers of two: faster than the sum of two Fractions.
    (n, d), (p, q) = high.as_integer_ratio(), low.as_integer_ratio()
    return Fraction(n * (q // d) + p, q) if q > d else Fraction(n + p * (d // q), d)
