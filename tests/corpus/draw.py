"""Seeded inputs of runs: formats, models, signals and operands, as plain numbers that any code can read."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple
from zlib import crc32

Matrix = list[list[Fraction]]

ROUNDINGS = ("nearest", "chop", "even", "up", "down", "odd")
PRECISIONS = {
    2: (3, 4, 5, 8, 11, 16, 24, 25, 33, 40, 52, 53),
    10: (3, 4, 5, 7, 8, 12, 15, 16, 17, 18),
    16: (3, 4, 6, 9, 12, 13),
}
LONG = {2: (54, 60, 64, 113), 3: (3, 4, 6, 10, 17, 33, 34, 40, 64), 10: (19, 25, 34, 64), 16: (14, 28, 64)}
"""Precisions without compiled loops, and base 3."""


class Float(NamedTuple):
    """A floating-point format."""

    base: int
    precision: int
    rounding: str = "nearest"
    emin: int | None = None
    emax: int | None = None
    subnormal: bool = True
    overflow: str = "raise"
    largest: Fraction | None = None

    def __str__(self) -> str:
        text = f"{self.precision} of base {self.base} {self.rounding}"
        if self.emin is not None:
            text += f" {self.emin} to {self.emax}{'' if self.subnormal else ' flushed'}"
        return text if self.overflow == "raise" else f"{text} {self.overflow}"


class Fixed(NamedTuple):
    """A fixed-point format."""

    integer: int
    fraction: int
    rounding: str = "nearest"
    overflow: str = "raise"

    def __str__(self) -> str:
        return f"Q{self.integer}.{self.fraction} {self.rounding} {self.overflow}"


Format = Float | Fixed

PROCESSORS = {
    "BINARY16": Float(2, 11, "even", -14, 15),
    "BINARY32": Float(2, 24, "even", -126, 127),
    "BINARY64": Float(2, 53, "even", -1022, 1023),
    "BINARY128": Float(2, 113, "even", -16382, 16383),
    "BFLOAT16": Float(2, 8, "even", -126, 127),
    "TF32": Float(2, 11, "even", -126, 127),
    "FP8_E5M2": Float(2, 3, "even", -14, 15),
    "FP8_E4M3": Float(2, 4, "even", -6, 8, largest=Fraction(448)),
    "DECIMAL32": Float(10, 7, "even", -95, 96),
    "DECIMAL64": Float(10, 16, "even", -383, 384),
    "DECIMAL128": Float(10, 34, "even", -6143, 6144),
    "IBM_HEX32": Float(16, 6, "chop", -65, 62, False),
    "IBM_HEX64": Float(16, 14, "chop", -65, 62, False),
}  # fmt: skip


class Model(NamedTuple):
    """A linear model: cycles of matrices, a first estimate and its covariance, and optional known inputs."""

    Phi: list[Matrix]
    H: list[Matrix]
    Q: list[Matrix]
    R: list[Matrix]
    x0: list[Fraction]
    P0: Matrix
    inputs: dict[str, Any] = {}  # noqa: RUF012  # B, u, b and d

    @property
    def n(self) -> int:
        return len(self.x0)

    @property
    def m(self) -> int:
        return len(self.H[0])


class Draw:
    """Random choices that follow from a name; only ``random()`` is used, whose sequence Python keeps."""

    def __init__(self, name: str, seed: int = 0) -> None:
        self.seed = crc32(f"{name} {seed}".encode())
        self.random = random.Random(self.seed).random

    def below(self, limit: int) -> int:
        """A whole number from 0 to limit - 1."""
        if limit < 2**40:
            return int(self.random() * limit)
        words = (int(self.random() * 2**40) << 40 * i for i in range(limit.bit_length() // 40 + 2))
        return sum(words) % limit

    def between(self, low: int, high: int) -> int:
        return low + self.below(high - low + 1)

    def chance(self, share: float) -> bool:
        return self.random() < share

    def pick(self, choices: Sequence[Any]) -> Any:
        return choices[self.below(len(choices))]

    def number(self, size: float = 1, decimals: int = 2) -> Fraction:
        """A decimal number of at most a size."""
        most = int(size * 10**decimals)
        return Fraction(self.between(-most, most), 10**decimals)

    # -- formats --------------------------------------------------------------------------------------------

    def ranged(self, fmt: Float, share: float = 0.5) -> Float:
        """The format with a range that its numbers sometimes reach, or as it is."""
        if not self.chance(share):
            return fmt
        if fmt.base == 2 and fmt.precision == 53 and fmt.rounding == "nearest":
            return fmt  # has no loops with a range
        reach = self.between(8, 40) if fmt.base < 10 else self.between(3, 12) + 40 * (fmt.base == 10)
        return fmt._replace(emin=-reach, emax=reach + self.below(9), subnormal=self.chance(0.6))

    def floating(self, index: int, bases: Sequence[int] = (2, 10, 16), table: Any = PRECISIONS) -> Float:
        """A format whose base and rounding take turns with the index."""
        base = bases[index % len(bases)]
        return self.ranged(
            Float(base, self.pick(table[base]), ROUNDINGS[(index % len(bases) + index // len(bases)) % 6])
        )

    def fixed(self, index: int, integer: int, overflows: Sequence[str] = ("raise", "saturate", "wrap")) -> Fixed:
        fraction = (4, 9, 15, 23, 31, 40)[index % 6]
        return Fixed(integer, fraction, ROUNDINGS[(index + index // 6) % 6], overflows[index % len(overflows)])

    # -- models and signals ---------------------------------------------------------------------------------

    def matrix(self, rows: int, columns: int, size: float = 1, decimals: int = 2, zeros: float = 0.0) -> Matrix:
        return [
            [Fraction(0) if self.chance(zeros) else self.number(size, decimals) for _ in range(columns)]
            for _ in range(rows)
        ]

    def covariance(self, n: int, size: float, least: Fraction) -> Matrix:
        """A covariance with correlations, and at least this much on its diagonal."""
        root = self.matrix(n, n, size, 2, 0.4)
        return [
            [sum((a * b for a, b in zip(root[i], root[j], strict=True)), least * (i == j)) for j in range(n)]
            for i in range(n)
        ]

    def model(self, n: int, m: int, inputs: bool = False) -> Model:
        """A filter that is stable or nearly so, with cycles of one to three sensors; some see nothing in a step."""
        few = 0.6 / max(n - 1, 1)
        Phi = [self.matrix(n, n, few, 3, 0.5) for _ in range(self.pick((1, 1, 2)))]
        for each in Phi:
            for i in range(n):
                each[i][i] = Fraction(self.between(60, 100), 100)
        H = [self.matrix(m, n, 2, 2, 0.3) for _ in range(self.between(1, 3))]
        if self.chance(0.2):
            H[-1] = [[Fraction(0)] * n for _ in range(m)]
        Q = [self.covariance(n, 0.3, Fraction(self.below(2), 100)) for _ in range(self.pick((1, 1, 2)))]
        R = [self.covariance(m, 0.8, Fraction(1, 4)) for _ in range(self.pick((1, 1, 3)))]
        known: dict[str, Any] = {}
        if inputs:
            p = self.between(1, 2)
            known = {"B": [self.matrix(n, p)], "u": self.matrix(64, p), "b": [[self.number() for _ in range(n)]]}
            known |= {"d": [[self.number() for _ in range(m)]]}
        x0 = [self.number(5) for _ in range(n)]
        return Model(Phi, H, Q, R, x0, self.covariance(n, 1.5, Fraction(1, 2)), known)

    def signal(self, steps: int, m: int, size: float = 4) -> Matrix:
        return self.matrix(steps, m, size)

    # -- operands -------------------------------------------------------------------------------------------

    def significand(self, base: int, digits: int) -> int:
        """A significand with `digits` digits: random, short, or beside a power of the base."""
        least, limit = base ** (digits - 1), base**digits
        kind = self.below(4)
        if kind == 0:
            return self.pick((least, limit - 1)) if digits == 1 else self.pick((least, least + 1, limit - 1, limit - 2))
        whole = least + self.below(limit - least)
        zeros = base ** self.below(digits) if kind == 1 else 1
        return max(whole // zeros * zeros, least)

    def value(self, fmt: Format, low: int, high: int) -> Fraction:
        """A number of a format, of a size from base**low to base**high."""
        if isinstance(fmt, Fixed):
            bits = self.between(1, fmt.integer + fmt.fraction)
            return self.pick((1, -1)) * Fraction(self.below(2**bits), 2**fmt.fraction)
        sign = self.pick((1, -1)) * (not self.chance(0.05))
        e = self.between(low, high) - fmt.precision + 1
        if fmt.emin is not None and e < fmt.emin - fmt.precision + 1:
            digits = max(fmt.precision - (fmt.emin - fmt.precision + 1 - e), 1) if fmt.subnormal else fmt.precision
            e = fmt.emin - fmt.precision + 1
            return sign * self.significand(fmt.base, digits) * Fraction(fmt.base) ** e
        return sign * self.significand(fmt.base, fmt.precision) * Fraction(fmt.base) ** e

    def operands(self, fmt: Format, operation: str, count: int, rounds: Callable[[Fraction], Fraction]) -> list[Any]:
        """Operands: random, or such that the result is a tie or nearly one, cancels, carries or underflows."""
        found = []
        while len(found) < count:
            given = [self.value(fmt, *self._sizes(fmt)) for _ in range(ARITY.get(operation, 1))]
            if len(given) > 1 and self.chance(0.6):
                given = self._hard(fmt, operation, given)
            try:
                given = [rounds(each) for each in given]
            except OverflowError:
                continue
            if operation in ("divide", "fmod", "remainder") and not given[1]:
                continue
            found.append([abs(given[0])] if operation == "sqrt" else given)
        return found

    def _sizes(self, fmt: Format) -> tuple[int, int]:
        if isinstance(fmt, Fixed) or fmt.emin is None:
            return -6, 6
        assert fmt.emax is not None
        if fmt.emax - fmt.emin > 400 and self.chance(0.5):
            return -6, 6
        return self.pick(((-3, 3), (-3, 3), (fmt.emin - fmt.precision + 1, fmt.emin + 2), (fmt.emax - 2, fmt.emax),
                          (fmt.emin // 2 - 2, fmt.emin // 2 + 2), (fmt.emax // 2 - 2, fmt.emax // 2 + 1)))  # fmt: skip

    def _hard(self, fmt: Format, operation: str, given: list[Fraction]) -> list[Fraction]:
        x, y, *rest = given
        if not x or not y:
            return given
        unit = abs(x) / 2 ** self.between(1, 4) if isinstance(fmt, Fixed) else _last_digit(x, fmt)
        near = unit * self.between(-2, 2)
        if operation in ("add", "subtract"):
            y = self.pick((near - x, x + near, unit / 2 + near / fmt_base(fmt) ** 3, unit / 2, near))
        elif operation == "divide":
            x = self.pick(((x + unit / 2) * y, x * y))
        elif operation == "multiply":
            y = self.pick((y, (x + unit / 2) / y))
        elif operation == "fused":
            rest = [self.pick((near - x * y, unit * y / 2, x * y * near / x))]
        return [x, y, *rest]


ARITY = {
    "add": 2, "subtract": 2, "multiply": 2, "divide": 2, "fused": 3, "fmod": 2, "remainder": 2, "maximum": 2,
    "arctan2": 2, "hypot": 2, "float_power": 2,
}  # fmt: skip


def fmt_base(fmt: Format) -> int:
    return 2 if isinstance(fmt, Fixed) else fmt.base


def _last_digit(x: Fraction, fmt: Float) -> Fraction:
    """The unit of the last digit of x, or its neighbour's."""
    e, size = 0, abs(x)
    while size >= Fraction(fmt.base) ** (e + 1):
        e += 1 if e < 64 else 64
    while size < Fraction(fmt.base) ** e:
        e -= 1 if e > -64 else 64
    return Fraction(fmt.base) ** (e - fmt.precision + 1)
