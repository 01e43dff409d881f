"""Figures that a phone shows smaller than they were drawn: a tap or a key enlarges them."""

from __future__ import annotations

import pytest

from . import axe
from . import browser as tools

ADDRESS = "book/geometry.html"
SHOWN = "() => document.querySelector('dialog.enlarged')?.open ?? false"


@pytest.fixture(scope="module")
def phone(open_page):
    with open_page(ADDRESS, "phone", shared=True) as page:
        page.evaluate("document.querySelectorAll('img').forEach(i => i.loading = 'eager')")
        page.wait_for_function("[...document.images].every(i => i.complete)")
        page.evaluate(tools.RESTED)
        yield page
        assert page.faults == []


def figures(page):
    return page.locator("article figure img.reduced")


def test_each_figure_of_a_phone_can_be_enlarged(phone):
    every = phone.locator("article figure img").count()
    assert every >= 4
    assert figures(phone).count() == every
    buttons = phone.locator("article .enlarge:visible")
    assert buttons.count() == every
    assert all(button.bounding_box()["height"] >= 24 for button in buttons.all())


@pytest.mark.parametrize("way", ["tap", "Enter", " "])
@pytest.mark.parametrize("end", ["Escape", "button"])
def test_a_figure_is_enlarged_and_the_focus_returns(phone, way, end):
    figure, button = figures(phone).nth(1), phone.locator("article .enlarge:visible").nth(1)
    small = figure.bounding_box()["width"]
    if way == "tap":
        figure.click()
    else:
        button.focus()
        phone.keyboard.press("Enter" if way == "Enter" else "Space")
    assert phone.evaluate(SHOWN)
    large = phone.locator("dialog.enlarged img")
    assert large.get_attribute("src") == figure.get_attribute("src")
    assert large.get_attribute("alt") == figure.get_attribute("alt")
    assert large.bounding_box()["width"] >= max(1.5 * small, large.evaluate("e => e.naturalWidth") - 1)
    assert phone.evaluate("document.activeElement.textContent") == "Close"
    # The whole figure can be seen: it scrolls within the dialog, by the arrow keys as well.
    phone.keyboard.press("Tab")
    assert phone.evaluate("document.activeElement.tagName") == "FIGURE"
    for _ in range(3):
        phone.keyboard.press("ArrowRight")
    phone.wait_for_function("document.activeElement.scrollLeft > 0")
    phone.keyboard.press("Escape") if end == "Escape" else phone.locator("dialog.enlarged button").click()
    assert not phone.evaluate(SHOWN)
    phone.wait_for_selector("dialog.enlarged", state="detached")
    assert button.evaluate("e => e === document.activeElement")


def test_axe_finds_nothing_in_an_enlarged_figure(phone):
    figures(phone).first.click()
    try:
        assert axe.violations(phone, within="dialog.enlarged") == []
    finally:
        phone.keyboard.press("Escape")
        phone.emulate_media(color_scheme="light")
