"""The poster: one page of size A1 whose words stand on it, tell the stored numbers, and do not cover each other."""

from __future__ import annotations

import re

import pytest

from gpbnb.report import poster
from gpbnb.report.gravity_probe_b import summary
from gpbnb.report.guarantees import certificates

from .poster import PAGE

PLACES = """() => [...document.querySelectorAll("svg > :is(text, image)")].map((e) => {
  const b = e.getBBox();
  return [e.tagName, e.textContent, b.x, b.y, b.x + b.width, b.y + b.height];
})"""


@pytest.fixture(scope="module")
def drawn():
    return poster.poster()


@pytest.fixture(scope="module")
def page(drawn, open_page):
    with open_page("_static/favicon.svg") as page:
        page.goto("about:blank")
        page.set_content(PAGE.format(poster.WIDTH, poster.HEIGHT, drawn), wait_until="load")
        yield page


def test_it_prints_as_one_page_of_size_a1(page):
    printed = page.pdf(width=f"{poster.WIDTH}mm", height=f"{poster.HEIGHT}mm", print_background=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 1
    box = re.search(rb"/MediaBox\s*\[0 0 ([\d.]+) ([\d.]+)\]", printed)
    # Chromium rounds the paper to whole pixels of 0.75 points.
    assert [float(side) * 25.4 / 72 for side in box.groups()] == pytest.approx([594, 841], abs=0.5)


def test_nothing_leaves_the_page_or_covers_anything_else(page):
    boxes = page.evaluate(PLACES)
    assert sum(tag == "image" for tag, *_ in boxes) == 6
    assert all(x0 >= 20 and y0 >= 20 and x1 <= 574 and y1 <= 831 for *_, x0, y0, x1, y1 in boxes)
    for i, (_, one, a0, b0, a1, b1) in enumerate(boxes):
        for _, other, c0, d0, c1, d1 in boxes[:i]:
            assert min(a1, c1) <= max(a0, c0) or min(b1, d1) - max(b0, d0) < 2.5, (one, other)


def test_it_tells_the_numbers_of_the_front_page(page):
    words = page.locator("svg > text").all_text_contents()
    table = summary.table()
    for row in (table.header, *table.body):
        at = words.index(row[0])
        assert tuple(words[at : at + len(row)]) == row
    sizes = [each.size for each in certificates.load() if each.verdict == "proved"]
    assert f"{len(sizes)} guarantees come with a certificate of {min(sizes):,} to {max(sizes):,} bytes" in " ".join(
        words
    )


def test_it_is_the_same_at_every_run(drawn):
    assert poster.poster() == drawn
