"""The built book on a loopback port, and a real Chromium that can reach nothing else."""

from __future__ import annotations

import functools
import importlib.util
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

try:
    from playwright.sync_api import Browser, sync_playwright
except ImportError:
    sync_playwright = None

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
# Formulas are typeset, except those in closed details, and fonts are there.
SETTLED = "async () => { await window.formulasTypeset; await document.fonts.ready }"
# What follows from a new size is done: the boxes are observed before a frame is painted.
RESTED = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))))"
# Milliseconds until the text is painted, and until every formula that is shown is typeset. On a busy machine a page
# may be loaded before it is painted.
TIMES = """async () => {
  const text = await new Promise((done) => new PerformanceObserver((list) => {
    const [entry] = list.getEntriesByName("first-contentful-paint");
    if (entry) done(entry);
  }).observe({ type: "paint", buffered: true }));
  const loaded = performance.getEntriesByType("navigation")[0].loadEventEnd;
  return { text: text.startTime, complete: Math.max(window.formulas.shown?.time ?? 0, loaded) };
}"""
LONGEST = {"text": 1000, "complete": 4000}
LOADS = 10  # at most
HIGHEST = 20_000  # pixels, on a desktop
HEAVIEST = 300_000  # bytes of HTML
REFERENCE = "book/api.html"  # all public names, looked up and not read through: it may be heavier and higher
SIZES = {"desktop": {"width": 1280, "height": 900}, "phone": {"width": 390, "height": 844}}
PAPER = {"width": 688, "height": 974}  # A4 without margins, at 96 dots an inch


def missing() -> str | None:
    """What the page tests lack, and how to get it."""
    if not list(HTML.rglob("*.html")):
        return f"no page in {HTML.parent.name}/{HTML.name}: build the book with `make book`"
    if sync_playwright is None or importlib.util.find_spec("axe_playwright_python") is None:
        return "no playwright: install the group `pages` of pyproject.toml, as `make test-pages` does"
    if chromium() is None:
        return (
            "no Chromium: install it (Debian: apt install chromium; Ubuntu: snap install chromium) or name its program "
            "in the environment variable CHROMIUM"
        )
    return None


def required() -> None:
    """End the program if something is missing."""
    if reason := missing():
        raise SystemExit(f"The pages cannot be opened. There is {reason}.")


def pages() -> list[str]:
    """Every HTML page of the book, as its address below the root, without those that only lead to another."""
    every = (p for p in HTML.rglob("*.html") if not p.is_relative_to(HTML / "_static"))
    read = (p for p in every if 'http-equiv="refresh"' not in p.read_text(encoding="utf-8"))
    return sorted(p.relative_to(HTML).as_posix() for p in read)


def chromium() -> str | None:
    """Path of the machine's Chromium; the environment variable CHROMIUM overrides the search."""
    names = (os.environ.get("CHROMIUM"), "chromium", "chromium-browser", "google-chrome")
    return next((path for name in names if name and (path := shutil.which(name))), None)


class QuietHandler(SimpleHTTPRequestHandler):
    protocol_version = "HTTP/1.1"  # connections stay open

    def end_headers(self) -> None:
        self.send_header("Cache-Control", "max-age=3600")  # else the browser asks again for every script and font
        super().end_headers()

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
    required()
    with sync_playwright() as playwright:
        settings = {**os.environ, "XDG_CONFIG_HOME": str(HTML.parents[1] / ".cache" / "config")}
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS, env=settings)
        try:
            yield browser
        finally:
            browser.close()


if __name__ == "__main__":
    required()
