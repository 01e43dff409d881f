r"""Linear systems without a covariance: digital filters, controllers and observers with fixed coefficients.

.. math:: x_{k+1} = A x_k + B u_k, \qquad y_k = C x_k + D u_k

Each row of A and B, and of C and D, is one sum from left to right, unless the system has another structure, such as
those of :mod:`gpbnb.filters.structures`. A :class:`LinearFilter` is any step written as a program; the same program is
emulated and bounded.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.kernels.tags import DoubleDouble, Tag
from gpbnb.arithmetic.named import arithmetic, format_named
from gpbnb.arithmetic.rational import eigenvalues, exact, rationals
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.checkpoints import Progress
from gpbnb.filters.model import real_numbers
from gpbnb.filters.named import checked_name, checked_names, named, naming, range_text, sized, whole_number
from gpbnb.filters.opening import as_packed, packed_array, stored_start
from gpbnb.filters.pairs import widened_estimates
from gpbnb.filters.program import matrices
from gpbnb.filters.recording import system_step
from gpbnb.filters.sections import factored, repaired, scaled, sections_from_zeros
from gpbnb.filters.stepping import Repeats, RunningStep, Stop
from gpbnb.filters.structures import (
    CASCADES,
    DIRECT,
    SUMS,
    LinearFilter,
    balanced,
    cascade,
    check_of_cascade,
    companion,
    controller,
    expanded,
    lattice,
    sections_of,
    smoother,
    state_space,
    structure_named,
    sum_structure,
    transfer_function,
)
from gpbnb.filters.word_formats import WordFormats
from gpbnb.filters.words import WordSteps, integer_program, integers_of, pairs_of

SystemFormat = FloatFormat | FixedFormat | WordFormats
"""What a linear system runs in."""

BLOCK = 32
"""Usual number of inputs in a block of a sum."""

MOST_INPUTS = 100_000
"""Largest number of inputs of a sum, whose operations are listed in seconds."""


@dataclass(frozen=True, eq=False, init=False, repr=False)
class LinearSystem:
    r"""A linear system with known inputs: :math:`x_{k+1} = Ax_k + Bu_k`, :math:`y_k = Cx_k + Du_k`.

    Entries are stored exactly, as Fractions; numbers, strings and Decimals are read exactly.

    Parameters
    ----------
    A : (n, n), transition matrix.
    B : (n, m), input matrix.
    C : (p, n), output matrix; by default the identity, so that the outputs are the states.
    D : (p, m), feedthrough matrix; by default zero.
    x0 : (n,), the first state; by default zeros.
    name : name in tables and reports.
    made : the program that computes a step, if a step does not multiply by the matrices directly; see
        :meth:`from_filter`.
    state_names, input_names, output_names : names of the n states, m inputs and p outputs, for messages, tables and
        reports, each optionally with its unit, as in ``["speed (m/s)"]``; by default they are numbered.

    Raises
    ------
    TypeError : an entry that is not a number, or a name that is not text.
    ValueError : shapes that do not fit; NaN or infinity.

    Examples
    --------
    Exponential smoothing that forgets a tenth in each step:

    >>> system = LinearSystem([["0.9"]], [["0.1"]])
    >>> system.n, system.m, system.p
    (1, 1, 1)
    """

    A: NDArray[Any]
    B: NDArray[Any]
    C: NDArray[Any]
    D: NDArray[Any]
    x0: NDArray[Any]
    name: str
    made: LinearFilter | None
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]

    def __init__(
        self,
        A: Numbers,
        B: Numbers,
        C: Numbers | None = None,
        D: Numbers | None = None,
        x0: Numbers | None = None,
        name: str = "a linear system",
        made: LinearFilter | None = None,
        state_names: Sequence[str] | None = None,
        input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None,
    ) -> None:
        given = (A, B, C, D, x0, name, made, state_names, input_names, output_names)
        for each, value in zip(fields(self), given, strict=True):
            object.__setattr__(self, each.name, value)
        self._read()
        for kind, count in (("state", self.n), ("input", self.m), ("output", self.p)):
            names = checked_names(f"{kind}_names", getattr(self, f"{kind}_names"), count)
            object.__setattr__(self, f"{kind}_names", names)

    def __repr__(self) -> str:
        """Describe the system in three lines: its sizes, and its matrices with the sizes of their entries."""
        matrices = [
            f"{letter} {getattr(self, letter).shape} {range_text(getattr(self, letter).flat)}"
            for letter in ("A", "B", "C", "D", "x0")
        ]
        return (
            f"LinearSystem {self.name!r}, {sized(self.n, 'state', self.state_names)}; "
            f"{sized(self.m, 'input', self.input_names)}; {sized(self.p, 'output', self.output_names)}\n"
            f"  {', '.join(matrices[:2])}\n  {', '.join(matrices[2:])}"
        )

    def _read(self) -> None:
        checked_name(self.name)
        for letter in ("A", "B", "C", "D", "x0"):
            given = getattr(self, letter)
            if given is None and letter in ("C", "D", "x0"):
                n, m = self.A.shape[0], self.B.shape[1]
                given = {
                    "C": np.eye(n, dtype=int),
                    "D": np.zeros((len(self.C) if letter == "D" else n, m), dtype=int),
                    "x0": np.zeros(n, dtype=int),
                }[letter]
            with naming(letter):
                entries = exact(given)
            if letter != "x0" and (entries.ndim != 2 or not entries.size):
                raise ValueError(f"got {letter} of shape {entries.shape}; needed a matrix")
            entries.flags.writeable = False
            object.__setattr__(self, letter, entries)
        n, m, p = self.n, self.m, self.p
        for letter, shape in (("A", (n, n)), ("B", (n, m)), ("C", (p, n)), ("D", (p, m)), ("x0", (n,))):
            if getattr(self, letter).shape != shape:
                raise ValueError(
                    f"got {letter} of shape {getattr(self, letter).shape}; needed {shape}: A has {n} rows, B {m} "
                    f"columns and C {p} rows"
                )

    @classmethod
    def from_filter(cls, made: LinearFilter, x0: Any = None, name: str | None = None) -> LinearSystem:
        """Return a system that a program computes; A, B, C and D are the exact matrices of the program.

        A name replaces that of the filter.

        Raises
        ------
        ValueError : the program has no states, or no outputs.
        """
        made = made if name is None else replace(made, name=name)
        n = made.program.n - made.program.p
        if not made.program.p or not n:
            raise ValueError(f"got a program with {n} states and {made.program.p} outputs; needed at least one of each")
        A, B = matrices(made.program, made.coefficients)
        return cls(A[:n, :n], B[:n], A[n:, :n], B[n:], x0, made.name, made)

    @classmethod
    def from_coefficients(
        cls,
        b: Any,
        a: Any = (1,),
        structure: str = "direct form II transposed",
        pairing: str | None = None,
        order: Any = None,
        name: str | None = None,
    ) -> LinearSystem:
        r"""Return a digital filter in a given structure from the coefficients of its transfer function.

        .. math:: a_0 y_k = b_0 u_k + b_1 u_{k-1} + \dots - a_1 y_{k-1} - \dots

        Parameters
        ----------
        b, a : b0 … bM and a0 … aN, as in ``scipy.signal``; both are divided by a0 first, exactly.
        structure : one of :data:`gpbnb.filters.structures.STRUCTURES`, or "FIR" for a filter without feedback.
        pairing, order : how the sections of a cascade are paired and ordered, by default "nearest" and "up"; see
            :func:`gpbnb.filters.sections.factored`. Only a cascade has them.
        name : name in tables and reports; by default the structure.

        Raises
        ------
        ValueError : there are no coefficients; ``a[0] = 0``; no coefficient belongs to a delayed input or output; the
            structure is unknown, or the filter cannot be built in it; a pairing or order for another than a cascade.
        TypeError : entries that are not numbers.

        Examples
        --------
        >>> import numpy as np
        >>> from gpbnb import BINARY16
        >>> system = LinearSystem.from_coefficients([1], [1, "-0.9"], structure="direct form I")
        >>> system.outputs(np.ones((3, 1)), BINARY16)[:, 0, 0].tolist()
        [1.0, 1.900390625, 2.7109375]
        """
        top, bottom = transfer_function(b, a)
        found = structure_named(structure)
        check_of_cascade(found, pairing=pairing, order=order)
        if found in CASCADES:
            sections = factored(top, bottom, pairing or "nearest", "up" if order is None else order)
            made = cascade(sections, found.removeprefix("cascade of "))
        elif found in DIRECT:
            made = cascade([(top, bottom)], found)
        elif found == "lattice":
            made = lattice(top, bottom)
        elif found == "FIR":
            if bottom:
                raise ValueError(f'got structure "FIR" and a of {len(bottom) + 1} coefficients; needed a = [1]')
            made = cascade([(top, bottom)], "direct form I")
        else:
            companions = companion(top, bottom)
            A, B, C, D = balanced(companions) if found == "balanced state space" else companions
            made = state_space(A, B, C, D)
        return cls.from_filter(made, name=found if name is None else name)

    @classmethod
    def from_sections(
        cls,
        sos: Any,
        structure: str = "direct form II transposed",
        pairing: str | None = None,
        order: Any = None,
        scale: bool = False,
        name: str | None = None,
    ) -> LinearSystem:
        """Return a cascade of second-order sections, each in a direct form, or the whole filter in another structure.

        Parameters
        ----------
        sos : (sections, 6), rows b0, b1, b2, a0, a1, a2, as in ``scipy.signal``.
        structure : a direct form for each section; "lattice", "state space" or "balanced state space" for the filter as
            a whole. For the whole filter in a direct form, multiply the sections, as ``scipy.signal.sos2tf`` does, and
            use :meth:`from_coefficients`.
        pairing, order : see :func:`gpbnb.filters.sections.repaired`; by default the sections stay as given.
        scale : whether to multiply the sections of a cascade by powers of two, so that the numbers passed between them
            stay within 1 for inputs within 1; see :func:`gpbnb.filters.sections.scaled`.
        name : name in tables and reports; by default the structure.

        Raises
        ------
        ValueError : a wrong shape, ``a0 = 0``, or an unknown structure, pairing or order, where the message names the
            section; a pairing, an order or scale for another than a cascade.
        TypeError : entries that are not numbers.

        Examples
        --------
        >>> from scipy import signal
        >>> sos = signal.butter(4, 0.1, output="sos")
        >>> LinearSystem.from_sections(sos, structure="direct form I").name
        'cascade of direct form I'
        """
        sections = sections_of(sos)
        found = structure_named(structure)
        form = found.removeprefix("cascade of ")
        if form not in DIRECT:
            check_of_cascade(found, pairing=pairing, order=order, scale=scale or None)
            b, a = expanded(sections)
            return cls.from_coefficients(b, a, found, name=name)
        sections = repaired(sections, pairing or "given", "given" if order is None else order)
        if scale:
            sections = scaled(sections, form)
        return cls.from_filter(cascade(sections, form), name=f"cascade of {form}" if name is None else name)

    @classmethod
    def from_zeros(
        cls, z: Any, p: Any, k: Any, structure: str = "cascade", pairing: str | None = None, order: Any = None
    ) -> LinearSystem:
        """Return a digital filter in a given structure from its zeros, poles and gain, as in ``scipy.signal``.

        Parameters
        ----------
        z, p, k : zeros, poles and gain; each complex number comes with its conjugate.
        structure, pairing, order : as in :meth:`from_coefficients`; by default a cascade.

        Raises
        ------
        ValueError : a complex number without its conjugate; more zeros than poles; or for a reason given in
            :meth:`from_coefficients`.
        """
        found = structure_named(structure)
        check_of_cascade(found, pairing=pairing, order=order)
        sections = sections_from_zeros(z, p, k, pairing or "nearest", "up" if order is None else order)
        if found in CASCADES:
            return cls.from_filter(cascade(sections, found.removeprefix("cascade of ")), name=found)
        b, a = expanded(sections)
        return cls.from_coefficients(b, a, found)

    @classmethod
    def smoother(cls, alpha: Any, name: str = "exponential smoothing") -> LinearSystem:
        """Return an exponential smoother, y ← y + α (u - y), that computes only one product in a step.

        ``LinearSystem.from_coefficients([alpha], [1, alpha - 1])`` has the same transfer function but computes two
        products.

        Parameters
        ----------
        alpha : weight of a new input, between 0 and 2; the filter is not stable otherwise.

        Examples
        --------
        >>> import numpy as np
        >>> system = LinearSystem.smoother("1/8")
        >>> system.outputs(np.ones((2, 1)))[:, 0, 0].tolist()
        [0.125, 0.234375]
        """
        return cls.from_filter(smoother(exact([alpha])[0]), name=name)

    @classmethod
    def sum(
        cls, count: int = 1, order: str = "pairwise", block: int = BLOCK, running: bool = False, name: str | None = None
    ) -> LinearSystem:
        """Return a system that adds the inputs of each step in a given order.

        Parameters
        ----------
        count : number of inputs in each step.
        order : "left", "pairwise" or "blocked", as for :func:`gpbnb.arithmetic.linalg.matmul`; or "tree", which adds
            neighbours level by level, as a parallel reduction does.
        block : number of inputs in a block.
        running : whether the sum of each step is added to the sum of all earlier steps, as a clock or an integrator
            does.
        name : name in tables and reports; by default the order.

        Raises
        ------
        ValueError : an unknown order; `count` or `block` is not a whole number above 0; more than 100,000 inputs; or
            there is a single input and `running` is False.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> clock = LinearSystem.sum(running=True)
        >>> float(clock.outputs([["0.1"]] * 200, BINARY32)[-1, 0, 0])
        20.00004005432129
        """
        count, block = whole_number("count", count), whole_number("block", block)
        found = structure_named(order, SUMS)
        if block != BLOCK and found != "blocked":
            raise ValueError(f'got block {block} and order "{found}"; needed order "blocked" for it')
        if count == 1 and not running:
            raise ValueError("got the sum of one input; needed at least two, or running=True")
        if count > MOST_INPUTS:
            raise ValueError(f"got the sum of {count} inputs; needed at most {MOST_INPUTS}; add sums of fewer inputs")
        made = sum_structure(count, found, block, running)
        usual = "a running sum" if running else f"a {found} sum" if found != "left" else "a sum from left to right"
        return cls.from_filter(made, name=usual if name is None else name)

    @classmethod
    def pid(
        cls,
        Kp: Any,
        Ki: Any,
        Kd: Any = None,
        leak: Any = 1,
        limits: Any = None,
        integral_limits: Any = None,
        back_calculation: Any = None,
        name: str | None = None,
    ) -> LinearSystem:
        r"""Return a PI or PID controller whose input is the control error e.

        .. math::
            i \leftarrow \lambda i + K_i e + K_b (y_{-1} - v_{-1}),\quad v = K_p e + i + K_d(e - e_{-1}),\quad
            y = v \text{ limited}

        Parameters
        ----------
        Kp, Ki, Kd : gains per step; without Kd, a PI controller.
        leak : λ, the factor by which the integral decays in a step. With 1, it keeps every rounding error, and there is
            no bound that holds for ever.
        limits : lowest and highest output; by default none.
        integral_limits : lowest and highest integral, one way to prevent windup; by default none.
        back_calculation : :math:`K_b`, another way to prevent windup. In the last step, the limiter changed the
            output by :math:`y_{-1} - v_{-1}`; the controller adds :math:`K_b` times this change to the integral. This
            requires `limits`.

        Raises
        ------
        ValueError : limits that are not two numbers in ascending order; `back_calculation` without `limits`.
        TypeError : entries that are not numbers.

        Examples
        --------
        >>> import numpy as np
        >>> controller = LinearSystem.pid(2, "0.5", limits=(-3, 3))
        >>> controller.outputs(np.ones((3, 1)))[:, 0, 0].tolist()
        [2.5, 3.0, 3.0]
        """
        if back_calculation is not None and limits is None:
            raise ValueError("got back_calculation without limits; needed limits=(low, high) of the output")
        proportional, integral, kept = exact([Kp, Ki, leak])
        made = controller(
            proportional,
            integral,
            kept,
            None if Kd is None else exact([Kd])[0],
            _ascending("limits", limits),
            _ascending("integral_limits", integral_limits),
            None if back_calculation is None else exact([back_calculation])[0],
        )
        kind = "a PI controller" if Kd is None else "a PID controller"
        return cls.from_filter(made, name=kind if name is None else name)

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    @property
    def m(self) -> int:
        """Number of inputs."""
        return int(self.B.shape[1])

    @property
    def p(self) -> int:
        """Number of outputs."""
        return int(self.C.shape[0])

    def as_filter(self) -> LinearFilter:
        """Return this system as the linear filter that a guarantee needs, whose last p states are the outputs."""
        return self.made if self.made is not None else state_space(self.A, self.B, self.C, self.D, self.name)

    def outputs(self, u: Any, fmt: SystemFormat | str | None = None) -> NDArray[np.float64]:
        """Return the outputs of a run with every operation rounded to a format, or without a format in double-double.

        Parameters
        ----------
        u : (steps, m), inputs; each is rounded into the format.

        Returns
        -------
        y : (steps, p, 2), each output as a sum of two float64.

        Notes
        -----
        Formats without a range run in float64. Where a response has decayed so far that a number would fall below
        2**-960, states below 2**-700 become zero.

        Raises
        ------
        OverflowError : a number leaves the range of float64 or of the format's compiled loops. The message names the
            state or output, counted from 0, and the step, counted from 1.
        """
        return np.ascontiguousarray(self.states(u, fmt)[:, self.n :])

    def states(self, u: Any, fmt: SystemFormat | str | None = None) -> NDArray[np.float64]:
        """Return states and outputs after each step, (steps, n + p, 2), as :meth:`outputs` computes them.

        Raises
        ------
        OverflowError : as for :meth:`outputs`.
        """
        run = SystemRun(self, format_named(fmt))
        found = run.states(u)
        if run.stopped is not None:
            raise OverflowError(run.reason)
        return found

    def stored(self, fmt: SystemFormat) -> tuple[NDArray[Any], ...]:
        """Return the exact A, B, C and D of the structure after a format has rounded its coefficients."""
        made = self.as_filter()
        A, B = matrices(made.program, made.stored(fmt))
        return A[: self.n, : self.n], B[: self.n], A[self.n :, : self.n], B[self.n :]

    def unstable(self, fmt: SystemFormat | None = None) -> str:
        """Return the reason why the system, as given or as stored in a format, is not stable; empty if both are stable.

        The test is exact. A system with an eigenvalue of absolute value 1 counts as not stable.
        """
        if not is_stable(self.A):
            return f"the system as given is not stable, since A has {_eigenvalue(self.A, self.state_names)}"
        if fmt is not None and not is_stable(stored := self.stored(fmt)[0]):
            growing = _eigenvalue(stored, self.state_names)
            name = str(fmt) if isinstance(fmt, WordFormats) else arithmetic(fmt)
            return f"the system is stable, but as stored in {name} it is not, since A has {growing}"
        return ""

    def beyond(self, fmt: SystemFormat | None = None) -> str:
        """Return why a number of a run cannot be stored, and what to do about it; without a format, in float64."""
        what, cure = "a number beyond the range of float64", "scale the numbers"
        if isinstance(fmt, WordFormats):
            name = arithmetic(fmt.data) if fmt == WordFormats(fmt.data) else str(fmt)
        else:
            name = "" if fmt is None or (fmt.limits is None and fmt.base != 10) else arithmetic(fmt)
        if name:
            what = f"a number beyond the range of {name}"
        if cause := self.unstable(fmt):
            return f"got {what}; {cause}, so numbers grow without end; scaling delays that, no precision prevents it"
        if isinstance(fmt, WordFormats) or (fmt is not None and fmt.limits is not None):
            cure += ", or use a format with a larger range"
        elif fmt is not None and fmt.base != 10:
            cure += ", or use base 10"
        return f"got {what}; {cure}"

    def value(self, i: int) -> str:
        """Name a state, or an output, which follow the states."""
        if i < self.n:
            return named("state", i, self.state_names)
        return named("output", i - self.n, self.output_names)


class SystemRun(Progress):
    """A run of a linear system. An estimate of a step is its states and, behind them, its outputs.

    Parameters
    ----------
    model : the system.
    fmt : the format in which everything is stored and computed, or formats of words; None for double-double.
    checkpoint_steps : as for :class:`~gpbnb.filters.run.Run`.
    """

    def __init__(self, model: LinearSystem, fmt: SystemFormat | None, checkpoint_steps: Sequence[int] = ()) -> None:
        if not isinstance(fmt, FloatFormat | FixedFormat | WordFormats | None):
            raise TypeError(f"got the format {fmt!r}; needed a FloatFormat, a FixedFormat, WordFormats or a name")
        super().__init__(checkpoint_steps)
        if isinstance(fmt, FixedFormat) and fmt.rounding is not Rounding.STOCHASTIC:
            fmt = WordFormats(fmt)
        self.model, self.fmt = model, fmt
        self._steps, self._states = self._begun(model, fmt)

    @staticmethod
    def _begun(model: LinearSystem, fmt: SystemFormat | None) -> tuple[Repeats, NDArray[Any]]:
        """Return what takes steps, and the first states."""
        made, start = model.as_filter(), np.concatenate([model.x0, exact([0] * model.p)])
        if isinstance(fmt, WordFormats):
            program = integer_program(made, fmt)
            with naming("x0"):
                return WordSteps(program), integers_of(start, fmt.data.strict)
        if fmt is None:
            tag: Tag = DoubleDouble()
            coefficients, x = double_doubles(made.coefficients), double_doubles(start)
        else:
            tag = fmt.run_tag()
            fmt.restart()
            coefficients, x = made.packed(fmt), packed_array(stored_start(fmt, start))
        step = system_step(made.program, in_order=fmt is not None and fmt.rounding is Rounding.STOCHASTIC)
        return RunningStep(step, [fmt], [coefficients[None]], tag=tag), x

    @property
    def _width(self) -> int:
        """Number of states and outputs."""
        return self.model.n + self.model.p

    def blocks(self, z: Any) -> Iterator[NDArray[Any]]:
        """Continue by as many steps as there are inputs, (steps, m), and give what each computes, packed."""
        if self.stopped is not None:
            return
        inputs, missing = system_inputs(self.model, z), ""
        try:
            packed = self._stored(inputs)
        except OverflowError as error:
            missing = str(error)
            packed = self._stored(inputs[: bisect_left(range(len(inputs)), True, key=partial(self._loses, inputs))])
        for found in self.repeat(self._steps, [self._states], packed, self._fault):
            yield found.given[0]
        if missing and self.stopped is None:
            self.stop("inputs", f": {missing}")

    def _fault(self, stop: Stop) -> tuple[str, str]:
        """Name the state or output that a step cannot compute, and a cure."""
        return self.model.value(int(stop.quantity)), f": {self.model.beyond(self.fmt)}"

    def _stored(self, inputs: NDArray[Any]) -> NDArray[Any]:
        if isinstance(self.fmt, WordFormats):
            return integers_of(inputs, self.fmt.data)
        return as_packed(self.fmt, inputs)

    def _loses(self, inputs: NDArray[Any], last: int) -> bool:
        """Whether the format does not hold some inputs up to the last."""
        try:
            self._stored(inputs[: last + 1])
        except OverflowError:
            return True
        return False

    def estimates(self, found: NDArray[Any]) -> NDArray[np.float64]:
        """Return states and outputs of some steps, (steps, n + p, 2), as double-double."""
        if isinstance(self.fmt, WordFormats):
            return pairs_of(found, self.fmt.data.unit)
        return widened_estimates(found[:, :, None])[:, :, 0]

    def states(self, z: Any) -> NDArray[np.float64]:
        """Continue, and return all estimates; a decimal number beyond the range of double-double ends the run, too."""
        found = super().states(z)
        for k, i in np.argwhere(np.isnan(found[..., 0]))[:1].tolist():
            self.steps -= len(found) - k
            self.stop(self.model.value(i), f": {self.model.beyond()}")
            found = found[:k]
        return found


def _ascending(name: str, given: Any) -> tuple[Fraction, Fraction] | None:
    """Return a pair of limits, exact."""
    if given is None:
        return None
    entries = exact(given)
    if entries.shape != (2,) or not entries[0] < entries[1]:
        raise ValueError(f"got {name}={given!r}; needed two numbers, the lower first")
    return entries[0], entries[1]


def system_inputs(system: LinearSystem, u: Any) -> NDArray[Any]:
    """Check the inputs of a system, (steps, m), and return them."""
    given = real_numbers(u)
    if given.ndim != 2 or given.shape[1] != system.m or not len(given):
        column = "; write u.reshape(-1, 1)" if given.ndim == system.m == 1 else ""
        raise ValueError(f"got inputs of shape {given.shape}; needed (steps, {system.m}){column}")
    if given.dtype.kind != "f":
        return exact(given)
    for k, i in np.argwhere(~np.isfinite(given)):
        which = named("input", int(i), system.input_names)
        raise ValueError(f"got {given[k, i]} for {which} of step {k + 1}; needed a finite number: inputs are known")
    return given


def is_stable(A: NDArray[Any]) -> bool:
    r"""Whether all eigenvalues of an exact matrix lie inside the unit circle, by the exact test of Schur and Cohn.

    A polynomial p with the coefficients :math:`a_0 \dots a_n` is stable if :math:`|a_0| < |a_n|` and
    :math:`(a_n\,p(x) - a_0\,x^n p(1/x))/x` is stable.
    """
    polynomial = rationals(A).charpoly()
    p = [polynomial[i] for i in range(len(A) + 1)]
    while len(p) > 1:
        first, last = p[0], p[-1]
        if not abs(first) < abs(last):
            return False
        share = first / last
        p = [high - share * low for high, low in zip(p[1:], p[-2::-1], strict=True)]
    return True


def unobserved(Phi: NDArray[Any], H: NDArray[Any], names: tuple[str, ...] = ()) -> str:
    """Return in words that no measurement observes a state which does not decay; empty if there is none.

    The unobserved states are those that H Φᵏ maps to zero for every k; Φ maps them to each other. The test is exact.
    """
    n, rows = len(Phi), [H]
    for _ in range(n - 1):
        rows.append(rows[-1] @ Phi)
    reduced, rank = rationals(np.concatenate(rows)).rref()
    pivots = [next(j for j in range(n) if reduced[i, j]) for i in range(rank)]
    free = [j for j in range(n) if j not in pivots]
    if not free:
        return ""
    basis = np.full((n, len(free)), Fraction(0), dtype=object)
    for at, j in enumerate(free):
        basis[j, at] = Fraction(1)
        for i, pivot in enumerate(pivots):
            basis[pivot, at] = -Fraction(int(reduced[i, j].p), int(reduced[i, j].q))
    moved = (Phi @ basis)[free]  # the coordinates in this basis are the free entries
    if is_stable(moved):
        return ""
    return f"no measurement observes a part of the state that does not decay, with {_eigenvalue(moved, names, basis)}"


def _eigenvalue(A: NDArray[Any], names: tuple[str, ...], basis: NDArray[Any] | None = None) -> str:
    """Name the size of the largest eigenvalue of a matrix that is not stable, and the state that it moves most."""
    values = eigenvalues(A)
    largest = values[np.abs(values).argmax()]
    size, entries = float(abs(largest)), A.astype(np.float64)
    if not np.isfinite([size, *entries.ravel()]).all():
        return "an eigenvalue of size 1 or more"
    vector = np.linalg.svd(entries - largest * np.eye(len(A)))[2][-1].conj()
    moved = np.abs(vector if basis is None else basis.astype(np.float64) @ vector)
    text = f"an eigenvalue of size {size:.6g}" if size > 1 + 1e-6 else "an eigenvalue of size 1 or more"
    return f"{text}, mostly in {named('state', int(moved.argmax()), names)}"
