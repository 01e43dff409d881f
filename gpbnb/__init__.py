"""Bound and emulate, digit for digit, rounding errors in recursive filters, integrators and matrix computations.

The public interface::

    FloatFormat, Rounding      a number format: base, precision, rounding, range
    FixedFormat                fixed point: integer bits, fraction bits, overflow
    BINARY32, BFLOAT16, ...    the formats of processors; NAMED_FORMATS lists them
    linalg                     dot, matmul, lu, solve, inv with every operation rounded
    LinearModel                a linear dynamic model for a Kalman filter
    LinearSystem               a linear filter, controller or observer with known inputs
    required_precision         the smallest precision that keeps a filter, or your own function, within a tolerance
    survey_records             many measurement records in many formats at once
    peek                       look at numbers of a function while its precision is searched
    read_model                 a model from a TOML file, SciPy, python-control or FilterPy

Each chapter of the book has a sub-package: rounding, inversion, kalman, rolling, integration, budget, geometry and
wordlength. ``gpbnb.ledger`` judges every statement printed in the three documents.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gpbnb import clock as clock  # before all other modules, because it notes the time

if TYPE_CHECKING:
    from gpbnb.arithmetic import linalg
    from gpbnb.arithmetic.array import FloatArray
    from gpbnb.arithmetic.exits import peek
    from gpbnb.arithmetic.fixed import FixedFormat
    from gpbnb.arithmetic.formats import FloatFormat
    from gpbnb.arithmetic.named import (
        BFLOAT16,
        BINARY16,
        BINARY32,
        BINARY64,
        BINARY128,
        DECIMAL32,
        DECIMAL64,
        DECIMAL128,
        FP8_E4M3,
        FP8_E5M2,
        IBM_704,
        IBM_HEX32,
        IBM_HEX64,
        TF32,
    )
    from gpbnb.arithmetic.rounding import Rounding
    from gpbnb.filters.model import LinearModel
    from gpbnb.wordlength.models import read_model
    from gpbnb.wordlength.precision import required_precision
    from gpbnb.wordlength.records import survey_records
    from gpbnb.wordlength.system import LinearSystem

__version__ = "0.2.0"
# fmt: off
NAMED_FORMATS = (
    "BINARY16", "BINARY32", "BINARY64", "BINARY128", "BFLOAT16", "TF32", "FP8_E4M3", "FP8_E5M2",
    "DECIMAL32", "DECIMAL64", "DECIMAL128", "IBM_HEX32", "IBM_HEX64", "IBM_704",
)

__all__ = [
    "BFLOAT16", "BINARY16", "BINARY32", "BINARY64", "BINARY128", "DECIMAL32", "DECIMAL64", "DECIMAL128", "FP8_E4M3",
    "FP8_E5M2", "IBM_704", "IBM_HEX32", "IBM_HEX64", "NAMED_FORMATS", "TF32", "FixedFormat", "FloatArray",
    "FloatFormat", "LinearModel", "LinearSystem", "Rounding", "linalg", "peek", "read_model",
    "required_precision", "survey_records",
]
# fmt: on

_HOME = {
    "FixedFormat": "gpbnb.arithmetic.fixed",
    "FloatArray": "gpbnb.arithmetic.array",
    "FloatFormat": "gpbnb.arithmetic.formats",
    "LinearModel": "gpbnb.filters.model",
    "LinearSystem": "gpbnb.wordlength.system",
    "Rounding": "gpbnb.arithmetic.rounding",
    "peek": "gpbnb.arithmetic.exits",
    "read_model": "gpbnb.wordlength.models",
    "required_precision": "gpbnb.wordlength.precision",
    "survey_records": "gpbnb.wordlength.records",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``import gpbnb`` stays fast."""
    if name == "linalg":
        return import_module("gpbnb.arithmetic.linalg")
    if name in NAMED_FORMATS:
        return getattr(import_module("gpbnb.arithmetic.named"), name)
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'gpbnb' has no attribute {name!r}; the public names are {', '.join(__all__)}")


def __dir__() -> list[str]:
    return sorted(__all__)
