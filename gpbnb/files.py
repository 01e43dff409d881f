"""Files that are written as a whole or not at all, only over others that gpbnb has written; where they were made."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path

WRITTEN = "Written by gpbnb"
"""What reports, runs and code say of themselves; other files of their names are not replaced."""

PACKAGES = ("numpy", "numba", "llvmlite", "python-flint")
"""Packages on whose versions digits may depend."""


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


def machine() -> dict[str, str]:
    """Return system, versions, and the commit if there is one."""
    try:
        found = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short=12", "HEAD"],
            capture_output=True,
            text=True,
            check=False,
        ).stdout.strip()
    except OSError:
        found = ""
    return {
        "machine": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "versions": ", ".join(f"{name} {metadata.version(name)}" for name in PACKAGES),
        "commit": found or "none",
    }
