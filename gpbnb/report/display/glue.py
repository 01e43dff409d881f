"""Store numbers that a notebook computes, for display in its own text or in other chapters."""

from __future__ import annotations

import math
from typing import Any

from IPython.core.formatters import format_display_data
from IPython.display import display as show

DIGITS = 6
_RECORD = "application/papermill.record/"


def glue(name: str, value: Any, display: bool = False) -> None:
    """Store a value under a name in the notebook, for MyST-NB's ``{glue:text}``; MyST-NB need not be installed.

    A float is stored with six significant digits, because later digits can differ between processors. A whole
    number is stored as it is.

    Parameters
    ----------
    name : the name that the text uses.
    value : a number or a text.
    display : whether to show it below the cell, too.
    """
    data, metadata = format_display_data(rounded(value))
    prefix = "" if display else _RECORD
    metadata["scrapbook"] = {"name": name, "mime_prefix": prefix}
    show({prefix + kind: content for kind, content in data.items()}, raw=True, metadata=metadata)


def rounded(value: Any) -> Any:
    """Round a float that is not a whole number to six significant digits; return anything else unchanged."""
    if not isinstance(value, float):
        return value
    exact = not math.isfinite(value) or value.is_integer()
    return float(value) if exact else float(f"{value:.{DIGITS}g}")
