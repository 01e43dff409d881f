"""Files that are written as a whole or not at all, and only over others that gpbnb has written."""

from __future__ import annotations

import os
from pathlib import Path

WRITTEN = "Written by gpbnb"
"""What reports, runs and code say of themselves; other files of their names are not replaced."""


def is_written(path: Path) -> bool:
    """Whether gpbnb has written a file."""
    try:
        found = path.read_bytes()
    except OSError:
        return False
    return WRITTEN.encode() in found or found.startswith(b'{"certificate": ')


def replace_file(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all: on a full disk, what it held stays."""
    path = path.resolve()
    draft = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        draft.write_bytes(content)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
