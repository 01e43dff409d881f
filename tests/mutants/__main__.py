"""Seed faults in the package and list those that no test catches: ``make mutants``.

Faults are the changes of :mod:`tests.mutants.operators`, made with cosmic-ray in a copy of the checkout. The tests of a
mutant are those that execute its line, as far as ``--measure`` has found them, then those that reach its module through
imports, nearest first, up to a number of seconds. Each result is written to the cache at once, so that a campaign that
was stopped goes on where it was. The repository keeps what no test catches, with the reason, and counts by module.
"""

from __future__ import annotations

import argparse
import ast
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
from typing import Any

from tests.mutants.concern import Concern, module_of
from tests.mutants.covered import Covered
from tests.mutants.operators import Mutant, mutants, mutated
from tests.mutants.record import FIELDS, NOT_CAUGHT, by_place, key, read, record, summary, text_of, write
from tests.mutants.runs import Collected, Fresh, How, Outcome, load_libraries, with_collected

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CACHE = ROOT / ".cache" / "mutants"
COMPILED = CACHE / "gpbnb" / "compiled"
COVERED = CACHE / "covered.json"
RESULTS = CACHE / "results.csv"
SURVIVORS, MODULES = HERE / "survivors.csv", HERE / "modules.csv"
MOST_FILES = 30
"""Test files that judge a mutant, the nearest."""
MOST_TESTS = 600
"""Tests that execute its line, the nearest."""


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


_COMPILES = re.compile(r"^@(compiled|inner|njit|overload|intrinsic)", re.MULTILINE)


def is_compiled(source: str, line: int) -> bool:
    """Whether a line may be part of compiled code: of a decorated function, or of a constant."""
    inside = False
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.lineno <= line <= (node.end_lineno or line):
            inside = True
            if any(_COMPILES.match("@" + ast.unparse(each)) for each in node.decorator_list):
                return True
    return not inside


Codes = Mapping[Any, Any] | None
"""What a fault changes: functions with their new code, in the tests imported already; None for a file."""


class Judges:
    """The tests that judge the mutants of a module."""

    def __init__(self, tree: Path, budget: float, collected: Collected, fresh: Fresh) -> None:
        self.tree, self.budget, self.collected, self.fresh = tree, budget, collected, fresh
        self.concern = Concern(tree)
        self.covered = Covered(COVERED) if COVERED.is_file() else None
        self.file = CACHE / "tests.json"
        #: What is known of tests: durations, which are too slow or fail without a fault, and which are not.
        self.known: dict[str, Any] = {"seconds": {}, "unfit": {}, "sound": {}}
        if self.file.is_file():
            self.known |= json.loads(self.file.read_text(encoding="utf-8"))
        if self.covered is not None:
            self.known["seconds"] = self.covered.seconds | self.known["seconds"]
        self._compiled = [
            name for name, path in self.concern.modules.items() if _COMPILES.search(path.read_text(encoding="utf-8"))
        ]
        self._stamps = self._find_stamps()

    def _find_stamps(self) -> dict[str, str]:
        """Digests of the sources of compiled functions, without a fault."""
        files = [str(self.concern.modules[name]) for name in self._compiled]
        code = (
            "import json, sys; from pathlib import Path; from gpbnb.caching import digest, imported;"
            "print(json.dumps({each: digest(imported(Path(each))) for each in sys.argv[1:]}))"
        )
        environment = os.environ | {"PYTHONPATH": str(self.tree)}
        command = [sys.executable, "-B", "-c", code, *files]
        done = subprocess.run(command, cwd=self.tree, env=environment, check=True, capture_output=True, text=True)
        return dict(json.loads(done.stdout))

    def tests(self, name: str, line: int) -> tuple[list[str], list[str]]:
        """Tests that execute a line, and test files that reach its module; the nearest and quickest first."""
        path = self.tree / name
        files = [str(test.relative_to(self.tree)) for test in self.concern.judges(module_of(path, self.tree))]
        rank = {file: number for number, file in enumerate(files)}
        found = self.covered.tests(name, path.read_text(encoding="utf-8"), line) if self.covered else set()

        def order(test: str) -> tuple[int, float]:
            return rank.get(test.partition("::")[0], len(files)), self.known["seconds"].get(test, math.inf)

        return sorted(found, key=order)[:MOST_TESTS], files[:MOST_FILES]

    def ways(self, name: str, line: int) -> tuple[str, How]:
        """How to run the tests on a fault in a line of a file, and a name for it.

        A fault outside compiled functions needs no compilation. Otherwise they are compiled again, and the tests get
        more time.
        """
        seconds = self.known["seconds"]
        module = module_of(self.tree / name, self.tree)
        if not any(self.concern.reaches(each, module) for each in self._compiled):
            return "valid", How(self.budget, seconds=seconds)
        if not is_compiled((self.tree / name).read_text(encoding="utf-8"), line):
            return "valid", How(self.budget, stamps=self._stamps, seconds=seconds)
        return "compiled again", How(4 * self.budget, seconds=seconds)

    def run(self, files: Sequence[str], way: str, how: How, codes: Codes = None) -> Outcome:
        """Run test files, without those tests that fail or take too long without a fault."""
        unfit = frozenset(self.known["unfit"].setdefault(way, []))
        files = [each for each in files if each not in unfit]
        if how.pictures:
            files = [each for each in files if "pictured" in (self.tree / each.partition("::")[0]).read_text("utf-8")]
        how = how._replace(left_out=unfit)
        found = self.fresh.run(self.tree, files, how) if codes is None else self.collected.run(files, codes, how)
        if not how.pictures:
            for test, seconds in found.seconds.items():
                self.known["seconds"].setdefault(test, round(seconds, 2))
        return found

    def refuse(self, way: str, how: How, tests: Sequence[str], codes: Codes = None) -> bool:
        """Whether tests fail or take too long without a fault, too; they judge no more mutants then."""
        sound, unfit = self.known["sound"].setdefault(way, []), self.known["unfit"].setdefault(way, [])
        names = [each.removesuffix(": the process ended") for each in tests]
        new = [each for each in names if each not in (*sound, *unfit) and (self.tree / each.split("::")[0]).is_file()]
        if not new:
            return False
        how = how._replace(stop=False)
        found = self.fresh.run(self.tree, new, how) if codes is None else self.collected.run(new, {}, how)
        bad = [each for each in new if found.stuck or found.failed]
        sound += [each for each in new if each not in bad]
        unfit += bad
        self.save()
        return bool(bad)

    def save(self) -> None:
        self.file.write_text(json.dumps(self.known, indent=1), encoding="utf-8")


def judge(judges: Judges, name: str, mutant: Mutant) -> dict[str, str]:
    """Seed a fault, run the tests that concern it, and restore the file."""
    path = judges.tree / name
    source = path.read_text(encoding="utf-8")
    other = mutated(source, mutant)
    if other is None or other == source:
        return {"outcome": "no change"}
    try:
        compile(other, name, "exec")
    except SyntaxError:  # not every f-string survives the change of its quotes
        return {"outcome": "no change"}
    before, after = changed_line(source, other)
    row = {"before": before, "after": after}
    tests, files = judges.tests(name, mutant.line)
    if not tests and not files:
        return row | {"outcome": "no test"}
    way, how = judges.ways(name, mutant.line)
    how = how._replace(budget=how.budget * (2 if tests else 1))
    begun = time.monotonic()

    codes: Codes = None
    if way == "valid":
        codes = judges.collected.changed(path, source, other)
    single = [*tests, *files]
    whole = list(dict.fromkeys(each.partition("::")[0] for each in single))
    chosen = whole if codes is None else single

    def with_the_fault(how: How) -> Outcome:
        while True:
            if codes is not None:
                found = judges.run(chosen, way, how, codes)
            else:
                compiled = set(COMPILED.glob("*"))
                try:
                    path.write_text(other, encoding="utf-8")
                    found = judges.run(chosen, way, how)
                finally:
                    path.write_text(source, encoding="utf-8")
                if how.stamps is None:  # what was compiled from a fault is of no further use
                    for file in set(COMPILED.glob("*")) - compiled:
                        file.unlink()
            if not judges.refuse(way, how, [found.stuck] if found.stuck else found.failed, codes):
                return found

    found, outcome = with_the_fault(how), "caught"
    if codes is not None and not found.stuck and not found.failed:
        # What was computed, and kept, while the tests were imported does not have the fault.
        codes, chosen = None, whole
        found = with_the_fault(how)
    if not found.stuck and not found.failed:
        count = len(found.seconds)
        found, outcome = with_the_fault(how._replace(pictures=True)), "caught by a stored picture"
        found.seconds.update({str(i): 0.0 for i in range(count)})
    if found.stuck:
        outcome = "timeout"
    elif not found.failed:
        outcome = "survived"
    by = found.stuck or (found.failed or [f"{len(found.seconds)} tests"])[0]
    judges.save()
    return row | {"outcome": outcome, "by": by, "seconds": f"{time.monotonic() - begun:.1f}"}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__.split("\n\n")[0])
    parser.add_argument("files", nargs="*", help="files of gpbnb; without any, all of them")
    parser.add_argument("--since", metavar="COMMIT", help="files that changed since this commit")
    parser.add_argument("--lines", type=int, default=75, help="one mutant for each so many lines, at least two a file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=12.0, help="seconds of processor time for each mutant")
    parser.add_argument(
        "--measure", action="store_true", help="find the tests that execute each line first; 20 minutes"
    )
    parser.add_argument("--again", action="store_true", help="judge the survivors of the stored results again")
    parser.add_argument("--minutes", type=float, default=math.inf, help="stop after so many minutes; it resumes")
    parser.add_argument("--results", type=Path, default=RESULTS, help="table to continue; without it %(default)s")
    chosen = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    commit, now = git("rev-parse", "--short", "HEAD"), datetime.now(UTC)
    names = chosen_files(chosen.files, chosen.since)
    print(f"mutants: seed {chosen.seed}, commit {commit}, {len(names)} files", flush=True)

    rows = {key(row): row for row in (*read(SURVIVORS), *read(chosen.results))}
    # A result is of no use once its line has changed.
    rows = {at: row for at, row in rows.items() if row["before"] in text_of(row["module"])}
    if chosen.again:
        plan = [
            (row["module"], Mutant(row["operator"], int(row["occurrence"]), int(row["line"])))
            for row in rows.values()
            if row["outcome"] in NOT_CAUGHT and (not chosen.files or row["module"] in names)
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
    os.environ["GPBNB_CACHE_DIR"] = str(COMPILED.parent)
    os.environ["GPBNB_QUIET"] = "1"
    tree = CACHE / f"tree-{os.getpid()}"
    copy_tree(tree)
    concern = Concern(tree)
    if chosen.measure:
        tests = [str(test.relative_to(tree)) for test in concern.tests]
        subprocess.run([sys.executable, "-m", "tests.mutants.covered", tree, COVERED, *tests], cwd=ROOT, check=True)
    load_libraries()
    fresh = Fresh()

    def campaign(collected: Collected) -> None:
        judges = Judges(tree, chosen.budget, collected, fresh)
        end = time.monotonic() + 60 * chosen.minutes
        for number, (name, mutant) in enumerate(plan):
            place = (name, mutant.operator, str(mutant.occurrence), str(mutant.line))
            row = dict(zip(FIELDS, place, strict=False))
            if key(row) in rows and not chosen.again:
                continue
            row["reason"] = rows.get(key(row), {}).get("reason", "")
            if time.monotonic() > end:
                break
            row |= {"commit": commit, "date": f"{now:%Y-%m-%d}"} | judge(judges, name, mutant)
            if row["outcome"] != "no change":
                rows[key(row)] = row
                write(chosen.results, by_place(rows.values()))
            where = f"{name}:{mutant.line} {mutant.operator}"
            print(f"{number + 1}/{len(plan)} {row['outcome']} {where} {row.get('seconds', '')}", flush=True)

    # Without a measurement, tests that none of the faults needs are not imported.
    needed = set(concern.tests)
    if not COVERED.is_file():
        needed = {test for name in names for test in concern.judges(module_of(tree / name, tree))[:MOST_FILES]}
    with_collected(tree, [str(test.relative_to(tree)) for test in sorted(needed)], campaign)
    shutil.rmtree(tree)
    record(list(rows.values()), {name for name, _ in plan}, SURVIVORS, MODULES)
    summary([row for row in rows.values() if row["module"] in names])


if __name__ == "__main__":
    sys.exit(main())
