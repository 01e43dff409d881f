"""A filter design, as coefficients or second-order sections, before a structure is chosen for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from gpbnb.filters.named import checked_names
from gpbnb.filters.structures import (
    CASCADES,
    STRUCTURES,
    USUAL,
    check_of_cascade,
    expanded,
    sections_of,
    structure_named,
    transfer_function,
)
from gpbnb.filters.system import LinearSystem

SIDE_BY_SIDE = ("direct form I", USUAL, f"cascade of {USUAL}", "lattice", "balanced state space")
"""Structures that are compared if none are named."""

_NAMED = ("input", "output")


class Structures(NamedTuple):
    """A filter in its structures, and the reason why it does not have the others, both by name."""

    systems: dict[str, LinearSystem]
    lacking: dict[str, str]


@dataclass(frozen=True, eq=False)
class FilterDesign:
    """A filter design, given by b and a, or by second-order sections.

    Parameters
    ----------
    b, a : coefficients of the transfer function, as in :meth:`gpbnb.filters.system.LinearSystem.from_coefficients`.
    sos : (sections, 6), in place of these.
    pairing, order : how the sections of a cascade are paired and ordered; by default as given for sections, else
        "nearest" and "up". They and `scale` are refused where no structure is a cascade.
    scale : whether to scale the sections, as in :meth:`gpbnb.filters.system.LinearSystem.from_sections`.
    name : name of the filter in tables and reports.
    input_names, output_names : lists with one name each, perhaps with a unit, as of
        :class:`gpbnb.filters.system.LinearSystem`.

    Examples
    --------
    >>> design = FilterDesign(b=[1], a=[1, "-0.9"])
    >>> list(design.systems())[:2]
    ['direct form I', 'direct form II transposed']
    """

    b: Any = None
    a: Any = None
    sos: Any = None
    pairing: str | None = None
    order: Any = None
    scale: bool = False
    name: str = "a digital filter"
    input_names: Sequence[str] | None = None
    output_names: Sequence[str] | None = None

    def __post_init__(self) -> None:
        if (self.b is None) == (self.sos is None) or (self.a is not None and self.sos is not None):
            raise ValueError("got neither or both of b and sos; needed b and perhaps a, or sos")
        if not isinstance(self.scale, bool):
            raise ValueError(f"got scale {self.scale!r}; needed true or false")
        if self.sos is None:
            transfer_function(self.b, (1,) if self.a is None else self.a)
        else:
            sections_of(self.sos)
        for kind in _NAMED:
            checked_names(f"{kind}_names", getattr(self, f"{kind}_names"), 1)

    @property
    def usual(self) -> str:
        """The structure that is used when none is named, a cascade for sections, else the transposed direct form II."""
        return USUAL if self.sos is None else f"cascade of {USUAL}"

    def system(self, structure: str | None = None) -> LinearSystem:
        """Return the filter in a structure, by default the usual one."""
        chosen = structure_named(self.usual if structure is None else structure)
        check_of_cascade(chosen, pairing=self.pairing, order=self.order, scale=self.scale or None)
        return self._built(chosen)

    def _built(self, structure: str) -> LinearSystem:
        is_cascade = structure in CASCADES
        if self.scale and is_cascade and self.sos is None:
            raise ValueError("got scale for b and a; needed sections in sos, which it scales")
        pairing, order = (self.pairing, self.order) if is_cascade else (None, None)
        if self.sos is not None and is_cascade:
            found = LinearSystem.from_sections(self.sos, structure, pairing, order, self.scale, self.name)
        else:
            b, a = (self.b, (1,) if self.a is None else self.a) if self.sos is None else expanded(sections_of(self.sos))
            found = LinearSystem.from_coefficients(b, a, structure, pairing, order, self.name)
        inputs, outputs = (checked_names(f"{kind}_names", getattr(self, f"{kind}_names"), 1) for kind in _NAMED)
        return replace(found, input_names=inputs, output_names=outputs) if inputs or outputs else found

    def systems(self, structures: Sequence[str] | str = SIDE_BY_SIDE) -> dict[str, LinearSystem]:
        """Return the filter in several structures, by their names, as :meth:`compared` does."""
        return self.compared(structures).systems

    def compared(self, structures: Sequence[str] | str = SIDE_BY_SIDE) -> Structures:
        """Return the filter in several structures, and why it does not have others of them.

        Parameters
        ----------
        structures : names, or "all".

        Raises
        ------
        ValueError : an unknown structure, or the filter has none of those named; the message says why for each.

        Examples
        --------
        >>> list(FilterDesign(b=[1], a=[1, 0, 1]).compared("all").lacking)
        ['lattice', 'balanced state space']
        """
        names = STRUCTURES if structures == "all" else [structures] if isinstance(structures, str) else structures
        found, why = dict[str, LinearSystem](), dict[str, str]()
        chosen = [structure_named(name) for name in names]
        build = self._built if any(name in CASCADES for name in chosen) else self.system
        for name in chosen:
            try:
                found[name] = build(name)
            except ValueError as error:
                why[name] = str(error)
        if not found:
            raise ValueError("; ".join(f"{name}: {reason}" for name, reason in why.items()))
        return Structures(found, why)
