"""What search engines and link previews read: a description of every page, Open Graph tags and a sitemap.

Link previews, canonical links and sitemaps need full addresses. Set the environment variable ``BOOK_ADDRESS`` or
``html: baseurl:`` in ``_config.yml`` to the address of the published book, as in
``BOOK_ADDRESS=https://example.org/gpbnb make book``; the variable has priority. Without either, addresses are relative.
"""

import os
import re
from html import escape
from pathlib import Path
from urllib.parse import urlsplit
from xml.sax.saxutils import escape as escape_xml

import matplotlib.pyplot as plt
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.errors import ConfigError

from gpbnb.report.display import style
from gpbnb.report.gravity_probe_b import figures, summary

VARIABLE = "BOOK_ADDRESS"
PREVIEW = "_static/preview.png"
PREVIEW_SIZE = (8.0, 4.2)
"""Width and height of the preview picture in inches."""
PREVIEW_DPI = 150
"""Pixels per inch: the picture has 1200 x 630 of them, as link previews expect."""
SHORTEST, LONGEST = 50, 260
"""Characters in a description."""
CITATION = re.compile(r"\s*\[[^\]]*[^\W\d][^\]]*\d{4}\w?\]")
YEAR = re.compile(r"\[(\d{4}\w?)\]")
QUESTION = re.compile(r"^(?:The q|Q)uestion\.")
"""How the box that opens a chapter begins."""


def sentences(text: str) -> str:
    """Return the first whole sentences of a paragraph, without citations, up to the first that holds a formula."""
    kept = ""
    text = YEAR.sub(r"(\1)", CITATION.sub("", " ".join(text.split())))
    for sentence in re.split(r"(?<=[.?!])\s+(?![a-z])", text):  # a title within a sentence may end with a mark
        if "\\" in sentence or len(kept) + len(sentence) > LONGEST or not sentence.endswith((".", "?", "!")):
            break
        kept = f"{kept} {sentence}".strip()
    return kept


def description(doctree: nodes.document) -> str:
    """Return the question of a chapter, or else the first sentences of a page; empty if there are none."""
    paragraphs = list(doctree.findall(nodes.paragraph))
    asked = [each.astext() for each in paragraphs if QUESTION.match(each.astext())]
    texts = [QUESTION.sub("", text) for text in asked]
    texts += [each.astext() for each in paragraphs if isinstance(each.parent, nodes.section)]
    return next((kept for text in texts if len(kept := sentences(text)) >= SHORTEST), "")


def read_address(app: Sphinx, config: Config) -> None:
    """Take the address of the published book from the environment, or else from the configuration."""
    given = (os.environ.get(VARIABLE) or config.html_baseurl or "").strip()
    if not given:
        return
    parts = urlsplit(given)
    if parts.scheme not in ("http", "https") or not parts.netloc or parts.query or parts.fragment:
        raise ConfigError(f"got the address {given!r} for the book; needed one such as https://example.org/gpbnb/")
    config.html_baseurl = given


def address(app: Sphinx, place: str) -> str:
    """Return the address of a file of the book: full if the book's own address is known, otherwise relative."""
    base = app.config.html_baseurl
    return f"{base.rstrip('/')}/{place}" if base else place


def add_tags(app: Sphinx, page: str, template: str, context: dict, doctree: nodes.document | None) -> None:
    """Add a description and Open Graph tags to the head of a page."""
    if doctree is None or app.builder.format != "html":
        return
    title = re.sub(r"<[^>]*>|^\d+\. ", "", context.get("title", ""))
    tags = {"og:title": title, "og:type": "article", "og:site_name": app.config.project}
    tags["og:image"] = address(app, PREVIEW) if app.config.html_baseurl else context["pathto"](PREVIEW, 1)
    tags["og:image:alt"] = app.config.html_title
    if app.config.html_baseurl:
        tags["og:url"] = address(app, app.builder.get_target_uri(page))
    lines = [f'<meta property="{name}" content="{escape(value)}">' for name, value in tags.items()]
    if text := description(doctree):
        lines.append(f'<meta name="description" content="{escape(text)}">')
        lines.append(f'<meta property="og:description" content="{escape(text)}">')
    context["metatags"] = "\n".join([context.get("metatags", ""), *lines])


def write_preview(app: Sphinx, error: Exception | None) -> None:
    """Draw the picture of link previews, the figure that opens the book, on white."""
    if error or app.builder.format != "html":
        return
    figure, axes = style.figure(height=PREVIEW_SIZE[1])
    figure.set_size_inches(PREVIEW_SIZE)
    figures.answer_line(summary.find(), axes[0])
    figure.savefig(Path(app.outdir, PREVIEW), dpi=PREVIEW_DPI, facecolor="white", bbox_inches=None)
    plt.close(figure)


def write_sitemap(app: Sphinx, error: Exception | None) -> None:
    """List every page of the book in sitemap.xml."""
    if error or app.builder.format != "html":
        return
    pages = sorted(app.builder.get_target_uri(page) for page in app.env.found_docs)
    lines = [f"  <url><loc>{escape_xml(address(app, page))}</loc></url>" for page in pages]
    text = '<?xml version="1.0" encoding="UTF-8"?>\n<urlset xmlns="http://www.sitemaps.org/schemas/sitemap/0.9">\n'
    Path(app.outdir, "sitemap.xml").write_text(text + "\n".join(lines) + "\n</urlset>\n", encoding="utf-8")


def setup(app: Sphinx) -> dict:
    app.connect("config-inited", read_address)
    app.connect("html-page-context", add_tags)
    app.connect("build-finished", write_preview)
    app.connect("build-finished", write_sitemap)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
