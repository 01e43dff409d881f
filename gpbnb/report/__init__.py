"""The report: one package for each chapter of the book, none of which the library imports."""

from importlib.util import find_spec

PACKAGES = ("joblib", "matplotlib", "scipy", "sympy")
"""Packages of the extra ``gpbnb[report]``, which the report needs and the library does not."""

_missing = [name for name in PACKAGES if find_spec(name) is None]
if _missing:
    raise ImportError(
        f"gpbnb.report: got no {', '.join(_missing)}; needed {', '.join(PACKAGES)}; "
        "install them: pip install 'gpbnb[report]'",
        name=_missing[0],
    )
