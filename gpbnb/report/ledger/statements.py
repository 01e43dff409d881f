"""The printed statements of the three documents, read from ``statements.csv``."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from importlib.resources import files
from typing import Any, TypeVar

import sympy as sp

from gpbnb.report.ledger.formula import Link, Number, Part, Relation, Words, read

_L = TypeVar("_L", Number, Words)

DOCUMENTS = ("hung1984", "hung1982", "savage2016")


@dataclass(frozen=True)
class Statement:
    """One printed statement.

    Parameters
    ----------
    id : unique; ``document.chapter.place``, as in ``hung1984.II.eq20``.
    document : short name, one of `DOCUMENTS`.
    chapter, section : as numbered there; ``-`` if the document has none.
    item : its name in the document, as in ``eq (20)``.
    kind : equation, number, example, claim, figure, table or open.
    text : the printed text, with math between single dollar signs; ``{{1}}`` stands for the first part of the form.
    form : the machine-readable form, see :mod:`gpbnb.report.ledger.formula`; empty if there is none.
    """

    id: str
    document: str
    chapter: str
    section: str
    item: str
    kind: str
    text: str
    form: str = ""

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The parts of the machine-readable form."""
        return read(self.form)

    @cached_property
    def printed(self) -> str:
        """The printed text with its formulas typeset from the machine-readable form."""
        return _PLACE.sub(lambda place: self.parts[int(place[1]) - 1].markdown(), self.text)

    def relation(self, number: int = 1) -> Relation:
        """Return the relation with this number among the relations of the form, counted from 1."""
        relations = [part for part in self.parts if isinstance(part, Relation)]
        if not 1 <= number <= len(relations):
            raise LookupError(f"got relation number {number} of {self.id}; needed a number from 1 to {len(relations)}")
        return relations[number - 1]

    @property
    def equates(self) -> bool:
        """Whether each comparison of each relation is = or ≈."""
        return all(part.equates for part in self.parts if isinstance(part, Relation))

    def links(
        self, names: Mapping[str, Any] | None = None, number: Callable[[Fraction], Any] = sp.Rational
    ) -> tuple[Link, ...]:
        """Evaluate all comparisons of all relations; parameters as for :meth:`.formula.Relation.links`."""
        relations = [part for part in self.parts if isinstance(part, Relation)]
        return tuple(link for relation in relations for link in relation.links(names, number))

    def number(self, label: str) -> Number:
        """Return the printed number with this label."""
        return self._labelled(Number, label)

    def says(self, label: str) -> str:
        """Return the phrase that the document prints for this label."""
        return self._labelled(Words, label).printed

    def _labelled(self, sort: type[_L], label: str) -> _L:
        for part in self.parts:
            if isinstance(part, sort) and part.label == label:
                return part
        labels = ", ".join(part.label for part in self.parts if isinstance(part, sort)) or "none"
        raise LookupError(f"got {sort.__name__.lower()} {label!r} of {self.id}; needed one of {labels}")


_PLACE = re.compile(r"\{\{(\d+)\}\}")


def rows_of(name: str) -> csv.DictReader[str]:
    """Read a table of the ledger, such as ``statements.csv``."""
    return csv.DictReader((files(__package__) / name).read_text(encoding="utf-8").splitlines(), strict=True)


@cache
def load_statements() -> tuple[Statement, ...]:
    """Read all statements, in the order of the file."""
    return tuple(Statement(**row) for row in rows_of("statements.csv"))


@cache
def _by_id() -> dict[str, Statement]:
    return {each.id: each for each in load_statements()}


def statement(key: str) -> Statement:
    """Return the statement with the id `key`."""
    if key not in _by_id():
        raise KeyError(f"got {key!r}; needed the id of a statement in statements.csv")
    return _by_id()[key]


def quote(key: str) -> str:
    """Return the printed text of the statement `key`; KeyError as for :func:`statement`."""
    return statement(key).printed


def select(
    entries: Iterable[Statement],
    document: str | None = None,
    chapter: str | None = None,
    sections: str | Iterable[str | int] | None = None,
) -> tuple[Statement, ...]:
    """Pick the entries of a document, of a chapter or of some sections.

    Parameters
    ----------
    entries : the entries to choose from.
    document, chapter : all by default.
    sections : numbers or names; ``9`` includes 9.1 and 9.2. All by default.
    """
    found = tuple(entries)
    if document is not None:
        found = _keep(found, "document", document)
    if chapter is not None:
        found = _keep(found, "chapter", chapter)
    if sections is not None:
        wanted = [sections] if isinstance(sections, str) else [str(section) for section in sections]
        if not wanted:
            raise ValueError("got an empty sections; needed at least one section, or None for all")
        within = {entry.id for section in wanted for entry in _keep(found, "section", section)}
        found = tuple(entry for entry in found if entry.id in within)
    return found


def _keep(entries: tuple[Statement, ...], field: str, value: str) -> tuple[Statement, ...]:
    kept = tuple(
        entry
        for entry in entries
        if getattr(entry, field) == value or (field == "section" and entry.section.startswith(f"{value}."))
    )
    if not kept:
        there = ", ".join(dict.fromkeys(getattr(entry, field) for entry in entries))
        raise ValueError(f"got {field} {value!r}, which no entry has; needed one of {there}")
    return kept
