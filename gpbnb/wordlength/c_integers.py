"""Integer arithmetic in C99 for generated filters: rounding, overflow, and 128 bits where products need them.

Each helper is a function in C. A file contains only the helpers that it uses, so that it compiles without a warning. No
operation has an undefined or implementation-defined result.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.named import rounding_text
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.word_formats import WordFormats

NARROW = {32: 30, 64: 62}
"""Bits of a C type, and how many bits without the sign the intermediate results may have."""

_UP = {
    Rounding.NEAREST: "rest >= {size} - rest + ({negative})",
    Rounding.EVEN: "rest >= {size} - rest + !(found & 1)",
    Rounding.HALF_UP: "rest >= {size} - rest",
    Rounding.CHOP: "rest > 0 && {negative}",
    Rounding.UP: "rest > 0",
    Rounding.DOWN: "",
    Rounding.ODD: "rest > 0 && !(found & 1)",
}
"""When a result rounds up from its floor, `found` units; `rest` is what the floor leaves, `size` one unit."""

_WHOLE = {"floor": Rounding.DOWN, "ceil": Rounding.UP, "trunc": Rounding.CHOP, "rint": Rounding.EVEN}
"""How each function of C finds a whole number."""

_WIDE = """#ifndef __SIZEOF_INT128__
#error "Words of more than 32 bits need __int128, which gcc and clang have for 64-bit processors."
#endif
__extension__ typedef __int128 wide;
__extension__ typedef unsigned __int128 uwide;
"""


def _more(rounding: Rounding, size: str, negative: str) -> str:
    """Return what a rounding adds to a floor."""
    return f" + ({_UP[rounding].format(size=size, negative=negative)})" if _UP[rounding] else ""


def word_bits(fmt: FixedFormat) -> int | None:
    """Return the bits of the C type that holds a word, 16, 32 or 64; None if there is none."""
    return next((bits for bits in (16, 32, 64) if 1 + fmt.precision <= bits), None)


def literal(n: int) -> str:
    """Return an integer as a constant in C."""
    if n == -(2**63):
        return "(-INT64_C(9223372036854775807) - 1)"
    return f"INT64_C({n})" if abs(n) >= 2**31 else str(n)


def modulus(value: str, rest: str) -> str:
    """Return the function in C for ``np.remainder``, from what a division toward zero leaves."""
    return f"""/* x - y floor(x / y) */
static {value} modulus({value} x, {value} y)
{{
    const {value} rest = {rest};
    return (rest < 0 && y > 0) || (rest > 0 && y < 0) ? rest + y : rest;
}}
"""


def used_functions(functions: dict[str, str], body: str) -> str:
    """Return those of some functions by name that a piece of code uses, directly or through others."""
    used, before = {name for name in functions if re.search(rf"\b{name}\b", body)}, set[str]()
    while used != before:
        before, text = used, body + "".join(functions[name] for name in used)
        used = {name for name in functions if re.search(rf"\b{name}\b", text)}
    return "\n".join(text for name, text in functions.items() if name in used)


@dataclass(frozen=True)
class Integers:
    """The helpers in C for some formats of words.

    Parameters
    ----------
    words : the formats.
    most : bits that intermediate results need without the sign, and the largest shift of a product.
    """

    words: WordFormats
    most: int

    @property
    def bits(self) -> int:
        """Bits of the type of intermediate results: 32, 64 or 128."""
        return next((bits for bits, room in NARROW.items() if self.most <= room), 128)

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
        return any(each.overflow == "raise" for each in (self.words.data, self.words.accumulator))

    def functions(self) -> dict[str, str]:
        """Return all helpers by name, each after those that it uses."""
        V, W, gap = self.value, self.wide, self.words.gap
        data, sums = self.words.data, self.words.accumulator
        o, passed = (", int *overflow", ", overflow") if self.raises else ("", "")
        first, of_first = ("data", data) if self.words.sums is None else ("sums", sums)
        nearest, stored = (f"rounded_{each.rounding.name.lower()}" for each in (of_first, data))
        found = {"wide": _WIDE} if self.bits == 128 else {}
        found |= {f"rounded_{each.name.lower()}": self._rounded(each) for each in _UP}
        found |= {f"in_{name}": self._kept(name, fmt) for name, fmt in (("data", data), ("sums", sums))}
        point = max(data.fraction_bits, 0)
        short = {
            "multiply": (
                f"c x, which loses `shift` fraction bits, in the format of the {first}",
                f"{V} multiply({V} c, {V} x, int shift{o})",
                f"in_{first}({nearest}(({W})c * x, shift){passed})",
            ),
            "lifted": (f"a number of the data in units of the {first}", f"{W} lifted({V} x)", f"x * (({W})1 << {gap})"),
            "add": (f"a + b in the format of the {first}", f"{V} add({W} a, {W} b{o})", f"in_{first}(a + b{passed})"),
            "subtract": ("a - b, likewise", f"{V} subtract({W} a, {W} b{o})", f"in_{first}(a - b{passed})"),
            "store": (
                "a sum in the format of the data, rounded once",
                f"{V} store({V} x{o})",
                f"in_data({stored}(x, {gap}){passed})",
            ),
            "modulo": (
                "what a / b, toward zero, leaves of a; the step itself notes a divisor of zero",
                f"{V} modulo({V} a, {V} b)",
                "b == 0 || b == -1 ? 0 : a % b",
            ),
        } | {
            f"whole_{name}": (
                f"a whole number, {rounding_text(rounding)}",
                f"{V} whole_{name}({V} a{o})",
                f"in_data(rounded_{rounding.name.lower()}(a, {point}) * (({W})1 << {point}){passed})",
            )
            for name, rounding in _WHOLE.items()
        }
        found |= {
            name: f"/* {what} */\nstatic {head}\n{{\n    return {value};\n}}\n"
            for name, (what, head, value) in short.items()
        }
        found |= {"divide": self._quotient(o, passed), "root": self._root(o, passed)}
        return found | {"modulus": modulus(V, "modulo(x, y)")}

    def _rounded(self, rounding: Rounding) -> str:
        W, up = self.wide, _more(rounding, "size", "value < 0")
        rest = f"    const {W} size = ({W})1 << shift, rest = value - found * size;\n" if up else ""
        return f"""/* value / 2**shift, {rounding_text(rounding)} */
static {W} rounded_{rounding.name.lower()}({W} value, int shift)
{{
    if (shift <= 0)
        return value * (({W})1 << -shift);
    const {W} found = value >= 0 ? value >> shift : -1 - ((-1 - value) >> shift);
{rest}    return found{up};
}}
"""

    def _kept(self, name: str, fmt: FixedFormat) -> str:
        V, low, high = self.value, *(literal(int(each / fmt.unit)) for each in (fmt.lowest, fmt.largest))
        mask, sign = f"UINT64_C({2 ** (fmt.precision + 1) - 1})", f"UINT64_C({2**fmt.precision})"
        unused = "    (void)overflow;\n" if self.raises and fmt.overflow != "raise" else ""
        what, lines = {
            "saturate": (
                "or the nearest of the format",
                f"    if (x < {low})\n        return {low};\n    return x > {high} ? {high} : ({V})x;",
            ),
            "wrap": (
                "wrapped around",
                f"    const uint64_t bits = (uint64_t)x & {mask};\n"
                f"    return bits & {sign} ? -1 - ({V})(~bits & {mask}) : ({V})bits;",
            ),
            "raise": (
                "which must fit",
                f"    if (x < {low} || x > {high}) {{\n        *overflow = 1;\n        return 0;\n    }}\n"
                f"    return ({V})x;",
            ),
        }[fmt.overflow]
        return f"""/* x in the {1 + fmt.precision} bits of the {name}, {what} */
static {V} in_{name}({self.wide} x{", int *overflow" if self.raises else ""})
{{
{unused}{lines}
}}
"""

    def _quotient(self, overflow: str, passed: str) -> str:
        V, W, U, data = self.value, self.wide, f"u{self.wide}", self.words.data
        left, right = max(data.fraction_bits, 0), max(-data.fraction_bits, 0)
        up = _more(data.rounding, "size", "negative")
        return f"""/* a / b, {rounding_text(data.rounding)}; the step itself notes a divisor of zero */
static {V} divide({V} a, {V} b{overflow})
{{
    const int negative = (a < 0) != (b < 0);
    const {U} top = ({U})(a < 0 ? -({W})a : a) << {left};
    const {U} size = ({U})(b < 0 ? -({W})b : b) << {right};
    if (b == 0)
        return 0;
    {W} found = ({W})(top / size);
    {U} rest = top % size;
    if (negative) {{
        found = -found - (rest > 0);
        rest = rest > 0 ? size - rest : 0;
    }}
    return in_data(found{up}{passed});
}}
"""

    def _root(self, overflow: str, passed: str) -> str:
        V, data, point = self.value, self.words.data, self.words.data.fraction_bits
        up = _more(data.rounding, "(2 * found + 1)", "a < 0")
        return f"""/* square root, {rounding_text(data.rounding)}; the step itself notes a negative argument */
static {V} root({V} a{overflow})
{{
    const uint64_t top = a < 0 ? 0 : (uint64_t)a;
    uint64_t found = 0, rest = 0;
    int i;
    for (i = {(data.precision + point + 1) // 2 * 2 - 1}; i > 0; i -= 2) {{
        rest = rest << 1 | (i < {point} ? 0 : top >> (i - {point}) & 1);
        rest = rest << 1 | (i <= {point} ? 0 : top >> (i - {point} - 1) & 1);
        found <<= 1;
        if (rest > 2 * found) {{
            rest -= 2 * found + 1;
            found++;
        }}
    }}
    return in_data(({self.wide})(found{up}){passed});
}}
"""
