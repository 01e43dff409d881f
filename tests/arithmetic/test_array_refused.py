"""Arrays of t-digit numbers: what they refuse, and the cure that the message names."""

from __future__ import annotations

import operator
from collections.abc import Callable
from datetime import date
from typing import Any

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray, NegativeRootError, WholeNumberError
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
D4 = FloatFormat(10, 4)
B8 = FloatFormat(2, 8)


def rows(n: int) -> FloatArray:
    return D4.array(np.arange(1, n * n + 1).reshape(n, n))


V, W = D4.array(["1.5", "-2", "0"]), B8.array([1, 2, 3])
ONE, NAN = np.ones((2, 2)), float("nan")
HUGE, TINY = D4.array(["1", "1e400"]), D4.array(["-1e-400"])

BAD: list[tuple[str, Callable[[], Any], type[Exception], str]] = [
    # numbers
    ("nan", lambda: D4.array([1.0, NAN]), ValueError, "entry [1]: got nan; needed a finite number; remove or replace"),
    ("inf", lambda: D4.round(float("-inf")), ValueError, "got -inf; needed a finite number; remove or replace"),
    ("nan str", lambda: D4.round("NaN"), ValueError, "got 'NaN'; needed a finite number"),
    ("complex", lambda: D4.round(1 + 2j), TypeError, "got (1+2j) of type complex; needed a str, int, float, Decimal"),
    ("None", lambda: D4.array([1, None]), TypeError, "entry [1]: got None of type NoneType; needed a str, int"),
    ("bytes", lambda: D4.array([b"1"]), TypeError, "entry [0]: got b'1' of type bytes; needed a str, int"),
    ("bool", lambda: D4.array([True]), TypeError, "entry [0]: got the truth value True; needed a str, int, float, De"),
    ("comma", lambda: D4.array("1,5"), ValueError, "got '1,5'; needed a number such as '765.4567', '1e-3' or '1/3', w"),
    ("separators", lambda: D4.round("1_000"), ValueError, "with a point as decimal mark and no separators"),
    ("zero denominator", lambda: D4.round("1/0"), ValueError, "got '1/0'; needed a denominator other than zero"),
    ("date", lambda: D4.round(date(2026, 1, 1)), TypeError, "got datetime.date(2026, 1, 1) of type date; needed"),
    ("far in base 2", lambda: B8.array("1e99999999"), OverflowError, "got a decimal exponent of 99999999; needed at m"),
    # containers
    ("ragged", lambda: D4.array([[1, 2], [3]]), ValueError, "got nested lists with parts of shapes (1,), (2,); needed"),
    ("masked", lambda: D4.array(np.ma.array([1, 2])), TypeError, "got a masked array; needed an array without masked"),
    ("dict", lambda: D4.array({1: 2}), TypeError, "got a dict; needed a number, list or array; make it a list first"),
    ("generator", lambda: D4.array(i for i in "12"), TypeError, "got a generator; needed a number, list or array; mak"),
    ("object", lambda: D4.array(Rounding), TypeError, "needed a str, int, float, Decimal or Fraction"),
    ("no format", lambda: FloatArray(), TypeError, "needed a format; write fmt.array(values)"),  # type: ignore[call-arg]
    # formats
    ("base 1", lambda: FloatFormat(1, 4), ValueError, "base: got 1; needed an int of at least 2"),
    ("base 2.0", lambda: FloatFormat(2.0, 4), TypeError, "base: got 2.0 of type float; needed an int of at least 2"),
    ("precision 0", lambda: FloatFormat(10, 0), ValueError, "precision: got 0; needed an int of at least 1"),
    ("precision vast", lambda: FloatFormat(2, 10**12), ValueError, "precision: got 1000000000000 bits; needed at mo"),
    ("rounding int", lambda: FloatFormat(10, 4, 0), TypeError,
     "rounding: got 0 of type int; needed one of Rounding.NEAREST, Rounding.CHOP"),
    ("rounding str", lambda: FloatFormat(10, 4, "sideways"), ValueError,
     "got rounding 'sideways'; needed a Rounding or one of 'nearest', 'chop'"),
    # operands
    ("mixed +", lambda: V + W, ValueError, f"got operands in {D4} and {B8}; needed one format; convert one of them"),
    ("mixed roundings", lambda: V + FloatFormat(10, 4, CHOP).array(V), ValueError, "needed one format; convert one of"),
    ("mixed @", lambda: V @ W, ValueError, f"got operands in {D4} and {B8}; needed one format"),
    ("mixed concatenate", lambda: np.concatenate([V, W]), ValueError, "needed one format; convert one of them"),
    ("mixed solve", lambda: linalg.solve(rows(1), W[:1]), ValueError, "needed one format; convert one of them"),
    ("not representable", lambda: W + 0.1, ValueError,
     f"got the operand 0.1; needed a number that {B8} holds exactly; round it first by x.format.array(...), "
     "or compare x.to_float() with it"),
    ("not representable, long", lambda: V < 10**5000 + 1, WholeNumberError, "got the operand about 10**5000; needed"),
    ("not representable, left", lambda: np.array([1, 257, 3]) * W, WholeNumberError, "entry [1]: got the operand 257"),
    ("no number", lambda: V + None, TypeError, "got None of type NoneType; needed a str, int, float, Decimal or Fract"),
    ("bool operand", lambda: V * True, TypeError, "got the truth value True; needed"),
    ("broadcast", lambda: V + V[:2], ValueError, "add: got operands of shapes (3,) and (2,); needed shapes that broad"),
    ("broadcast fused", lambda: V.multiply_add(V, V[:2]), ValueError, "multiply_add: got operands of shapes (3,) and"),
    ("broadcast where", lambda: np.where([True, False], V, 0), ValueError, "where: got operands of shapes (2,) and (3"),
    ("interface", lambda: rows(3) @ rows(2), ValueError,
     "matmul: got shapes (3, 3) and (2, 2), so 3 columns against 2 rows; needed equal numbers; transpose or reshap"),
    ("stacks", lambda: D4.array(np.ones((2, 1, 1))) @ D4.array(np.ones((3, 1, 1))), ValueError, "matmul: got operands"),
    ("scalar matmul", lambda: V @ 2, ValueError, "matmul: got shapes (3,) and (); needed at least one axis each; use"),
    ("dot of stacks", lambda: np.dot(D4.array([ONE]), D4.array(ONE)), ValueError, "needed at most two axes each; use"),
    ("division", lambda: 1 / V, ZeroDivisionError, "got a division by zero at [2] of the divisor; needed a divisor ot"),
    ("negative root", lambda: np.sqrt(V), NegativeRootError, "got the square root of a negative number at [1]; needed"),
    ("power", lambda: V**0.5, DomainError, "got np.float_power of -2.0 and 0.5 at [1]; needed an argument for which"),
    ("power, right", lambda: (-2) ** (V / 4), DomainError, "got np.float_power of -2.0 and 0.375 at [0]; needed"),
    ("remainder", lambda: 2 % V, ZeroDivisionError, "got a division by zero at [2] of the divisor; needed a divisor"),
    ("select", lambda: np.select([V > 0], [V, V]), ValueError, "select: got 1 conditions and 2 choices; needed one c"),
    ("cross", lambda: np.cross(V, [1, 2]), ValueError, "cross: got shapes (3,) and (2,); needed vectors of length 3"),
    # use of an array
    ("assignment", lambda: operator.setitem(V, 0, 1), TypeError, "got an assignment to an entry of a FloatArray"),
    ("truth", lambda: bool(V), ValueError, "got the truth value of a FloatArray of shape (3,); needed one number; com"),
    ("float", lambda: float(V), TypeError, "got float() of a FloatArray of shape (3,); needed one number; use x.to_fl"),
    ("len", lambda: len(V[0]), TypeError, "got a FloatArray of a single number, which has no"),
    ("index", lambda: V[3], IndexError, "index 3 is out of bounds for axis 0 with size 3"),
    ("reshape", lambda: V.reshape(2, 2), ValueError, "cannot reshape array of size 3 into shape (2,2)"),
    ("axis", lambda: V.sum(1), np.exceptions.AxisError, "axis 1 is out of bounds for array of dimension 1"),
    ("axes", lambda: V.sum((0, 1)), TypeError, "axis: got (0, 1); needed an int or None; reduce one axis at a ti"),
    ("overflow", lambda: HUGE.to_float(), OverflowError,
     "got a number of about 10**400; needed one within the range of float64, 2**-1074 to 2**1024; scale it, or use"),
    ("too long", lambda: D4.round("1e99999999"), OverflowError, "got a number of about 10**99999999; needed an expone"),
    ("astype int", lambda: V.astype(int), TypeError, "got a conversion to dtype int64; needed float64 (nearest) or ob"),
    ("no copy", lambda: np.array(V, copy=False), ValueError, "got copy=False; needed True or None"),
    # NumPy
    ("np.spacing", lambda: np.spacing(V), TypeError, "got np.spacing of a FloatArray; needed one of absolute, add"),
    ("out", lambda: np.add(V, V, out=np.zeros(3)), TypeError, "got np.add with out of a FloatArray; needed one of"),
    ("np.median", lambda: np.median(V), TypeError, "got np.median of a FloatArray; needed one of"),
    ("np.linalg, cure", lambda: np.linalg.eig(rows(2)), TypeError, "for linear algebra see gpbnb.linalg; or convert:"),
    ("initial", lambda: np.sum(V, initial=1), TypeError, "needed np.sum(a, axis, keepdims)"),
    ("dtype", lambda: np.concatenate([V, V], dtype=float), TypeError, "got np.concatenate of a FloatArray with dtype;"),
    ("place", lambda: np.transpose(a=V), TypeError, "got np.transpose with a FloatArray in an unexpected place; neede"),
    # linear algebra
    ("dot of matrices", lambda: linalg.dot(rows(2), rows(2)), ValueError, "x: got shape (2, 2); needed 1 axis, (n,)"),
    ("dot of lists", lambda: linalg.dot([1], V), TypeError, "x: got list; needed a FloatArray; write fmt.array(x)"),
    ("matmul of array", lambda: linalg.matmul(V, ONE), TypeError, "b: got ndarray; needed a FloatArray; write fmt.arr"),
    ("not square", lambda: linalg.inv(D4.array([[1, 2]])), ValueError, "a: got shape (1, 2); needed a square matrix ("),
    ("right-hand side", lambda: linalg.solve(rows(2), V), ValueError, "b: got shape (3,) with a of shape (2, 2); need"),
    ("singular", lambda: linalg.inv(D4.array(ONE), pivot=True), np.linalg.LinAlgError,
     "got a zero pivot in column 2 of 2; needed one other than zero; the matrix is singular in this format; use more"),
    ("needs pivoting", lambda: linalg.lu(D4.array([[0, 1], [1, 0]])), np.linalg.LinAlgError,
     "got a zero pivot in column 1 of 2; needed one other than zero; try pivot=True; if that fails too, the matrix is"),
]  # fmt: skip


def test_bad_input() -> None:
    for _case, call, kind, message in BAD:
        before = [repr(x) for x in (V, W, HUGE, TINY)], ONE.tolist()
        with pytest.raises(Exception) as caught:  # noqa: PT011 (the kind and the message are compared exactly below)
            call()
        assert caught.type is kind
        assert message in str(caught.value)
        assert ([repr(x) for x in (V, W, HUGE, TINY)], ONE.tolist()) == before
