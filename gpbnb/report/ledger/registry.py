"""Register the checks of a topic by the ids of the statements they judge."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from gpbnb.report.ledger.finding import Finding
from gpbnb.report.ledger.legibility import charged
from gpbnb.report.ledger.statements import Statement


def both(place: str) -> tuple[str, str]:
    """Ids of a statement printed in both reports, in ch. II of hung1984 and in ch. III of hung1982."""
    return f"hung1984.II.{place}", f"hung1982.III.{place}"


Check = Callable[..., Finding]
"""A check takes the printed :class:`~.statements.Statement`, or no argument if it does not need it."""
_C = TypeVar("_C", bound=Check)


class Checks(Mapping[str, Check]):
    """The checks of one topic, by the ids of their ledger entries.

    Examples
    --------
    >>> from gpbnb.report.ledger.finding import compare
    >>> from gpbnb.report.ledger.statements import statement
    >>> CHECKS = Checks()
    >>> @CHECKS.add("hung1984.II.eq14", "hung1982.III.eq14")
    ... def chopping_unit(printed):
    ...     ratio = 10**-3 / (10**-3 / 2)
    ...     return compare("2" in printed.printed and ratio == 2, f"{ratio:g}")
    >>> CHECKS.run(statement("hung1984.II.eq14")).verdict
    <Verdict.VERIFIED: 'verified'>
    """

    def __init__(self) -> None:
        self._checks: dict[str, Check] = {}

    def add(self, *ids: str) -> Callable[[_C], _C]:
        """Register the decorated function as the check of each of `ids`."""
        if not ids:
            raise TypeError("got add() without an id; needed @CHECKS.add('document.chapter.item')")
        for key in ids:
            if not isinstance(key, str):
                raise TypeError(f"got {key!r}; needed an id, as in @CHECKS.add('document.chapter.item')")
            if not key.strip():
                raise ValueError("got a blank id; needed the id of a ledger entry")

        def register(check: _C) -> _C:
            if len(inspect.signature(check).parameters) > 1:
                raise TypeError(
                    f"got {_name(check)} with several arguments; needed a check that takes only the printed statement"
                )
            new: dict[str, Check] = {}
            for key in ids:
                other = new.get(key) or self._checks.get(key)
                if other is not None:
                    raise ValueError(
                        f"got two checks of {key!r}, {_name(other)} and {_name(check)}; needed one "
                        "check per entry; remove one"
                    )
                new[key] = check
            self._checks.update(new)
            return check

        return register

    def run(self, statement: Statement) -> Finding:
        """Run a check and decide, by the rule of :mod:`gpbnb.report.ledger.legibility`, who is charged."""
        check = self[statement.id]
        finding = check(statement) if inspect.signature(check).parameters else check()
        if not isinstance(finding, Finding):
            raise TypeError(
                f"got {finding!r} from the check of {statement.id!r}, {_name(check)}; needed a "
                "Finding: return compare(...), answer(...), unverifiable(...) or given(...)"
            )
        return charged(statement.id, finding)

    def __getitem__(self, key: str) -> Check:
        try:
            return self._checks[key]
        except KeyError:
            raise KeyError(
                f"got {key!r}, which has no check here; needed one of the {len(self)} ids in list(checks)"
            ) from None

    def __contains__(self, key: object) -> bool:
        return key in self._checks

    def __iter__(self) -> Iterator[str]:
        return iter(self._checks)

    def __len__(self) -> int:
        return len(self._checks)

    def __repr__(self) -> str:
        return f"Checks({len(self)} ids)"


def _name(check: Callable[..., object]) -> str:
    return f"{check.__module__}.{check.__qualname__}" if inspect.isfunction(check) else repr(check)


def takes_statement(check: Callable[..., Any]) -> bool:
    """Whether a check judges the printed statement that it is given."""
    return bool(getattr(check, "takes_statement", inspect.signature(check).parameters))
