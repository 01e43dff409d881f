"""Seed faults in the package and list those that no test catches: ``make mutants``.

Faults are the changes of :mod:`tests.mutants.operators`, made with cosmic-ray in a copy of the checkout. The tests of a
mutant are those that reach its module through imports, nearest first, up to a number of seconds. Each result is written
at once, so that a campaign that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import random
import re
import shutil
import subprocess
import sys
import time
import zlib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import zip_longest
from pathlib import Path

from tests.mutants.concern import Concern, module_of
from tests.mutants.operators import Mutant, mutants, mutated
from tests.mutants.runs import load_libraries, run

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CACHE = ROOT / ".cache" / "mutants"
RESULTS = HERE / "results.csv"
FIELDS = ("module", "operator", "occurrence", "line", "before", "after", "outcome", "by", "seconds", "commit", "date")


def git(*arguments: str) -> str:
    return subprocess.run(["git", "-C", ROOT, *arguments], check=True, capture_output=True, text=True).stdout.strip()


def copy_tree(target: Path) -> None:
    """Copy all files of the checkout that git does not ignore."""
    shutil.rmtree(target, ignore_errors=True)
    for name in git("ls-files", "-co", "--exclude-standard", "-z").split("\0"):
        if name and (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)


def chosen_files(names: Sequence[str], since: str | None) -> list[str]:
    """Files to change, from the root: those that are named, those changed since a commit, or all of the package."""
    if since:
        names = [*names, *git("diff", "--name-only", "--diff-filter=d", since, "--", "gpbnb").splitlines()]
    elif not names:
        names = [str(path.relative_to(ROOT)) for path in sorted((ROOT / "gpbnb").rglob("*.py"))]
    found = sorted({str(Path(name).resolve().relative_to(ROOT)) for name in names if name.endswith(".py")})
    outside = [name for name in found if not name.startswith("gpbnb/") or not (ROOT / name).is_file()]
    if outside:
        raise SystemExit(f"mutants: got {', '.join(outside)}; needed files of gpbnb")
    return found


def sample(name: str, lines: int, seed: int) -> list[Mutant]:
    """Choose mutants of a file: every kind of operator as likely as the others, one for each so many lines."""
    source = (ROOT / name).read_text(encoding="utf-8")
    rng = random.Random(zlib.crc32(name.encode()) + seed)
    kinds: dict[str, list[Mutant]] = {}
    for each in mutants(source):
        kinds.setdefault(each.operator, []).append(each)
    for group in kinds.values():
        rng.shuffle(group)
    count = max(2, math.ceil(source.count("\n") / lines))
    found: list[Mutant] = []
    while kinds and len(found) < count:
        operator = rng.choice(sorted(kinds))
        found.append(kinds[operator].pop())
        if not kinds[operator]:
            del kinds[operator]
    return found


def changed_line(source: str, other: str) -> tuple[str, str]:
    """The first lines that differ."""
    for one, two in zip_longest(source.splitlines(), other.splitlines(), fillvalue=""):
        if one != two:
            return one.strip(), two.strip()
    return "", ""


class Judges:
    """The tests that judge the mutants of a module."""

    def __init__(self, tree: Path, budget: float) -> None:
        self.tree, self.budget = tree, budget
        self.concern = Concern(tree)
        self.file = CACHE / "unfit.json"
        #: Tests that judge no mutant: too slow, or, where nothing is compiled, failing without a fault.
        self.unfit: dict[str, list[str]] = (
            json.loads(self.file.read_text(encoding="utf-8")) if self.file.is_file() else {"slow": []}
        )
        self._compiled = [
            name
            for name, path in self.concern.modules.items()
            if re.search(r"^@(compiled|njit|inlined|register_jitable)", path.read_text(encoding="utf-8"), re.MULTILINE)
        ]

    def compiled(self, module: str) -> bool:
        """Whether the tests can use compiled functions: a change of the module does not change them."""
        return not any(self.concern.reaches(name, module) for name in self._compiled)

    def of(self, module: str) -> tuple[list[str], frozenset[str], bool]:
        """Test files, tests of them left out, and whether to compile."""
        compiled = self.compiled(module)
        files = [str(test.relative_to(self.tree)) for test in self.concern.judges(module)][:12]
        left_out = set(self.unfit["slow"])
        if not compiled:
            files = files[:6]
            for name in files:
                key = f"{name}, not compiled"
                if key not in self.unfit:
                    found = run(self.tree, [name], budget=self.budget, compiled=False, stop=False)
                    self._note(key, [name] if found.stuck else found.failed)
                left_out |= set(self.unfit[key])
        return [name for name in files if name not in left_out], frozenset(left_out), compiled

    def _note(self, key: str, tests: list[str]) -> None:
        self.unfit[key] = tests
        self.file.write_text(json.dumps(self.unfit, indent=1), encoding="utf-8")

    def is_slow(self, test: str, compiled: bool) -> bool:
        """Whether a test takes too long without a fault, too; it judges no more mutants then."""
        if test == "collection" or not run(self.tree, [test], budget=self.budget, compiled=compiled).stuck:
            return False
        self._note("slow", [*self.unfit["slow"], test])
        return True


def judge(judges: Judges, name: str, mutant: Mutant) -> dict[str, str]:
    """Seed a fault, run the tests that concern it, and restore the file."""
    path = judges.tree / name
    source = path.read_text(encoding="utf-8")
    other = mutated(source, mutant)
    if other is None or other == source:
        return {"outcome": "no change"}
    before, after = changed_line(source, other)
    while True:
        files, left_out, compiled = judges.of(module_of(path, judges.tree))
        if not files:
            return {"before": before, "after": after, "outcome": "no test"}
        begun = time.monotonic()
        try:
            path.write_text(other, encoding="utf-8")
            found = run(judges.tree, files, budget=judges.budget, compiled=compiled, left_out=left_out)
        finally:
            path.write_text(source, encoding="utf-8")
        if not found.stuck or not judges.is_slow(found.stuck, compiled):
            break
    outcome = "timeout" if found.stuck else "caught" if found.failed else "survived"
    by = found.stuck or (found.failed or [f"{len(found.seconds)} tests"])[0]
    seconds = f"{time.monotonic() - begun:.1f}"
    return {"before": before, "after": after, "outcome": outcome, "by": by, "seconds": seconds}


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


def write(path: Path, rows: Sequence[Mapping[str, str]]) -> None:
    draft = path.with_suffix(".tmp")
    with draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n", restval="")
        writer.writeheader()
        writer.writerows(rows)
    draft.replace(path)


def summary(rows: Sequence[Mapping[str, str]]) -> None:
    """Print the counts and the survivors."""
    survivors = [row for row in rows if row["outcome"] in ("survived", "no test")]
    for row in survivors:
        print(f"{row['module']}:{row['line']} {row['operator']}: {row['outcome']}")
        print(f"  - {row['before']}\n  + {row['after']}")
    caught = sum(row["outcome"] in ("caught", "timeout") for row in rows)
    print(f"{len(rows)} mutants in {len({row['module'] for row in rows})} files, {caught} caught, {len(survivors)} not")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__.split("\n\n")[0])
    parser.add_argument("files", nargs="*", help="files of gpbnb; without any, all of them")
    parser.add_argument("--since", metavar="COMMIT", help="files that changed since this commit")
    parser.add_argument("--lines", type=int, default=75, help="one mutant for each so many lines, at least two a file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=12.0, help="seconds of processor time for each mutant")
    parser.add_argument("--again", action="store_true", help="judge the survivors of the stored results again")
    parser.add_argument("--minutes", type=float, default=math.inf, help="stop after so many minutes; it resumes")
    parser.add_argument("--results", type=Path, default=RESULTS, help="table to continue; without it %(default)s")
    chosen = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    commit, now = git("rev-parse", "--short", "HEAD"), datetime.now(UTC)
    names = chosen_files(chosen.files, chosen.since)
    print(f"mutants: seed {chosen.seed}, commit {commit}, {len(names)} files", flush=True)

    rows = {key(row): row for row in read(chosen.results)}
    # A result is of no use once its line has changed.
    rows = {at: row for at, row in rows.items() if row["before"] in text_of(row["module"])}
    if chosen.again:
        plan = [
            (row["module"], Mutant(row["operator"], int(row["occurrence"]), int(row["line"])))
            for row in rows.values()
            if row["outcome"] in ("survived", "no test") and (not chosen.files or row["module"] in names)
        ]
    else:
        samples = {name: sample(name, chosen.lines, chosen.seed) for name in names}
        # One of each file in turn, so that a part of a campaign tells of all files.
        plan = [
            (name, mutant)
            for round_ in zip_longest(*samples.values())
            for name, mutant in zip(samples, round_, strict=True)
            if mutant is not None
        ]
    tree = CACHE / f"tree-{os.getpid()}"
    copy_tree(tree)
    load_libraries()
    judges = Judges(tree, chosen.budget)
    end = time.monotonic() + 60 * chosen.minutes
    for number, (name, mutant) in enumerate(plan):
        place = (name, mutant.operator, str(mutant.occurrence), str(mutant.line))
        row = dict(zip(FIELDS, place, strict=False))
        if key(row) in rows and not chosen.again:
            continue
        if time.monotonic() > end:
            break
        row |= {"commit": commit, "date": f"{now:%Y-%m-%d}"} | judge(judges, name, mutant)
        if row["outcome"] != "no change":
            rows[key(row)] = row
            write(
                chosen.results, sorted(rows.values(), key=lambda each: (each["module"], int(each["line"]), key(each)))
            )
        where = f"{name}:{mutant.line} {mutant.operator}"
        print(f"{number + 1}/{len(plan)} {row['outcome']} {where} {row.get('seconds', '')}", flush=True)
    shutil.rmtree(tree)
    summary([row for row in rows.values() if row["module"] in names])


if __name__ == "__main__":
    sys.exit(main())
