"""Write the poster as SVG and, printed by the machine's Chromium, as PDF."""

from __future__ import annotations

from pathlib import Path

from gpbnb.report.poster import HEIGHT, WIDTH, poster

from . import browser as tools

FOLDER = Path(__file__).resolve().parents[2] / "_build"
PAGE = (
    "<!DOCTYPE html><html lang='en'><head><meta charset='utf-8'><title>Poster</title>"
    "<style>@page {{ size: {0}mm {1}mm; margin: 0 }} body {{ margin: 0 }} svg {{ display: block }}</style></head>"
    "<body>{2}</body></html>"
)


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    svg = poster()
    drawn, printed = FOLDER / "poster.svg", FOLDER / "poster.pdf"
    drawn.write_text(svg, encoding="utf-8")
    with tools.launch() as browser:
        page = browser.new_page()
        page.set_content(PAGE.format(WIDTH, HEIGHT, svg), wait_until="load")
        page.pdf(path=printed, width=f"{WIDTH}mm", height=f"{HEIGHT}mm", print_background=True)
    for path in (drawn, printed):
        print(f"{path.parent.name}/{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
