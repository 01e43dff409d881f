"""Blocks of a filter's step, each computed in an arithmetic of its own.

The step is written once. With the tag of one arithmetic, every block has this arithmetic, and what a block takes from
another is used as it is: numba compiles the same code as without blocks. With the tag
:class:`gpbnb.arithmetic.kernels.tags.Blocks`, a block first rounds what it takes from another block or from the model.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.compiling import inner
from gpbnb.arithmetic.kernels.scalar import load, put, round_
from gpbnb.arithmetic.kernels.tags import Blocks


class TakenArrays(NamedTuple):
    """Arrays for what blocks take from each other; see :func:`taken`."""

    #: (n, n): transition and other matrices of this shape.
    Phi: NDArray[Any]
    square: NDArray[Any]
    #: (m, n) and (n, m): measurement matrices and gains.
    H: NDArray[Any]
    HT: NDArray[Any]
    wide: NDArray[Any]
    tall: NDArray[Any]
    #: (m, m).
    small: NDArray[Any]


@inner
def taken_arrays(P: Any, H: Any, HT: Any, R: Any) -> Any:
    """Return arrays for what blocks take from each other."""
    square = np.empty_like(P), np.empty_like(P)
    return TakenArrays(
        *square, np.empty_like(H), np.empty_like(HT), np.empty_like(H), np.empty_like(HT), np.empty_like(R)
    )


def _is_blocks(fmt: Any) -> bool:
    return getattr(fmt, "instance_class", None) is Blocks


def _only_compiled(name: str) -> TypeError:
    return TypeError(f"got a call of {name} from Python; needed one from a function compiled by numba")


def of_state(fmt: Any) -> Any:
    """Return the arithmetic of the estimate, the predicted measurement and the innovation."""
    raise _only_compiled("of_state")


def of_gain(fmt: Any) -> Any:
    """Return the arithmetic of the gain."""
    raise _only_compiled("of_gain")


def of_covariance(fmt: Any) -> Any:
    """Return the arithmetic of the covariance, or of its factors."""
    raise _only_compiled("of_covariance")


def of_innovation(fmt: Any) -> Any:
    """Return the arithmetic of the innovation covariance and its inverse."""
    raise _only_compiled("of_innovation")


def taken(fmt: Any, tag: Any, a: Any, own: Any) -> Any:
    """Return a matrix of another block as a block with the arithmetic `tag` takes it, in the array `own` if rounded."""
    raise _only_compiled("taken")


def number_taken(fmt: Any, tag: Any, x: Any) -> Any:
    """Return a number of another block as a block with the arithmetic `tag` takes it."""
    raise _only_compiled("number_taken")


@overload(of_state, strict=False, inline="always")
def _of_state(fmt: Any) -> Any:
    return (lambda fmt: fmt.state) if _is_blocks(fmt) else lambda fmt: fmt


@overload(of_gain, strict=False, inline="always")
def _of_gain(fmt: Any) -> Any:
    return (lambda fmt: fmt.gain) if _is_blocks(fmt) else lambda fmt: fmt


@overload(of_covariance, strict=False, inline="always")
def _of_covariance(fmt: Any) -> Any:
    return (lambda fmt: fmt.covariance) if _is_blocks(fmt) else lambda fmt: fmt


@overload(of_innovation, strict=False, inline="always")
def _of_innovation(fmt: Any) -> Any:
    return (lambda fmt: fmt.innovation) if _is_blocks(fmt) else lambda fmt: fmt


@overload(taken, strict=False, jit_options={"_nrt": False})
def _taken(fmt: Any, tag: Any, a: Any, own: Any) -> Any:
    def rounded(fmt: Any, tag: Any, a: Any, own: Any) -> Any:
        for i in range(a.shape[0]):
            for j in range(a.shape[1]):
                put(tag, own, (i, j), round_(tag, load(tag, a, (i, j))))
        return own

    return rounded if _is_blocks(fmt) else lambda fmt, tag, a, own: a


@overload(number_taken, strict=False, jit_options={"_nrt": False})
def _number_taken(fmt: Any, tag: Any, x: Any) -> Any:
    return (lambda fmt, tag, x: round_(tag, x)) if _is_blocks(fmt) else lambda fmt, tag, x: x
