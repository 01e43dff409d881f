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
from functools import partial
from pathlib import Path
from typing import Literal, TypeVar

from gpbnb.sweeps.numbers import plain_integer, plain_number

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
    lines, count = [], 0
    for row in rows:
        fault = _fault(columns, row)
        if fault:
            raise ValueError(f"{file.name}, row {count + 1}: {fault}")
        lines.append(_line(row))
        count += 1
    head = {**provenance, CHECK: _digest(lines), "rows": str(count)}
    for key, value in head.items():
        if ":" in key or any(ord(c) < 32 for c in key + value) or value != value.strip():
            raise ValueError(f"got {key!r}: {value!r} as provenance; needed one line of text, and no colon in its name")
    body = "".join(f"# {key}: {value}\n" for key, value in head.items())
    body += _line(tuple(column.name for column in columns)) + "".join(lines)
    draft = file.with_suffix(".draft")
    draft.write_text(body, encoding="utf-8", newline="")
    draft.replace(file)


def damaged_file(file: Path, cure: str, line: int, problem: str) -> DamagedFileError:
    """Return the error that names the file, the line and the command that computes the file again."""
    return DamagedFileError(
        f"{file.parent.name}/{file.name}, line {line}: {problem}. Restore the file from the repository, or compute "
        f"it again: {cure}"
    )


def text_of(file: Path, cure: str) -> str:
    """Return the text of a stored file."""
    try:
        return file.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise damaged_file(file, cure, 1, "the file is missing") from None
    except OSError as error:
        raise damaged_file(file, cure, 1, f"the file cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise damaged_file(file, cure, 1, f"the file is not UTF-8: {error}") from None


def read(file: Path, columns: Sequence[Column], cure: str) -> StoredTable:
    """Read a table and check all of it.

    Parameters
    ----------
    columns : the columns that the file must have.
    cure : the command that recomputes the file; it appears in every error message.
    """
    damaged = partial(damaged_file, file, cure)
    text = text_of(file, cure)
    lines = text.split("\n")
    provenance: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        if not line.startswith("# "):
            break
        key, colon, value = line[2:].partition(": ")
        if not colon or key in provenance:
            raise damaged(number, f"got {line!r}; needed '# key: value', each key once")
        provenance[key] = value
    start = len(provenance)
    if "rows" not in provenance:
        raise damaged(start + 1, "the line '# rows: …' is missing")
    header = tuple(column.name for column in columns)
    if start >= len(lines) or lines[start] + "\n" != _line(header):
        got = lines[start] if start < len(lines) else ""
        raise damaged(start + 1, f"got the columns {got!r}; needed {','.join(header)!r}")
    if not re.fullmatch("[0-9]{1,12}", provenance["rows"]):
        raise damaged(start, f"got {provenance['rows']!r} rows; needed a whole number")
    rows, expected = list[Record](), int(provenance["rows"])
    for index, line in enumerate(lines[start + 1 :]):
        number = start + 2 + index
        if index == expected:
            if line or number != len(lines):
                raise damaged(number, f"the file has more than the {expected} rows that its first lines announce")
            break
        if number == len(lines):
            raise damaged(number, f"the file ends after {index} of {expected} rows")
        try:
            row = next(csv.reader([line]), [])
        except csv.Error as error:
            raise damaged(number, str(error)) from None
        fault = _fault(columns, row)
        if fault:
            raise damaged(number, fault)
        rows.append(tuple(row))
    if len(rows) < expected:
        raise damaged(len(lines), f"the file ends after {len(rows)} of {expected} rows")
    digest = _digest(f"{line}\n" for line in lines[start + 1 : -1])
    if digest != provenance.get(CHECK):
        raise damaged(
            start - 1, f"the checksum of the rows is {digest}, not {provenance.get(CHECK)}: some value differs"
        )
    return StoredTable(tuple(columns), tuple(rows), provenance)


def _fault(columns: Sequence[Column], row: Sequence[str]) -> str | None:
    if len(row) != len(columns):
        return f"got {len(row)} fields; needed {len(columns)}"
    for column, text in zip(columns, row, strict=True):
        fault = column.fault(text)
        if fault:
            return f"got {column.name} = {text!r}; {fault}"
    return None


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def _line(fields: Sequence[str]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(fields)
    return text.getvalue()
