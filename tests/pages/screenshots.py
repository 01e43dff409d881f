"""Write a picture of every page, light, dark and on a phone, into _build/screenshots.

Two more are for book/_static: `page.png`, the front page for the README, and `report.png`, the first part of a report.
With the option --static, only these are made, and where the book has them.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
from pathlib import Path

from PIL import Image
from tqdm import tqdm

from gpbnb.wordlength.__main__ import main as wordlength

from . import browser as tools

LOOKS = {"light": ("desktop", "light"), "dark": ("desktop", "dark"), "phone": ("phone", "light")}
STATIC = Path(__file__).resolve().parents[2] / "book" / "_static"
COLOURS = 256


def static(browser: tools.Browser, folder: Path) -> None:
    """Draw the front page, and the report of the book's tracker down to the table of forms."""
    with tools.serve() as base:
        page = browser.new_page(viewport=tools.SIZES["desktop"], device_scale_factor=0.8, color_scheme="light")
        page.goto(f"{base}book/index.html", wait_until="load")
        page.evaluate(tools.SETTLED)
        _save(page.screenshot(), folder / "page.png")
    with tempfile.TemporaryDirectory() as made:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            report = Path(made) / "report.html"
            wordlength([str(STATIC / "tracker.toml"), "--tolerance", "0.01", "--report", str(report)])
        page = browser.new_page(viewport={"width": 768, "height": 900}, device_scale_factor=1.6, color_scheme="light")
        page.goto(report.as_uri(), wait_until="load")
        end = page.locator("table").nth(1).bounding_box()
        height = end["y"] + end["height"] + 24
        _save(
            page.screenshot(full_page=True, clip={"x": 0, "y": 0, "width": 768, "height": height}),
            folder / "report.png",
        )


def _save(picture: bytes, path: Path) -> None:
    with Image.open(io.BytesIO(picture)) as opened:
        opened.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)


def main(arguments: list[str]) -> None:
    if "--static" in arguments:
        with tools.launch() as browser:
            static(browser, STATIC)
        return
    folder = tools.HTML.parent / "screenshots"
    folder.mkdir(exist_ok=True)
    with tools.serve() as base, tools.launch() as browser:
        static(browser, folder)
        for look, (size, scheme) in LOOKS.items():
            context = browser.new_context(viewport=tools.SIZES[size], color_scheme=scheme, reduced_motion="reduce")
            page = context.new_page()
            for address in tqdm(tools.pages(), desc=look, ncols=80):
                page.goto(base + address, wait_until="load")
                page.evaluate(tools.SETTLED)
                name = address.removesuffix(".html").replace("/", "-")
                page.screenshot(path=folder / f"{name}.{look}.png", full_page=True)
    print(f"Pictures are in {folder.parent.name}/{folder.name}")


if __name__ == "__main__":
    main(sys.argv[1:])
