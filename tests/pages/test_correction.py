"""Bound (125) above its correction, in a real browser: marks that are seen without colour, and no formula cut off."""

from __future__ import annotations

import pytest

from . import browser as tools

WIDTHS = """() => [...document.querySelectorAll(".correction-printed, .correction-corrected")].map((panel) => {
  const inside = panel.getBoundingClientRect();
  return [...panel.querySelectorAll("mjx-c, mjx-munder")].every((sign) => {
    const box = sign.getBoundingClientRect();
    return box.left >= inside.left && box.right <= inside.right;
  });
})"""
BRACES = """(name) => [...document.querySelectorAll(`.correction-${name} mjx-munder`)]
  .filter((each) => !each.parentElement.closest("mjx-munder, mjx-munderover"))
  .map((each) => getComputedStyle(each).color)"""

LIMITS = """() => [...document.querySelectorAll(".correction mjx-munderover, .correction mjx-munderover *")]
  .map((each) => getComputedStyle(each).color)"""


@pytest.fixture(scope="module", params=tools.SIZES)
def page(request, open_page):
    with open_page("book/errata.html", request.param, shared=True) as page:
        page.locator(".correction").scroll_into_view_if_needed()
        page.evaluate(tools.SETTLED)
        page.evaluate(tools.RESTED)
        yield page


def test_both_formulas_lie_within_their_panels(page):
    assert page.evaluate(WIDTHS) == [True, True]
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_each_brace_has_the_colour_of_its_panel(page):
    printed, corrected = (page.evaluate(BRACES, name) for name in ("printed", "corrected"))
    assert (len(printed), len(corrected)) == (4, 2)
    (one,), (other,) = set(printed), set(corrected)
    plain = page.evaluate("getComputedStyle(document.querySelector('.correction-printed')).color")
    assert len({one, other, plain}) == 3
    # The limits of a sum are no brace.
    assert {*page.evaluate(LIMITS)} == {plain}
