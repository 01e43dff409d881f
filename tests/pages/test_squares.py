"""The squares of the errata page in a real browser: keyboard, words, and the rows to which they lead."""

from __future__ import annotations

import pytest

from . import browser as tools


@pytest.fixture(scope="module", params=tools.SIZES)
def page(request, open_page):
    with open_page("book/errata.html", request.param, shared=True) as page:
        yield page


def test_the_squares_are_one_stop_and_the_arrows_go_through_them(page):
    box = page.locator(".squares").first
    squares = box.locator("a.square")
    assert squares.count() == page.evaluate("document.querySelectorAll('.squares')[0].querySelectorAll('a').length")
    assert box.locator("a.square[tabindex='0']").count() == 1
    squares.first.focus()
    for key, expected in (
        ("ArrowLeft", 0),
        ("ArrowRight", 1),
        ("End", squares.count() - 1),
        ("ArrowRight", -1),
        ("Home", 0),
    ):
        page.keyboard.press(key)
        here = page.evaluate("[...document.querySelectorAll('.squares a')].indexOf(document.activeElement)")
        assert here == (squares.count() - 1 if expected == -1 else expected)
        words = squares.nth(here).get_attribute("aria-label")
        assert box.locator(".squares-said").text_content() == words
        assert box.locator("a.square[tabindex='0']").count() == 1


def test_a_square_leads_to_its_row(open_page):
    with open_page("book/errata.html", shared=True) as page:
        square = page.locator(".squares a.square-wrong").first
        target = square.get_attribute("href")
        square.focus()
        page.keyboard.press("Enter")
        page.wait_for_url(f"**/{target}")
        row = page.locator(f"[id='{target.partition('#')[2]}']")
        assert row.locator(".verdict").text_content() == "wrong"
