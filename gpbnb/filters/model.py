"""The linear model of a Kalman filter, checked once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.definiteness import is_definite
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.covariance import (
    REPAIR_TOLERANCE,
    Repair,
    check_covariance,
    raised_as_stored,
    repair_tolerance,
    repaired,
)
from gpbnb.filters.named import checked_name, checked_names, naming, range_text, sized

LARGEST_EXPONENT = 450
"""Largest size of an exponent of two in a model for compiled loops of a format with any exponent."""


F = TypeVar("F", bound=Callable[..., Any])

Entries: TypeAlias = "Numbers | Callable[[int], Numbers]"
"""What a matrix of a model may be given as, numbers or a function of the step."""


@dataclass(frozen=True, eq=False, init=False, repr=False)
class LinearModel:
    r"""A linear process and its measurements, as in hung1984, ch. II, before (98).

    .. math:: x_k = \Phi_{k-1} x_{k-1} + B_{k-1} u_{k-1} + b_{k-1} + w_{k-1}, \qquad z_k = H_k x_k + d_k + v_k, \qquad
        w_k \sim N(0, Q_k),\ v_k \sim N(0, R_k)

    Each matrix and offset may be the same for all steps, or a cycle of c matrices along a leading axis. Step k = 1, 2,
    … then uses member (k - 1) mod c; each cycle has its own c. A matrix may also be a function of k, which is called
    for k = 1 … `steps`. Entries are stored exactly, as Fractions; numbers, strings and Decimals are read exactly.

    Without u, b and d this is the model of the report. With them, a filter predicts
    :math:`((\Phi\hat x) + (Bu)) + b` and takes the innovation :math:`(z - d) - H\hat x`, in this order.

    Parameters
    ----------
    Phi : (n, n) or (c, n, n), transition matrix.
    H : (m, n) or (c, m, n), measurement matrix.
    Q : (n, n) or (c, n, n), covariance of the process noise, positive semidefinite.
    R : (m, m) or (c, m, m), covariance of the measurement noise, positive definite.
    x0 : (n,), the first estimate.
    P0 : (n, n), covariance of the first estimate, positive semidefinite.
    name : name in tables and figures.
    repair : whether to repair rounding errors in Q, R and P0, as described in :mod:`gpbnb.filters.covariance`. By
        default, only covariances given in floats are repaired, not those given as strings, whole numbers or Fractions.
        A covariance that becomes indefinite when a format stores it is repaired unless `repair` is False.
    B : (n, p) or (c, n, p), input matrix.
    u : (steps, p), known inputs, row k - 1 for step k; or (p,), the same in every step.
    b : (n,), or (c, n) for a cycle: known offset of the states.
    d : (m,), or (c, m) for a cycle: known offset of the measurements.
    steps : number of steps that the model describes; required if an argument is a function. By default, this is the
        number of rows of `u`; if `u` is missing or a single row, there is no limit. A longer run is rejected.
    state_names, measurement_names, input_names : names of the n states, m measurements and inputs u, for messages,
        tables and reports, each optionally with its unit, as in ``["tilt (°)", "rate (°/s)"]``; by default they are
        numbered.

    Attributes
    ----------
    repairs : the repairs of Q, R and P0; empty if nothing was repaired.

    Raises
    ------
    ValueError : shapes do not fit together; an entry is NaN or infinite; a covariance is not symmetric or not definite;
        a matrix is a function but `steps` is missing; or there are fewer inputs than steps.

    Examples
    --------
    A cart whose acceleration is known, and whose sensor reads 0.5 m too much:

    >>> cart = LinearModel(
    ...     Phi=[[1, "0.1"], [0, 1]], H=[[1, 0]], Q=[["1e-6", 0], [0, "1e-4"]], R=[["0.04"]], x0=[0, 0],
    ...     P0=[[1, 0], [0, 1]], B=[["0.005"], ["0.1"]], u=[[1], [1], [0]], d=["0.5"],
    ... )
    >>> cart.n, cart.m, cart.steps
    (2, 1, 3)
    """

    Phi: NDArray[Any]
    H: NDArray[Any]
    Q: NDArray[Any]
    R: NDArray[Any]
    x0: NDArray[Any]
    P0: NDArray[Any]
    name: str
    repair: bool | None
    B: Any
    u: Any
    b: Any
    d: Any
    steps: int | None
    state_names: tuple[str, ...]
    measurement_names: tuple[str, ...]
    input_names: tuple[str, ...]
    repairs: tuple[Repair, ...] = field(default=(), init=False)

    def __init__(
        self,
        Phi: Entries,
        H: Entries,
        Q: Entries,
        R: Entries,
        x0: Numbers,
        P0: Numbers,
        name: str = "a linear model",
        repair: bool | None = None,
        B: Entries | None = None,
        u: Entries | None = None,
        b: Entries | None = None,
        d: Entries | None = None,
        steps: int | None = None,
        state_names: Sequence[str] | None = None,
        measurement_names: Sequence[str] | None = None,
        input_names: Sequence[str] | None = None,
    ) -> None:
        names = (state_names, measurement_names, input_names)
        given = (Phi, H, Q, R, x0, P0, name, repair, B, u, b, d, steps, *names)
        for each, value in zip(fields(self), given, strict=False):  # the last, `repairs`, is found
            object.__setattr__(self, each.name, value)
        self._read()
        for what, count in (("state_names", self.n), ("measurement_names", self.m), ("input_names", self.p)):
            object.__setattr__(self, what, checked_names(what, getattr(self, what), count))

    def __repr__(self) -> str:
        """Describe the model in three lines: its sizes, its matrices with the sizes of their entries, and its start."""
        inputs = f"; {sized(self.p, 'input', self.input_names)}" if self.p else ""
        steps = "" if self.steps is None else f"; at most {sized(self.steps, 'step', ())}"
        matrices = [
            f"{letter} {_of_one(given) if letter in _CYCLES else given.shape} {range_text(given.flat)}"
            + (f" in a cycle of {len(given)}" if letter in _CYCLES and len(given) > 1 else "")
            for letter in (*LETTERS, *INPUTS)
            if (given := getattr(self, letter)) is not None
        ]
        return (
            f"LinearModel {self.name!r}, {sized(self.n, 'state', self.state_names)}; "
            f"{sized(self.m, 'measurement', self.measurement_names)}{inputs}{steps}\n"
            f"  {', '.join(matrices[:4])}\n  {', '.join(matrices[4:])}"
        )

    def _read(self) -> None:
        if self.repair is not None and not isinstance(self.repair, bool):
            raise ValueError(f"got repair {self.repair!r}; needed True, False or None")
        checked_name(self.name)
        self._evaluate_functions()
        tolerances: dict[str, float | None] = dict.fromkeys(_COVARIANCES)
        if self.repair is not False:
            tolerances = {letter: repair_tolerance(getattr(self, letter)) for letter in _COVARIANCES}
        for letter in ("Phi", "H", "Q", "R", "x0", "P0"):
            with naming(letter):
                entries = exact(getattr(self, letter))
            if letter in ("Phi", "H", "Q", "R") and entries.ndim == 2:
                entries = entries[np.newaxis]
            entries.flags.writeable = False
            object.__setattr__(self, letter, entries)
        if self.x0.ndim != 1 or not self.x0.size:
            raise ValueError(f"got x0 of shape {self.x0.shape}; needed (n,) with n >= 1, one number per state")
        n = self.x0.size
        if self.H.ndim != 3 or 0 in self.H.shape or self.H.shape[2] != n:
            raise ValueError(
                f"got H of shape {_of_one(self.H)}; needed (m, {n}), one row per measurement and "
                "one column per state of x0"
            )
        m = self.H.shape[1]
        for letter, size in (("Phi", n), ("Q", n), ("R", m)):
            given = getattr(self, letter)
            shape = given.shape
            if len(shape) != 3 or shape[1:] != (size, size) or not shape[0]:
                raise ValueError(
                    f"got {letter} of shape {_of_one(given)}; needed ({size}, {size}), or a cycle (p, {size}, {size}): "
                    f"x0 has {n} states and H {m} measurements"
                )
        if self.P0.shape != (n, n):
            raise ValueError(f"got P0 of shape {self.P0.shape}; needed ({n}, {n}), as x0 has {n} states")
        self._read_inputs()
        repairs: list[Repair] = []
        for letter, strictly in _COVARIANCES.items():
            matrices, tolerance = getattr(self, letter), tolerances[letter]
            if tolerance is not None or self.repair:
                least = REPAIR_TOLERANCE if tolerance is None else tolerance
                object.__setattr__(self, letter, _repaired_cycle(letter, matrices, strictly, least, repairs))
                continue
            _check_cycle(letter, matrices, strictly)
        object.__setattr__(self, "repairs", tuple(repairs))

    def _evaluate_functions(self) -> None:
        """Replace functions of the step by their values for each step."""
        if self.steps is not None and (
            isinstance(self.steps, bool) or not isinstance(self.steps, (int, np.integer)) or self.steps < 1
        ):
            raise ValueError(f"got steps {self.steps!r}; needed a whole number, at least 1")
        for letter in ("Phi", "H", "Q", "R", *INPUTS):
            given = getattr(self, letter)
            if callable(given):
                if self.steps is None:
                    raise ValueError(f"got a function for {letter} without steps; needed steps=, how often to call it")
                members = [given(k) for k in range(1, int(self.steps) + 1)]
                shapes = {np.shape(each) for each in members}
                if len(shapes) != 1:
                    raise ValueError(f"{letter}: the function gave shapes {sorted(shapes)}; needed one shape")
                with naming(letter):
                    values = exact(members) if repair_tolerance(members) is None else np.array(members)
                object.__setattr__(self, letter, values)

    def _read_inputs(self) -> None:
        """Read known inputs and offsets as exact cycles."""
        n, m = self.n, self.m
        if (self.B is None) != (self.u is None):
            raise ValueError(
                f"got {'u without B' if self.B is None else 'B without u'}; needed both: B of shape ({n}, p) and u of "
                "shape (steps, p)"
            )
        for letter in INPUTS:
            given = getattr(self, letter)
            if given is None:
                continue
            with naming(letter):
                entries = exact(given)
            single = 2 if letter == "B" else 1
            if letter == "u" and entries.ndim == 2 and (self.steps is None or self.steps > len(entries)):
                if self.steps is not None:
                    raise ValueError(f"got u for {len(entries)} steps; needed one row for each of the {self.steps}")
                object.__setattr__(self, "steps", len(entries))
            if letter != "u" and entries.ndim == single:
                entries = entries[np.newaxis]
            width = entries.shape[-1] if entries.ndim else 0
            needed = {"B": (n, width), "u": (width,), "b": (n,), "d": (m,)}[letter]
            axes = (1, 2) if letter == "u" else (single + 1,)
            if entries.ndim not in axes or entries.shape[-single:] != needed or not entries.size:
                texts = {"B": f"({n}, p)", "u": "(p,) or (steps, p)", "b": f"({n},)", "d": f"({m},)"}
                raise ValueError(f"got {letter} of shape {np.shape(given)}; needed {texts[letter]}")
            entries.flags.writeable = False
            object.__setattr__(self, letter, entries)
        if self.B is not None and self.B.shape[2] != self.u.shape[-1]:
            raise ValueError(
                f"got B with {self.B.shape[2]} columns and u with {self.u.shape[-1]} numbers per "
                "step; needed equal numbers"
            )

    @property
    def has_inputs(self) -> bool:
        """Whether there are known inputs or offsets."""
        return any(getattr(self, letter) is not None for letter in INPUTS)

    def without_inputs(self) -> LinearModel:
        """Return the same model without known inputs and offsets."""
        return self._changed(B=None, u=None, b=None, d=None, input_names=()) if self.has_inputs else self

    def without_missing(self, z: Any) -> tuple[LinearModel, Any]:
        """Return a model for the measurements of each step, and the measurements with zeros in place of missing ones.

        A missing measurement gets a row of zeros in H, and its noise is uncorrelated with the others. Its column of the
        gain is then exactly zero in every form and format, so estimate and covariance are those of a step without it.

        Parameters
        ----------
        z : (steps, m), with NaN for missing measurements, or a masked array.

        Returns
        -------
        model, z : unchanged if nothing is missing.
        """
        if isinstance(z, np.ma.MaskedArray):
            missing = np.array(np.ma.getmaskarray(z))
            given = np.array(np.ma.getdata(z))
            given[missing] = 0
            given = real_numbers(given)
        else:
            given = real_numbers(z)
            missing = np.zeros(given.shape, dtype=bool)
        if given.dtype.kind == "f":
            missing |= np.isnan(given)
        if given.ndim != 2 or given.shape[1] != self.m or not missing.any():
            return self, given
        H, R = [], []
        for k, gone in enumerate(missing):
            h, r = self.H[k % len(self.H)], self.R[k % len(self.R)]
            if gone.any():
                h, r = h.copy(), r.copy()
                h[gone] = Fraction(0)
                apart = (gone[:, None] | gone[None, :]) & ~np.eye(self.m, dtype=bool)
                r[apart] = Fraction(0)
            H.append(h)
            R.append(r)
        filled = given.copy()
        filled[missing] = 0
        return self._changed(H=np.array(H, dtype=object), R=np.array(R, dtype=object)), filled

    def _changed(self, **entries: Any) -> LinearModel:
        """Return a copy with other entries, which need no check: Fractions of the same shapes, covariances definite."""
        made = copy(self)
        for name, value in entries.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(made, name, value)
        return made

    def known(self, k: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the exact input of step k + 1, :math:`Bu + b`, (n,), and the measurement offset d, (m,)."""
        state, measurement = (np.array([Fraction(0)] * size, dtype=object) for size in (self.n, self.m))
        if self.B is not None:
            state = state + self.B[k % len(self.B)] @ (self.u if self.u.ndim == 1 else self.u[k])
        if self.b is not None:
            state = state + self.b[k % len(self.b)]
        return state, measurement if self.d is None else self.d[k % len(self.d)]

    def refuse_inputs(self, what: str) -> None:
        """Reject a model with known inputs or offsets where they would be ignored."""
        if self.has_inputs:
            raise ValueError(
                f"got {self.name} with known inputs or offsets; needed none for {what}, which does not cover them; use "
                'required_precision with basis "emulation" or "bound"'
            )

    def check_measurements(self, z: Any, first: int) -> None:
        """Reject measurements whose shape is not (steps, m), or that have more steps than the model describes.

        A number of `first` steps were taken before them.
        """
        shape = z.shape if hasattr(z, "shape") else np.shape(z)
        if len(shape) != 2 or shape[1] != self.m:
            raise ValueError(f"got measurements of shape {shape}; needed (steps, {self.m})")
        self.check_steps(first + len(z))

    def check_steps(self, count: int) -> None:
        """Reject a run that is longer than the model describes."""
        if self.steps is not None and count > self.steps:
            raise ValueError(f"got {count} steps; needed at most {self.steps}: {self.name} describes no more")

    def check_sizes(self) -> None:
        """Reject entries whose products would leave the exponents of float64, in which the compiled loops compute."""
        for letter, (values, _) in different_entries(self).items():
            for entry in filter(None, abs(values)):
                exponent = entry.numerator.bit_length() - entry.denominator.bit_length()
                if abs(exponent) > LARGEST_EXPONENT:
                    raise OverflowError(
                        f"got {letter} with an entry near 2**{exponent}; needed 2**-{LARGEST_EXPONENT} to "
                        f"2**{LARGEST_EXPONENT}, or products leave the exponents of float64; scale the model by powers "
                        "of two"
                    )

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.x0.size)

    @property
    def m(self) -> int:
        """Number of measurements in each step."""
        return int(self.H.shape[1])

    @property
    def p(self) -> int:
        """Number of known inputs in each step."""
        return 0 if self.B is None else int(self.B.shape[2])

    @property
    def cycle(self) -> int:
        """Number of steps after which all four matrices repeat."""
        return math.lcm(*(len(each) for each in (self.Phi, self.H, self.Q, self.R)))

    def definite_in(self, fmt: FloatFormat | FixedFormat) -> LinearModel:
        """Return this model, or a copy with covariances repaired so that they stay definite when a format stores them.

        The variances of a covariance that would become indefinite are raised as described in
        :mod:`gpbnb.filters.covariance`; `repairs` lists the changes. A covariance is not changed if larger variances do
        not help, if `repair` is False, or for stochastic rounding.
        """
        if self.repair is False or fmt.rounding is Rounding.STOCHASTIC:
            return self
        return _definite_in(self, fmt)

    def rounded(self, fmt: FloatFormat | FixedFormat) -> LinearModel:
        """Return the model as a computer with this format stores it, with each entry rounded.

        A run in this format is compared with the exact filter for the rounded model. The run itself starts from the
        model as given; see :mod:`gpbnb.filters.opening`.

        Raises
        ------
        ValueError : a stored covariance is indefinite, and :meth:`definite_in` could not repair it.
        """
        return _rounded(self, fmt) if fmt.rounding is Rounding.STOCHASTIC else _rounded_once(self, fmt)

    def arrays(self, fmt: FloatFormat | FixedFormat) -> dict[str, FloatArray]:
        """Return the model as a dict of arrays, by letter, with each entry rounded into the format.

        The dict holds Phi, H, Q, R, x0, P0 and any inputs and offsets. With stochastic rounding, the random numbers
        restart from the seed, and entries of a covariance above the diagonal are copied below it, so that the
        covariance stays symmetric.

        Raises
        ------
        OverflowError : an entry is beyond the range of the format.
        """
        random = fmt.rounding is Rounding.STOCHASTIC
        if random:
            fmt.restart()
        made: dict[str, FloatArray] = {}
        for letter, (values, places) in different_entries(self).items():
            with naming(letter):
                made[letter] = fmt.store(values[places]) if random else _in_places(fmt, values, places)
            if letter in _COVARIANCES and random:
                made[letter] = made[letter].moved(_mirrored)
        return made

    def to_float(self) -> dict[str, NDArray[np.float64]]:
        """Return a dict, by letter, of Phi, H, Q, R, x0 and P0, with the nearest float64 of each entry.

        Raises
        ------
        OverflowError : an entry is beyond the range of float64.
        """
        return {letter: entries.copy() for letter, entries in _floats(self).items()}


def remembered(function: F) -> F:
    """Keep the last results of a function of a model, and perhaps of a format; models are told apart by identity."""
    return cast(F, lru_cache(maxsize=16)(function))


@remembered
def different_entries(model: LinearModel) -> dict[str, tuple[NDArray[Any], NDArray[np.int64]]]:
    """Return, for each array of a model, its distinct entries (k,), and for every entry its index among them.

    The matrices of a long cycle consist of few distinct numbers. Entries are told apart as objects, not as numbers.
    """
    found = {}
    for letter in (*LETTERS, *INPUTS):
        if (given := getattr(model, letter)) is not None:
            entries = {id(entry): entry for entry in given.flat}
            order = dict(zip(entries, range(len(entries)), strict=True))
            places = np.array([order[id(entry)] for entry in given.flat], np.int64).reshape(given.shape)
            found[letter] = np.array([*entries.values()], object), places
    return found


def _in_places(fmt: FloatFormat | FixedFormat, values: NDArray[Any], places: NDArray[np.int64]) -> FloatArray:
    try:
        found: FloatArray = fmt.store(values)[places]
    except OverflowError:
        return fmt.store(values[places])  # whose message names the entry
    return found


def stored_arrays(model: LinearModel, fmt: FloatFormat | FixedFormat) -> dict[str, FloatArray]:
    """Return :meth:`LinearModel.arrays`, rounded once for each format; their formats are equal to `fmt`.

    With stochastic rounding, they are rounded each time: arrays that were kept would draw no random numbers, and the
    measurements would be rounded with others.
    """
    return model.arrays(fmt) if fmt.rounding is Rounding.STOCHASTIC else _arrays_once(model, fmt)


@remembered
def _arrays_once(model: LinearModel, fmt: FloatFormat | FixedFormat) -> dict[str, FloatArray]:
    return model.arrays(replace(fmt))  # a format of its own, for which no search refuses conversions


def check_one(fmt: FloatFormat | FixedFormat) -> None:
    """Reject a format without the number 1."""
    if fmt.limits is not None and not fmt.smallest <= 1 <= fmt.largest:
        cure = "at least 1 integer bit and 0 fraction bits or more" if isinstance(fmt, FixedFormat) else "a wider range"
        raise ValueError(
            f"got {format_text(fmt)}, which does not hold the number 1; needed a format that does, because every step "
            f"computes with an identity matrix; use {cure}"
        )


def stored_measurements(z: Any, fmt: FloatFormat | FixedFormat | BlockFormats) -> FloatArray:
    """Round measurements into a format."""
    with naming("measurements"):
        return fmt.array(z)


def in_columns(z: Any, m: int) -> Any:
    """Return numbers (steps, m), which may be given as (steps,) if m = 1."""
    given = z if hasattr(z, "to_fractions") or isinstance(z, np.ma.MaskedArray) else real_numbers(z)
    return given.reshape(-1, 1) if m == 1 and given.ndim == 1 else given


def real_numbers(values: Any) -> NDArray[Any]:
    """Return measurements as an array of float64 or whole numbers, or of Fractions if those cannot hold them."""
    if np.ma.is_masked(values):
        raise ValueError("got measurements of which some are masked; needed a number for each")
    try:
        given = np.asarray(values)
    except ValueError:
        raise ValueError("got measurements in rows of different lengths; needed (steps, m) numbers") from None
    if given.dtype.kind in "iu":
        return given
    if given.dtype.kind == "f":
        with np.errstate(over="ignore", under="ignore"):
            nearest = given.astype(np.float64, copy=False)
        if np.array_equal(nearest, given, equal_nan=True):
            return nearest
    with naming("measurements"):
        return exact(given if given.dtype.kind == "f" else values)


LETTERS = ("Phi", "H", "Q", "R", "x0", "P0")
INPUTS = ("B", "u", "b", "d")
_CYCLES = ("Phi", "H", "Q", "R", "B")
_COVARIANCES = {"Q": False, "R": True, "P0": False}  # and whether they must be definite


def _of_one(matrices: NDArray[Any]) -> tuple[int, ...]:
    """Return the shape of each matrix of a cycle, or of an array that is not a cycle."""
    return matrices.shape[1:] if matrices.ndim == 3 else matrices.shape


def _mirrored(matrices: NDArray[Any]) -> NDArray[Any]:
    """Copy the entries above the diagonals of (..., n, n) below them."""
    above = np.triu(np.ones(matrices.shape[-2:], dtype=bool))
    return np.where(above, matrices, np.swapaxes(matrices, -1, -2))


@remembered
def _floats(model: LinearModel) -> dict[str, NDArray[np.float64]]:
    found = {}
    for letter in LETTERS:
        values, places = different_entries(model)[letter]
        try:
            found[letter] = values.astype(np.float64)[places]
        except OverflowError:
            raise OverflowError(
                f"got {letter} with an entry beyond the range of float64; needed entries below 1.8e308; scale the model"
            ) from None
    return found


def _rounded(model: LinearModel, fmt: FloatFormat | FixedFormat) -> LinearModel:
    sound = model.definite_in(fmt)
    stored = {letter: array.to_fractions() for letter, array in stored_arrays(sound, fmt).items()}
    for letter, strictly in _COVARIANCES.items():
        _check_cycle(letter, stored[letter], strictly)
    return sound._changed(**stored, name=f"{model.name}, in {format_text(fmt)}", repair=None)


_rounded_once = remembered(_rounded)


@remembered
def _definite_in(model: LinearModel, fmt: FloatFormat | FixedFormat) -> LinearModel:
    try:
        rounded = {letter: stored_arrays(model, fmt)[letter].to_fractions() for letter in _COVARIANCES}
    except OverflowError:  # nothing can store it
        return model
    changed: dict[str, NDArray[Any]] = {}
    repairs: list[Repair] = []
    for letter, strictly in _COVARIANCES.items():
        matrices = getattr(model, letter)
        members = matrices.reshape(-1, *matrices.shape[-2:]).copy()
        found: dict[tuple[Fraction, ...], tuple[NDArray[Any], Repair] | None] = {}
        for member, stored in enumerate(rounded[letter].reshape(members.shape)):
            key = tuple(members[member].flat)
            if key not in found:
                sound = is_definite(stored, strictly)
                found[key] = None if sound else raised_as_stored(fmt, letter, member, members[member], strictly)
            if (better := found[key]) is not None:
                members[member], repair = better
                repairs.append(repair._replace(member=member))
                changed[letter] = members.reshape(matrices.shape)
    if not changed:
        return model
    return model._changed(**changed, repairs=(*model.repairs, *repairs))


def _check_cycle(letter: str, matrices: NDArray[Any], strictly: bool) -> None:
    """Check each different covariance of a cycle, or the only one; see :func:`check_covariance`."""
    different = {tuple(matrix.flat): matrix for matrix in matrices.reshape(-1, *matrices.shape[-2:])}
    for matrix in different.values():
        check_covariance(letter, matrix, strictly)


def _repaired_cycle(
    letter: str, matrices: NDArray[Any], strictly: bool, tolerance: float, repairs: list[Repair]
) -> NDArray[Any]:
    """Repair the covariances of a cycle, or the only one, where necessary; append the changes to `repairs`."""
    result = []
    for member, matrix in enumerate(matrices.reshape(-1, *matrices.shape[-2:])):
        sound, changed = repaired(letter, member, matrix, strictly, tolerance)
        result.append(sound)
        if changed is not None:
            repairs.append(changed)
    whole = np.array(result, dtype=object).reshape(matrices.shape)
    whole.flags.writeable = False
    return whole
