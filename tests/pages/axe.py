"""What axe finds on an opened page, in one colour scheme after the other."""

from __future__ import annotations

import functools

# Formulas are most of a page, and MathJax makes them all alike: only some at the beginning and at the end are kept.
EMPTY = """(kept) => {
  const all = [...document.querySelectorAll("mjx-container")];
  window.emptied = all.slice(kept, Math.max(kept, all.length - kept)).map((each) => [each, [...each.childNodes]]);
  for (const [each] of window.emptied) each.replaceChildren();
}"""
FILL = "for (const [each, parts] of window.emptied) each.replaceChildren(...parts)"
# These see colours; the others see the same in each scheme.
OF_COLOURS = ["color-contrast", "link-in-text-block"]
ALONE = {"runOnly": OF_COLOURS}
LEFT_OUT = {"rules": {name: {"enabled": False} for name in OF_COLOURS}}
# The contrast of every text takes nine tenths of the time: three texts of each look, on alike backgrounds, will do.
VIOLATIONS = """async ([within, rules]) => {
  const layers = new Map([[null, ""]]);
  const behind = (e) => {
    if (!layers.has(e)) {
      const { backgroundColor, backgroundImage, opacity, filter, position } = getComputedStyle(e);
      const clear = backgroundColor === "rgba(0, 0, 0, 0)" && backgroundImage === "none" && opacity === "1";
      const own = clear && filter === "none" ? "" : [backgroundColor, backgroundImage, opacity, filter].join();
      layers.set(e, `${behind(e.parentElement)} ${own}${/fixed|absolute|sticky/.test(position) ? position : ""}`);
    }
    return layers.get(e);
  };
  const chosen = [...document.querySelectorAll("input, select, textarea, button, summary")];
  const looks = new Map();
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const e = texts.currentNode.parentElement;
    if (!texts.currentNode.data.trim() || !e.checkVisibility()) continue;
    const { color, fontSize, fontWeight, textShadow } = getComputedStyle(e);
    const look = [color, fontSize, fontWeight, textShadow, behind(e)].join();
    looks.set(look, [...(looks.get(look) ?? []), e]);
  }
  for (const alike of looks.values()) chosen.push(alike[0], alike[alike.length >> 1], alike.at(-1));
  for (const each of chosen) each.dataset.chosen = "";
  axe.configure({ rules: [{ id: "color-contrast", selector: "[data-chosen]" }] });
  // axe asks for style sheets at wrong addresses, for a rule that it does not apply.
  const options = { resultTypes: ["violations"], preload: { assets: ["media"] }, ...rules };
  const found = (await axe.run(within ?? document, options)).violations;
  for (const each of chosen) delete each.dataset.chosen;
  return found.flatMap(({ id, nodes }) => nodes.map(({ target, html }) => `${id}: ${target} ${html.slice(0, 160)}`));
}"""


@functools.cache
def script() -> str:
    from axe_playwright_python.sync_playwright import Axe

    return Axe().axe_script


def violations(page, formulas: int = 0, within: str | None = None, colours: bool = True) -> list[str]:
    """What axe finds in the light scheme, with that many formulas at the page's beginning and end, and in the dark.

    Colours are the same in every size of a window: they may be left out.
    """
    if not page.evaluate("'axe' in window"):
        page.evaluate(script())
    found = []
    runs = (("light", formulas, {}), ("dark", 0, ALONE)) if colours else (("light", formulas, LEFT_OUT),)
    for scheme, kept, rules in runs:
        page.evaluate(EMPTY, kept)
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function(f"document.documentElement.dataset.theme === '{scheme}'")
        found += [f"{scheme}: {each}" for each in page.evaluate(VIOLATIONS, [within, rules])]
        page.evaluate(FILL)
    return found
