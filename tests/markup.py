"""HTML read for the tests: its elements, whether they nest, and the texts of cells."""

from __future__ import annotations

from html.parser import HTMLParser

VOID = frozenset(("area", "base", "br", "col", "hr", "img", "input", "link", "meta", "source", "wbr"))


class Elements(HTMLParser):
    """Every element with its attributes, in order.

    Parameters
    ----------
    text : the HTML.
    nested : require that every element is closed, in order, and that no attribute stands twice.
    """

    def __init__(self, text: str, nested: bool = True) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.cells: list[str] = []
        self.open: list[str] = []
        self.nested = nested
        self.feed(text)
        self.close()
        assert not (nested and self.open)

    def handle_starttag(self, tag, attrs):
        assert not self.nested or len(dict(attrs)) == len(attrs)
        self.found.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag):
        if self.nested:
            assert self.open.pop() == tag
        elif tag in self.open:
            del self.open[len(self.open) - 1 - self.open[::-1].index(tag) :]

    def handle_data(self, data):
        if {"td", "th"} & set(self.open):
            self.cells[-1] += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.found if name == tag]

    def values(self, *names: str) -> set[str]:
        """The values of some attributes, wherever they occur."""
        return {value for _, found in self.found for name in names if (value := found.get(name))}
