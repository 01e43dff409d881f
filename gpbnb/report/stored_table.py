"""A stored table: a CSV file with its provenance, whose shape and ranges are checked when it is read.

The file starts with lines ``# key: value``, the last of which give a checksum of the rows and their number.
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

from gpbnb.files import replace_file
from gpbnb.wordlength.numbers import plain_integer, plain_number

Record = tuple[str, ...]
T = TypeVar("T")

CHECK = "sha256"
"""Key of the checksum; it covers all rows."""


class DamagedFileError(ValueError):
    """A stored file was changed after it was written."""


@dataclass(frozen=True)
class Column:
    """One column of a table, and the values that it accepts.

    Parameters
    ----------
    name : name in the header.
    kind : "text", "integer" or "number".
    low, high : smallest and largest number accepted; NaN is never accepted.
    choices : the texts accepted; if empty, any text.
    optional : whether a cell may be empty.
    """

    name: str
    kind: Literal["text", "integer", "number"] = "number"
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    optional: bool = False

    def fault(self, text: str) -> str | None:
        """Describe what is wrong with a value, or return None."""
        if not text and self.optional:
            return None
        if self.kind == "text":
            return f"needed one of {', '.join(self.choices)}" if self.choices and text not in self.choices else None
        try:
            value = plain_integer(text) if self.kind == "integer" else plain_number(text)
        except ValueError:
            return "needed an integer" if self.kind == "integer" else "needed a number"
        return None if self.low <= value <= self.high else f"needed {self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class StoredTable:
    """Rows of text with their columns and provenance."""

    columns: tuple[Column, ...]
    rows: tuple[Record, ...]
    provenance: Mapping[str, str]

    def records(self, **where: str) -> list[dict[str, str]]:
        """Return the rows whose columns have these values, each as a dictionary by column name."""
        names = [column.name for column in self.columns]
        found = (dict(zip(names, row, strict=True)) for row in self.rows)
        return [each for each in found if all(each[name] == value for name, value in where.items())]


def write(file: Path, columns: Sequence[Column], rows: Iterable[Record], provenance: Mapping[str, str]) -> None:
    """Write a table, either completely or not at all."""
    text, count = io.StringIO(), 0
    lines = csv.writer(text, lineterminator="\n")
    for count, row in enumerate(rows, 1):
        if fault := _fault(columns, row):
            raise ValueError(f"{file.name}, row {count}: {fault}")
        lines.writerow(row)
    head = {**provenance, CHECK: _digest(text.getvalue()), "rows": str(count)}
    for key, value in head.items():
        if ":" in key or any(ord(c) < 32 for c in key + value) or value != value.strip():
            raise ValueError(f"got {key!r}: {value!r} as provenance; needed one line of text, and no colon in its name")
    body = "".join(f"# {key}: {value}\n" for key, value in head.items())
    body += ",".join(column.name for column in columns) + "\n" + text.getvalue()
    file.parent.mkdir(parents=True, exist_ok=True)
    replace_file(file, body.encode())


def read(file: Path, columns: Sequence[Column], cure: str) -> StoredTable:
    """Read a table and check all of it.

    Parameters
    ----------
    columns : the columns that the file must have.
    cure : the command that recomputes the file; it appears in every error message.
    """

    def damaged(line: int, problem: str) -> DamagedFileError:
        return DamagedFileError(
            f"{file.parent.name}/{file.name}, line {line}: {problem}. Restore the file from the repository, or compute "
            f"it again: {cure}"
        )

    try:
        text = file.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise damaged(1, "the file is missing") from None
    except OSError as error:
        raise damaged(1, f"the file cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise damaged(1, f"the file is not UTF-8: {error}") from None
    provenance: dict[str, str] = dict(re.findall("^# ([^:\n]+): (.*)$", text, re.MULTILINE))
    start = len(provenance)
    header, _, body = text.split("\n", start)[-1].partition("\n")
    names = ",".join(column.name for column in columns)
    if header != names:
        raise damaged(start + 1, f"got the columns {header!r}; needed {names!r}")
    if _digest(body) != provenance.get(CHECK):
        raise damaged(start - 1, f"the checksum of the rows is {_digest(body)}, not {provenance.get(CHECK)}")
    rows = list(csv.reader(io.StringIO(body)))
    for number, row in enumerate(rows, start + 2):
        if fault := _fault(columns, row):
            raise damaged(number, fault)
    return StoredTable(tuple(columns), tuple(map(tuple, rows)), provenance)


def _fault(columns: Sequence[Column], row: Sequence[str]) -> str | None:
    if len(row) != len(columns):
        return f"got {len(row)} fields; needed {len(columns)}"
    for column, text in zip(columns, row, strict=True):
        fault = column.fault(text)
        if fault:
            return f"got {column.name} = {text!r}; {fault}"
    return None


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
