"""Topics made up for the tests, as modules that a subprocess can import by name too."""

import re
import textwrap

import pytest

from gpbnb.report.ledger import load_statements, select

CHECKED = tuple(entry.id for entry in select(load_statements(), "hung1984", "I"))


@pytest.fixture
def topic(tmp_path, monkeypatch):
    """Return a function that makes an importable module with the given checks and returns its name."""
    monkeypatch.syspath_prepend(tmp_path)

    def make(name, body):
        source = (
            "from gpbnb.report.ledger.finding import Verdict, answer, compare\n"
            "from gpbnb.report.ledger.judge import Checks\n\nCHECKS = Checks()\n\n"
        )
        (tmp_path / f"{name}.py").write_text(source + textwrap.dedent(body), encoding="utf-8")
        return name

    return make


@pytest.fixture
def complete(topic, request):
    """A topic that checks all of hung1984, I."""
    name = re.sub(r"\W", "_", request.node.name)
    return topic(
        f"complete_{name}",
        f"""
        CALLS = []

        def both(printed):
            CALLS.append(printed.id)
            return compare(True, "$|a|$, not \\"b\\"", note="line one\\nline two")

        CHECKS.update(dict.fromkeys({CHECKED}, both))
        """,
    )
