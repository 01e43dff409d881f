"""The names of the package itself lead to the modules that define them."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

import gpbnb

HOMES = {
    "arithmetic.formats": "FloatFormat",
    "arithmetic.rounding": "Rounding",
    "arithmetic.fixed": "FixedFormat",
    "arithmetic.array": "FloatArray",
    "arithmetic.exits": "peek",
    "arithmetic.second_format": "convert",
    "arithmetic.traced": "TracedFunction",
    "arithmetic.named": "BINARY16 BINARY32 BINARY64 BINARY128 BFLOAT16 TF32 FP8_E4M3 FP8_E5M2 FP6_E3M2 FP6_E2M3 "
    "FP4_E2M1 DECIMAL32 DECIMAL64 DECIMAL128 IBM_HEX32 IBM_HEX64 IBM_704",
    "filters.model": "LinearModel",
    "filters.blocks": "BlockFormats",
    "filters.forms": "Form",
    "filters.nonlinear": "NonlinearModel",
    "filters.nonlinear_system": "NonlinearSystem",
    "filters.smoothing": "FixedIntervalSmoother SmoothedRecord",
    "filters.words": "WordFormats",
    "bounds.guarantee": "FilterGuarantee Guarantee limits",
    "bounds.limit_cycles": "LimitCycles",
    "wordlength.answer": "Requirement",
    "wordlength.bounding": "guarantee limit_cycles",
    "wordlength.emulation": "EmulatedRun emulate",
    "filters.system": "LinearSystem",
    "wordlength.required": "required_precision",
    "wordlength.models": "read_model",
    "wordlength.records": "RecordSurvey survey_records",
    "wordlength.code": "write_code",
}


@pytest.mark.parametrize(("home", "names"), HOMES.items())
def test_a_public_name_is_what_its_module_defines(home, names):
    module = import_module(f"gpbnb.{home}")
    for name in names.split():
        assert getattr(gpbnb, name) is getattr(module, name)


def test_the_public_names_are_these():
    names = {name for some in HOMES.values() for name in some.split()} | {"linalg", "NAMED_FORMATS"}
    assert dir(gpbnb) == sorted(gpbnb.__all__) == sorted(names)
    assert gpbnb.linalg is import_module("gpbnb.arithmetic.linalg")
    assert list(gpbnb.NAMED_FORMATS) == HOMES["arithmetic.named"].split()
    assert {name: getattr(gpbnb, name) for name in gpbnb.NAMED_FORMATS} == import_module("gpbnb.arithmetic.named").NAMED
    with pytest.raises(AttributeError, match="no attribute 'BINARY8'; the public names are BFLOAT16, "):
        _ = gpbnb.BINARY8


def test_only_long_computations_of_commands_show_progress_unasked():
    shown = set()
    for path in Path(gpbnb.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                given = node.args
                defaults = [*zip(reversed(given.args), reversed(given.defaults), strict=False)]
                defaults += zip(given.kwonlyargs, given.kw_defaults, strict=True)
                shown |= {
                    f"{path.stem}.{node.name}"
                    for argument, default in defaults
                    if argument.arg == "progress" and default is not None and ast.unparse(default) == "True"
                }
    assert shown == {"sweep.run"}
