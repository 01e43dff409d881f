"""The names of the package itself lead to the modules that define them, also in the stub for type checkers."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

import gpbnb
from gpbnb.names import HOMES, NAMED_FORMATS

PACKAGE = Path(gpbnb.__file__).parent


def test_a_public_name_is_what_its_module_defines():
    for name, home in HOMES.items():
        module = import_module(home)
        found = getattr(gpbnb, name)
        assert found is (module if name == "linalg" else getattr(module, name)), name
        assert name in NAMED_FORMATS or getattr(found, "__module__", home) == home, name
    with pytest.raises(AttributeError, match="no attribute 'BINARY8'; the public names are BFLOAT16, "):
        _ = gpbnb.BINARY8


def test_the_package_and_its_stub_have_the_same_names_from_the_same_modules():
    assert dir(gpbnb) == sorted(gpbnb.__all__) == sorted([*HOMES, "NAMED_FORMATS"])
    assert list(gpbnb.NAMED_FORMATS) == list(NAMED_FORMATS)
    assert {name: getattr(gpbnb, name) for name in NAMED_FORMATS} == import_module("gpbnb.arithmetic.named").NAMED
    stub = {}
    for node in ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            stub |= {alias.asname: node.module for alias in node.names}
    assert stub == HOMES | {"NAMED_FORMATS": stub["NAMED_FORMATS"], "linalg": "gpbnb.arithmetic"}


def test_no_function_shows_progress_unasked():
    texts = [path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")]
    assert not any("progress: bool = True" in text for text in texts)
