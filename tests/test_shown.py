"""What users are shown, in shown.txt: the whole text of answers, reports, code in C, objects and warnings.

`python -m tests.test_shown` writes the texts of today into the file; `git diff` shows what has changed.
"""

from __future__ import annotations

import contextlib
import html
import io
import math
import os
import re
import shlex
import subprocess
from pathlib import Path
from unittest import mock

import pytest

from gpbnb.__main__ import main as top
from gpbnb.bounds.check import main as check
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.poles import stored_response
from gpbnb.filters.settled import settled_filter
from gpbnb.report.ledger import command
from gpbnb.report.stored import main as sweeps
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.code import format_words
from gpbnb.wordlength.required import judge
from tests import test_refused

ROOT = Path(__file__).resolve().parents[1]
STORED = Path(__file__).with_name("shown.txt")
FILES = test_refused.FILES | {
    "named.toml": (
        'name = "tracker <1>"\nstates = ["range (m)", "rate (m/s)"]\nmeasurements = ["radar (m)"]\n'
        "Phi = [[1, 0.1], [0, 1]]\nH = [[1, 0]]\nQ = [[1e-4, 0], [0, 1e-2]]\nR = [[0.01]]\nx0 = [0, 0]\n"
        "P0 = [[100, 0], [0, 100]]\n"
    ),
    "biquad.toml": 'name = "low-pass"\nb = [0.1, 0.2, 0.1]\na = [1, -1.2, 0.5]\nstructure = "all"\n',
    "cascade.toml": (
        "sos = [[0.1, 0.2, 0.1, 1, -1.2, 0.5], [1, -1, 0, 1, -0.5, 0.25]]\n"
        'structure = "cascade of direct form II transposed"\norder = "down"\nscale = true\n'
    ),
    "own.py": "def step(fmt, x, u):\n    return [x[0] + u[0] / 8], [x[0]]\n",
    "own.toml": 'step = "own.py:step"\nx0 = [0]\n',
}
COMMANDS = {"wordlength": main, "gpbnb": top, "ledger": command.main, "sweeps": sweeps, "check": check}


def ran(line):
    """What a command prints, an error after "! ", and its exit status unless it is 0."""
    name, *words = shlex.split(line)
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="")
    with contextlib.redirect_stderr(io.StringIO()) as err, contextlib.redirect_stdout(out):
        try:
            status = COMMANDS[name](words)
        except SystemExit as end:
            status = end.code
    out.flush()
    lines = [*out.buffer.getvalue().decode().splitlines(), *(f"! {line}" for line in err.getvalue().splitlines())]
    return "\n".join([*lines, *([f"status {status}"] if status else [])])


def read(page):
    """What is read on a page, a line for each paragraph and row, with bars between cells; versions are left out."""
    body = re.sub(r"<style>.*</style>", "", Path(page).read_text(encoding="utf-8"), flags=re.DOTALL)
    plain = re.sub(r"<[^>]*>", "", re.sub(r"</t[hd]>(?=<t)", " | ", re.sub(r"\n\n[^<]*</pre>", "", body)))
    return "\n".join(line for line in html.unescape(plain).split("\n") if line.strip())


def files(folder, *names):
    """The text of generated files, without the numbers of test vectors."""
    return "\n".join(f"== {name}\n{Path(folder, name).read_text(encoding='utf-8')}" for name in names)


def made(words):
    """The commands that make would run, with what few targets need installed."""
    ready = [word for each in ("made-for", "with-dev", "with-pages", "with-bench") for word in ("-o", f".venv/{each}")]
    asked = ["make", "--no-print-directory", "-n", *ready, *shlex.split(words)]
    env = {"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/")}
    done = subprocess.run(asked, cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    return (done.stdout + done.stderr).replace(str(ROOT), ".").replace("\\\n", "\n")


USED = (ran, read, files, made, format_words, Path, judge, settled_filter, stored_response, FilterDesign)
NAMES = test_refused.NAMES | {each.__name__: each for each in USED}


def texts():
    """For each part the calls, each with its stored text."""
    found, part = {}, []
    for line in STORED.read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            part = found.setdefault(line.removeprefix("# "), [])
        elif line and not line.startswith("    "):
            part.append((line, []))
        elif part:
            part[-1][1].append(line[4:])
    return {name: [(call, "\n".join(lines).rstrip("\n")) for call, lines in part] for name, part in found.items()}


def indented(text):
    return "\n".join(line and f"    {line}" for line in text.split("\n"))


@contextlib.contextmanager
def folder(path):
    """The files, in the current folder; a slow ledger does not say how far it is."""
    with contextlib.chdir(path), mock.patch.object(command, "_PAUSE", math.inf):
        for name, text in FILES.items():
            Path(name).write_text(text, encoding="utf-8")
        yield


def shown(call):
    """The text of a call: what it returns at a prompt, and what print shows, if that is another text."""
    found = eval(call, dict(NAMES))
    if isinstance(found, str):
        return "\n".join(line.rstrip() for line in found.rstrip("\n").splitlines())
    both = repr(found), str(found)
    return "\n".join(line.rstrip() for text in dict.fromkeys(both) for line in text.splitlines())


@pytest.mark.parametrize("part", texts())
def test_users_are_shown_the_stored_text(part, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    with folder(tmp_path):
        for call, text in texts()[part]:
            assert shown(call) == text, call


if __name__ == "__main__":
    import tempfile

    os.environ["COLUMNS"] = "100"
    given = {part: [call for call, _ in calls] for part, calls in texts().items()}
    with tempfile.TemporaryDirectory() as path, folder(path):
        parts = [
            "\n".join([f"# {part}", *(f"{call}\n{indented(shown(call))}" for call in calls)])
            for part, calls in given.items()
        ]
    STORED.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
