"""The timeline against the bibliography and the text of the page that shows it."""

from __future__ import annotations

import re
from pathlib import Path

from gpbnb.report.gravity_probe_b import timeline

BOOK = Path(__file__).resolve().parents[2] / "book"
ENTRIES = {
    entry.partition(",")[0]: entry
    for entry in re.split(r"^@\w+\{", (BOOK / "references.bib").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
}


def year(key):
    return re.search(r"^\s*year\s*=\s*\{(\d+)\}", ENTRIES[key], re.MULTILINE)[1]


def test_every_year_is_that_of_its_source():
    events = {each.words.replace("\n", " "): each for each in timeline.EVENTS}
    flight = [events.pop(name) for name in ("launch", "data")]
    apollo = events.pop("Apollo: 15-bit words, Potter's square root")
    assert (apollo.begin, apollo.end) == (year("kalman1960"), year("dyer1969"))
    assert set(apollo.sources) == {"tracy2022", "dyer1969"}
    for each in events.values():
        assert [year(key) for key in each.sources] == [each.begin]
        assert each.end == ""
    told = " ".join((BOOK / "story.md").read_text(encoding="utf-8").split())
    launch, data = (each.when.replace("–", " to ") for each in flight)
    assert f"launched on {launch}, and it collected data from {data}." in told
    assert all(each.sources == ("everitt2011",) for each in flight)


def test_words_and_table_name_every_event():
    said, table = timeline.description(), timeline.sources().splitlines()
    assert table[0].startswith(":::{dropdown}")
    assert table[-1] == ":::"
    rows = [line for line in table if "{cite:p}" in line]
    for each in timeline.EVENTS:
        words = each.words.replace("\n", " ")
        assert f"{each.when}, {words}" in said
        (row,) = [row for row in rows if f"| {each.when} | {words} |" in row]
        assert set(re.search(r"`(.*)`", row)[1].split(",")) == set(each.sources)
    assert len(rows) == len(timeline.EVENTS)
    html = timeline.picture()
    assert html == timeline.picture()
    assert html.startswith('<figure><img alt="A timeline')


def test_the_earliest_year_is_above():
    (ax,) = timeline.figure().axes
    heights = {text.get_text(): ax.transData.transform(text.get_position())[1] for text in ax.texts}
    assert heights["1960"] > heights["2000"]
