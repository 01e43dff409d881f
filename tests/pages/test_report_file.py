"""The report file of the command, in a browser: on paper, on a phone, in both colour schemes."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import pytest

from gpbnb.wordlength.__main__ import main

from . import axe
from . import browser as tools

MODEL = Path(__file__).resolve().parents[2] / "book" / "_static" / "tracker.toml"


@pytest.fixture(scope="module")
def report(tmp_path_factory, open_page):
    folder = tmp_path_factory.mktemp("report")
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        assert main([str(MODEL), "--tolerance", "0.01", "--report", str(folder / "report.html")]) == 0
    with tools.serve(folder) as base, open_page("_static/favicon.svg") as page:
        page.goto(f"{base}report.html", wait_until="load")
        yield page


def test_it_prints_on_two_pages(report):
    printed = report.pdf(format="A4")
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2


@pytest.mark.parametrize("size", tools.SIZES)
def test_it_fits_the_window_and_axe_finds_nothing(report, size):
    report.set_viewport_size(tools.SIZES[size])
    assert report.evaluate("document.documentElement.scrollWidth") <= tools.SIZES[size]["width"]
    report.evaluate(axe.script())
    for scheme in ("light", "dark"):
        report.emulate_media(color_scheme=scheme)
        found = report.evaluate("async () => (await axe.run()).violations.map(v => v.id)")
        assert found == []
    report.set_viewport_size(tools.SIZES["desktop"])
    report.emulate_media(color_scheme="light")
