"""Guarantees of models of any kind that have them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds import guarantee as of_filters
from gpbnb.bounds.guarantee import Guarantee
from gpbnb.bounds.guess import FilterLimits
from gpbnb.bounds.system import OutputBounds
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import whole_number
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.asked import admitted, checked_format
from gpbnb.wordlength.judges import largest_inputs
from gpbnb.wordlength.models import ModelSource


def guarantee(
    model: ModelSource,
    fmt: FloatFormat | FixedFormat | WordFormats | str,
    within: FilterLimits,
    *,
    form: Form | str | None = None,
    horizon: int = 1_000,
    most: int | None = None,
) -> Guarantee:
    """Bound the effect of rounding on a Kalman filter or a linear system, for all admissible measurements or inputs.

    Parameters
    ----------
    model : a Kalman filter without known inputs, or a linear system, as :func:`gpbnb.read_model` reads them.
    fmt : a format or its name; for a linear system also :class:`gpbnb.WordFormats`.
    within : limits from :func:`gpbnb.limits`; those of a linear system are limits on its inputs, `measurement`.
    form : form of a Kalman filter, by default the innovation form.
    horizon : the number of steps that the bound covers if no bound holds for ever.
    most : the largest number of steps to emulate while the gain of a filter settles; see
        :func:`gpbnb.bounds.guarantee.guarantee`, which lists the assumptions, too.

    Raises
    ------
    ValueError : a model without guarantees, where the message says what to use; limits for another model.
    TypeError : `within` is not a result of ``limits``, or `fmt` is not a format.

    Examples
    --------
    >>> from gpbnb import LinearSystem, limits
    >>> guarantee(LinearSystem.smoother("1/8"), "float32", limits(measurement=10))
    within 6.2e-06 for ever, in 24 bits, ties to even, exponents -126 to 127
    """
    given = admitted(model, "have a guarantee", "" if form is None else "have a form")
    named = checked_format(fmt, WordFormats)
    horizon = whole_number("horizon", horizon)
    if isinstance(given, LinearModel):
        return of_filters.guarantee(given, named, within, form or Form.INNOVATION, most, horizon)
    if most is not None:
        raise ValueError(f"got most={most} for {given.name}; needed none: only the gain of a Kalman filter settles")
    return _of_system(given, named, largest_inputs(given, within), horizon)


def _of_system(system: LinearSystem, fmt: Any, largest: NDArray[np.float64], horizon: int) -> Guarantee:
    linear = system.as_filter().program.is_linear
    why = system.unstable() if linear else ""
    for steps in (horizon,) if why else (None,) if linear else (None, horizon):
        try:
            bound, text = OutputBounds(system, largest, steps).proof(fmt)
            return Guarantee(bound, steps, why, fmt, text)
        except (ValueError, OverflowError) as error:
            why = str(error)
    return Guarantee(np.full(system.p, np.inf), 0, why, fmt)
