"""``python -m gpbnb.ledger``: output, exit status, errors."""

import csv
import io
import os
import pty
import stat
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from gpbnb.report.ledger import command, load_statements
from gpbnb.report.ledger.checking import Row
from gpbnb.report.ledger.stored import load_findings

INVENTORY = load_statements()
ROOT = Path(__file__).parents[2]
CHOSEN = ("--document", "hung1984", "--chapter", "I")


def stored(entries, progress=iter):
    """The stored findings in place of those of the checks, which take a minute."""
    return tuple(Row(each, load_findings()[each.id]) for each in progress(tuple(entries)))


class Unclosed(io.BytesIO):
    """Bytes that stay readable when the stream on top of them is closed."""

    def close(self):
        pass


@pytest.fixture
def ledger(monkeypatch):
    """The command in this process, with the stored findings."""

    def call(*arguments):
        stdout, stderr = Unclosed(), Unclosed()
        with monkeypatch.context() as patch:
            patch.setattr(command, "examine", stored)
            patch.setattr(sys, "stdout", io.TextIOWrapper(stdout, encoding="ascii"))
            patch.setattr(sys, "stderr", io.TextIOWrapper(stderr, encoding="ascii", errors="backslashreplace"))
            try:
                status = command.main(arguments)
            except SystemExit as end:
                status = end.code
            sys.stdout.flush()
            sys.stderr.flush()
        return subprocess.CompletedProcess(arguments, status, stdout.getvalue(), stderr.getvalue())

    return call


def records(stdout):
    return list(csv.DictReader(io.StringIO(stdout.decode(), newline=""), strict=True))


def run(*arguments, **streams):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "ascii"}
    started = [sys.executable, "-m", "gpbnb.ledger", *arguments]
    return subprocess.run(started, env=environment, check=False, **streams)


def test_one_record_an_entry(ledger):
    done = ledger()
    found = records(done.stdout)
    assert [record["id"] for record in found] == [entry.id for entry in INVENTORY]
    assert [record["printed"] for record in found] == [entry.printed for entry in INVENTORY]
    assert done.stderr.decode().startswith(f"{len(INVENTORY)} entries: ")
    assert done.returncode == 0
    assert done.stdout == ledger().stdout
    assert "zᵣ" in done.stdout.decode("utf-8")


def test_output_file_is_replaced_as_a_whole(ledger, tmp_path):
    target = tmp_path / "out" / "ledger.csv"
    target.parent.mkdir()
    target.write_text("old", encoding="utf-8")
    link = target.with_name("link.csv")
    link.symlink_to(target)
    done = ledger(*CHOSEN, "--output", str(link))
    assert done.returncode == 0
    assert done.stdout == b""
    assert target.read_bytes() == ledger(*CHOSEN).stdout
    assert link.is_symlink()
    assert {path.name for path in target.parent.iterdir()} == {"ledger.csv", "link.csv"}


def test_a_pipe_is_refused_and_stays(ledger, tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    done = ledger(*CHOSEN, "--output", str(tmp_path / "pipe.csv"))
    assert (done.returncode, b"needed a regular file" in done.stderr) == (2, True)
    assert stat.S_ISFIFO((tmp_path / "pipe.csv").stat().st_mode)


def test_the_command_itself_shows_its_progress_on_a_terminal_and_lets_a_reader_leave():
    """A run of the command imports what computes, which takes seconds."""
    main_end, terminal = pty.openpty()
    termios.tcsetwinsize(terminal, (24, 80))
    reading, writing = os.pipe()
    os.close(reading)
    done = run("--document", "hung1984", "--chapter", "II", "--section", "4", stdout=writing, stderr=terminal)
    os.close(writing)
    os.close(terminal)
    shown = b""
    try:
        while chunk := os.read(main_end, 4096):
            shown += chunk
    except OSError:  # Linux says so when the other end is closed
        pass
    os.close(main_end)
    assert done.returncode == 0
    assert b"checks:" in shown
    assert b"Traceback" not in shown
