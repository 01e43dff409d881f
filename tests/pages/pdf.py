"""Print the whole book, built as a single page, to one PDF with bookmarks and tags, in the machine's Chromium."""

from __future__ import annotations

import re
from pathlib import Path

from . import browser as tools

SINGLE = tools.HTML.parent / "singlehtml"
PDF = tools.HTML.parent / "gpbnb.pdf"
FOOTER = (
    '<div style="width: 100%; font-size: 8px; text-align: center">'
    '<span class="pageNumber"></span> / <span class="totalPages"></span></div>'
)


def dead_links(pdf: bytes) -> set[str]:
    """Links that lead out to the server that is gone, or to a place that is not there.

    Chromium writes annotations and the table of named places uncompressed.
    """
    outside = set(re.findall(rb"/URI \((http://127\.[^)]*)\)", pdf))
    asked = set(re.findall(rb"/Dest /([^\s/<>\[\]()]+)", pdf))
    table = re.search(rb"/Dests (\d+) 0 R", pdf)
    if not asked or not table:
        raise SystemExit("The PDF has no links within it; Chromium writes them otherwise than before.")
    start = re.search(rb"(?m)^%b 0 obj$" % table[1], pdf).end()
    there = set(re.findall(rb"/([^\s/<>\[\]()]+) \[", pdf[start : pdf.index(b"endobj", start)]))
    return {name.decode() for name in outside | (asked - there)}


def main() -> None:
    # Sphinx writes the page into the folder of the root document, with addresses as from the folder above.
    for name in ("_static", "_images", "_sources", "_downloads"):
        link = SINGLE / "book" / name
        if (SINGLE / name).exists() and not link.exists():
            link.symlink_to(Path("..") / name)
    with tools.serve(SINGLE) as base, tools.launch() as browser:
        page = browser.new_page(color_scheme="light")
        page.set_default_timeout(600_000)
        page.goto(base + "book/index.html", wait_until="load")
        page.evaluate("document.querySelectorAll('img').forEach(i => i.loading = 'eager')")
        page.evaluate(tools.SETTLED)
        page.wait_for_function("[...document.images].every(i => i.complete)")
        page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        if unset := page.locator("article .math:not(:has(mjx-container))").count():
            raise SystemExit(f"{unset} formulas were not typeset")
        page.pdf(
            path=PDF,
            prefer_css_page_size=True,
            print_background=True,
            outline=True,
            tagged=True,
            display_header_footer=True,
            header_template="<span></span>",
            footer_template=FOOTER,
        )
    if dead := dead_links(PDF.read_bytes()):
        raise SystemExit(f"Links of the PDF that lead nowhere: {', '.join(sorted(dead))}")
    print(f"{PDF.parent.name}/{PDF.name}: {PDF.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
