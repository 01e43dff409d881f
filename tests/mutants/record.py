"""What is kept of a campaign with seeded faults: what no test catches, with the reason, and counts by module."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FIELDS = (
    *("module", "operator", "occurrence", "line", "before", "after"),
    *("outcome", "by", "seconds", "commit", "date", "reason"),
)
#: Outcomes in the order of the table. By hand, a survivor becomes equivalent, with the reason; survivors have one, too.
OUTCOMES = ("caught", "timeout", "caught by a stored picture", "equivalent", "survived", "no test")
NOT_CAUGHT = OUTCOMES[2:3] + OUTCOMES[4:]
COUNTS = ("module", "mutants", "caught", *OUTCOMES[2:], "commit", "date")


def read(path: Path) -> list[dict[str, str]]:
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def text_of(name: str) -> str:
    path = ROOT / name
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def key(row: Mapping[str, str]) -> tuple[str, ...]:
    return row["module"], row["operator"], str(row["occurrence"]), row["line"]


def write(path: Path, rows: Sequence[Mapping[str, str]], fields: Sequence[str] = FIELDS) -> None:
    draft = path.with_suffix(".tmp")
    with draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fields, lineterminator="\n", restval="")
        writer.writeheader()
        writer.writerows(rows)
    draft.replace(path)


def by_place(rows: Iterable[dict[str, str]]) -> list[dict[str, str]]:
    return sorted(rows, key=lambda each: (each["module"], int(each["line"]), key(each)))


def counts(rows: Iterable[Mapping[str, str]]) -> dict[str, dict[str, str]]:
    """Count the outcomes of each module, with the commit and the date of its last result."""
    modules: dict[str, list[Mapping[str, str]]] = {}
    for row in rows:
        modules.setdefault(row["module"], []).append(row)
    found = {}
    for module, group in modules.items():
        outcomes, last = Counter(row["outcome"] for row in group), max(group, key=lambda row: row["date"])
        found[module] = {"module": module, "commit": last["commit"], "date": last["date"]} | {
            name: str(count)
            for name, count in (
                ("mutants", outcomes.total()),
                ("caught", outcomes["caught"] + outcomes["timeout"]),
                *((name, outcomes[name]) for name in OUTCOMES[2:]),
            )
        }
    return found


def record(rows: Sequence[dict[str, str]], names: Iterable[str], survivors: Path, modules: Path) -> None:
    """Write what no test catches, and the counts of the modules that a campaign judged; other counts stay."""
    write(survivors, by_place(row for row in rows if row["outcome"] not in OUTCOMES[:2]))
    stored = {row["module"]: row for row in read(modules) if text_of(row["module"])}
    judged = counts(row for row in rows if row["module"] in set(names))
    write(modules, [row for _, row in sorted((stored | judged).items())], COUNTS)


def summary(rows: Sequence[Mapping[str, str]]) -> None:
    """Print the counts of each package, and what was not caught."""
    for row in rows:
        if row["outcome"] in NOT_CAUGHT:
            print(f"{row['module']}:{row['line']} {row['operator']}: {row['outcome']}; {row['reason']}")
            print(f"  - {row['before']}\n  + {row['after']}")
    print("\nmutants | caught | by a stored picture only | equivalent | survived | package")
    packages: dict[str, Counter[str]] = {}
    for row in rows:
        packages.setdefault(str(Path(row["module"]).parent), Counter())[row["outcome"]] += 1
    for name, count in [*sorted(packages.items()), ("all", sum(packages.values(), Counter()))]:
        caught = count["caught"] + count["timeout"]
        numbers = (caught, count["caught by a stored picture"], count["equivalent"])
        print(" | ".join(f"{each:4}" for each in (count.total(), *numbers, count.total() - sum(numbers))), "|", name)
    if judged := count.total() - count["equivalent"]:
        print(f"{caught / judged:.1%} of those that are not equivalent are caught")
