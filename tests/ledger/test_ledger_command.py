"""``python -m gpbnb.ledger``: output, exit status, errors."""

import csv
import importlib
import io
import json
import os
import pty
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from gpbnb.report.ledger import command as command
from gpbnb.report.ledger import examine, load_statements, select, table
from gpbnb.report.ledger.render import to_csv

INVENTORY = load_statements()
CHECKED = [entry for entry in INVENTORY if entry.id.startswith("hung1984.I.")]
# The command with other topics: what they check is known, and quick.
DRIVER = (
    "import sys; from importlib import import_module; from gpbnb.report.ledger import command;"
    "command.TOPICS = {name: import_module(name).CHECKS for name in sys.argv.pop(1).split()};"
    "sys.exit(command.main(sys.argv[1:]))"
)
ROOT = Path(__file__).parents[2]


class Unclosed(io.BytesIO):
    """Bytes that stay readable when the stream on top of them is closed."""

    def close(self):
        pass


@pytest.fixture
def ledger(monkeypatch):
    """The command in this process, which has loaded the checks of the package already."""

    def call(topics, *arguments):
        stdout, stderr = Unclosed(), Unclosed()
        with monkeypatch.context() as patch:
            patch.setattr(command, "TOPICS", made(*topics.split()))
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


def made(*names):
    return {name: importlib.import_module(name).CHECKS for name in names}


def records(stdout):
    return list(csv.DictReader(io.StringIO(stdout.decode(), newline=""), strict=True))


def test_the_command_itself_runs_the_topics_of_the_package():
    arguments = [sys.executable, "-m", "gpbnb.ledger", "--format", "csv", "--document", "savage2016"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(arguments, capture_output=True, env=environment, check=False)
    found = records(done.stdout)
    assert list(found[0]) == ["id", "document", "kind", "printed", "recomputed", "agrees", "verdict", "note"]
    assert [record["id"] for record in found] == [entry.id for entry in INVENTORY if entry.document == "savage2016"]
    missing = sum(not record["verdict"] for record in found)
    assert f"\n{missing} entries have no check\n" in done.stderr.decode()
    assert done.returncode == (1 if missing else 0)


def test_one_record_an_entry_and_status_1_while_checks_are_missing(ledger, complete):
    done = ledger(complete)
    found = records(done.stdout)
    assert [record["id"] for record in found] == [entry.id for entry in INVENTORY]
    assert [record["printed"] for record in found] == [entry.printed for entry in INVENTORY]
    lacking = len(INVENTORY) - len(CHECKED)
    assert done.stderr.decode() == (
        f"{len(INVENTORY)} entries: {len(CHECKED)} verified, {lacking} no check\n{lacking} entries have no check\n"
    )
    assert done.returncode == 1


def test_status_0_when_the_selection_is_complete(ledger, complete):
    done = ledger(complete, "--document", "hung1984", "--chapter", "I")
    assert [record["verdict"] for record in records(done.stdout)] == ["verified"] * len(CHECKED)
    assert done.stderr.decode() == f"{len(CHECKED)} entries: {len(CHECKED)} verified\n0 entries have no check\n"
    assert done.returncode == 0


def test_sections(ledger, complete):
    done = ledger(complete, "--document", "hung1984", "--chapter", "II", "--section", "1", "9")
    assert {record["id"].split(".")[2][:2] for record in records(done.stdout)} >= {"s1", "eq", "s9"}
    assert len(records(done.stdout)) == sum(
        entry.id.startswith("hung1984.II.") and entry.section in {"1", "9", "9.1", "9.2"} for entry in INVENTORY
    )


def test_formats(ledger, complete):
    part = examine(select(INVENTORY, "hung1984", "I"), made(complete))
    chosen = ("--document", "hung1984", "--chapter", "I")
    assert ledger(complete, *chosen).stdout.decode() == to_csv(part)
    assert ledger(complete, *chosen, "--format", "markdown").stdout.decode() == table(part).markdown() + "\n"
    assert [item["agrees"] for item in json.loads(ledger(complete, *chosen, "--format", "json").stdout)] == [
        True
    ] * len(CHECKED)
    text = ledger(complete, *chosen, "--format", "text").stdout.decode()
    assert text.startswith('verified      hung1984.I.two-tasks  $|a|$, not "b"  line one line two\n')


def test_output_does_not_depend_on_the_terminal_encoding(ledger, complete):
    done = ledger(complete, "--document", "hung1982")
    assert "zᵣ" in done.stdout.decode("utf-8")


def test_two_runs_are_alike(ledger, complete):
    assert ledger(complete).stdout == ledger(complete).stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--document", "hung1983"],
            "got document 'hung1983', which no entry has; needed one of hung1984, hung1982, savage2016",
        ),
        (["--chapter", "V"], "got chapter 'V'"),
        (["--section", "2", "99"], "got section '99'"),
        (["--section"], "expected at least one argument"),
        (["--format", "xml"], "invalid choice: 'xml'"),
        (["--output", "."], "needed a regular file"),
        (["--output", os.devnull], "needed a regular file"),
        (["--output", "no/such/file.csv"], "needed an existing directory"),
        (["extra"], "unrecognized arguments: extra"),
    ],
)
def test_bad_arguments_are_explained_with_status_2(ledger, complete, arguments, message):
    done = ledger(complete, *arguments)
    assert done.returncode == 2
    assert message in done.stderr.decode()
    assert "Traceback" not in done.stderr.decode()
    assert done.stdout == b""


def test_a_check_that_raises_is_named_and_hides_no_other(ledger, topic):
    name = topic(
        "raising_topic",
        """
        def divides(printed):
            return 1 / 0

        CHECKS.update(dict.fromkeys(OTHERS, lambda printed: compare(True, "1")))
        CHECKS["hung1984.I.two-tasks"] = divides
        """.replace("OTHERS", repr(tuple(entry.id for entry in CHECKED[1:]))),
    )
    done = ledger(name, "--document", "hung1984", "--chapter", "I")
    assert done.returncode == 3
    assert [record["verdict"] for record in records(done.stdout)] == ["", *["verified"] * len(CHECKED[1:])]
    first, *rest = done.stderr.decode().splitlines()
    assert first.startswith("the check of hung1984.I.two-tasks failed: ZeroDivisionError: division by zero (")
    assert first.endswith("raising_topic.py:8)")
    assert rest == [f"{len(CHECKED)} entries: {len(CHECKED) - 1} verified, 1 check failed", "0 entries have no check"]


def test_output_file_is_replaced_as_a_whole(ledger, complete, tmp_path):
    chosen = ("--document", "hung1984", "--chapter", "I")
    target = tmp_path / "out" / "ledger.csv"
    target.parent.mkdir()
    target.write_text("old", encoding="utf-8")
    link = target.with_name("link.csv")
    link.symlink_to(target)
    done = ledger(complete, *chosen, "--output", str(link))
    assert done.returncode == 0
    assert done.stdout == b""
    assert b"0 entries have no check" in done.stderr
    assert target.read_bytes() == ledger(complete, *chosen).stdout
    assert link.is_symlink()
    assert {path.name for path in target.parent.iterdir()} == {"ledger.csv", "link.csv"}


def test_help_explains_the_exit_status(ledger, complete):
    done = ledger(complete, "--help")
    assert done.returncode == 0
    assert b"exit status: 0" in done.stdout


@pytest.mark.parametrize("merged", [False, True])
def test_a_reader_that_leaves_early_gets_no_traceback(complete, tmp_path, merged):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(tmp_path)])}
    reading, writing = os.pipe()
    os.close(reading)
    errors = writing if merged else subprocess.PIPE
    started = [sys.executable, "-c", DRIVER, complete]
    done = subprocess.run(started, stdout=writing, stderr=errors, env=environment, check=False)
    os.close(writing)
    assert done.returncode == 1
    if not merged:
        assert done.stderr == b""


def test_a_progress_bar_on_a_terminal_only(complete, tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(tmp_path)])}
    main_end, terminal = pty.openpty()
    termios.tcsetwinsize(terminal, (24, 80))
    started = [sys.executable, "-c", DRIVER, complete, "--document", "hung1984", "--chapter", "I"]
    done = subprocess.run(started, stdout=subprocess.PIPE, stderr=terminal, env=environment, check=False)
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
    assert b"checks:" not in done.stdout
