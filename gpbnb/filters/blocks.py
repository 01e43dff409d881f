"""Number formats for the blocks of a Kalman filter: state, gain, covariance, innovation covariance, and sums.

Each block computes in its own format and stores its results in it. What it takes from the model or from another block,
it rounds first, as a program does that converts a variable before it computes with it:

======================  ===========================================================================================
block                   what it computes
======================  ===========================================================================================
covariance              the predicted covariance and its update, or their factors
innovation              :math:`PH^T`, the innovation covariance and its inverse
gain                    the gain
state                   the predicted state and measurement, the innovation, and the estimate
sums                    sums of products in any block, which are rounded once when they are stored
======================  ===========================================================================================

The model is stored in the format of the four with the most digits; without limits of its exponents, if compiled loops
have such a format. They have none with the digits and the rounding of BINARY64, so it stores the model itself.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, cast

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.rounding import Rounding, digit_unit

BLOCKS = ("state", "gain", "covariance", "innovation")
"""Blocks that store numbers; the innovation block holds the innovation covariance."""


@dataclass(frozen=True)
class BlockFormats:
    """Formats for the blocks of a Kalman filter.

    Parameters
    ----------
    state, gain, covariance, innovation : formats with compiled loops, all of the same base; any rounding except
        stochastic.
    sums : format of sums of products, with at least as many digits as each block; base 2 or 16. By default, each
        product and each sum is rounded in the format of its block.

    Raises
    ------
    TypeError : a format is not a ``FloatFormat``.
    ValueError : formats of different bases; a format without compiled loops or with stochastic rounding; `sums` with
        too few digits.

    Examples
    --------
    Every block in binary32 except the covariance, which has double precision:

    >>> from gpbnb import BINARY32, BINARY64
    >>> print(BlockFormats.uniform(BINARY32).with_block("covariance", BINARY64))
    state 24, gain 24, covariance 53, innovation 24 bits
    """

    state: FloatFormat
    gain: FloatFormat
    covariance: FloatFormat
    innovation: FloatFormat
    sums: FloatFormat | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            fmt = getattr(self, field.name)
            if fmt is None and field.name == "sums":
                continue
            if not isinstance(fmt, FloatFormat):
                raise TypeError(f"got {field.name} {fmt!r}; needed a FloatFormat")
            if fmt.base != self.state.base:
                raise ValueError(
                    f"got base {fmt.base} for {field.name} and {self.state.base} for state; needed one base"
                )
            if fmt.rounding is Rounding.STOCHASTIC:
                raise ValueError(f"got stochastic rounding for {field.name}; needed another rounding")
            fmt.check_compiled()
        for name in BLOCKS:
            getattr(self, name).run_tag(sums=self.sums)

    @classmethod
    def uniform(cls, fmt: FloatFormat, sums: FloatFormat | None = None) -> BlockFormats:
        """Return block formats that are the same for all blocks."""
        return cls(fmt, fmt, fmt, fmt, sums)

    def with_block(self, name: str, fmt: FloatFormat | None) -> BlockFormats:
        """Return a copy in which one block has another format; the block may be "sums".

        Raises
        ------
        ValueError : there is no block of this name.
        """
        if name not in (*BLOCKS, "sums"):
            raise ValueError(f"got block {name!r}; needed one of {', '.join(map(repr, (*BLOCKS, 'sums')))}")
        changed: dict[str, Any] = {name: fmt}
        return replace(self, **changed)

    @property
    def model(self) -> FloatFormat:
        """The format in which the model is stored."""
        widest = max((getattr(self, name) for name in BLOCKS), key=lambda fmt: fmt.precision)
        unlimited = FloatFormat(widest.base, widest.precision, widest.rounding)
        return unlimited if isinstance(unlimited.backend, Compiled) else cast(FloatFormat, widest)

    def array(self, values: Any) -> FloatArray:
        """Round measurements into the format of the state."""
        return self.state.array(values)

    def __str__(self) -> str:
        each = [f"{name} {getattr(self, name).precision}" for name in BLOCKS]
        each += [] if self.sums is None else [f"sums {self.sums.precision}"]
        return f"{', '.join(each)} {digit_unit(self.state.base)}"
