"""Execute the notebooks of the book, several at a time, and store their outputs in them.

Outputs are kept in a cache until something changes that they depend on: the notebook's code, the sources and data of
the package that it imports, the installed packages, or the processor. `make book` takes them from there too, through
`book/_ext/gpbnb_notebooks.py`.
"""

from __future__ import annotations

import argparse
import asyncio
import difflib
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

from gpbnb import caching

ROOT = Path(__file__).resolve().parents[1]
BOOK = ROOT / "book"
OUTSIDE = re.compile(r"""["'](\.\./[^"'\n]+)["']""")
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
# The longest first, so that none is left over at the end; others follow.
LONGEST = (
    "wordlength",
    "rolling",
    "nonlinear",
    "integration",
    "kalman",
    "year",
    "processors",
    "guarantee",
    "inversion",
    "geometry",
    "rounding",
    "mission",
)
LEDGER = "the ledger"
LEDGER_COMMAND = [sys.executable, "-m", "gpbnb.ledger"]
RUNNERS = ("ipykernel", "ipython", "matplotlib-inline", "nbclient", "nbformat")  # packages that write the outputs
TIMEOUT = 900  # seconds a cell
_FAILED = 1


class Failure(Exception):
    """A notebook did not run to its end."""


def code_of(notebook: Any) -> list[str]:
    """The code cells of a notebook, as text."""
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def named_files(text: str) -> list[Path]:
    """The files outside the book that the code of a notebook names."""
    paths = [(BOOK / name).resolve() for name in OUTSIDE.findall(text)]
    return [path for path in paths if path.is_file()]


def key_of(notebook: Any) -> str:
    """A digest of all that the outputs of a notebook depend on."""
    code = code_of(notebook)
    text = "\n".join(code)
    sources = caching.imported_by(text)
    digest = caching.digest([*caching.with_data(sources), *named_files(text)])
    key = repr((code, digest, caching.environment(sources, text, RUNNERS)))
    return hashlib.sha256(key.encode()).hexdigest()[:24]


def executed(
    paths: Sequence[Path], jobs: int | None = None, say: Callable[[str], None] = print, findings: bool = True
) -> dict[Path, Any]:
    """Notebooks with the outputs of an execution in the present state, from the cache where they are there.

    Parameters
    ----------
    paths : of notebooks; they are not changed.
    jobs : how many to execute at a time; by default one more than there are processors, because one may wait for what
        another compiles.
    say : is told of each start and end.
    findings : whether to run the checks of the ledger meanwhile, for the pages that show them.

    Raises
    ------
    ExceptionGroup : of `Failure`, one for each notebook with an error.
    """
    notebooks = {path: nbformat.read(path, as_version=4) for path in paths}
    folder = caching.cache_folder("notebooks")
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="gpbnb-notebooks-"))
    caching.remove_unused(folder)
    stored = {path: folder / f"{path.stem}.{key_of(notebook)}.json" for path, notebook in notebooks.items()}
    waiting = [path for path, file in stored.items() if _outputs(file) is None]
    if waiting:
        say(f"{len(waiting)} of {len(paths)} notebooks to execute: what they depend on has changed")
        _execute_all({path: stored[path] for path in _longest_first(waiting)}, jobs or _processors() + 1, say, findings)
    for path, notebook in notebooks.items():
        outputs = _outputs(stored[path])
        if outputs is None:
            raise RuntimeError(f"the outputs of {path.name} are not in {stored[path]}; run the command again")
        _put(notebook, outputs)
    return notebooks


def _execute_all(files: dict[Path, Path], jobs: int, say: Callable[[str], None], findings: bool) -> None:
    """Execute notebooks, each in a kernel of its own, and write their outputs to files."""
    began = time.monotonic()
    running: list[str] = []
    done = 0
    failures: list[Failure] = []
    environment = os.environ | {"GPBNB_QUIET": "1"}

    def run(path: Path | None) -> float:
        name = _name(path)
        running.append(name)
        started = time.monotonic()
        try:
            if path is None:  # pages that show the ledger say what is wrong with it
                subprocess.run(LEDGER_COMMAND, env=environment, cwd=ROOT, capture_output=True)
            else:
                _execute(path, files[path], environment)
        except Exception as error:
            raise Failure(f"{name} failed:\n{error}") from error
        finally:
            running.remove(name)
        return time.monotonic() - started

    tasks: list[Path | None] = [None, *files] if findings else [*files]
    with ThreadPoolExecutor(jobs) as pool:
        futures = {pool.submit(run, task): task for task in tasks}
        say(f"  running: {', '.join(_name(task) for task in tasks[:jobs])}")
        for future in as_completed(futures):
            done += 1
            name = _name(futures[future])
            try:
                took = f"{future.result():.0f} s"
            except Failure as failure:
                failures.append(failure)
                took = "FAILED"
            now = f"{time.monotonic() - began:.0f} s"
            say(f"  [{done}/{len(tasks)}, {now}] {name}: {took}; running: {', '.join(running) or 'none'}")
    if failures:
        raise ExceptionGroup(f"{len(failures)} notebooks failed", failures)


def _execute(path: Path, file: Path, environment: dict[str, str]) -> None:
    """Execute one notebook and write the outputs of its code cells to a file."""
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    settings = {"timeout": TIMEOUT, "kernel_name": "python3", "record_timing": False, "coalesce_streams": True}
    client = NotebookClient(notebook, resources={"metadata": {"path": str(path.parent)}}, **settings)
    client.extra_arguments = ["--log-level=ERROR"]  # it warns of TCP without encryption, on this very machine
    asyncio.run(client.async_execute(env=environment))
    # If a source was changed meanwhile, nobody knows what these are the outputs of.
    caching.forget()
    if f"{path.stem}.{key_of(notebook)}.json" != file.name:
        raise RuntimeError(f"{path.name}, or what it depends on, was changed while it ran; run the command again")
    caching.write(file, json.dumps([c.outputs for c in notebook.cells if c.cell_type == "code"]).encode())


def _name(path: Path | None) -> str:
    return LEDGER if path is None else path.stem


def _longest_first(paths: Iterable[Path]) -> list[Path]:
    return sorted(paths, key=lambda path: LONGEST.index(path.stem) if path.stem in LONGEST else len(LONGEST))


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _outputs(file: Path) -> list[Any] | None:
    content = caching.read(file)
    return None if content is None else list(json.loads(content))


def _put(notebook: Any, outputs: list[Any]) -> None:
    """Put outputs into a notebook, and leave out what differs between two runs of the same code."""
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for number, cell in enumerate(notebook.cells):
        cell["id"] = cell.get("id") or f"cell-{number}"
    for count, (cell, found) in enumerate(zip(cells, outputs, strict=True), 1):
        cell.outputs, cell.execution_count = nbformat.from_dict(found), count
        cell.metadata.pop("execution", None)
    notebook.metadata = nbformat.from_dict({"kernelspec": KERNEL, "language_info": {"name": "python"}})
    nbformat.validate(notebook)


def write(path: Path, notebook: Any) -> bool:
    """Write a notebook as a whole, if it differs from what is there; returns whether it did."""
    text = nbformat.writes(notebook) + "\n"
    if path.is_file() and path.read_text(encoding="utf-8") == text:
        return False
    draft = path.with_suffix(".draft")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)
    return True


def differences(path: Path, computed: Any) -> list[str]:
    """How the stored outputs of a notebook differ from computed ones, execution counts aside."""
    stored = nbformat.read(path, as_version=4)
    found = []
    for number, (cell, other) in enumerate(zip(stored.cells, computed.cells, strict=True)):
        if cell.cell_type == "code" and (before := _compared(cell)) != (now := _compared(other)):
            lines = difflib.unified_diff(before, now, "stored", "computed", lineterm="", n=1)
            found.append(f"{path.name}, cell {number}:\n" + "\n".join(lines))
    return found


def _compared(cell: Any) -> list[str]:
    lines: list[str] = []
    for output in cell.outputs:
        lines.append(f"[{output.output_type}]")
        if output.output_type == "stream":
            lines += f"{output.name}: {output.text}".splitlines()
        elif output.output_type == "error":
            lines.append(f"{output.ename}: {output.evalue}")
        else:
            for kind in sorted(output.data):
                content = output.data[kind]
                text = content if isinstance(content, str) else json.dumps(content)
                if kind.startswith("image/"):  # a picture is one very long line
                    text = f"picture {hashlib.sha256(text.encode()).hexdigest()[:12]}"
                lines += f"{kind}: {text}".splitlines()
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("notebooks", nargs="*", type=Path, help="default: all of the book")
    parser.add_argument(
        "--jobs", type=int, help="number of notebooks to run at a time; default: one more than the number of processors"
    )
    parser.add_argument("--check", action="store_true", help="compare with the stored outputs and change nothing")
    given = parser.parse_args(arguments)
    try:
        paths = [path.resolve() for path in given.notebooks] or sorted(BOOK.glob("*.ipynb"))
        found = executed(paths, given.jobs, findings=not given.notebooks)
    except ExceptionGroup as group:
        for failure in group.exceptions:
            print(failure, file=sys.stderr)
        return _FAILED
    if given.check:
        wrong = [each for path, notebook in found.items() for each in differences(path, notebook)]
        print(
            "\n\n".join(
                [*wrong, f"{len(found)} notebooks compared with their stored outputs: {len(wrong)} cells differ"]
            )
        )
        return _FAILED if wrong else 0
    changed = [path.stem for path, notebook in found.items() if write(path, notebook)]
    print(f"{len(changed)} notebooks changed{': ' if changed else ''}{', '.join(changed)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
