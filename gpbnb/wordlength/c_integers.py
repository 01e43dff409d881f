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
    Rounding.EVEN: "rest > half || (rest == half && floor_is_odd)",
    Rounding.HALF_UP: "rest > half || rest == half",
    Rounding.CHOP: "rest > 0 && value < 0",
    Rounding.UP: "rest > 0",
    Rounding.DOWN: "0",
    Rounding.ODD: "rest > 0 && !floor_is_odd",
}
"""When a number rounds up from its floor; `rest` is what the floor leaves, `half` half a unit."""

_AWAY = {
    Rounding.NEAREST: "rest >= size - rest",
    Rounding.EVEN: "rest > size - rest || (rest == size - rest && odd)",
    Rounding.HALF_UP: "rest > size - rest || (rest == size - rest && !negative)",
    Rounding.CHOP: "0",
    Rounding.UP: "rest > 0 && !negative",
    Rounding.DOWN: "rest > 0 && negative",
    Rounding.ODD: "rest > 0 && !odd",
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

_IN_WIDE = {
    "rest > half": "wide_less(half, rest)",
    "rest == half": "wide_equal(rest, half)",
    "rest > 0": "(rest.high | rest.low) != 0",
    "value >= 0": "!(value.high >> 63)",
    "value < 0": "(value.high >> 63)",
    "floor_is_odd": "(floor_.low & 1)",
}
"""The same comparisons of numbers of 128 bits."""


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
        """Bits of the type of intermediate results, 32 or 64, or 128 for a pair of 64."""
        most = max(self.needs)
        return next((bits for bits, room in NARROW.items() if most <= room), 128)

    @property
    def value(self) -> str:
        """Type of the results of operations."""
        return "int32_t" if self.bits == 32 else "int64_t"

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
        V, W = self.value, self.value if self.bits < 128 else "wide"
        data, sums = self.words.data, self.words.accumulator
        found = dict(_WIDE) if self.bits == 128 else {}
        for each in _UP:
            found[f"rounded_{each.name.lower()}"] = self._rounded(each)
        for name, fmt in (("data", data), ("sums", sums)):
            found[f"in_{name}"] = self._kept(name, fmt)
        first = "sums" if self.words.sums is not None else "data"
        mode = sums.rounding if self.words.sums is not None else data.rounding
        product = "c * x" if self.bits < 128 else "wide_product(c, x)"
        lifted = self._lifted("x", self.words.gap)
        as_wide = "x" if self.bits < 128 else "wide_of(x)"
        total = (
            {"add": "a + b", "subtract": "a - b"}
            if self.bits < 128
            else {"add": "wide_sum(a, b)", "subtract": "wide_sum(a, wide_negative(b))"}
        )
        comment = f"/* c x, which loses `shift` fraction bits, in the format of the {first} */"
        found["multiply"] = (
            f"{comment}\nstatic {V} multiply({V} c, {V} x, int shift{overflow})\n{{\n"
            f"    return in_{first}(rounded_{mode.name.lower()}({product}, shift){passed});\n}}\n"
        )
        found["lifted"] = (
            f"/* a number of the data in units of the {first} */\n"
            f"static {W} lifted({V} x)\n{{\n    return {lifted};\n}}\n"
        )
        found["as_sum"] = f"static {W} as_sum({V} x)\n{{\n    return {as_wide};\n}}\n"
        for name, expression in total.items():
            found[name] = (
                f"static {V} {name}({W} a, {W} b{overflow})\n{{\n    return in_{first}({expression}{passed});\n}}\n"
            )
        found["store"] = (
            f"/* a sum in the format of the data, rounded once */\nstatic {V} store({V} x{overflow})\n{{\n"
            f"    return in_data(rounded_{data.rounding.name.lower()}({as_wide}, {self.words.gap}){passed});\n}}\n"
        )
        found["divide"] = self._quotient(overflow, passed)
        found["modulo"] = _function(
            "/* what a / b, toward zero, leaves of a; the step itself notes a divisor of zero */",
            f"static {V} modulo({V} a, {V} b)",
            ["return b == 0 || b == -1 ? 0 : a % b;"],
        )
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

    def _lifted(self, x: str, shift: int) -> str:
        if self.bits == 128:
            return f"wide_left(wide_of({x}), {shift})"
        return x if shift == 0 else f"{x} * ({self.value}){self.literal(2**shift)}"

    def _rounded(self, rounding: Rounding) -> str:
        V, W, up = self.value, self.value if self.bits < 128 else "wide", _UP[rounding]
        if self.bits == 128:
            for narrow, wide in _IN_WIDE.items():
                up = up.replace(narrow, wide)
            lines = {
                "": f"wide {', '.join(_declared(up))};",
                "1": "if (shift <= 0)\n        return wide_left(value, -shift);",
                "floor_": "floor_ = wide_right(value, shift);",
                "rest": "rest = wide_sum(value, wide_negative(wide_left(floor_, shift)));",
                "half": "half = wide_left(wide_of(1), shift - 1);",
                "2": f"return wide_sum(floor_, wide_of({up} ? 1 : 0));",
            }
        else:
            up = up.replace("floor_is_odd", "(floor_ & 1)")
            lines = {
                "": f"{V} {', '.join(_declared(up))};",
                "1": f"if (shift <= 0)\n        return value * (({V})1 << -shift);",
                "floor_": "floor_ = value >= 0 ? value >> shift : -1 - ((-1 - value) >> shift);",
                "rest": f"rest = value - floor_ * (({V})1 << shift);",
                "half": f"half = ({V})1 << (shift - 1);",
                "2": f"return floor_ + ({up} ? 1 : 0);",
            }
        if up == "0":
            lines["2"] = "return floor_;"
        chosen = [line for name, line in lines.items() if name not in ("rest", "half") or name in _declared(up)]
        comment = f"/* value / 2**shift, {_describe(rounding)} */"
        return _function(comment, f"static {W} rounded_{rounding.name.lower()}({W} value, int shift)", chosen)

    def _kept(self, name: str, fmt: FixedFormat) -> str:
        V, W = self.value, self.value if self.bits < 128 else "wide"
        low, high = (self.literal(int(each / fmt.unit)) for each in (fmt.lowest, fmt.largest))
        if self.bits == 128:
            below, above = f"wide_less(x, wide_of({low}))", f"wide_less(wide_of({high}), x)"
            itself, unsigned = "wide_narrow(x)", "x.low"
        else:
            below, above, itself, unsigned = f"x < {low}", f"x > {high}", "x", "(uint64_t)x"
        mask, sign = f"UINT64_C({2 ** (fmt.precision + 1) - 1})", f"UINT64_C({2**fmt.precision})"
        lines = {
            "saturate": [f"if ({below})\n        return {low};", f"return {above} ? {high} : {itself};"],
            "wrap": [
                f"const uint64_t bits = {unsigned} & {mask};",
                f"return bits & {sign} ? -1 - ({V})(~bits & {mask}) : ({V})bits;",
            ],
            "raise": [
                f"if ({below} || {above}) {{\n        *overflow = 1;\n        return 0;\n    }}",
                f"return {itself};",
            ],
        }[fmt.overflow]
        if self.raises and fmt.overflow != "raise":
            lines.insert(len(lines) - 1, "(void)overflow;")
        what = {"saturate": "or the nearest of the format", "wrap": "wrapped around", "raise": "which must fit"}
        comment = f"/* x in the {1 + fmt.precision} bits of the {name}, {what[fmt.overflow]} */"
        return _function(comment, f"static {V} in_{name}({W} x{', int *overflow' if self.raises else ''})", lines)

    def _quotient(self, overflow: str, passed: str) -> str:
        V, data = self.value, self.words.data
        up, down = max(data.fraction_bits, 0), max(-data.fraction_bits, 0)
        if self.bits == 128:
            U, odd, grow, negative = (
                "uint64_t",
                "(found.low & 1)",
                "found = wide_sum(found, wide_of(1));",
                "wide_negative(found)",
            )
            found = [
                f"top.low = a < 0 ? ~({U})a + 1 : ({U})a;\n    top = wide_left(top, {up});",
                "for (i = 127; i >= 0; i--) {",
                "    rest = rest << 1 | ((i < 64 ? top.low >> i : top.high >> (i - 64)) & 1);",
                "    found = wide_left(found, 1);\n        if (rest >= size) {\n            rest -= size;",
                "        found.low |= 1;\n        }\n    }",
            ]
            first = [
                "wide found = {0, 0}, top = {0, 0};",
                f"const {U} size = (b < 0 ? ~({U})b + 1 : ({U})b) << {down};",
                f"{U} rest = 0;",
                "int i;",
            ]
        else:
            U, odd, grow, negative = f"u{V}", "(found & 1)", "found++;", f"-({V})found"
            found = ["found = top / size;", *(["rest = top % size;"] if "rest" in _AWAY[data.rounding] else [])]
            first = [
                f"const {U} top = ({U})(a < 0 ? -a : a) << {up};",
                f"const {U} size = ({U})(b < 0 ? -b : b) << {down};",
                f"{U} found{', rest' if len(found) > 1 else ''};",
            ]
        away = _AWAY[data.rounding].replace("odd", odd)
        grown = [f"if ({away})\n        {grow}"] if away != "0" else []
        itself = "found" if self.bits == 128 else f"({V})found"
        lines = [
            "const int negative = (a < 0) != (b < 0);",
            *first,
            "if (b == 0)\n        return 0;",
            *found,
            *grown,
            f"return in_data(negative ? {negative} : {itself}{passed});",
        ]
        comment = f"/* a / b, {_describe(data.rounding)}; the step itself notes a divisor of zero */"
        return _function(comment, f"static {V} divide({V} a, {V} b{overflow})", lines)

    def _root(self, overflow: str, passed: str) -> str:
        V, point, grows = self.value, self.words.data.fraction_bits, _ROOT_GROWS[self.words.data.rounding]
        bits = self.words.data.precision + point
        found = f"({V})found" if self.bits < 128 else "wide_of((int64_t)found)"
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
            f"return in_data({found}{passed});",
        ]
        comment = f"/* square root, {_describe(self.words.data.rounding)}; the step itself notes a negative argument */"
        return _function(comment, f"static {V} root({V} a{overflow})", lines)

    def _whole(self, name: str, rounding: Rounding, overflow: str, passed: str) -> str:
        V, point = self.value, max(self.words.data.fraction_bits, 0)
        if self.bits == 128:
            found = f"wide_left(rounded_{rounding.name.lower()}(wide_of(a), {point}), {point})"
        else:
            found = f"rounded_{rounding.name.lower()}(a, {point}) * (({V})1 << {point})"
        comment = f"/* a whole number, {_describe(rounding)} */"
        return _function(comment, f"static {V} whole_{name}({V} a{overflow})", [f"return in_data({found}{passed});"])


def _function(comment: str, head: str, lines: list[str]) -> str:
    return f"{comment}\n{head}\n{{\n    " + "\n    ".join(lines) + "\n}\n"


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


_WIDE = {
    "wide": "/* 128 bits in two's complement */\ntypedef struct { uint64_t high, low; } wide;\n",
    "wide_of": """static wide wide_of(int64_t x)
{
    wide w;
    w.high = x < 0 ? ~UINT64_C(0) : 0;
    w.low = (uint64_t)x;
    return w;
}
""",
    "wide_narrow": """static int64_t wide_narrow(wide x)
{
    return x.high >> 63 ? -1 - (int64_t)~x.low : (int64_t)x.low;
}
""",
    "wide_sum": """static wide wide_sum(wide a, wide b)
{
    wide w;
    w.low = a.low + b.low;
    w.high = a.high + b.high + (w.low < a.low);
    return w;
}
""",
    "wide_negative": """static wide wide_negative(wide x)
{
    wide w;
    w.low = ~x.low + 1;
    w.high = ~x.high + (w.low == 0);
    return w;
}
""",
    "wide_less": """static int wide_less(wide a, wide b)
{
    const uint64_t sign = UINT64_C(1) << 63;
    return a.high != b.high ? (a.high ^ sign) < (b.high ^ sign) : a.low < b.low;
}
""",
    "wide_equal": """static int wide_equal(wide a, wide b)
{
    return a.high == b.high && a.low == b.low;
}
""",
    "wide_left": """static wide wide_left(wide x, int shift)
{
    wide w = {0, 0};
    if (shift >= 128)
        return w;
    if (shift >= 64) {
        w.high = x.low << (shift - 64);
        return w;
    }
    if (shift <= 0)
        return x;
    w.high = x.high << shift | x.low >> (64 - shift);
    w.low = x.low << shift;
    return w;
}
""",
    "wide_right": """/* floor of x / 2**shift, 0 < shift < 128 */
static wide wide_right(wide x, int shift)
{
    const uint64_t sign = x.high >> 63 ? ~UINT64_C(0) : 0;
    wide w;
    if (shift > 64) {
        w.high = sign;
        w.low = x.high >> (shift - 64) | sign << (128 - shift);
    } else if (shift == 64) {
        w.high = sign;
        w.low = x.high;
    } else {
        w.high = x.high >> shift | sign << (64 - shift);
        w.low = x.low >> shift | x.high << (64 - shift);
    }
    return w;
}
""",
    "wide_product": """static wide wide_product(int64_t a, int64_t b)
{
    const uint64_t p = a < 0 ? ~(uint64_t)a + 1 : (uint64_t)a, q = b < 0 ? ~(uint64_t)b + 1 : (uint64_t)b;
    const uint64_t half = UINT64_C(0xffffffff);
    const uint64_t low = (p & half) * (q & half), middle = (p >> 32) * (q & half) + (low >> 32);
    const uint64_t other = (p & half) * (q >> 32) + (middle & half);
    wide w;
    w.low = other << 32 | (low & half);
    w.high = (p >> 32) * (q >> 32) + (middle >> 32) + (other >> 32);
    return (a < 0) != (b < 0) ? wide_negative(w) : w;
}
""",
}
