"""Integer arithmetic in C99 for generated filters: rounding, overflow, and 128 bits where products need them.

Each helper is a function in C. A file contains only the helpers that it uses, so that it compiles without a warning. No
operation has an undefined or implementation-defined result.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.words import WordFormats

NARROW = {32: 30, 64: 62}
"""Bits of a C type, and how many bits without the sign the intermediate results may have."""

LONGEST_SHIFT = 126
"""Fraction bits that the helpers for 128 bits can take from a product."""

_UP = {
    Rounding.NEAREST: "rest > half || (rest == half && value >= 0)",
    Rounding.EVEN: "rest > half || (rest == half && (floor_ & 1))",
    Rounding.HALF_UP: "rest >= half",
    Rounding.CHOP: "rest > 0 && value < 0",
    Rounding.UP: "rest > 0",
    Rounding.DOWN: "0",
    Rounding.ODD: "rest > 0 && !(floor_ & 1)",
}
"""When a number rounds up from its floor; `rest` is what the floor leaves, `half` half a unit."""

_AWAY = {
    Rounding.NEAREST: "rest >= size - rest",
    Rounding.EVEN: "rest > size - rest || (rest == size - rest && (found & 1))",
    Rounding.HALF_UP: "rest > size - rest || (rest == size - rest && !negative)",
    Rounding.CHOP: "0",
    Rounding.UP: "rest > 0 && !negative",
    Rounding.DOWN: "rest > 0 && negative",
    Rounding.ODD: "rest > 0 && !(found & 1)",
}
"""When the size of a quotient grows by one; `rest` is what is left of the divisor, `size` the divisor."""


_ROOT_GROWS = {
    Rounding.NEAREST: "rest > found",
    Rounding.EVEN: "rest > found",
    Rounding.HALF_UP: "rest > found",
    Rounding.CHOP: "0",
    Rounding.UP: "rest > 0",
    Rounding.DOWN: "0",
    Rounding.ODD: "rest > 0 && !(found & 1)",
}
"""When a square root grows by one; `rest` is what is left of its argument. No root is a tie."""

_WHOLE = {
    "floor": Rounding.DOWN,
    "ceil": Rounding.UP,
    "trunc": Rounding.CHOP,
    "rint": Rounding.EVEN,
}
"""How each function of C finds a whole number."""

LONGEST_RADICAND = 122
"""Bits of an argument whose square root the helpers find."""

_WIDE = """#ifndef __SIZEOF_INT128__
#error "Words of more than 32 bits need __int128, which gcc and clang have for 64-bit processors."
#endif
__extension__ typedef __int128 wide;
__extension__ typedef unsigned __int128 uwide;
"""


def word_bits(fmt: FixedFormat) -> int | None:
    """Return the bits of the C type that holds a word, 16, 32 or 64; None if there is none."""
    return next((bits for bits in (16, 32, 64) if 1 + fmt.precision <= bits), None)


def radicand_bits(fmt: FixedFormat) -> int:
    """The bits of a word shifted left by its fraction bits; the integer square root of this is the word's root."""
    bits = fmt.precision + fmt.fraction_bits
    if fmt.fraction_bits < 0 or bits > LONGEST_RADICAND:
        raise ValueError(
            f"got a square root of {1 + fmt.precision} bits with {fmt.fraction_bits} after the point; needed at least "
            f"none, and at most {LONGEST_RADICAND} together with those of the word"
        )
    return bits


class Needs(NamedTuple):
    """What a filter in words needs: bits of intermediate results without sign, and largest shift of a product."""

    bits: int
    shift: int


@dataclass(frozen=True)
class Integers:
    """The helpers in C for some formats of words.

    Parameters
    ----------
    words : the formats.
    needs : what the operations need.
    """

    words: WordFormats
    needs: Needs

    @property
    def bits(self) -> int:
        """Bits of the type of intermediate results: 32, 64 or 128."""
        most = max(self.needs)
        return next((bits for bits, room in NARROW.items() if most <= room), 128)

    @property
    def value(self) -> str:
        """Type of the results of operations."""
        return "int32_t" if self.bits == 32 else "int64_t"

    @property
    def wide(self) -> str:
        """Type of intermediate results."""
        return "wide" if self.bits == 128 else self.value

    @property
    def raises(self) -> bool:
        """Whether an overflow ends a run."""
        formats = [self.words.data, self.words.accumulator]
        return any(each.overflow == "raise" for each in formats)

    def literal(self, n: int) -> str:
        """Return an integer as a constant in C."""
        if n == -(2**63):
            return "(-INT64_C(9223372036854775807) - 1)"
        return f"INT64_C({n})" if abs(n) >= 2**31 else str(n)

    def functions(self) -> dict[str, str]:
        """Return all helpers by name, each after those that it uses."""
        overflow = ", int *overflow" if self.raises else ""
        passed = ", overflow" if self.raises else ""
        V, W, gap = self.value, self.wide, self.words.gap
        data, sums = self.words.data, self.words.accumulator
        found = {"wide": _WIDE} if self.bits == 128 else {}
        for each in _UP:
            found[f"rounded_{each.name.lower()}"] = self._rounded(each)
        for name, fmt in (("data", data), ("sums", sums)):
            found[f"in_{name}"] = self._kept(name, fmt)
        first = "sums" if self.words.sums is not None else "data"
        mode = (sums if self.words.sums is not None else data).rounding.name.lower()
        found["multiply"] = _function(
            f"/* c x, which loses `shift` fraction bits, in the format of the {first} */",
            f"static {V} multiply({V} c, {V} x, int shift{overflow})",
            [f"return in_{first}(rounded_{mode}(({W})c * x, shift){passed});"],
        )
        found["lifted"] = _function(
            f"/* a number of the data in units of the {first} */",
            f"static {W} lifted({V} x)",
            [f"return x * (({W})1 << {gap});"],
        )
        for name, sign in (("add", "+"), ("subtract", "-")):
            head = f"static {V} {name}({W} a, {W} b{overflow})"
            found[name] = _function("", head, [f"return in_{first}(a {sign} b{passed});"])
        found["store"] = _function(
            "/* a sum in the format of the data, rounded once */",
            f"static {V} store({V} x{overflow})",
            [f"return in_data(rounded_{data.rounding.name.lower()}(x, {gap}){passed});"],
        )
        found["divide"] = self._quotient(overflow, passed)
        found["modulo"] = _function(
            "/* what a / b, toward zero, leaves of a; the step itself notes a divisor of zero */",
            f"static {V} modulo({V} a, {V} b)",
            ["return b == 0 || b == -1 ? 0 : a % b;"],
        )
        found["modulus"] = modulus(V, "modulo(x, y)")
        found["root"] = self._root(overflow, passed)
        for name, rounding in _WHOLE.items():
            found[f"whole_{name}"] = self._whole(name, rounding, overflow, passed)
        return found

    def text(self, body: str) -> str:
        """Return the helpers that a piece of code uses, directly or through others."""
        functions = self.functions()
        used = {name for name in functions if re.search(rf"\b{name}\b", body)}
        while more := {
            name
            for name in functions
            for user in used
            if name not in used and re.search(rf"\b{name}\b", functions[user])
        }:
            used |= more
        return "\n".join(text for name, text in functions.items() if name in used)

    def _rounded(self, rounding: Rounding) -> str:
        W, up = self.wide, _UP[rounding]
        lines = {
            "": f"{W} {', '.join(_declared(up))};",
            "1": f"if (shift <= 0)\n        return value * (({W})1 << -shift);",
            "floor_": "floor_ = value >= 0 ? value >> shift : -1 - ((-1 - value) >> shift);",
            "rest": f"rest = value - floor_ * (({W})1 << shift);",
            "half": f"half = ({W})1 << (shift - 1);",
            "2": "return floor_;" if up == "0" else f"return floor_ + ({up} ? 1 : 0);",
        }
        chosen = [line for name, line in lines.items() if name not in ("rest", "half") or name in _declared(up)]
        comment = f"/* value / 2**shift, {_describe(rounding)} */"
        return _function(comment, f"static {W} rounded_{rounding.name.lower()}({W} value, int shift)", chosen)

    def _kept(self, name: str, fmt: FixedFormat) -> str:
        V = self.value
        low, high = (self.literal(int(each / fmt.unit)) for each in (fmt.lowest, fmt.largest))
        mask, sign = f"UINT64_C({2 ** (fmt.precision + 1) - 1})", f"UINT64_C({2**fmt.precision})"
        lines = {
            "saturate": [f"if (x < {low})\n        return {low};", f"return x > {high} ? {high} : ({V})x;"],
            "wrap": [
                f"const uint64_t bits = (uint64_t)x & {mask};",
                f"return bits & {sign} ? -1 - ({V})(~bits & {mask}) : ({V})bits;",
            ],
            "raise": [
                f"if (x < {low} || x > {high}) {{\n        *overflow = 1;\n        return 0;\n    }}",
                f"return ({V})x;",
            ],
        }[fmt.overflow]
        if self.raises and fmt.overflow != "raise":
            lines.insert(len(lines) - 1, "(void)overflow;")
        what = {"saturate": "or the nearest of the format", "wrap": "wrapped around", "raise": "which must fit"}
        comment = f"/* x in the {1 + fmt.precision} bits of the {name}, {what[fmt.overflow]} */"
        head = f"static {V} in_{name}({self.wide} x{', int *overflow' if self.raises else ''})"
        return _function(comment, head, lines)

    def _quotient(self, overflow: str, passed: str) -> str:
        V, W, U, data = self.value, self.wide, f"u{self.wide}", self.words.data
        up, down = max(data.fraction_bits, 0), max(-data.fraction_bits, 0)
        away = _AWAY[data.rounding]
        lines = [
            "const int negative = (a < 0) != (b < 0);",
            f"const {U} top = ({U})(a < 0 ? -({W})a : a) << {up};",
            f"const {U} size = ({U})(b < 0 ? -({W})b : b) << {down};",
            f"{U} found{', rest' if 'rest' in away else ''};",
            "if (b == 0)\n        return 0;",
            "found = top / size;",
            *(["rest = top % size;"] if "rest" in away else []),
            *([f"if ({away})\n        found++;"] if away != "0" else []),
            f"return in_data(negative ? -({W})found : ({W})found{passed});",
        ]
        comment = f"/* a / b, {_describe(data.rounding)}; the step itself notes a divisor of zero */"
        return _function(comment, f"static {V} divide({V} a, {V} b{overflow})", lines)

    def _root(self, overflow: str, passed: str) -> str:
        V, point, grows = self.value, self.words.data.fraction_bits, _ROOT_GROWS[self.words.data.rounding]
        bits = self.words.data.precision + point
        lines = [
            "const uint64_t top = a < 0 ? 0 : (uint64_t)a;",
            "uint64_t found = 0, rest = 0;",
            "int i;",
            f"for (i = {(bits + 1) // 2 * 2 - 1}; i > 0; i -= 2) {{",
            f"    rest = rest << 1 | (i < {point} ? 0 : top >> (i - {point}) & 1);",
            f"    rest = rest << 1 | (i <= {point} ? 0 : top >> (i - {point} - 1) & 1);",
            "    found <<= 1;",
            "    if (rest > 2 * found) {",
            "        rest -= 2 * found + 1;",
            "        found++;",
            "    }",
            "}",
            *([f"if ({grows})", "    found++;"] if grows != "0" else []),
            f"return in_data(({self.wide})found{passed});",
        ]
        comment = f"/* square root, {_describe(self.words.data.rounding)}; the step itself notes a negative argument */"
        return _function(comment, f"static {V} root({V} a{overflow})", lines)

    def _whole(self, name: str, rounding: Rounding, overflow: str, passed: str) -> str:
        V, point = self.value, max(self.words.data.fraction_bits, 0)
        found = f"rounded_{rounding.name.lower()}(a, {point}) * (({self.wide})1 << {point})"
        comment = f"/* a whole number, {_describe(rounding)} */"
        return _function(comment, f"static {V} whole_{name}({V} a{overflow})", [f"return in_data({found}{passed});"])


def modulus(value: str, rest: str) -> str:
    """Return the function in C for ``np.remainder``, from what a division toward zero leaves."""
    return f"""/* x - y floor(x / y) */
static {value} modulus({value} x, {value} y)
{{
    const {value} rest = {rest};
    return (rest < 0 && y > 0) || (rest > 0 && y < 0) ? rest + y : rest;
}}
"""


def _function(comment: str, head: str, lines: list[str]) -> str:
    return f"{comment}{comment and chr(10)}{head}\n{{\n    " + "\n    ".join(lines) + "\n}\n"


def _declared(up: str) -> list[str]:
    """Name the numbers that a rounding needs."""
    return ["floor_", *(each for each in ("rest", "half") if each in up)]


def _describe(rounding: Rounding) -> str:
    return {
        Rounding.NEAREST: "to nearest, ties away from zero",
        Rounding.EVEN: "to nearest, ties to even",
        Rounding.HALF_UP: "to nearest, ties up",
        Rounding.CHOP: "toward zero",
        Rounding.UP: "up",
        Rounding.DOWN: "down",
        Rounding.ODD: "to odd",
    }[rounding]
