"""Write a picture of every page, light, dark and on a phone, into _build/screenshots."""

from __future__ import annotations

from tqdm import tqdm

from . import browser as tools

LOOKS = {"light": ("desktop", "light"), "dark": ("desktop", "dark"), "phone": ("phone", "light")}


def main() -> None:
    folder = tools.HTML.parent / "screenshots"
    folder.mkdir(exist_ok=True)
    with tools.serve() as base, tools.launch() as browser:
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
    main()
