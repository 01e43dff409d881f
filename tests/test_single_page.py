"""The book built as one page, as for its PDF: links lead to their places within it; tables of the ledger fit."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from urllib.parse import unquote

import pytest
from sphinx.application import Sphinx

EXT = Path(__file__).resolve().parents[1] / "book" / "_ext"
CONF = """
extensions = ["sphinx.ext.autodoc", "myst_parser", "gpbnb_book", "gpbnb_ledger"]
root_doc = "book/index"
numfig = True
"""
PAGES = {
    "index": """# Book

See [one](one.md), [its ledger](one.md#the-ledger), {ref}`two-ledger` and {eq}`square`.

```{toctree}
one
page-two
```
""",
    "one": """# One

## The ledger

Two's is [there](page-two.md#the-ledger); this is [here](#the-ledger). [^a] To the [book](index.md).

[^a]: A note.

```{raw} html
<p><a href="page-two.html#row.2">a row</a> <a href="one.html">one page, raw</a>
<a href="page-two.html#the-ledger">two ledger, raw</a></p>
```
""",
    "page-two": """# Two

(two-ledger)=
## The ledger

Of [one ledger](one.md#the-ledger). [^a]

[^a]: Another note.

```{math}
:label: square
x^2
```

```{raw} html
<p id="row.2">Row</p>
```

| Item | Verdict | Printed | Recomputed | Note |
| --- | --- | --- | --- | --- |
| eq (1) | wrong | $a*b*c$ | 2 \\* 3 | see \\*Kalman bound\\*, and 2 \\* 3 \\* 4 |
| eq (2) | verified | 5 | | |
""",
}


@pytest.fixture(scope="module")
def single(tmp_path_factory):
    """The page made of three, as HTML."""
    source = tmp_path_factory.mktemp("source")
    (source / "conf.py").write_text(CONF + 'myst_heading_anchors = 3\nmyst_enable_extensions = ["dollarmath"]\n')
    (source / "book").mkdir()
    for name, text in PAGES.items():
        (source / "book" / f"{name}.md").write_text(text)
    out = source / "out"
    before = sys.path[:]
    sys.path.insert(0, str(EXT))
    try:
        app = Sphinx(source, source, out, out / "doctrees", "singlehtml", status=None, warningiserror=True)
        app.build()
    finally:
        sys.path[:] = before
    return (out / "book" / "index.html").read_text(encoding="utf-8")


def test_every_link_leads_to_its_place_within_the_page(single):
    main = single[single.index('<div class="body"') : single.index('<div class="sphinxsidebar"')]
    ids = re.findall(r'id="([^"]+)"', main)
    links = [unquote(link) for link in re.findall(r'<a [^>]*href="([^"]+)"', main)]
    assert [link for link in links if not link.startswith("#")] == []
    assert {link[1:] for link in links} <= set(ids)
    # Those that could be mistaken have names that stand once, and as many as there are places.
    led = [link[1:] for link in links if link.startswith("#book/")]
    names = ("a", "id1", "the-ledger")
    assert sorted(set(led)) == [f"book/{page}-{name}" for page in ("one", "page-two") for name in names]
    assert all(ids.count(name) == 1 for name in led)


def test_each_way_to_link_is_mended(single):
    text = {t: h for h, t in re.findall(r'<a [^>]*href="#([^"]+)">(?:<span[^>]*>)*([^<]+)<', single)}
    assert text["its ledger"] == text["here"] == text["one ledger"] == "book/one-the-ledger"
    assert text["there"] == text["two ledger, raw"] == "book/page-two-the-ledger"
    assert text["The ledger"] == "two-ledger"
    assert (text["(1)"], text["a row"], text["one page, raw"]) == ("equation-square", "row.2", "document-book/one")
    assert (text["one"], text["book"]) == ("document-book/one", "book")
