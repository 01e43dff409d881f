"""Every page of the built book in a real browser without a network."""

from __future__ import annotations

from html.parser import HTMLParser
from itertools import pairwise
from urllib.parse import unquote, urljoin, urlsplit

import pytest
from PIL import Image

from . import axe
from . import browser as tools

PAGES = tools.pages()
FORMULAS = 12
"""Formulas that axe looks at, at the beginning and at the end of a page."""
LONG_PAGES = ("book/kalman.html", "book/ledger-1984-3.html")
CHAPTERS = [each for each in PAGES if each.startswith("book/") and not each.startswith("book/ledger-")]


def on_a_desktop(addresses):
    """Mark a test that looks at these pages on a desktop alone."""
    return pytest.mark.parametrize("page", [(a, "desktop") for a in addresses], ids="-".join, indirect=True)


FOCUS = """() => {
  const e = document.activeElement;
  const box = e.getBoundingClientRect();
  const style = getComputedStyle(e);
  const marked = style.outlineStyle !== "none" || style.boxShadow !== "none";
  const inside = box.bottom > 0 && box.top < innerHeight && box.width > 0;
  return { place: `${e.tagName} ${box.left} ${box.top + scrollY} ${e.textContent.trim().slice(0, 40)}`,
    shown: marked && inside, main: document.querySelector("main").contains(e) };
}"""


def test_loads_from_this_machine_alone(page):
    assert page.faults == []
    assert page.title().strip()


def test_every_formula_that_is_shown_is_rendered(page):
    raw = page.locator(".math").evaluate_all(
        "all => all.filter(e => e.checkVisibility() && !e.querySelector('mjx-container')).map(e => e.textContent)"
    )
    assert raw == []
    assert page.locator("mjx-merror, [data-mjx-error]").all_text_contents() == []


def test_no_formula_or_table_is_left_as_typed(page):
    """An output that is not parsed as MyST shows its dollars and bars; code is meant to, and a script is not seen."""
    text = page.locator("main").evaluate(
        "e => { e = e.cloneNode(true);"
        " e.querySelectorAll('pre, code, dt, script, .math').forEach(x => x.remove()); return e.textContent }"
    )
    assert [line for line in text.splitlines() if "$" in line or "| --" in line or "| —" in line] == []


def test_every_picture_loads_and_has_alt_text(page):
    page.evaluate("document.querySelectorAll('img').forEach(i => i.loading = 'eager')")
    page.wait_for_function("[...document.images].every(i => i.complete)")
    pictures = page.locator("article img").evaluate_all(
        "all => all.map(i => ({src: i.src, alt: i.alt.trim(), width: i.naturalWidth}))"
    )
    # The name of the file is what Sphinx puts where an author gave no text.
    poor = [p for p in pictures if not p["alt"] or not p["width"] or p["alt"].endswith((".png", ".svg", ".jpg"))]
    assert poor == []


def test_never_scrolls_sideways(page):
    page.evaluate("window.scrollTo(1000, 0)")
    assert page.evaluate("[document.documentElement.scrollWidth, window.scrollX]") == [page.viewport_size["width"], 0]


@on_a_desktop(tools.pages())
def test_on_a_desktop_only_formulas_scroll(page):
    """Code, outputs and tables fit the column; a formula scrolls only where it has no place left to break."""
    scrolling = page.locator("article :is(div, pre)").evaluate_all(
        "all => all.filter(e => e.scrollWidth > e.clientWidth + 1 && /auto|scroll/.test(getComputedStyle(e).overflowX))"
        ".map(e => e.textContent.trim().slice(0, 80))"
    )
    assert scrolling == []


def test_only_what_scrolls_is_a_stop_of_the_keyboard(page):
    idle = page.locator("article :is(div, pre, mjx-container)[tabindex='0']").evaluate_all(
        "all => all.filter(e => (e.querySelector(':scope > mjx-math') ?? e).scrollWidth <= e.clientWidth)"
        ".map(e => e.textContent.trim().slice(0, 80))"
    )
    assert idle == []


def test_every_formula_can_be_heard(page):
    assert page.locator("mjx-container:not(:has(mjx-assistive-mml math))").count() == 0


def test_headings_step_down_by_one(page):
    levels = page.locator("main :is(h1, h2, h3, h4, h5, h6)").evaluate_all(
        "all => all.filter(h => h.checkVisibility()).map(h => Number(h.tagName[1]))"
    )
    assert levels[:1] == [1]
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_columns_of_tables_have_names(page):
    nameless = page.locator("article table.table, article .ledger-table, article .calculator table").evaluate_all(
        "all => all.filter(t => { const names = [...t.querySelectorAll('thead th')];"
        " return !names.length || names.some(n => !n.textContent.trim()) }).map(t => t.textContent.trim().slice(0, 80))"
    )
    assert nameless == []


def test_axe_finds_no_violation(page):
    """Formulas and colours are the same in each look: one look is enough, at all formulas on one page."""
    formulas, desktop = 0, page.viewport_size == tools.SIZES["desktop"]
    if desktop:
        formulas = page.locator("mjx-container").count() if page.url.endswith(LONG_PAGES[0]) else FORMULAS
    assert axe.violations(page, formulas, colours=desktop) == []


def test_index_leads_to_the_first_page(open_page):
    with open_page("") as page:
        page.wait_for_url("**/book/index.html")
        assert page.locator("article h1").count() == 1


def test_the_colour_mode_can_be_chosen(open_page):
    with open_page("book/index.html") as page:
        seen = set()
        for _ in range(3):
            page.locator(".theme-switch-button").first.click()
            seen.add(page.locator("html").get_attribute("data-mode"))
        assert seen == {"light", "dark", "auto"}
        assert page.faults == []


def test_the_keyboard_skips_to_the_text_and_shows_where_it_is(open_page):
    with open_page("book/rounding.html", shared=True) as page:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.getAttribute('href')") == "#main-content"
        page.wait_for_function("document.activeElement.getBoundingClientRect().top >= 0")  # it slides in
        page.keyboard.press("Enter")
        seen = []
        for _ in range(40):
            page.keyboard.press("Tab")
            seen.append(page.evaluate(FOCUS))
        # No two stops one after the other are the same, all are seen, and the first is in the text.
        assert all(a["place"] != b["place"] for a, b in pairwise(seen))
        assert [each["place"] for each in seen if not each["shown"]] == []
        assert seen[0]["main"]


@on_a_desktop(["book/kalman.html"])
def test_chapters_show_their_errors_with_badges(page):
    table = page.locator(".ledger-errors")
    assert table.count() == 1
    assert table.locator("thead th").all_inner_texts() == ["Error", "Verdict", "Statements affected"]
    rows = table.locator("tbody tr")
    assert rows.count() == table.locator("tbody tr > th").count() > 5
    assert table.locator("tbody tr:has(> td .verdict):has(> td a)").count() == rows.count()
    assert table.locator("tbody tr:has(details)").count() > 5


def test_search_finds_a_word(open_page):
    with open_page("search.html?q=rounding", shared=True) as page:
        first = page.locator("#search-results li a").first
        first.wait_for(timeout=10_000)
        first.click()
        page.wait_for_url(lambda url: "search.html" not in url)
        assert "rounding" in page.locator("main").inner_text().lower()
        assert page.faults == []


class Places(HTMLParser):
    """Where a page's links lead, and the places on it that links lead to."""

    def __init__(self, text):
        super().__init__()
        self.links, self.anchors = set(), {"", "top"}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.links.update(value for name, value in attrs if name in ("href", "src") and value)
        self.anchors.update(value for name, value in attrs if name in ("id", "name"))


def dead_links(root, pages):
    """Links of these pages to nothing; `urljoin` knows the scheme http, and of no made-up one that it has folders."""
    places = {address: Places((root / address).read_text(encoding="utf-8")) for address in pages}
    for address, page in places.items():
        for link in sorted(page.links):
            parts = urlsplit(urljoin(f"http://book/{address}", link))
            if parts.netloc != "book":
                continue
            target = unquote(parts.path).lstrip("/")
            there = target not in places or unquote(parts.fragment) in places[target].anchors
            if not there or not (root / target).is_file():
                yield f"{address}: {link}"


def test_every_link_within_the_book_leads_somewhere():
    every = sorted(path.relative_to(tools.HTML).as_posix() for path in tools.HTML.rglob("*.html"))
    assert len(every) > len(PAGES)
    assert list(dead_links(tools.HTML, every)) == []


def test_no_page_is_too_heavy():
    sizes = {address: (tools.HTML / address).stat().st_size for address in PAGES if address != tools.REFERENCE}
    assert {address: size for address, size in sizes.items() if size > tools.HEAVIEST} == {}


@on_a_desktop([each for each in tools.pages() if each != tools.REFERENCE])
def test_no_page_is_too_high(page):
    assert page.evaluate("document.documentElement.scrollHeight") <= tools.HIGHEST


def test_the_front_page_shows_claim_answers_and_doors_at_once(open_page):
    with open_page("book/index.html") as page:
        page.set_viewport_size({"width": 1440, "height": 900})
        doors = page.locator("article .sd-card").all()
        assert len(doors) == 3
        for part in (page.locator("article p strong").first, page.locator("article figure").first, *doors):
            box = part.bounding_box()
            assert box["y"] >= 0
            assert box["y"] + box["height"] <= 900


@on_a_desktop(CHAPTERS)
def test_a_chapter_shows_its_text_and_its_formulas_in_time(page, open_page):
    """Of several loads the fastest counts, because other programs delay some of them."""
    fastest = page.times
    for _ in range(1, tools.LOADS):
        if all(time <= tools.LONGEST[name] for name, time in fastest.items()):
            break
        with open_page(urlsplit(page.url).path.removeprefix("/")) as again:
            fastest = {name: min(time, fastest[name]) for name, time in again.evaluate(tools.TIMES).items()}
    assert {name: time for name, time in fastest.items() if time > tools.LONGEST[name]} == {}


CUT = """() => {
  const paper = document.querySelector("article, main").getBoundingClientRect().right + 1;
  const ends = (e) => e.getBoundingClientRect().right;
  const all = [...document.querySelectorAll("article :is(p, pre, img, svg, td, th, li, dt, dd, h1, h2, h3, mjx-math)")];
  const within = (e) => (e.matches("mjx-math") && e.closest("td, th") ? ends(e.closest("td, th")) + 1 : paper);
  const cut = all.filter((e) => e.checkVisibility() && ends(e) > Math.min(paper, within(e)));
  return cut.map((e) => e.textContent.slice(0, 80));
}"""


@pytest.mark.parametrize("page", [(a, "phone") for a in PAGES], ids="-".join, indirect=True)
def test_nothing_is_cut_on_paper(page, look_at):
    """The last look at a page, which is not as it was before."""
    paper = look_at(urlsplit(page.url).path.removeprefix("/"), "paper")
    assert paper.evaluate(CUT) == []
    assert paper.locator(".math:not(:has(mjx-container))").all_text_contents() == []


def test_no_page_names_a_host_for_scripts():
    """What a browser would only load when asked to is seen in the page's text."""
    hosts = ("unpkg.com", "jsdelivr.net", "cdnjs", "googleapis.com", "gstatic.com")
    texts = {address: (tools.HTML / address).read_text(encoding="utf-8") for address in PAGES}
    assert [(address, host) for address, text in texts.items() for host in hosts if host in text] == []


def test_every_page_of_the_book_has_a_preview_and_an_entry_in_the_sitemap():
    listed = (tools.HTML / "sitemap.xml").read_text(encoding="utf-8")
    for address in (each for each in PAGES if each.startswith("book/")):
        page = (tools.HTML / address).read_text(encoding="utf-8")
        assert all(f'<meta property="og:{name}"' in page for name in ("title", "image")), address
        assert f"{address}</loc>" in listed
    with Image.open(tools.HTML / "_static" / "preview.png") as preview:
        assert preview.size == (1200, 630)
