"""What the documents print: the list of entries, as package data."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass, fields
from importlib.resources import files
from importlib.resources.abc import Traversable

DOCUMENTS = ("hung1984", "hung1982", "savage2016")
KINDS = ("equation", "number", "example", "claim", "figure", "table", "open")


@dataclass(frozen=True)
class Entry:
    """One printed statement.

    Parameters
    ----------
    id : unique; ``document.chapter.place``, as in ``hung1984.II.eq20``.
    document : short name, one of `DOCUMENTS`.
    chapter, section : as numbered there; ``-`` where the document has none.
    item : what it is called there, as in ``eq (20)``.
    kind : one of `KINDS`.
    printed : what is printed; prose with math between single dollar signs.
    """

    id: str
    document: str
    chapter: str
    section: str
    item: str
    kind: str
    printed: str


HEADER = tuple(field.name for field in fields(Entry))


def load_inventory(source: Traversable | None = None) -> tuple[Entry, ...]:
    """Read and validate the inventory.

    Parameters
    ----------
    source : a CSV file, such as a ``pathlib.Path``; the one of the package by default.

    Returns
    -------
    entries : in the order of the file.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : the file is not a valid inventory; the message names the line.
    """
    source = files(__package__) / "statements.csv" if source is None else source
    try:
        text = source.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{source.name} is not UTF-8 ({error}); save it as UTF-8") from error
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    entries: list[Entry] = []
    seen: dict[str, int] = {}
    try:
        header = next(reader, [])
        if tuple(header) != HEADER:
            raise ValueError(f"the header is {','.join(header)!r}; {','.join(HEADER)!r} is needed")
        for record in reader:
            entry = _entry(record)
            if entry.id in seen:
                raise ValueError(
                    f"id {entry.id!r} is that of line {seen[entry.id]} already; ids are unique: rename one"
                )
            seen[entry.id] = reader.line_num
            entries.append(entry)
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{source.name}, line {max(reader.line_num, 1)}: {error}") from error
    return tuple(entries)


def quote(key: str) -> str:
    """What the entry `key` of the package's inventory prints.

    Raises
    ------
    KeyError : the inventory has no such id.
    """
    for entry in load_inventory():
        if entry.id == key:
            return entry.printed
    raise KeyError(f"no entry {key!r} in the inventory; correct the id")


def _entry(record: list[str]) -> Entry:
    if len(record) != len(HEADER):
        raise ValueError(f"{len(record)} fields; {len(HEADER)} are needed: quote a field that holds a comma")
    entry = Entry(*record)
    for name, value in zip(HEADER, record, strict=True):
        if not value or value != value.strip():
            raise ValueError(f"{name}={value!r} is blank or has blanks at an end; fill it in, '-' where there is none")
    if entry.document not in DOCUMENTS:
        raise ValueError(f"unknown document {entry.document!r}; take one of {', '.join(DOCUMENTS)}")
    if entry.kind not in KINDS:
        raise ValueError(f"unknown kind {entry.kind!r}; take one of {', '.join(KINDS)}")
    if not entry.id.startswith(f"{entry.document}."):
        raise ValueError(f"id {entry.id!r} does not begin with its document; write '{entry.document}.…'")
    if entry.printed.count("$") % 2 or "$$" in entry.printed:
        raise ValueError(f"printed={entry.printed!r} has an unpaired or doubled dollar sign; write math as $...$")
    return entry


def select(
    entries: Iterable[Entry],
    document: str | None = None,
    chapter: str | None = None,
    sections: str | Iterable[str | int] | None = None,
) -> tuple[Entry, ...]:
    """Pick the entries of a document, a chapter, some sections.

    Parameters
    ----------
    entries : where from.
    document, chapter : all by default.
    sections : numbers or names; ``9`` takes 9.1 and 9.2 too. All by default.

    Raises
    ------
    ValueError : nothing is there of that document, of that chapter, or of one of the sections.
    """
    found = tuple(entries)
    if document is not None:
        found = _keep(found, "document", document)
    if chapter is not None:
        found = _keep(found, "chapter", chapter)
    if sections is not None:
        wanted = [sections] if isinstance(sections, str) else [str(section) for section in sections]
        if not wanted:
            raise ValueError("sections is empty; name at least one, or None for all")
        within = {entry.id for section in wanted for entry in _keep(found, "section", section)}
        found = tuple(entry for entry in found if entry.id in within)
    return found


def _keep(entries: tuple[Entry, ...], field: str, value: str) -> tuple[Entry, ...]:
    kept = tuple(
        entry
        for entry in entries
        if getattr(entry, field) == value or (field == "section" and entry.section.startswith(f"{value}."))
    )
    if not kept:
        there = ", ".join(dict.fromkeys(getattr(entry, field) for entry in entries))
        raise ValueError(f"no entry of {field} {value!r}; here are: {there}")
    return kept
