r"""What a filter starts with in a format: its model as stored and, for the UD form, factors of the covariances.

Every run, bound and guarantee opens a filter here, from the model as given. In t digits, factoring a covariance that is
close to singular can give a negative pivot although the stored covariance is definite. Its variances *as given* are
then raised by a share δ of themselves, doubled until the factors are definite, and stored and factored again. So
factors have an error of their own,

.. math:: \hat U\hat D\hat U^T = M + \delta M ,

which holds the roundings of the factoring and what the raised variances add. The exact filter with which a run is
compared, or for which a bound holds, has the stored M without δM, in every form: it is given by the model, the format
and the measurements, and the error of a UD form includes that of its factors. Where a covariance is already indefinite
as stored, no exact filter exists; there, the raised covariance *is* the stored one, for the exact filter as for all
forms, see :mod:`gpbnb.filters.covariance`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled, double_doubles
from gpbnb.arithmetic.kernels.tags import Tag
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import digit_unit
from gpbnb.filters.covariance import LARGEST_STORED_SHIFT, Repair, least_shift, raised_until
from gpbnb.filters.factors import factors_of_each, inverses_of_each, roots_of_each
from gpbnb.filters.forms import ROOTS, Form
from gpbnb.filters.model import LinearModel, different_entries, remembered, stored_arrays
from gpbnb.filters.named import naming
from gpbnb.filters.pairs import nearest_double_doubles
from gpbnb.filters.steps import FACTORED


class Opening(NamedTuple):
    """What a run starts with, as the compiled loops expect it; its arrays may be those of other runs.

    Parameters
    ----------
    x0, P0 : (n,) and (n, n); P0 is factors in the UD form, with D on the diagonal, or a root.
    letters : matrices by their letters, each with its own cycle: Phi, H, Q and R, or UQ and UR, factors in the UD form,
        in forms with roots a root of Q and factors of R. RI are inverses of R in Hung's form with the second gain, and
        B, u, b and d known inputs and offsets.
    repairs : all changes of covariances: those of the model, and variances that were raised until their factors were
        definite.
    """

    x0: NDArray[Any]
    P0: NDArray[Any]
    letters: dict[str, NDArray[Any]]
    repairs: tuple[Repair, ...]


def opening(model: LinearModel, fmt: FloatFormat | None, form: Form, tag: Tag) -> Opening:
    """Return what a filter starts with in a format, None for double-double.

    The model is as given, not as stored, because UD factors are computed from the variances as given. Factors and
    inverses take their random numbers from the arithmetic of the run, too.
    """
    stored = model if fmt is None else model.definite_in(fmt)
    letters = dict(_double_doubles(stored) if fmt is None else _packed(stored, fmt))
    x0, P0, raised, lost = letters.pop("x0"), letters.pop("P0"), list[Repair](), ""
    if model.u is not None and model.u.ndim == 1:
        letters["u"] = letters["u"][np.newaxis]

    def factored(letter: str, packed: NDArray[Any]) -> NDArray[Any] | None:
        """Return factors, of raised variances if those stored are indefinite; None if none are definite."""
        factors = np.zeros_like(packed)

        def sound(given: NDArray[Any]) -> bool:
            definite = factors_of_each(fmt, tag, given, factors)
            signs = factors[..., 0] if factors.ndim > 3 else factors
            return definite and (letter != "R" or bool(np.all(np.diagonal(signs, axis1=1, axis2=2) > 0)))

        if sound(packed):
            return factors
        if model.repair is False:
            return None
        matrices = getattr(stored, letter)
        found = raised_until(
            matrices.reshape(-1, *matrices.shape[-2:]),
            lambda higher: sound(as_packed(fmt, higher)),
            least_shift(fmt),
            LARGEST_STORED_SHIFT,
        )
        if found is None:
            return None
        raised.append(Repair(letter, 0, 0.0, found[1], fmt))
        return factors

    try:
        if form is Form.HUNG_SECOND_GAIN:
            letters["RI"] = np.zeros_like(letters["R"])
            lost = "" if inverses_of_each(fmt, tag, letters["R"], letters["RI"]) else "R"
        elif form in FACTORED:
            for letter, packed in (("Q", letters.pop("Q")), ("R", letters.pop("R")), ("P0", P0[np.newaxis])):
                factors = factored(letter, packed)
                if factors is None:
                    lost = letter
                    break
                letters[f"U{letter}"] = factors
            else:
                P0 = letters.pop("UP0")
                if form in ROOTS:
                    letters["UQ"], P0 = roots_of_each(fmt, tag, letters["UQ"]), roots_of_each(fmt, tag, P0)
                P0 = P0[0]
    except ZeroDivisionError:
        lost = "R"
    except OverflowError as error:
        what = "the inverse of R" if form is Form.HUNG_SECOND_GAIN else "factors of covariances"
        where = "double-double" if fmt is None else format_text(fmt)
        raise OverflowError(f"{error} in {what}; needed numbers within the range of {where}; scale the model") from None
    if lost:
        words, unit = ("double-double", "bits") if fmt is None else (format_text(fmt), digit_unit(fmt.base))
        kind = "positive definite" if lost == "R" else "positive semidefinite"
        raise ValueError(
            f"got {model.name} in {words}, in which {lost} does not stay {kind} when its factors or inverse are "
            f"computed; needed a covariance that does; use more {unit}, or add a little to the diagonal of {lost}"
        )
    return Opening(x0, P0, letters, (*stored.repairs, *raised))


def as_packed(fmt: FloatFormat | FixedFormat | None, values: Any) -> NDArray[Any]:
    """Round numbers into a format, None for double-double, and return them as the compiled loops expect them."""
    if fmt is None:
        if hasattr(values, "to_fractions"):
            return double_doubles_of(values)
        entries = np.asarray(values)
        if entries.dtype == np.float64:
            if not np.isfinite(entries).all():
                raise ValueError("got measurements with NaN or infinity; needed finite numbers")
            return np.stack([entries, np.zeros_like(entries)], axis=-1)
        return double_doubles(exact(entries))
    return packed_array(fmt.array(values))


def stored_start(fmt: FloatFormat | FixedFormat, x0: Any) -> FloatArray:
    """Round a first state into a format."""
    with naming("x0"):
        return fmt.store(x0)


def double_doubles_of(array: FloatArray) -> NDArray[np.float64]:
    """Round the numbers of an array to the nearest double-doubles, (..., 2); exact in base 2 and 16."""
    if isinstance(array.backend, Compiled):
        return nearest_double_doubles(array.backend.pack(array.components))
    return double_doubles(exact(array))


def packed_array(array: FloatArray) -> NDArray[Any]:
    """Convert an array to the form that the compiled loops of its format expect."""
    if not isinstance(array.backend, Compiled):
        array.format.check_compiled()
        cure = "" if array.format.base == 10 else ", or use base 10"
        raise OverflowError(
            f"got numbers beyond the range of the compiled loops of {array.format}; needed others; "
            f"scale the states{cure}"
        )
    return array.backend.pack(array.components)


@remembered
def _double_doubles(model: LinearModel) -> dict[str, NDArray[np.float64]]:
    return {letter: double_doubles(values)[places] for letter, (values, places) in different_entries(model).items()}


def _packed(model: LinearModel, fmt: FloatFormat) -> dict[str, NDArray[Any]]:
    """The matrices by their letters, as the compiled loops expect them."""
    packed = {}
    for letter, each in stored_arrays(model, fmt).items():
        with naming(letter):
            packed[letter] = packed_array(each)
    return packed
