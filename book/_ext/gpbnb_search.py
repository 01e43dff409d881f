"""The search: numbers are words, and book/_static/search.js says in which order results stand and what they show."""

import re

from sphinx.application import Sphinx
from sphinx.search.en import SearchEnglish

SEPARATOR = re.compile(r"(?<=\d)(?:,|\{,\}|\\,|\N{THIN SPACE}|\N{NARROW NO-BREAK SPACE})(?=\d{3}(?!\d))")
"""What groups the digits of a number, in text or in TeX; search.js has the same."""


class Numbers(SearchEnglish):
    """English, in which 3,153,600 is one word, also where a formula writes ``3{,}153{,}600``."""

    def split(self, input: str) -> list[str]:
        return super().split(SEPARATOR.sub("", input))


def add_script(app: Sphinx, pagename: str, templatename: str, context: dict, doctree: object) -> None:
    """Load the script on the page of results alone."""
    if pagename == "search":
        app.add_js_file("search.js", defer="defer")


def setup(app: Sphinx) -> dict:
    app.add_search_language(Numbers)
    app.connect("html-page-context", add_script)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
