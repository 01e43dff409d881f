"""The public names of the package, and the module that defines each."""

import re

# fmt: off
NAMED_FORMATS = (
    "BINARY16", "BINARY32", "BINARY64", "BINARY128", "BFLOAT16", "TF32", "FP8_E4M3", "FP8_E5M2",
    "FP6_E3M2", "FP6_E2M3", "FP4_E2M1", "DECIMAL32", "DECIMAL64", "DECIMAL128", "IBM_HEX32", "IBM_HEX64", "IBM_704",
)

WITHOUT_LOOPS = ("BINARY128", "DECIMAL128")
"""Named formats with too many digits for the compiled loops of filters; arrays compute in them on Python integers."""

ALIASES = {
    "FLOAT16": "BINARY16", "HALF": "BINARY16", "FLOAT32": "BINARY32", "SINGLE": "BINARY32", "FLOAT": "BINARY32",
    "FLOAT64": "BINARY64", "DOUBLE": "BINARY64", "FLOAT128": "BINARY128", "BF16": "BFLOAT16",
}
# fmt: on
"""Names of formats in C and NumPy."""

HOMES = {
    "BlockFormats": "gpbnb.filters.blocks",
    "FixedFormat": "gpbnb.arithmetic.fixed",
    "FixedIntervalSmoother": "gpbnb.filters.smoothing",
    "FloatArray": "gpbnb.arithmetic.array",
    "FloatFormat": "gpbnb.arithmetic.formats",
    "Form": "gpbnb.filters.forms",
    "LinearModel": "gpbnb.filters.model",
    "LinearSystem": "gpbnb.filters.system",
    "NonlinearModel": "gpbnb.filters.nonlinear",
    "NonlinearSystem": "gpbnb.filters.nonlinear_system",
    "Rounding": "gpbnb.arithmetic.rounding",
    "TracedFunction": "gpbnb.arithmetic.traced",
    "WordFormats": "gpbnb.filters.words",
    "emulate": "gpbnb.filters.emulation",
    "guarantee": "gpbnb.bounds.guarantee",
    "limit_cycles": "gpbnb.bounds.limit_cycles",
    "limits": "gpbnb.bounds.guarantee",
    "linalg": "gpbnb.arithmetic.linalg",
    "peek": "gpbnb.arithmetic.exits",
    "read_model": "gpbnb.wordlength.models",
    "required_block_precisions": "gpbnb.wordlength.blocks",
    "required_fraction_bits": "gpbnb.wordlength.fixed_point",
    "required_precision": "gpbnb.wordlength.precision",
    "required_word_formats": "gpbnb.wordlength.blocks",
    "survey_records": "gpbnb.wordlength.records",
    "write_code": "gpbnb.wordlength.code",
}
HOMES |= dict.fromkeys(NAMED_FORMATS, "gpbnb.arithmetic.named")
"""The module that defines each public name; type checkers read the same from the stub of the package."""

_FIXED = re.compile(r"FIXED[ _-]?(-?\d+)\.(-?\d+)|Q(?:(-?\d+)\.)?(-?\d+)", re.ASCII)


def format_parts(name: str) -> str | tuple[int, int]:
    """Return what the name of a format means: one of ``NAMED_FORMATS``, or integer and fraction bits.

    Names of C and NumPy, such as "float32" and "double", are known, too. In "fixed 4.12" and "Q4.12", the first number
    counts the bits before the binary point without the sign, and the second those after it; "Q15" has none before it.
    Case, blanks, hyphens and underscores do not matter.

    Raises
    ------
    ValueError : no such format.

    Examples
    --------
    >>> format_parts("bfloat16"), format_parts("Q15"), format_parts("fixed 4.12")
    ('BFLOAT16', (0, 15), (4, 12))
    """
    wanted = name.strip().upper()
    wanted = ALIASES.get(wanted, wanted)
    for known in NAMED_FORMATS:
        if re.sub(r"[ _-]", "", wanted) == known.replace("_", ""):
            return known
    if match := _FIXED.fullmatch(wanted):
        integer, fraction = (match[1], match[2]) if match[2] else (match[3] or "0", match[4])
        return int(integer), int(fraction)
    raise ValueError(f'got format {name!r}; needed one of {", ".join(NAMED_FORMATS)}, or "Q15", or "fixed 4.12"')
