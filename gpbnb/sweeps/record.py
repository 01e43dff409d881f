"""A stored record: a JSON file with a checksum, checked when it is read."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from gpbnb.sweeps.table import damaged_file, text_of

CHECK = "sha256"
"""Key of the checksum; it covers everything else."""


def write_record(file: Path, values: Mapping[str, Any]) -> None:
    """Write a record, either completely or not at all."""
    draft = file.with_suffix(f".{os.getpid()}.draft")
    whole = {CHECK: _digest(values), **values}
    draft.write_text(json.dumps(whole, indent=1, ensure_ascii=False) + "\n", encoding="utf-8", newline="")
    draft.replace(file)


def read_record(file: Path, cure: str) -> dict[str, Any]:
    """Read a record and check all of it.

    Parameters
    ----------
    cure : the command that computes the file again; it appears in every error message.
    """
    damaged = partial(damaged_file, file, cure)
    text = text_of(file, cure)
    try:
        found = json.loads(text)
    except json.JSONDecodeError as error:
        raise damaged(error.lineno, f"the file is not JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:  # an integer of thousands of digits, or lists nested too deeply
        raise damaged(1, f"the file cannot be read: {error}") from None
    if not isinstance(found, dict) or CHECK not in found:
        raise damaged(1, f"the entry {CHECK!r} is missing")
    check = found.pop(CHECK)
    if check != _digest(found):
        raise damaged(1, f"the checksum of the file is {_digest(found)}, not {check}: some value differs")
    return found


def _digest(values: Mapping[str, Any]) -> str:
    text = json.dumps(values, ensure_ascii=False)
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()
