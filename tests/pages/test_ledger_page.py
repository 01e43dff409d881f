"""The searchable ledger in a real browser: search, filters, keyboard, links, phone, paper, and without scripts."""

from __future__ import annotations

import json
import re

import pytest

from . import browser as tools

LEDGER = "book/ledger-1984-3.html"
pytestmark = pytest.mark.skipif(not (tools.HTML / LEDGER).is_file(), reason="the book has no ledger page")
EMPTY = "[...document.querySelectorAll('.ledger table')].filter(t => t.offsetHeight).map(t => t.innerText)"
SHOWN = "document.querySelectorAll('.ledger tbody tr[id]:not([hidden])').length"


@pytest.fixture(scope="module")
def page(open_page):
    with open_page(LEDGER, shared=True) as page:
        yield page


@pytest.fixture(autouse=True)
def reset(page):
    yield
    page.set_viewport_size(tools.SIZES["desktop"])
    page.emulate_media(media="screen")
    page.locator(".ledger-form button").evaluate("button => button.click()")  # a pointer may miss it while it moves


def count(page):
    """What the page says, checked against the rows that are there to be seen."""
    said = page.locator(".ledger-form output").text_content()
    shown, every = map(int, re.fullmatch(r"(\d+) of (\d+) statements shown", said).groups())
    assert shown == page.evaluate(SHOWN)
    assert every == page.locator(".ledger tbody tr[id]").count()
    return shown, every


def test_everything_is_shown_at_first(page):
    shown, every = count(page)
    assert shown == every > 50


@pytest.mark.parametrize("name", ["verdict", "kind", "chapter"])
def test_each_choice_shows_as_many_entries_as_it_says(page, name):
    select = page.locator(f'.ledger-form select[name="{name}"]')
    for option in select.locator("option").all()[1:]:
        select.select_option(option.get_attribute("value"))
        assert count(page)[0] == int(re.search(r"\((\d+)\)$", option.text_content())[1])
    select.select_option("")
    shown, every = count(page)
    assert shown == every


def test_filters_and_words_hold_together(page):
    page.locator('select[name="kind"]').select_option("equation")
    both = page.evaluate("[...document.querySelectorAll('tr[data-kind=equation]')].map(r => r.id)")
    assert count(page)[0] == len(both)
    page.locator('input[name="words"]').fill("EQ125 hung1984")
    shown = page.evaluate("[...document.querySelectorAll('.ledger tbody tr[id]:not([hidden])')].map(r => r.id)")
    assert shown == [row for row in both if "eq125" in row.lower()]
    assert "hung1984.II.eq125" in shown


def test_formulas_are_found_as_typed_and_by_greek_letter(page):
    words = page.locator('input[name="words"]')
    words.fill(r"\beta")
    tex, _ = count(page)
    words.fill("β")
    letter, _ = count(page)
    assert letter >= tex > 5


def test_nothing_found_leaves_no_empty_table(page):
    page.locator('input[name="words"]').fill("zzzz")
    assert count(page)[0] == 0
    assert page.evaluate(EMPTY) == []


def test_the_keyboard_alone_searches_filters_and_resets(page):
    words = page.locator('input[name="words"]')
    words.focus()
    page.keyboard.type("gain")
    found, every = count(page)
    assert 0 < found < every
    for name in ("verdict", "kind", "chapter"):
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.name") == name
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert count(page) == (every, every)
    assert words.input_value() == ""


def test_enter_in_the_search_box_stays_on_the_page(page):
    words = page.locator('input[name="words"]')
    words.fill("gain")
    before = page.evaluate("(window.still_here = true, location.href)")  # page.url follows the address a moment later
    words.press("Enter")
    assert page.evaluate("[location.href, window.still_here]") == [before, True]
    assert words.input_value() == "gain"


def test_a_link_to_a_hidden_entry_shows_it(page):
    page.locator('input[name="words"]').fill("zzzz")
    page.evaluate("location.hash = 'hung1984.II.eq105'")
    row = page.locator('[id="hung1984.II.eq105"]')
    row.wait_for(state="visible")
    box = row.bounding_box()
    assert 0 <= box["y"] < tools.SIZES["desktop"]["height"]


UNSET = (
    "all => all.filter(e => !e.querySelector('mjx-container') || e.querySelector('mjx-merror')).map(e => e.textContent)"
)


def test_collapsed_formulas_are_typeset_when_opened_and_all_before_printing(open_page):
    with open_page(LEDGER, shared=True) as page:
        evidence = page.locator(".ledger tr[id] details:has(.math)").first
        assert evidence.locator("mjx-container").count() == 0
        evidence.locator("summary").click()
        evidence.locator("mjx-container").first.wait_for()
        page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        assert page.locator(".ledger .math").evaluate_all(UNSET) == []
        assert page.faults == []


def test_evidence_is_collapsed_only_where_nothing_depends_on_an_error(page):
    collapsed = page.evaluate(
        "[...document.querySelectorAll('.ledger tr[id]:has(details)')].map(r => r.dataset.verdict)"
    )
    assert set(collapsed) == {"verified", "given", "misprint"}
    assert page.faults == []


def test_nothing_is_cut_on_a_phone(page):
    page.set_viewport_size(tools.SIZES["phone"])
    assert page.evaluate("document.documentElement.scrollWidth") == tools.SIZES["phone"]["width"]
    for box in page.locator(".ledger-form :is(input, select, button)").evaluate_all(
        "all => all.map(e => { const b = e.getBoundingClientRect(); return [b.left, b.right] })"
    ):
        assert 0 <= box[0] < box[1] <= tools.SIZES["phone"]["width"]
    page.locator('input[name="words"]').fill("zzzz")
    assert page.evaluate(EMPTY) == []


def test_paper_has_the_tables_and_no_form(page):
    page.emulate_media(media="print")
    assert not page.locator(".ledger-form").is_visible()
    row = page.locator('[id="hung1984.II.eq125"]')
    row.wait_for(state="visible")
    assert row.evaluate("e => getComputedStyle(e).display") == "table-row"


@pytest.mark.parametrize("scripts", [True, False])
def test_it_works_from_the_file_system_and_without_scripts(open_page, page, scripts):
    context = page.context.browser.new_context(java_script_enabled=scripts)
    try:
        other = context.new_page()
        other.goto((tools.HTML / LEDGER).as_uri(), wait_until="domcontentloaded")
        assert other.locator(".ledger-form").is_visible() == scripts
        assert other.locator('[id="hung1984.II.eq125"]').is_visible()
        if scripts:
            other.locator('input[name="words"]').fill("zzzz")
            assert other.locator(".ledger-form output").text_content().startswith("0 of ")
    finally:
        context.close()


def test_other_pages_can_be_led_to_a_statement():
    """The labels that Sphinx was given lead to rows that are there."""
    notation = (tools.HTML / "book" / "notation.html").read_text(encoding="utf-8")
    targets = re.findall(r'href="(ledger-[\w-]+\.html)#([^"]+)"', notation)
    rows = {
        (path.name, row)
        for path in (tools.HTML / "book").glob("ledger-*.html")
        for row in re.findall(r'<tr id="([^"]+)"', path.read_text(encoding="utf-8"))
    }
    assert len(set(targets)) > 20
    assert set(targets) <= rows


def test_filters_and_words_write_the_address(open_page, page):
    """The address leads to what is shown, and a reset clears it; the place on the page stays."""
    page.evaluate("location.hash = 'hung1984.II.eq105'")
    page.locator('select[name="kind"]').select_option("equation")
    page.locator('input[name="words"]').fill("gain β")
    shown = count(page)
    address = page.evaluate("location.href.slice(location.href.indexOf('book/'))")
    assert "kind=equation" in address
    assert address.endswith("#hung1984.II.eq105")
    page.locator(".ledger-form button").click()
    assert page.evaluate("location.href").endswith(f"{LEDGER}#hung1984.II.eq105")
    with open_page(address.partition("#")[0], shared=True) as other:
        assert other.locator('input[name="words"]').input_value() == "gain β"
        assert count(other) == shown
    page.evaluate("history.replaceState(null, '', location.pathname)")


def test_the_search_of_the_book_knows_the_ledger():
    index = (tools.HTML / "searchindex.js").read_text(encoding="utf-8")
    data = json.loads(index[index.index("{") : index.rindex("}") + 1])
    places = data["terms"]["boresight"]
    found = {data["docnames"][place] for place in (places if isinstance(places, list) else [places])}
    assert any(name.startswith("book/ledger-") for name in found)
