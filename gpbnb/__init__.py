"""Bound and emulate, digit for digit, rounding errors in recursive filters, integrators and matrix computations.

The public interface::

    FloatFormat, Rounding      a number format: base, precision, rounding, range
    FixedFormat                fixed point: integer bits, fraction bits, overflow
    BINARY32, BFLOAT16, ...    the formats of processors; NAMED_FORMATS lists them
    linalg                     dot, matmul, lu, solve, inv, det, cholesky with every operation rounded
    LinearModel                a linear dynamic model for a Kalman filter
    NonlinearModel             functions of a state for an extended or unscented Kalman filter
    NonlinearSystem            a step of your own, from state and inputs to the next state and outputs
    LinearSystem               a digital filter in any structure, a controller or an observer
    required_precision         the format with the fewest digits that keeps any model within a tolerance, in floating or
                               fixed point, in words of a digital filter or in blocks of a Kalman filter
    limit_cycles               every limit cycle of a filter in fixed point with a constant input
    limits, guarantee          limits on a filter, and a bound for every measurement within them, for ever
    emulate                    one run of any model with every operation rounded; Form: the forms of a Kalman filter
    FixedIntervalSmoother      a Rauch-Tung-Striebel smoother of a record, as a function of a format
    survey_records             many measurement records in many formats at once
    write_code                 the model as C99, with results that agree with the emulation digit for digit
    TracedFunction             your own function of arrays, run in compiled code
    convert                    round numbers into another format, such as those of a plant beside a controller
    peek                       show intermediate values of a function whose precision is being searched
    read_model                 a model from a TOML file, SciPy, python-control or FilterPy

Each chapter of the book has a sub-package of ``gpbnb.report``, such as ``gpbnb.report.kalman``.
``gpbnb.report.ledger`` judges every statement printed in the three documents.
"""

from importlib import import_module
from typing import Any

from gpbnb.names import HOMES, NAMED_FORMATS

__version__ = "0.2.0"
# fmt: off
__all__ = [
    "BFLOAT16", "BINARY16", "BINARY32", "BINARY64", "BINARY128", "DECIMAL32", "DECIMAL64", "DECIMAL128", "FP4_E2M1",
    "FP6_E2M3", "FP6_E3M2", "FP8_E4M3", "FP8_E5M2", "IBM_704", "IBM_HEX32", "IBM_HEX64", "NAMED_FORMATS", "TF32",
    "BlockFormats", "EmulatedRun", "FilterGuarantee", "FixedFormat", "FixedIntervalSmoother", "FloatArray",
    "FloatFormat", "Form", "Guarantee", "LimitCycles", "LinearModel", "LinearSystem", "NonlinearModel",
    "NonlinearSystem", "RecordSurvey", "Requirement", "Rounding", "SmoothedRecord", "TracedFunction", "WordFormats",
    "convert", "emulate", "guarantee", "limit_cycles", "limits", "linalg",
    "peek", "read_model", "required_precision", "survey_records", "write_code",
]
# fmt: on


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``import gpbnb`` stays fast."""
    if name not in HOMES:
        raise AttributeError(f"module 'gpbnb' has no attribute {name!r}; the public names are {', '.join(__all__)}")
    module = import_module(HOMES[name])
    return module if name == "linalg" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(__all__)
