r"""One step of a filter in every form, over numbers of any kind, also over numbers that record their operations.

With covariances, the order of operations is that of hung1984: predicted covariance (100), gain (99), covariance (101),
then the estimate by the innovation (98) or by the closed loop (109)-(111). Forms with factors or square roots take one
measurement after the other; roots need ``sqrt``. Only :func:`predicted` to :func:`looped` take states and
measurements as columns.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gpbnb.arithmetic.algebra import Algebra, Matrix, as_computed, inverse_in_order
from gpbnb.filters.forms import Form


class StepTaken(NamedTuple):
    """What a step gives: its states, its gain as arrays in tuples or lists, and whether all is definite.

    All is definite if all variances, and all pivots of the innovation covariance, are positive. Of several steps,
    arrays and truth values have one row for each.
    """

    states: tuple[Any, ...]
    gain: Any
    definite: Any


class BlockStorage(NamedTuple):
    """How each block of a filter takes numbers from the model or from another block; by default as they are."""

    state: Callable[[Matrix], Matrix] = as_computed
    gain: Callable[[Matrix], Matrix] = as_computed
    covariance: Callable[[Matrix], Matrix] = as_computed
    innovation: Callable[[Matrix], Matrix] = as_computed


ONE_FORMAT = BlockStorage()
"""All blocks compute with the same numbers."""


# -- with covariances --------------------------------------------------------------------------------------------------


HUNG_FORMS = (Form.HUNG, Form.HUNG_SECOND_GAIN)
"""Forms that compute the estimate by the closed loop."""


class StepModel(NamedTuple):
    """The matrices of one step: Phi (n, n), H (m, n), Q (n, n), R (m, m)."""

    Phi: Matrix
    H: Matrix
    Q: Matrix
    R: Matrix


def unnamed(quantity: str) -> None:
    """Take no note of the quantity that is computed next."""


class Innovation(NamedTuple):
    """:math:`VH^T` (n, m), the innovation covariance (m, m), its inverse, and the pivots of its elimination."""

    VH: Matrix
    covariance: Matrix
    inverse: Matrix
    pivots: list[Any]


def predicted(algebra: Algebra, Phi: Matrix, P: Matrix, Q: Matrix) -> Matrix:
    r"""Return :math:`(\Phi P)\Phi^T + Q`; (100)."""
    times = algebra.times
    return algebra.rounded(times(times(Phi, P), Phi.T) + Q)


def innovation(algebra: Algebra, H: Matrix, R: Matrix, V: Matrix, about: Callable[[str], None] = unnamed) -> Innovation:
    """Return :math:`VH^T`, the innovation covariance :math:`H(VH^T) + R` and its inverse."""
    times = algebra.times
    VH = times(V, H.T)
    S = algebra.rounded(times(H, VH) + R)
    about("its inverse")
    return Innovation(VH, S, *algebra.invert(S, algebra.identity(len(S))))


def gain(algebra: Algebra, H: Matrix, R: Matrix, V: Matrix) -> tuple[Matrix, Innovation]:
    """Return :math:`(VH^T)(H(VH^T) + R)^{-1}` for the predicted covariance V; the first form of (99)."""
    found = innovation(algebra, H, R, V)
    return algebra.times(found.VH, found.inverse), found


def reduction(algebra: Algebra, K: Matrix, H: Matrix) -> Matrix:
    """Return :math:`I - KH`."""
    return algebra.rounded(algebra.identity(H.shape[1]) - algebra.times(K, H))


def updated(algebra: Algebra, form: Form, model: StepModel, V: Matrix, K: Matrix) -> Matrix:
    r"""Return :math:`(I - KH)V`, (101), or in Joseph's form :math:`((I - KH)V)(I - KH)^T + (KR)K^T`."""
    times, W = algebra.times, reduction(algebra, K, model.H)
    P = times(W, V)
    if form is not Form.JOSEPH:
        return P
    return algebra.rounded(times(P, W.T) + times(times(K, model.R), K.T))


class BlockAlgebra(NamedTuple):
    """How each block of a filter computes, and how it takes numbers from the model or from another block."""

    state: Algebra
    gain: Algebra
    covariance: Algebra
    innovation: Algebra
    stored: BlockStorage = ONE_FORMAT


class Measured(NamedTuple):
    """A gain (n, m), covariance (n, n) and innovation covariance after a measurement, and whether all is definite."""

    K: Matrix
    P: Matrix
    S: Matrix
    definite: Any


def predicted_in(blocks: BlockAlgebra, Phi: Matrix, P: Matrix, Q: Matrix) -> Matrix:
    """Return the predicted covariance, computed in the covariance block."""
    taken = blocks.stored.covariance
    return predicted(blocks.covariance, taken(Phi), P, taken(Q))


def measured_in(
    blocks: BlockAlgebra,
    form: Form,
    H: Matrix,
    R: Matrix,
    V: Matrix,
    about: Callable[[str], None] = unnamed,
) -> Measured:
    """Return the gain, and the covariance after a measurement, each computed in its own block.

    The name of each quantity is told before it is computed.
    """
    stored = blocks.stored
    about("the innovation covariance")
    own_H, own_R, own_V = map(stored.innovation, (H, R, V))
    found = innovation(blocks.innovation, own_H, own_R, own_V, about)
    about("the gain")
    K = blocks.gain.times(stored.gain(found.inverse).T, stored.gain(found.VH).T).T
    about("the covariance")
    own = StepModel(None, stored.covariance(H), None, stored.covariance(R))
    P = updated(blocks.covariance, form, own, V, stored.covariance(K))
    if form is Form.SYMMETRIZED:
        P = (P + P.T) / 2
    definite = np.all(np.diagonal(P) > 0)
    for pivot in found.pivots:
        definite = definite & np.all(pivot > 0)
    return Measured(K, P, found.covariance, definite)


def corrected(algebra: Algebra, H: Matrix, K: Matrix, ahead: Matrix, z: Matrix) -> Matrix:
    """Return :math:`x_p + K(z - Hx_p)` for the predicted estimate; (98)."""
    return corrected_by(algebra, K, ahead, algebra.rounded(z - algebra.times(H, ahead)))


def corrected_by(algebra: Algebra, K: Matrix, ahead: Matrix, difference: Matrix) -> Matrix:
    """Return :math:`x_p + Ky` for the predicted estimate and an innovation y, as a nonlinear filter has it."""
    return algebra.rounded(ahead + algebra.times(K, difference))


def looped(algebra: Algebra, F: Matrix, K: Matrix, x: Matrix, z: Matrix) -> Matrix:
    r"""Return :math:`Fx + Kz` for the closed loop F and the estimate of the step before; (111)."""
    return algebra.rounded(algebra.times(F, x) + algebra.times(K, z))


# -- with factors and roots --------------------------------------------------------------------------------------------


Times = Callable[[Matrix, Matrix], Matrix]
"""A product of matrices."""


def predict_ud(Phi: Matrix, U: Matrix, UQ: Matrix, times: Times = operator.matmul) -> tuple[Matrix, Any]:
    """Predict UD factors by Thornton's modified weighted Gram-Schmidt; the diagonals hold D, which may have zeros.

    Also return whether no entry of D is negative, and the variance of each state positive.
    """
    n = len(U)
    W = np.concatenate([times(Phi, _unit(U)), _unit(UQ)], axis=1)
    D = np.concatenate([np.diagonal(U), np.diagonal(UQ)])
    columns: list[Matrix] = []
    for j in range(n - 1, -1, -1):
        c = D * W[j]
        d = (W[j] * c).sum()
        s = if_holds(d != 0, _share(W[:j], c, d), U[:j, j] * 0) if j else U[:0, j]
        W = W[:j] - s[:, None] * W[j]
        columns.append(np.concatenate([s, _stacked([d]), U[j + 1 :, j] * 0]))
    found = _stacked(columns[::-1]).T
    D = np.diagonal(found)
    return found, np.all(np.logical_not(D < 0)) & np.all(_of_variances(found, D) > 0)


def _of_variances(U: Matrix, D: Matrix) -> Matrix:
    """Return for each state an entry of D that adds to its variance, or zero if none does."""
    found = D
    for j in range(1, len(D)):
        first = found[:j]
        found = np.concatenate([np.where((first == 0) & (U[:j, j] != 0), D[j], first), found[j:]])
    return found


def _share(W: Matrix, c: Matrix, d: Matrix) -> Callable[[], Matrix]:
    return lambda: (W * c).sum(1) / d


def if_holds(truth: Any, changed: Callable[[], Any], unchanged: Any) -> Any:
    """Return changed numbers if a truth value holds, else the unchanged ones.

    A truth value that is recorded, see :mod:`gpbnb.arithmetic.traced`, records both.
    """
    if hasattr(type(truth), "if_holds"):  # arrays would look for names that are spelled alike
        return truth.if_holds(changed, unchanged)
    return changed() if truth else unchanged


def check_nonzero(a: Any) -> None:
    """Refuse a variance of the innovation that is zero; a number that records its operations records the check."""
    if hasattr(type(a), "check_nonzero"):
        a.check_nonzero()
    elif a == 0:
        raise ZeroDivisionError("a zero pivot in the innovation covariance")


def innovation_of_one(h: Matrix, z: Matrix, x: Matrix) -> Matrix:
    """Return one measurement z minus h'x, term by term."""
    for each in h * x:
        z = z - each
    return z


def observe_ud(
    h: Matrix, z: Matrix, r: Matrix, x: Matrix, U: Matrix, stored: BlockStorage = ONE_FORMAT
) -> tuple[Matrix, Matrix, Matrix, Any]:
    """Update UD factors by Bierman's method, for one measurement z of h'x with variance r.

    The innovation block has h (n,) and r, the state block z and x (n,), and the covariance block U (n, n). Return x, U
    and gain after the update, and whether variances stay positive.
    """
    y = innovation_of_one(stored.state(h), z, x)
    seen = stored.innovation(U)
    f = _unit(seen).T @ h
    g = np.diagonal(seen) * f
    taken, moved, added, nonzero = stored.gain(g), stored.covariance(f), f * g, g != 0
    gain, columns, variances, earlier = taken[:0], list[Matrix](), [r], nonzero[0]
    for j in range(len(x)):
        variances.append(variances[-1] + added[j])
        check_nonzero(variances[-1])
        column, known = U[: j + 1, j], [stored.covariance(each) for each in (gain, moved[j], *variances[-2:])]
        change = partial(_updated, column, earlier, *known)
        columns.append(np.concatenate([if_holds(nonzero[j], change, column), U[j + 1 :, j]]))
        share = gain + taken[j] * stored.gain(column[:j])
        gain, earlier = np.concatenate([share, taken[j : j + 1]]), earlier | nonzero[j]
    after = _stacked(columns).T
    definite = np.all(_stacked(variances[1:]) > 0) & np.all(np.logical_not(np.diagonal(after) < 0))
    K = gain / stored.gain(variances[-1])
    return x + stored.state(K) * y, after, K, definite


def _updated(column: Matrix, earlier: Any, gain: Matrix, f: Matrix, before: Matrix, a: Matrix) -> Matrix:
    """Return an updated column of U, whose last entry is a variance.

    Entries above it change only if an entry of an earlier column is not zero; otherwise the gain is zero.
    """
    above = column[:-1]
    if len(above):
        above = if_holds(earlier, lambda: above + -(f / before) * gain, above)
    return np.concatenate([above, column[-1:] * before / a])


def predict_root(Phi: Matrix, S: Matrix, SQ: Matrix, times: Times = operator.matmul) -> tuple[Matrix, Any]:
    """Return the upper triangular root of the predicted covariance, by modified Gram-Schmidt on (Phi S, SQ)."""
    n = len(S)
    W = np.concatenate([times(Phi, S), SQ], axis=1)
    found = _entries(S * 0)
    for j in range(n - 1, -1, -1):
        size = (W[j] * W[j]).sum().sqrt()
        found[j][j] = size
        if j:
            s, above = if_holds(size != 0, partial(_projected, W, j, size), [W[:j, 0] * 0, W[:j]])
            W = np.concatenate([above, W[j:]])
            for i in range(j):
                found[i][j] = s[i]
    root = _matrix(found)
    return root, np.all(np.any(root != 0, axis=1))


def _projected(W: Matrix, j: int, size: Matrix) -> list[Matrix]:
    """Return the shares of the first rows in the direction of row j, and these rows without them."""
    direction = W[j] / size
    s = (W[:j] * direction).sum(1)
    return [s, W[:j] - s[:, None] * direction]


def observe_potter(h: Matrix, z: Matrix, r: Matrix, x: Matrix, S: Matrix) -> tuple[Matrix, Matrix, Matrix, bool]:
    r"""Update a square root by Potter's method, for one measurement; see :func:`observe_ud`.

    .. math:: f = S^Th, \quad a = f^Tf + r, \quad K = Sf/a, \quad S^+ = S - \frac{(Sf) f^T}{a + \sqrt{ra}}
    """
    f = S.T @ h
    a = (f * f).sum() + r
    Sf = S @ f
    K = Sf / a
    S = S - (Sf / (a + (r * a).sqrt()))[:, None] * f
    return x + K * (z - h @ x), S, K, a > 0


def observe_carlson(h: Matrix, z: Matrix, r: Matrix, x: Matrix, S: Matrix) -> tuple[Matrix, Matrix, Matrix, bool]:
    r"""Update an upper triangular root by Carlson's method, for one measurement; see :func:`observe_ud`.

    With :math:`f = S^Th` and :math:`a_j = a_{j-1} + f_j^2`, :math:`a_0 = r`, column j becomes
    :math:`\sqrt{a_{j-1}/a_j}\,S_j - f_j\,k_{j-1}/\sqrt{a_{j-1}a_j}`, and :math:`k_j = k_{j-1} + f_jS_j`; K is
    :math:`k_n/a_n`.
    """
    n = len(x)
    f = S.T @ h
    a, k = r, x * 0
    columns: list[Matrix] = []
    for j in range(n):
        a, column, k = if_holds(f[j] != 0, partial(_carlson, a, f[j], S[:, j], k), [a, S[:, j], k])
        columns.append(column)
    K = k / a
    return x + K * (z - h @ x), _stacked(columns).T, K, a > 0


def _carlson(before: Matrix, f: Matrix, column: Matrix, k: Matrix) -> list[Matrix]:
    a = before + f * f
    return [a, (before / a).sqrt() * column - f / (before * a).sqrt() * k, k + f * column]


def decorrelated(UR: Matrix, a: Matrix) -> Matrix:
    """Return the inverse of the unit upper triangle of R = U D U' times a, by back substitution."""
    m = len(UR)
    rows = [a[i] for i in range(m)]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            rows[i] = rows[i] - UR[i, k] * rows[k]
    return _stacked(rows)


Observe = Callable[[Matrix, Matrix, Matrix, Matrix, Matrix], tuple[Matrix, Matrix, Matrix, bool]]
"""An update by one measurement, such as :func:`observe_ud`."""


def observed(
    observe: Observe,
    H: Matrix,
    UR: Matrix,
    z: Sequence[Any] | Matrix,
    ahead: Matrix,
    P: Matrix,
    stored: BlockStorage = ONE_FORMAT,
) -> StepTaken:
    """Update a predicted estimate (n,) and its factors or root P (n, n) by measurements z (m,), one by one.

    They are decorrelated by the factors of R, UR (m, m). Column i of the gain is that of measurement i.
    """
    UR, of_state = stored.innovation(UR), stored.state(UR)
    rows, values, gains, x, definite = (
        decorrelated(UR, stored.innovation(H)),
        decorrelated(of_state, z),
        [],
        ahead,
        True,
    )
    for i in range(len(UR)):
        x, P, K, positive = observe(rows[i], values[i], UR[i, i], x, P)
        gains.append(K)
        definite = definite & positive
    return StepTaken((x, P), np.stack(gains, axis=1), definite)


def root_of_factors(U: Matrix) -> Matrix:
    r"""Return :math:`U\sqrt{D}` for the factors of U D U'."""
    return _unit(U) * np.sqrt(np.diagonal(U))


def _unit(U: Matrix) -> Any:
    """Return the upper triangle with ones on its diagonal."""
    return np.where(np.eye(len(U), dtype=bool), 1, U)


def _entries(a: Matrix) -> list[list[Matrix]]:
    return [[a[i, j] for j in range(a.shape[1])] for i in range(a.shape[0])]


def _matrix(entries: list[list[Matrix]]) -> Matrix:
    return _stacked([_stacked(row) for row in entries])


def _stacked(parts: list[Matrix]) -> Any:
    return np.stack(parts)


def combined_gain(K: Matrix, H: Matrix, UR: Matrix) -> Any:
    """Return the gain (n, m) for all measurements together, from those of decorrelated measurements one by one.

    Each column of K (n, m) is the gain of one of these; H (m, n) is the measurement matrix, and UR (m, m) factors of R.
    """
    m, rows = len(UR), decorrelated(UR, H)
    columns = [K[:, j] for j in range(m)]
    for i in range(m):
        for j in range(i):
            columns[j] = columns[j] - K[:, i] * (rows[i] * columns[j]).sum()
    for j in range(1, m):
        for i in range(j):
            columns[j] = columns[j] - columns[i] * UR[i, j]
    return np.stack(columns, axis=1)


def covariance_of_factors(U: Matrix) -> Matrix:
    """Return U D U', (n, n): D is the diagonal, U the unit triangle above it."""
    triangle = np.where(np.tri(len(U), k=-1, dtype=bool), 0, _unit(U))
    return (triangle * np.diagonal(U)) @ triangle.T


def covariance_of_root(S: Matrix) -> Matrix:
    """Return S S', (n, n)."""
    return S @ S.T


class Factored(NamedTuple):
    """How a form predicts factors or a root, updates them by one measurement, and what covariance they stand for."""

    predict: Callable[..., Any]
    observe: Callable[..., Any]
    covariance: Callable[[Matrix], Matrix]


FACTORED: dict[Form, Factored] = {
    Form.UD: Factored(predict_ud, observe_ud, covariance_of_factors),
    Form.POTTER: Factored(predict_root, observe_potter, covariance_of_root),
    Form.CARLSON: Factored(predict_root, observe_carlson, covariance_of_root),
}
"""Forms with factors or roots."""


# -- whole steps -------------------------------------------------------------------------------------------------------


class LinearStep:
    """A step on arrays of any kind, also of those that record their operations.

    Given are its matrices and known inputs, by their letters. The name of each quantity is told before it is computed.
    """

    def __init__(
        self,
        form: Form,
        blocks: BlockAlgebra,
        given: dict[str, Any],
        about: Callable[[str], None] = unnamed,
    ) -> None:
        self.form, self.blocks, self.given, self.about = form, blocks, given, about

    def taken(self, states: tuple[Any, ...], z: Any) -> StepTaken:
        """Take a step from an estimate (n,), a covariance, factors or a root (n, n), and what compensation carries.

        The gain is (K, S), or with factors and roots (K,), of which column i is the gain of measurement i.
        """
        if "d" in self.given:
            self.about("the measurement without its offset")
            z = z - self.given["d"]
        return self._factored(states, z) if self.form in FACTORED else self._covariance(states, z)

    def _covariance(self, states: tuple[Any, ...], z: Any) -> StepTaken:
        x, P, *carried = states
        blocks, given, form, about = self.blocks, self.given, self.form, self.about
        stored = blocks.stored
        about("the predicted covariance")
        V = predicted_in(blocks, given["Phi"], P, given["Q"])
        K, P, S, definite = measured_in(blocks, form, given["H"], given["R"], V, about)
        H = given["H"]
        if form is Form.HUNG_SECOND_GAIN:
            about("the gain")
            of_gain = blocks.gain.times(stored.gain(P), stored.gain(H).T)
            K = blocks.gain.times(of_gain, stored.gain(given["RI"]))
        own = stored.state(K)
        about("the estimate")
        if form in HUNG_FORMS:
            W = reduction(blocks.covariance, stored.covariance(K), stored.covariance(H))
            loop = blocks.state.times(stored.state(W), stored.state(given["Phi"]))
            x = looped(blocks.state, loop, own, x[:, None], z[:, None])[:, 0]
        elif form is Form.COMPENSATED:
            x, *carried = self._compensated(x, carried[0], own, z)
        else:
            x = corrected(blocks.state, stored.state(H), own, self._ahead(x)[:, None], z[:, None])[:, 0]
        return StepTaken((x, P, *carried), (K, S), definite)

    def _ahead(self, x: Any) -> Any:
        return self._with_inputs(self._times(self.blocks.stored.state(self.given["Phi"]), x))

    def _times(self, a: Any, x: Any) -> Any:
        return self.blocks.state.times(a, x[:, None])[:, 0]

    def _with_inputs(self, x: Any) -> Any:
        if "B" in self.given:
            x = x + self._times(self.given["B"], self.given["u"])
        return x + self.given["b"] if "b" in self.given else x

    def _compensated(self, x: Any, carried: Any, K: Any, z: Any) -> tuple[Any, Any]:
        change = self._with_inputs(self._times(self.given["increment"], x))
        change = change + self._times(K, z - self._times(self.given["H"], x + change))
        change = change - carried
        after = x + change
        return after, (after - x) - change

    def _factored(self, states: tuple[Any, ...], z: Any) -> StepTaken:
        x, P = states
        stored, given, about = self.blocks.stored, self.given, self.about
        predict, observe, _ = FACTORED[self.form]
        about("the predicted covariance")
        P, definite = predict(
            stored.covariance(given["Phi"]), P, stored.covariance(given["UQ"]), self.blocks.covariance.times
        )
        about("the update of factors and estimate")
        ahead = self._ahead(x)
        if self.form is Form.UD:
            observe = partial(observe, stored=stored)
        states, K, positive = observed(observe, given["H"], given["UR"], z, ahead, P, stored)
        return StepTaken(states, (K,), definite & positive)


# -- smoothing ---------------------------------------------------------------------------------------------------------


def filtered(
    algebra: Algebra, form: Form, model: StepModel, x: Matrix, P: Matrix, z: Matrix
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Take one step of the filter, in the innovation form or Joseph's, over numbers of any kind.

    From estimate x (n, 1) and covariance P (n, n) before the step, and its measurement z (m, 1), return x, P, and what
    a smoother keeps of the step.
    """
    V = predicted(algebra, model.Phi, P, model.Q)
    K, _ = gain(algebra, model.H, model.R, V)
    P = updated(algebra, form, model, V, K)
    ahead = algebra.times(model.Phi, x)
    return corrected(algebra, model.H, K, ahead, z), P, ahead, V


def smoothed(
    algebra: Algebra, Phi: Matrix, before: Sequence[Matrix], ahead: Matrix, V: Matrix, x: Matrix, P: Matrix
) -> tuple[Matrix, Matrix]:
    """Smooth a step of the filter, x and P of which are given before the next step, by the next smoothed ones."""
    times, rounded = algebra.times, algebra.rounded
    G = times(times(before[1], Phi.T), algebra.invert(V, algebra.identity(len(P))).matrix)
    x = rounded(before[0] + times(G, rounded(x - ahead)))
    return x, rounded(before[1] + times(times(G, rounded(P - V)), G.T))


def filtered_root(
    Phi: Matrix, H: Matrix, SQ: Matrix, UR: Matrix, x: Matrix, S: Matrix, z: Matrix, identity: Matrix
) -> tuple[Matrix, ...]:
    """Take one step with square roots, from an estimate x (n,) and a root S (n, n), with a measurement z (m,).

    SQ is a root of Q, and UR are factors of R. Return x and S, the prediction, and A, B and C of the triangle.
    """
    A, B, C = _joint_root(Phi, SQ, S, identity)
    ahead = Phi @ x
    (x, S), _, _ = observed(observe_carlson, H, UR, z, ahead, C)
    return x, S, ahead, A, B, C


def smoothed_root(
    before: Matrix, ahead: Matrix, A: Matrix, B: Matrix, C: Matrix, x: Matrix, S: Matrix
) -> tuple[Matrix, Matrix]:
    """Smooth as :func:`smoothed` does, with the estimate before the next step, and its triangle."""
    solved = inverse_in_order(C, np.concatenate([(x - ahead)[:, None], S], axis=1)).matrix
    return before + B @ solved[:, 0], predict_root(B, solved[:, 1:], A)[0]


def _joint_root(Phi: Matrix, SQ: Matrix, S: Matrix, identity: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return A, B and C of the triangle; the root of the prediction, C, has the digits of the filter alone."""
    n, zero = len(S), identity * 0
    both = np.concatenate([np.concatenate([identity, zero], axis=1), np.concatenate([Phi, identity], axis=1)])
    joint = np.concatenate([np.concatenate([S, zero], axis=1), np.concatenate([zero, SQ], axis=1)])
    root, _ = predict_root(both, joint, joint[:, :0])
    return root[:n, :n], root[:n, n:], root[n:, n:]


# -- nonlinear ---------------------------------------------------------------------------------------------------------


class ExtendedModel(NamedTuple):
    """What one step of an extended filter uses."""

    f: Callable[[Matrix], tuple[Matrix, Matrix]]  # of a state (n,): its value and derivatives (n, n); so does h
    h: Callable[[Matrix], tuple[Matrix, Matrix]]
    difference: Callable[[Matrix, Matrix], Matrix]  # of two measurements (m,)
    seen: Callable[[Matrix], Matrix]  # of what belongs to measurements: zero where they are missing
    iterations: int
    Q: Matrix  # (n, n), or its factors or root
    R: Matrix  # (m, m), or its factors


def extended_step(blocks: BlockAlgebra, form: Form, model: ExtendedModel, x: Matrix, P: Matrix, z: Matrix) -> StepTaken:
    """Predict, then update once or several times, each time with h and its derivatives at the last estimate.

    The gain is (K,), or with factors and roots the gains of one measurement after the other, H, and the factors of R.
    """
    stored = blocks.stored
    ahead, F = model.f(x)
    if form in FACTORED:
        V, definite = FACTORED[form].predict(stored.covariance(F), P, stored.covariance(model.Q))
    else:
        V, definite = predicted_in(blocks, F, P, model.Q), True
    K: tuple[Any, ...] = ()
    x, positive = ahead, True
    for _ in range(model.iterations):
        expected, H = model.h(x)
        y = model.difference(z, expected)
        if x is not ahead:
            y = y - H @ (ahead - x)
        H, y = model.seen(H), model.seen(y)
        if form in FACTORED:  # what the measurements correct is zero before them
            observe = FACTORED[form].observe
            observe = partial(observe, stored=stored) if form is Form.UD else observe
            (change, P), gains, positive = observed(observe, H, model.R, y, ahead * 0, V, stored)
            x, K = ahead + change, (gains, H, model.R)
        else:
            found = measured_in(blocks, form, H, model.R, V)
            x = corrected_by(blocks.state, stored.state(found.K), ahead, y)
            P, K, positive = found.P, (found.K,), found.definite
    return StepTaken((x, P), K, definite & positive)


class UnscentedModel(NamedTuple):
    """What one step uses."""

    f: Callable[[Matrix], Matrix]  # of a state (n,), as h
    h: Callable[[Matrix], Matrix]
    difference: Callable[[Matrix, Matrix], Matrix]  # of two measurements (m,)
    scale: Any  # n + λ
    means: Matrix  # weights, (2n + 1,)
    covariances: Matrix  # weights, (2n + 1,)
    Q: Matrix  # (n, n)
    R: Matrix  # (m, m)


def unscented_step(algebra: Algebra, model: UnscentedModel, x: Matrix, P: Matrix, z: Matrix) -> StepTaken:
    r"""Take one step of an unscented filter.

    The points are :math:`x` and :math:`x \pm` the columns of the lower Cholesky factor of :math:`(n + \lambda)P`. With
    weights W in means and W' in covariances, and :math:`Y_i = f(X_i)`, :math:`Z_i = h(Y_i)`,

    .. math::
        \bar x &= Y_0 + \sum_{i\ge1} W_i (Y_i - Y_0), \quad V = \sum_i W'_i d_i d_i^T + Q, \quad d_i = Y_i - \bar x \\
        \bar z &= Z_0 + \sum_{i\ge1} W_i (Z_i - Z_0), \quad S = \sum_i W'_i e_i e_i^T + R, \quad e_i = Z_i - \bar z \\
        K &= \Big(\sum_i W'_i d_i e_i^T\Big)S^{-1}, \quad x^+ = \bar x + K(z - \bar z), \quad P^+ = V - (KS)K^T

    Differences of measurements are those of the model, so that angles wrap. Means are formed from differences to the
    central point because the weight of this point may be large and negative.

    References
    ----------
    Julier & Uhlmann 2004; Wan & van der Merwe 2000.
    """
    root = lower_root(model.scale * P).T
    Y = [model.f(each) for each in (x, *(x + column for column in root), *(x - column for column in root))]
    Z = [model.h(each) for each in Y]
    ahead, D = _mean(model.means, Y, lambda a, b: a - b)
    expected, E = _mean(model.means, Z, model.difference)
    weighted = D.T * model.covariances
    V = weighted @ D + model.Q
    S = (E.T * model.covariances) @ E + model.R
    inverse, pivots = algebra.invert(S, algebra.identity(len(S)))
    K = (weighted @ E) @ inverse
    P = V - (K @ S) @ K.T
    definite = np.all(np.diagonal(P) > 0)
    for each in pivots:
        definite = definite & np.all(each > 0)
    return StepTaken((corrected_by(algebra, K, ahead, model.difference(z, expected)), P), (K,), definite)


def _mean(weights: Matrix, points: list[Matrix], difference: Callable[[Matrix, Matrix], Matrix]) -> Any:
    """Return the mean of points, and the difference of each point from it, (2n + 1, n)."""
    change = None
    for weight, point in zip(weights[1:], points[1:], strict=True):
        part = weight * difference(point, points[0])
        change = part if change is None else change + part
    mean = points[0] + change
    return mean, np.stack([difference(each, mean) for each in points])


def lower_root(P: Matrix) -> Any:
    """Return the lower Cholesky factor of a covariance (n, n), column by column; a zero pivot gives a zero column."""
    columns: list[Matrix] = []
    n = len(P)
    for j in range(n):
        rest = P[:, j]
        for column in columns:
            rest = rest - column * column[j]
        pivot = rest[j].sqrt()
        columns.append(if_holds(pivot != 0, partial(_column, rest, pivot, j), rest * 0))
    return np.stack(columns).T


def _column(rest: Matrix, pivot: Any, j: int) -> Any:
    at = np.arange(len(rest))
    return np.where(at == j, pivot, np.where(at > j, rest / pivot, rest * 0))
