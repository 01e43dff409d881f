"""Print the whole book, built as a single page, to one PDF with bookmarks and tags, in the machine's Chromium."""

from __future__ import annotations

from pathlib import Path

from . import browser as tools

SINGLE = tools.HTML.parent / "singlehtml"
PDF = tools.HTML.parent / "gpbnb.pdf"
FOOTER = (
    '<div style="width: 100%; font-size: 8px; text-align: center">'
    '<span class="pageNumber"></span> / <span class="totalPages"></span></div>'
)


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
    print(f"{PDF.parent.name}/{PDF.name}: {PDF.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
