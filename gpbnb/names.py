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
    "EmulatedRun": "gpbnb.wordlength.emulation",
    "FilterGuarantee": "gpbnb.bounds.guarantee",
    "FixedFormat": "gpbnb.arithmetic.fixed",
    "FixedIntervalSmoother": "gpbnb.filters.smoothing",
    "FloatArray": "gpbnb.arithmetic.array",
    "FloatFormat": "gpbnb.arithmetic.formats",
    "Form": "gpbnb.filters.forms",
    "Guarantee": "gpbnb.bounds.guarantee",
    "LimitCycles": "gpbnb.wordlength.limit_cycles",
    "LinearModel": "gpbnb.filters.model",
    "LinearSystem": "gpbnb.filters.system",
    "NonlinearModel": "gpbnb.filters.nonlinear",
    "NonlinearSystem": "gpbnb.filters.nonlinear_system",
    "RecordSurvey": "gpbnb.wordlength.records",
    "Requirement": "gpbnb.wordlength.answer",
    "Rounding": "gpbnb.arithmetic.rounding",
    "SmoothedRecord": "gpbnb.filters.smoothing",
    "TracedFunction": "gpbnb.arithmetic.traced",
    "WordFormats": "gpbnb.filters.word_formats",
    "convert": "gpbnb.arithmetic.second_format",
    "emulate": "gpbnb.wordlength.emulation",
    "guarantee": "gpbnb.wordlength.bounding",
    "limit_cycles": "gpbnb.wordlength.limit_cycles",
    "limits": "gpbnb.bounds.guarantee",
    "linalg": "gpbnb.arithmetic.linalg",
    "peek": "gpbnb.arithmetic.exits",
    "read_model": "gpbnb.wordlength.models",
    "required_precision": "gpbnb.wordlength.required",
    "survey_records": "gpbnb.wordlength.records",
    "write_code": "gpbnb.wordlength.code",
}
HOMES |= dict.fromkeys(NAMED_FORMATS, "gpbnb.arithmetic.named")
"""The module that defines each public name; type checkers read the same from the stub of the package."""

_FIXED = re.compile(r"FIXED[ _-]?(-?\d+)\.(-?\d+)|Q(?:(-?\d+)\.)?(-?\d+)", re.ASCII)


def format_parts(name: str) -> str | tuple[int, int]:
    """Return what the name of a format means: one of ``NAMED_FORMATS``, or integer and fraction bits.

    Names of C and NumPy, such as "float32" and "double", are known, too. In "Q3.12" and "fixed 3.12", the first number
    counts the bits before the binary point without the sign, and the second those after it; "Q15" has none before it.
    Case, blanks, hyphens and underscores do not matter.

    Raises
    ------
    ValueError : no such format.

    Examples
    --------
    >>> format_parts("bfloat16"), format_parts("Q15"), format_parts("Q3.12")
    ('BFLOAT16', (0, 15), (3, 12))
    """
    wanted = name.strip().upper()
    wanted = ALIASES.get(wanted, wanted)
    for known in NAMED_FORMATS:
        if re.sub(r"[ _-]", "", wanted) == known.replace("_", ""):
            return known
    if match := _FIXED.fullmatch(wanted):
        integer, fraction = (match[1], match[2]) if match[2] else (match[3] or "0", match[4])
        return int(integer), int(fraction)
    raise ValueError(
        f'got format {name!r}; needed one of {", ".join(NAMED_FORMATS)}, or fixed point as "Q15" or "Q3.12"'
    )
