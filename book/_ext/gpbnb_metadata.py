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

from docutils import nodes
from PIL import Image
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.errors import ConfigError

VARIABLE = "BOOK_ADDRESS"
PREVIEW = "_static/preview.png"
SIZE = (1200, 630)
"""Size of the preview picture in pixels, as link previews expect it."""
SHORTEST, LONGEST = 50, 200
"""Characters in a description."""
CITATION = re.compile(r"\s*\[[^\]]*\d{4}\w?\]")


def description(doctree: nodes.document) -> str:
    """Return the first sentences of a page, without formulas and citations; empty if there are none."""
    for paragraph in doctree.findall(nodes.paragraph):
        if not isinstance(paragraph.parent, nodes.section):
            continue
        kept = ""
        text = CITATION.sub("", " ".join(paragraph.astext().split()))
        for sentence in re.split(r"(?<=[.?!:])\s+", text):
            if "\\" in sentence or len(kept) + len(sentence) > LONGEST:
                break
            kept = f"{kept} {sentence}".strip()
        if len(kept) >= SHORTEST:
            return kept.rstrip(":")
    return ""


def read_address(app: Sphinx, config: Config) -> None:
    """Take the address of the published book from the environment, or else from the configuration."""
    given = (os.environ.get(VARIABLE) or config.html_baseurl or "").strip()
    if not given:
        return
    parts = urlsplit(given)
    if parts.scheme not in ("http", "https") or not parts.netloc or parts.query or parts.fragment:
        raise ConfigError(f"got the address {given!r} for the book; needed one such as https://example.org/gpbnb/")
    # Sphinx joins addresses: without the last slash it would drop the last folder.
    config.html_baseurl = given.rstrip("/") + "/"


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
    """Make the picture of link previews from the first figure of the book, on white."""
    if error or app.builder.format != "html":
        return
    figures = app.env.get_doctree(app.config.root_doc).findall(nodes.image)
    names = [app.env.images[figure["uri"]][1] for figure in figures if figure["uri"] in app.env.images]
    pictures = [Path(app.outdir, app.builder.imagedir, name) for name in names if name.endswith(".png")]
    if not pictures:
        return
    with Image.open(pictures[0]) as opened:
        figure = opened.convert("RGBA")
    scale = min((SIZE[0] - 80) / figure.width, (SIZE[1] - 40) / figure.height)
    figure = figure.resize((round(figure.width * scale), round(figure.height * scale)), Image.Resampling.LANCZOS)
    canvas = Image.new("RGBA", SIZE, "white")
    canvas.alpha_composite(figure, ((SIZE[0] - figure.width) // 2, (SIZE[1] - figure.height) // 2))
    canvas.convert("RGB").save(Path(app.outdir, PREVIEW), optimize=True)


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
