"""The examples in docstrings give what they say."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import gpbnb

ROOT = Path(gpbnb.__file__).parent
EXAMPLES = {
    ".".join(path.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")
    for path in ROOT.rglob("*.py")
    if "\n    >>> " in path.read_text(encoding="utf-8")
}


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_examples(name):
    found = doctest.testmod(import_module(name), raise_on_error=False)
    assert found.attempted
    assert not found.failed
