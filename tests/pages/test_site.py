"""The site around the chapters: search, order of pages, print, addresses, descriptions, and what a page weighs."""

from __future__ import annotations

import re
from html import unescape

import pytest

from . import browser as tools

PAGES = [each for each in tools.pages() if each.startswith("book/")]
HEAVIEST = 1_500_000  # bytes of a page with its pictures, scripts, styles and fonts
on_a_desktop = pytest.mark.parametrize(
    "page", [(each, "desktop") for each in tools.pages()], ids="-".join, indirect=True
)
RESULTS = """() => [...document.querySelectorAll("#search-results li")].map((each) => ({
  page: new URL(each.querySelector("a").href).pathname.slice(1),
  snippet: each.querySelector("p.context")?.textContent ?? "",
}))"""


@pytest.fixture
def search(open_page):
    """Search for words; return the results with a snippet, once all of them are there."""

    def search(words):
        with open_page(f"search.html?q={words}", shared=True) as page:
            page.wait_for_function("document.querySelector('.search-summary')?.textContent.includes('found')")
            pages = "[...document.querySelectorAll('#search-results li')].filter(e => !e.querySelector('span'))"
            page.wait_for_function(f"{pages}.every(e => e.querySelector('p.context'))")
            assert page.faults == []
            return page.evaluate(RESULTS)

    return search


def rank(page):
    return 2 if page == tools.REFERENCE else 1 if page.startswith("book/ledger-") else 0


@pytest.mark.parametrize(("words", "number"), [("6606", "6606"), ("3153600", "3153600"), ("3,153,600", "3153600")])
def test_the_search_finds_a_number(search, words, number):
    found = search(words)
    assert len(found) > 1
    assert rank(found[0]["page"]) == 0
    chapters = [each["snippet"] for each in found if rank(each["page"]) == 0]
    assert [each for each in chapters if number not in each.replace(",", "")] == []


@pytest.mark.parametrize("words", ["precision", "bound", "tolerance", "required_precision"])
def test_the_search_shows_chapters_first_and_the_reference_last(search, words):
    ranks = [rank(each["page"]) for each in search(words)]
    assert {0, 2} <= set(ranks)
    assert ranks == sorted(ranks)


@pytest.mark.parametrize(
    ("words", "pages"),
    [
        ("how many digits", ["index", "wordlength"]),
        ("33 bits", ["index"]),
        ("Taylor", ["integration"]),
        ("roll and deroll", ["rolling"]),
    ],
)
def test_the_search_shows_first_what_answers(search, words, pages):
    assert [each["page"] for each in search(words)][: len(pages)] == [f"book/{page}.html" for page in pages]


@pytest.mark.parametrize("words", ["covariance", "deroll", "stagnation"])
def test_a_snippet_can_be_read(search, words):
    """No TeX, no code, and it begins with a sentence and ends with a whole word."""
    chapters = [each for each in search(words) if rank(each["page"]) == 0]
    assert len({each["page"] for each in chapters}) > 1
    for snippet in (each["snippet"] for each in chapters):
        assert not re.search(r"\\\w|import |\s\s", snippet), snippet
        assert words in snippet.lower(), snippet
        assert len(snippet) < 260


def neighbour(address, way):
    """The page to which the link at the foot of a page leads."""
    text = (tools.HTML / address).read_text(encoding="utf-8")
    link = re.search(rf'<a class="{way}"\s+href="([^"]+)"', text)
    return f"book/{link[1]}" if link else None


def test_the_next_page_leads_through_the_whole_book():
    read = ["book/index.html"]
    while following := neighbour(read[-1], "right-next"):
        assert following not in read
        assert neighbour(following, "left-prev") == read[-1]
        read.append(following)
    assert set(read) == set(PAGES)


def test_folded_code_is_opaque_as_soon_as_it_is_opened_for_a_print(open_page):
    """A browser prints the first moment of an animation."""
    with open_page("book/wordlength.html") as page:
        page.emulate_media(media="print", reduced_motion="no-preference")
        seen = page.evaluate(
            """() => {
              window.dispatchEvent(new Event("beforeprint"));
              const folded = [...document.querySelectorAll("article details.hide > :not(summary)")];
              return folded.map((e) => [getComputedStyle(e).opacity, e.getAnimations().length, e.checkVisibility()]);
            }"""
        )
        assert len(seen) > 5
        assert {tuple(each) for each in seen} == {("1", 0, True)}


def description(address):
    text = (tools.HTML / address).read_text(encoding="utf-8")
    found = re.search(r'<meta name="description" content="([^"]*)">', text)
    return unescape(found[1]) if found else ""


def test_a_description_can_be_read_alone():
    """It consists of whole sentences, and speaks of no figure, no other chapter, and nothing that went before."""
    told = {each: description(each) for each in PAGES}
    assert [each for each, text in told.items() if not text.endswith((".", "?"))] == []
    leaning = re.compile(
        r"^(This (?!page|book)|That|Those|It|They|Here|Each|The (figure|table|formula|previous))\b|\bFig\.|∎"
    )
    assert {each: text for each, text in told.items() if leaning.search(text) and "book/ledger-" not in each} == {}
    assert len(set(told.values())) == len(told)


LOADED = """async () => {
  for (const picture of document.images) picture.loading = "eager";
  await Promise.all([...document.images].map((picture) => picture.decode().catch(() => {})));
  const all = [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")];
  return all.map((each) => [new URL(each.name).pathname.slice(1), each.decodedBodySize]);
}"""


@on_a_desktop
def test_no_page_is_heavier_than_its_limit(page):
    if "search.html" in page.url:
        pytest.skip("the page of results loads the index")
    loaded = dict(page.evaluate(LOADED))
    assert sum(loaded.values()) <= HEAVIEST, sorted(loaded.items(), key=lambda each: -each[1])[:8]
