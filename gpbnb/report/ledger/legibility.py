"""What the scans show where they are damaged, read from ``legibility.csv``, and whether author or scan is charged.

The rule, for a statement that disagrees with its recomputation:

1. A form repeats what the scan shows. Where the scan is damaged, ``scan`` quotes its characters, and the form follows
   the context or the other report.
2. The scan is charged, with the verdict OCR, if it is damaged at the judged place, or confuses similar characters
   there, and if a `witness` shows what was printed: a statement of the documents with the same
   formula, name or number, legible and right; it may be the rest of the same statement.
3. In all other cases the author is charged, even if the scan is damaged; the entry then shows the characters.
4. That the other report has the right text is not enough where this scan is legible: the report of 1984 corrects some
   errors of 1982.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

from gpbnb.report.ledger.finding import DISAGREEMENTS, Finding, Verdict
from gpbnb.report.ledger.statements import rows_of


@dataclass(frozen=True)
class Damage:
    """Damage of the scan in one statement.

    Parameters
    ----------
    id : id of the statement.
    scan : the characters of the scan at the damaged places.
    witness : id of the statement that shows what was printed at the judged place; empty if there is none.
    """

    id: str
    scan: str
    witness: str = ""

    def __post_init__(self) -> None:
        if not self.scan.strip():
            raise ValueError(f"got a blank scan for {self.id}; needed the characters of the scan")


@cache
def load_legibility() -> dict[str, Damage]:
    """Read ``legibility.csv``: statement id → damage, for the statements whose scan is damaged."""
    return {row["id"]: Damage(**row) for row in rows_of("legibility.csv")}


def charged(key: str, finding: Finding) -> Finding:
    """Return the finding on a statement with the verdict that rule 2 of this module asks for.

    Parameters
    ----------
    key : id of the statement.
    finding : what its check found, with an author's error if it disagrees.
    """
    damage = load_legibility().get(key)
    if damage is None or not damage.witness or finding.verdict not in DISAGREEMENTS:
        return finding
    return replace(finding, verdict=Verdict.OCR, root="")
