"""The model of a nonlinear filter, extended or unscented: functions, noise and a first estimate, checked once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from fractions import Fraction
from inspect import signature
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.derivatives import jacobian
from gpbnb.arithmetic.elementary import elementary
from gpbnb.arithmetic.exits import kept_in
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.covariance import Repair
from gpbnb.filters.model import Entries, LinearModel
from gpbnb.filters.named import naming, range_text, sized, whole_number

Function = Callable[..., Any]
"""A function of a state (n,), and of the inputs (p,) of a step if there are any, written with arrays of a format."""

Method = Literal["extended", "unscented"]


class SigmaPoints(NamedTuple):
    r"""How an unscented filter spreads its points, :math:`\pm\sqrt{(n + \lambda)P}` around the estimate.

    :math:`\lambda = \alpha^2(n + \kappa) - n`. The central point has the weight :math:`\lambda/(n + \lambda)` in a
    mean, and :math:`1 - \alpha^2 + \beta` more in a covariance; each other one has :math:`1/(2(n + \lambda))`. All
    weights are computed exactly, and rounded when a format stores them.

    References
    ----------
    Wan & van der Merwe 2000.
    """

    alpha: Numbers = 1
    beta: Numbers = 2
    kappa: Numbers = 0


USUAL_POINTS = SigmaPoints()

MOST_ITERATIONS = 1000
"""Largest number of iterations of an update."""
"""Sigma points that are spread as far as the estimate is uncertain."""


@dataclass(frozen=True, eq=False, init=False, repr=False)
class NonlinearModel:
    r"""A nonlinear process and its measurements, for an extended or an unscented Kalman filter.

    .. math:: x_k = f(x_{k-1}, u_k) + w_k, \qquad z_k = h(x_k, u_k) + v_k, \qquad
        w_k \sim N(0, Q_k),\ v_k \sim N(0, R_k)

    The functions receive arrays of the format in which the filter runs, and must compute in it; write constants as
    ``x.format.array("0.1")``. A run calls them with placeholders, records their operations, and repeats these in each
    step. A function that branches on a number is called in each step instead. The extended filter takes the step of a
    :class:`~gpbnb.filters.model.LinearModel` with the matrices :math:`F = \partial f/\partial x` at the last estimate
    and :math:`H = \partial h/\partial x` at the predicted one, in the same order of operations. It predicts the
    estimate :math:`\bar x = f(\hat x)`, and the innovation is :math:`z - h(\bar x)`. If f and h multiply the state by
    matrices, the innovation form and Joseph's form give the same digits as that linear filter. In the UD form and with
    square roots, the digits differ: the linear filter subtracts the products of H and x from z one after the other,
    while the extended filter subtracts their sum.

    Parameters
    ----------
    f : function of x (n,), or of x and u (p,), that returns the next state (n,), or one number if n = 1.
    F : function with the same arguments that returns its Jacobian (n, n). If None, f is differentiated exactly; see
        :mod:`gpbnb.arithmetic.derivatives`.
    h : function with the same arguments that returns the predicted measurement (m,), or one number if m = 1.
    H : function that returns its Jacobian (m, n); or None.
    Q, R, x0, P0, name, repair, state_names, measurement_names : as for ``LinearModel``; R gives the number m of
        measurements. Q and R may be cycles.
    u : (steps, p), known inputs, row k - 1 for step k.
    angles : indices or names of measurements that are angles in radians; their innovation is wrapped to
        :math:`[-\pi, \pi]`.
    residual : function of z (m,) and h(x) that returns the innovation (m,), in place of their difference.
    normalize : function of a state that is applied to each new estimate, for example to scale a quaternion to length
        one. The covariance does not change.
    iterations : how often the extended filter computes an update, each time with h and H at the last estimate (Bell &
        Cathey 1993).
    method : "extended" or "unscented". The unscented filter has one form and needs no Jacobians. It subtracts
        :math:`(KS)K^T` from the predicted covariance.
    points : the sigma points of the unscented filter.
    steps : number of steps that the model describes; by default the number of rows of `u`, or without `u` no limit.

    Attributes
    ----------
    noise : the model of everything but the functions, as a ``LinearModel`` whose Phi is the identity and whose H is
        filled with ones.

    Raises
    ------
    TypeError : an argument that must be a function is not one, or takes other arguments.
    ValueError : shapes that do not fit together; an unknown measurement among the angles; angles and a residual
        together; several iterations or a Jacobian for the unscented filter; or for a reason given in ``LinearModel``.

    References
    ----------
    Bar-Shalom, Li & Kirubarajan 2001, ch. 10.

    Examples
    --------
    The range and bearing of a beacon at (3, 4) from a vehicle that moves along x:

    >>> import numpy as np
    >>> from gpbnb import NonlinearModel, required_precision
    >>> def f(x):
    ...     return np.stack([x[0] + x[1], x[1]])
    >>> def h(x):
    ...     return np.stack([np.hypot(3 - x[0], 4), np.arctan2(4, 3 - x[0])])
    >>> model = NonlinearModel(
    ...     f, None, h, None, Q=np.diag([0, 2**-10]), R=np.diag([2**-4, 2**-10]), x0=[0, 1], P0=np.eye(2), angles=[1]
    ... )
    >>> z = [[4.5, 1.1], [4.1, 1.3], [4.0, 1.57], [4.1, 1.8]]
    >>> print(required_precision(model, z, 0.01))
    10 bits (binary32 is enough): 0.38 of the tolerance, observed in 4 steps
    """

    f: Function
    F: Function | None
    h: Function
    H: Function | None
    noise: LinearModel
    u: Any
    angles: tuple[int, ...]
    residual: Function | None
    normalize: Function | None
    iterations: int
    method: Method
    points: SigmaPoints
    steps: int | None

    def __init__(
        self,
        f: Function,
        F: Function | None,
        h: Function,
        H: Function | None,
        Q: Entries,
        R: Entries,
        x0: Numbers,
        P0: Numbers,
        *,
        u: Numbers | None = None,
        angles: Sequence[int | str] = (),
        residual: Function | None = None,
        normalize: Function | None = None,
        iterations: int = 1,
        method: Method = "extended",
        points: SigmaPoints = USUAL_POINTS,
        steps: int | None = None,
        name: str = "a nonlinear model",
        repair: bool | None = None,
        state_names: Sequence[str] | None = None,
        measurement_names: Sequence[str] | None = None,
    ) -> None:
        m = _shape(R(1) if callable(R) else R)[-1:] or (0,)
        n = _shape(x0)[:1] or (0,)
        H_shape = np.ones((max(m[0], 1), max(n[0], 1)), dtype=int)
        inputs = None if u is None else _inputs(u)
        if inputs is not None and steps is None:
            steps = len(inputs)
        noise = LinearModel(
            np.eye(max(n[0], 1), dtype=int),
            H_shape,
            Q,
            R,
            x0,
            P0,
            name,
            repair,
            steps=steps,
            state_names=state_names,
            measurement_names=measurement_names,
        )
        given = {
            "f": f,
            "F": F,
            "h": h,
            "H": H,
            "noise": noise,
            "u": inputs,
            "angles": _angles(angles, noise),
            "residual": residual,
            "normalize": normalize,
            "iterations": whole_number("iterations", iterations, most=MOST_ITERATIONS),
            "method": method,
            "points": _points(points),
            "steps": noise.steps,
        }
        for attribute, value in given.items():
            object.__setattr__(self, attribute, value)
        self._check()

    def _check(self) -> None:
        for what, optional in (("f", False), ("h", False), ("F", True), ("H", True), ("residual", True)):
            function = getattr(self, what)
            if not callable(function) and not (optional and function is None):
                raise TypeError(
                    f"got {what} {function!r}; needed a function of a state"
                    + (", or None to differentiate exactly" if what in "FH" else "")
                )
        if self.normalize is not None and not callable(self.normalize):
            raise TypeError(f"got normalize {self.normalize!r}; needed a function of a state, or None")
        if self.method not in get_args(Method):
            raise ValueError(f'got method {self.method!r}; needed "extended" or "unscented"')
        if self.angles and self.residual is not None:
            raise ValueError("got angles and a residual; needed one of them: a residual wraps its angles itself")
        if self.u is not None and self.steps is not None and len(self.u) < self.steps:
            raise ValueError(f"got u for {len(self.u)} steps; needed one row for each of the {self.steps}")
        if self.method == "unscented":
            if self.iterations > 1 or self.F is not None or self.H is not None:
                raise ValueError(
                    "got Jacobians or several iterations for the unscented filter; needed F=None, H=None and "
                    "iterations=1: its sigma points take their place"
                )
            self.weights()
        elif self.points != USUAL_POINTS:
            raise ValueError(
                f'got points {tuple(self.points)} and method "extended"; needed method "unscented" for them'
            )
        self._check_arguments()

    def _check_arguments(self) -> None:
        """Reject a function that does not take a state, or a state and inputs."""
        known = ("x",) if self.u is None else ("x", "u")
        takes = {**dict.fromkeys("fFhH", known), "residual": ("z", "predicted"), "normalize": ("x",)}
        for what, arguments in takes.items():
            try:
                signature(getattr(self, what) or (lambda *_: None)).bind(*arguments)
            except TypeError as error:
                inputs = ", for a model without u" if arguments == ("x",) else ", for a model with u"
                raise TypeError(
                    f"got {what} with other arguments: {error}; needed {what}({', '.join(arguments)})"
                    + (inputs if what in "fFhH" else "")
                ) from None
            except ValueError:  # a function of C without a signature
                pass

    def __repr__(self) -> str:
        """Describe the model in three lines: its sizes and method, its noise, and its start."""
        kind = f"{self.method}, iterated {self.iterations} times" if self.iterations > 1 else self.method
        steps = "" if self.steps is None else f"; at most {sized(self.steps, 'step', ())}"
        Q, R, x0, P0 = (f"{each} {range_text(getattr(self.noise, each).flat)}" for each in ("Q", "R", "x0", "P0"))
        return (
            f"NonlinearModel {self.name!r}, {kind}, {sized(self.n, 'state', self.state_names)}; "
            f"{sized(self.m, 'measurement', self.measurement_names)}{steps}\n  {Q}, {R}\n  {x0}, {P0}"
        )

    @property
    def n(self) -> int:
        """Number of states."""
        return self.noise.n

    @property
    def m(self) -> int:
        """Number of measurements in each step."""
        return self.noise.m

    @property
    def name(self) -> str:
        """Name in tables and messages."""
        return self.noise.name

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states, if they have any."""
        return self.noise.state_names

    @property
    def measurement_names(self) -> tuple[str, ...]:
        """Names of the measurements, if they have any."""
        return self.noise.measurement_names

    @property
    def repairs(self) -> tuple[Repair, ...]:
        """The repairs of Q, R and P0."""
        return self.noise.repairs

    def check_steps(self, count: int) -> None:
        """Reject a run that is longer than the model describes; see ``LinearModel.check_steps``."""
        self.noise.check_steps(count)

    def check_sizes(self) -> None:
        """Reject entries beyond the range of compiled loops; see ``LinearModel.check_sizes``."""
        self.noise.check_sizes()

    def without_missing(self, z: Any) -> tuple[NonlinearModel, Any]:
        """Return a model that ignores missing measurements, and the measurements with zeros in their place.

        A missing measurement gets an innovation of zero and a row of zeros in H.
        """
        noise, filled = self.noise.without_missing(z)
        if noise is self.noise:
            return self, filled
        made = copy(self)
        object.__setattr__(made, "noise", noise)
        return made, filled

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which measurements are present in each step, (p, m); p is 1 if none is missing in any."""
        return np.asarray(self.noise.H[:, :, 0] != 0, np.bool_)

    def weights(self) -> tuple[Fraction, NDArray[Any], NDArray[Any]]:
        r"""Return :math:`n + \lambda`, and the exact weights (2n + 1,) of the sigma points in means and covariances.

        Raises
        ------
        ValueError : :math:`n + \lambda` is not positive.
        """
        alpha, beta, kappa = (exact(each).item() for each in self.points)
        scale = alpha**2 * (self.n + kappa)
        if scale <= 0:
            raise ValueError(
                f"got {self.points} for {self.n} states; needed alpha other than zero and kappa above {-self.n}"
            )
        means = np.array([1 - self.n / scale, *[1 / (2 * scale)] * (2 * self.n)], dtype=object)
        covariances = means.copy()
        covariances[0] += 1 - alpha**2 + beta
        return scale, means, covariances

    # -- functions ----------------------------------------------------------------------------------------

    def moved(self, x: FloatArray, u: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Return f, (n,), and its Jacobian, (n, n), at a state."""
        return self._with_jacobian("f", "F", x, u)

    def measured(self, x: FloatArray, u: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Return h, (m,), and its Jacobian, (m, n), at a state."""
        return self._with_jacobian("h", "H", x, u)

    def value(self, name: str, x: FloatArray, u: FloatArray | None = None) -> FloatArray:
        """Return f or h at a state, checked to be of its shape and format."""
        return self._called(name, (self.n if name == "f" else self.m,), x, *_given(u))

    def _with_jacobian(
        self, name: str, slopes: str, x: FloatArray, u: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        rows = self.n if name == "f" else self.m
        if getattr(self, slopes) is not None:
            J = self._called(slopes, (rows, self.n), x, *_given(u))
            return self.value(name, x, u), J
        with kept_in(x.format):
            return jacobian(lambda at: self._checked(name, getattr(self, name)(at, *_given(u)), x, (rows,)), x)

    def difference(self, z: FloatArray, predicted: FloatArray) -> FloatArray:
        r"""Return the innovation (m,): z - h(x) with its angles wrapped, or what `residual` returns.

        Angles are wrapped by :math:`y - 2\pi\,\mathrm{rint}(y/2\pi)`, each operation rounded. The value used for
        :math:`2\pi` is twice the rounded :math:`\pi`.
        """
        if self.residual is not None:
            return self._called("residual", (self.m,), z, predicted)
        y = z - predicted
        if not self.angles:
            return y
        angle = np.isin(np.arange(self.m), self.angles)
        turn = 2 * elementary("arctan2", y.operand(0), y.operand(-1))
        found: Any = np.where(angle, y - np.rint(y / turn) * turn, y)
        return found

    def normalized(self, x: FloatArray) -> FloatArray:
        """Return a new estimate (n,) after the model's normalization."""
        return x if self.normalize is None else self._called("normalize", (self.n,), x)

    def _called(self, name: str, shape: tuple[int, ...], x: FloatArray, *others: FloatArray) -> FloatArray:
        """Call a function of the model, and check that its result has a shape, and the format of its first argument."""
        with kept_in(x.format):
            return self._checked(name, getattr(self, name)(x, *others), x, shape)

    def _checked(self, name: str, found: Any, x: FloatArray, shape: tuple[int, ...]) -> FloatArray:
        found = _joined([found] if shape == (1,) and getattr(found, "shape", None) == () else found, x)
        if isinstance(found, FloatArray) and found.format == x.format and found.shape == shape:
            return found
        if isinstance(found, FloatArray):
            kind = f"shape {found.shape}" if found.format == x.format else f"numbers in {found.format}"
        else:
            kind = f"a {type(found).__name__}"
        raise ValueError(
            f"got {kind} from {name}; needed an array of shape {shape} in {x.format}; compute with the operations of "
            'the state, write constants as x.format.array("0.1"), and join components with np.stack'
        )


def _joined(found: Any, x: FloatArray) -> Any:
    """Join arrays of a format and exact numbers in lists, or in rows of lists; anything else stays as it is."""
    if not isinstance(found, (list, tuple)) or not found:
        return found
    rows = [_joined(each, x) for each in found]
    return np.stack(rows) if any(isinstance(each, FloatArray) for each in rows) else x.operand(found)


AnyModel = LinearModel | NonlinearModel
"""A model of a filter, linear or nonlinear."""


def _shape(given: Any) -> tuple[int, ...]:
    return tuple(given.shape) if hasattr(given, "shape") else np.shape(given)


def _given(u: FloatArray | None) -> tuple[FloatArray, ...]:
    return () if u is None else (u,)


def _inputs(u: Any) -> NDArray[Any]:
    with naming("u"):
        found = exact(u)
    if found.ndim != 2 or not found.size:
        raise ValueError(f"got u of shape {found.shape}; needed (steps, p), one row for each step")
    return found


def _points(given: Any) -> SigmaPoints:
    try:
        points = SigmaPoints(*given)
        for each in points:
            exact(each)
    except (TypeError, ValueError) as error:
        needed = "gpbnb.filters.nonlinear.SigmaPoints(alpha, beta, kappa), three numbers"
        raise type(error)(f"got points {given!r}; needed {needed}") from None
    return points


def _angles(given: Sequence[int | str], noise: LinearModel) -> tuple[int, ...]:
    if given is None or isinstance(given, (str, int)):
        given = [given]
    names, found = noise.measurement_names, []
    for each in given:
        at = names.index(each) if isinstance(each, str) and each in names else each
        if isinstance(at, bool) or not isinstance(at, (int, np.integer)) or not 0 <= at < noise.m:
            known = f"0 to {noise.m - 1}" + (f", or {', '.join(map(repr, names))}" if names else "")
            raise ValueError(f"got the angle {each!r}; needed a measurement, {known}")
        found.append(int(at))
    return tuple(found)
