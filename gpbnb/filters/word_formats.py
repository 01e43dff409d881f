"""Number formats for the words of a fixed-point processor: data, coefficients and sums."""

from __future__ import annotations

from dataclasses import dataclass

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.rounding import Rounding, digits_text


@dataclass(frozen=True)
class WordFormats:
    """Number formats for data, coefficients and sums in a fixed-point processor.

    Parameters
    ----------
    data : format of inputs, states, outputs, and of each result that is stored.
    coefficients : format of all coefficients; or a number of significant bits, where each coefficient has its own
        binary point. By default the format of the data.
    sums : format of the accumulator, with at least as many fraction bits as the data; by default there is no
        accumulator, and each product and each sum is stored in the format of the data.

    Raises
    ------
    TypeError : a format that is not fixed point, or bits that are not a whole number.
    ValueError : a number of bits below 1; stochastic rounding; sums with fewer fraction bits than the data.

    Examples
    --------
    Coefficients in Q14, data in Q15, sums of 32 bits with one rounding when they are stored:

    >>> from gpbnb import FixedFormat
    >>> words = WordFormats(data=FixedFormat(0, 15), coefficients=FixedFormat(1, 14), sums=FixedFormat(2, 29))
    >>> words.gap
    14
    """

    data: FixedFormat
    coefficients: FixedFormat | int | None = None
    sums: FixedFormat | None = None

    def __post_init__(self) -> None:
        if isinstance(self.coefficients, int) and not isinstance(self.coefficients, bool):
            if self.coefficients < 1:
                raise ValueError(f"got {self.coefficients} bits for coefficients; needed at least 1")
        elif self.coefficients is not None and not isinstance(self.coefficients, FixedFormat):
            raise TypeError(f"got coefficients {self.coefficients!r}; needed a FixedFormat or a number of bits")
        for name, fmt in (("data", self.data), ("sums", self.sums)):
            if fmt is None and name == "sums":
                continue
            if not isinstance(fmt, FixedFormat):
                raise TypeError(f"got {name} {fmt!r}; needed a FixedFormat")
            if fmt.rounding is Rounding.STOCHASTIC:
                raise ValueError(f"got stochastic rounding for the {name}; needed another rounding for integers")
        if self.sums is not None and self.sums.fraction_bits < self.data.fraction_bits:
            raise ValueError(
                f"got sums with {self.sums.fraction_bits} fraction bits and data with {self.data.fraction_bits}; "
                "needed at least as many for the sums"
            )

    @property
    def accumulator(self) -> FixedFormat:
        """The format in which products and sums are computed; the format of the data if there is no accumulator."""
        return self.data if self.sums is None else self.sums

    @property
    def gap(self) -> int:
        """Number of fraction bits that a sum loses when it is stored."""
        return self.accumulator.fraction_bits - self.data.fraction_bits

    def __str__(self) -> str:
        def named(fmt: FixedFormat) -> str:
            return f"{1 + fmt.precision} bits with {fmt.fraction_bits} after the point"

        text = f"data of {named(self.data)}"
        if isinstance(self.coefficients, FixedFormat):
            text += f", coefficients of {named(self.coefficients)}"
        elif self.coefficients is not None:
            text += f", coefficients of {digits_text(self.coefficients, kind='significant')}"
        return text + (f", sums of {named(self.sums)}" if self.sums is not None else "")
