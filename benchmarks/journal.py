"""A journal of finished parts of a long comparison, so that it resumes after an interruption."""

from __future__ import annotations

import csv
from pathlib import Path


class Journal:
    """Finished parts, one a line, for the code as it is now.

    Parameters
    ----------
    file : where the lines are kept. code : characters that change with the code that is compared.
    """

    def __init__(self, file: Path, code: str) -> None:
        self.file, self.code = file, code
        self.parts: dict[str, list[str]] = {}
        if file.exists():
            with file.open(encoding="utf-8", newline="") as stream:
                for code_then, part, *found in csv.reader(stream):
                    if code_then == code:
                        self.parts[part] = found

    def add(self, part: str, found: tuple[object, ...]) -> None:
        """Write down a finished part and what was found."""
        self.parts[part] = [str(each) for each in found]
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerow((self.code, part, *found))
