"""The built book on a loopback port, and a real Chromium that can reach nothing else."""

from __future__ import annotations

import functools
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

HTML = Path(__file__).resolve().parents[2] / "_build" / "html"
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]
# Formulas are set and fonts are there.
SETTLED = "async () => { await window.MathJax?.startup?.promise; await document.fonts.ready }"
SIZES = {"desktop": {"width": 1280, "height": 900}, "phone": {"width": 390, "height": 844}}


def pages() -> list[str]:
    """Every HTML page of the book, as its address below the root; index.html only leads to the first."""
    every = (p.relative_to(HTML) for p in HTML.rglob("*.html"))
    found = sorted(p.as_posix() for p in every if p.parts[0] != "_static" and p.parts != ("index.html",))
    if not found:
        raise SystemExit(f"No page in {HTML.parent.name}/{HTML.name}. Build the book first: make book")
    return found


def opened() -> list[str]:
    """The pages that tests open: all but the listings of source, of which the longest stands for the others."""
    listings = [address for address in pages() if address.startswith("_modules/gpbnb/")]
    others = set(listings) - set(sorted(listings, key=lambda address: (HTML / address).stat().st_size)[-1:])
    return [address for address in pages() if address not in others]


def chromium() -> str:
    """Path of the machine's Chromium; the environment variable CHROMIUM overrides the search."""
    for name in (os.environ.get("CHROMIUM"), "chromium", "chromium-browser", "google-chrome"):
        if name and (path := shutil.which(name)):
            return path
    raise SystemExit(
        "The page tests need Chromium, and found none. Install it (Debian: apt install chromium; Ubuntu: "
        "snap install chromium) or name its program in the environment variable CHROMIUM."
    )


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        pass


@contextmanager
def serve(folder: Path = HTML) -> Iterator[str]:
    """Serve the book on a free loopback port; yields its address."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(QuietHandler, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@contextmanager
def launch() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        settings = {**os.environ, "XDG_CONFIG_HOME": str(HTML.parents[1] / ".cache" / "config")}
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS, env=settings)
        try:
            yield browser
        finally:
            browser.close()
