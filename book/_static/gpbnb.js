// Mends what the theme leaves out for readers who use a keyboard or a screen reader.
document.addEventListener("DOMContentLoaded", () => {
  // The sidebar with the book's name lies outside every landmark.
  const sidebar = document.getElementById("pst-primary-sidebar");
  sidebar?.setAttribute("role", "navigation");
  sidebar?.setAttribute("aria-label", "Book");
  // The arrow beside an entry of the sidebar has a picture alone.
  for (const arrow of document.querySelectorAll("nav summary")) arrow.setAttribute("aria-label", "Show the pages below");
  // docutils gives the entries of the bibliography a role that ARIA has withdrawn.
  for (const entry of document.querySelectorAll('[role="doc-biblioentry"]')) entry.setAttribute("role", "listitem");
});

// Only pages with a form that computes load its script.
const FOLDER = document.currentScript.src;
document.addEventListener("DOMContentLoaded", () => {
  if (!document.querySelector("form[data-calculator]")) return;
  const script = document.createElement("script");
  script.src = new URL("calculators.js", FOLDER);
  document.head.append(script);
});

// MathJax 3 breaks no lines. A long formula may break before a relation or a sign and after a comma, within brackets
// only if these are long: what lies between two such places is held together, and the style sheet lets the rest wrap.
const LONG = 9; // em
const LONG_BRACKETS = 12; // em
const OPENS = ":scope > mjx-c:is(.mjx-c28, .mjx-c5B, .mjx-c7B)";
const CLOSES = ":is(:scope, :scope:is(mjx-msup, mjx-msub, mjx-msubsup) > mjx-mo) > mjx-c:is(.mjx-c29, .mjx-c5D, .mjx-c7D)";
const COMMA = ":scope > mjx-c:is(.mjx-c2C, .mjx-c3B)";

function breakFormulas(boxes) {
  // All is measured before anything is changed: each change would have the page laid out anew.
  const plans = [...boxes].flatMap((box) => (isLong(box, LONG) ? planRow(box.firstElementChild) : []));
  plans.forEach(breakRow);
  for (const box of boxes) keepPunctuation(box.closest("span.math"));
}
function isLong(first, limit, last = first) {
  const width = last.getBoundingClientRect().right - first.getBoundingClientRect().left;
  return width > limit * parseFloat(getComputedStyle(first).fontSize);
}
function planRow(row) {
  while (row.children.length === 1 && /^MJX-(MROW|MSTYLE)$/.test(row.firstElementChild.tagName)) row = row.firstElementChild;
  const parts = [...row.children];
  if (parts.length < 3 || row.matches("mjx-mtable, .formula-row")) return [];
  // How many pairs of short brackets each part is in.
  const depth = parts.map(() => 0);
  const open = [];
  parts.forEach((part, i) => {
    if (part.querySelector(OPENS)) open.push(i);
    if (!part.querySelector(CLOSES) || !open.length) return;
    const start = open.pop();
    if (!isLong(parts[start], LONG_BRACKETS, part)) for (let k = start + 1; k <= i; k++) depth[k]++;
  });
  const within = parts.map((part) => (part.tagName === "MJX-MROW" && isLong(part, LONG_BRACKETS) ? planRow(part) : []));
  const starts = parts.map((part, i) => {
    const sign = part.tagName === "MJX-MO" && part.getAttribute("space") > 2;
    return !depth[i] && (sign || (i && parts[i - 1].querySelector(COMMA)));
  });
  return [{ row, parts, starts, rows: within.map((plans) => plans.length > 0) }, ...within.flat()];
}
function breakRow({ row, parts, starts, rows }) {
  row.classList.add("formula-row");
  let piece = null;
  parts.forEach((part, i) => {
    if (rows[i]) {
      piece = null;
      return;
    }
    if (!piece || starts[i]) {
      piece = document.createElement("span");
      piece.className = "formula-piece";
      row.insertBefore(piece, part);
    }
    piece.append(part);
  });
}
// A comma after a formula does not begin a line.
function keepPunctuation(formula) {
  const after = formula?.nextSibling;
  const signs = after?.nodeType === Node.TEXT_NODE && after.data.match(/^[,.;:!?)\]’”]+/)?.[0];
  if (!signs) return;
  after.splitText(signs.length);
  const last = [...formula.querySelectorAll(".formula-piece")].at(-1);
  if (last) {
    last.append(after);
    return;
  }
  const kept = document.createElement("span");
  kept.className = "formula-kept";
  formula.before(kept);
  kept.append(formula, after);
}

// A formula that is too wide even so, such as a matrix on a phone or in the ledger, is set smaller, as far as it can be
// read. Other tables are as wide as their formulas.
const SMALLEST = 0.6;
function shrinkToLine(boxes = [...document.querySelectorAll("article mjx-container")]) {
  const wide = boxes.filter((box) => (box.closest("td") ? box.closest(".ledger-table") : box.matches('[display="true"]')));
  for (const box of wide) if (box.dataset.size) box.style.fontSize = box.dataset.size;
  const shares = wide.map((box) => box.clientWidth / box.scrollWidth);
  wide.forEach((box, i) => {
    if (!(shares[i] < 1)) return;
    box.dataset.size ??= box.style.fontSize;
    box.style.fontSize = `${parseFloat(box.dataset.size) * Math.max(SMALLEST, 0.98 * shares[i])}%`;
  });
}

// What scrolls sideways must be reachable by keyboard. Formulas get their width late, boxes with the window's.
function markScrolling(boxes = [...document.querySelectorAll("article :is(div, pre, mjx-container)")]) {
  const scrolls = boxes.map((box) => box.scrollWidth > box.clientWidth && /auto|scroll/.test(getComputedStyle(box).overflowX));
  boxes.forEach((box, i) => {
    if (scrolls[i]) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  });
}
// On paper nothing scrolls: a formula that has no place to break is set smaller, to the width of its cell.
function shrinkToCells() {
  const boxes = [...document.querySelectorAll("article td mjx-container")].filter((box) => box.scrollWidth > box.clientWidth);
  const sizes = boxes.map((box) => (parseFloat(box.style.fontSize || "100") * box.clientWidth) / box.scrollWidth);
  boxes.forEach((box, i) => {
    box.classList.add("shrinks");
    box.style.setProperty("--on-paper", `${sizes[i]}%`);
  });
}

// MathJax takes seconds for a chapter. Formulas near the window are typeset first, so that the reader can begin; the
// others follow in batches between which the page answers. Formulas that are not shown, in closed details or filtered
// rows, wait until they are, and everything is typeset before the page is printed.
const NEARBY = "50%"; // of the window's height, above and below
const BATCH = 40; // the first; each is twice as large, as each has the whole page laid out anew
const waiting = new Set();
let typesetting = Promise.resolve();
window.formulas = { near: null, shown: null, count: () => document.querySelectorAll("mjx-container").length };

function take(formulas) {
  const taken = formulas.filter((formula) => waiting.delete(formula));
  for (const formula of taken) nearby.unobserve(formula);
  return taken;
}
function settle(formulas) {
  const boxes = formulas.map((formula) => formula.querySelector("mjx-container")).filter(Boolean);
  breakFormulas(boxes);
  shrinkToLine(boxes);
  // A formula that gets its width changes that of the others in its table.
  const tables = new Set(formulas.map((formula) => formula.closest("table")).filter(Boolean));
  markScrolling([...boxes, ...[...tables].flatMap((table) => [...table.querySelectorAll("mjx-container")])]);
}
function typeset(formulas) {
  const taken = take(formulas);
  if (taken.length) typesetting = typesetting.then(() => MathJax.typesetPromise(taken)).then(() => settle(taken));
  return typesetting;
}
const nearby = new IntersectionObserver(
  (seen) => typeset(seen.filter((each) => each.isIntersecting).map((each) => each.target)),
  { rootMargin: `${NEARBY} 0px` },
);
const pause = () => new Promise((resolve) => (window.requestIdleCallback ?? setTimeout)(resolve, { timeout: 100 }));

async function typesetShown() {
  const limit = (1 + 2 * (parseFloat(NEARBY) / 100)) * innerHeight;
  const all = [...waiting];
  const places = all.map((formula) => formula.getBoundingClientRect());
  const shown = all.map((formula) => formula.checkVisibility());
  const near = (i) => shown[i] && places[i].bottom > innerHeight - limit && places[i].top < limit;
  await typeset(all.filter((_, i) => near(i)));
  window.formulas.near = { time: performance.now(), count: window.formulas.count() };
  for (const formula of all) if (waiting.has(formula)) nearby.observe(formula);
  const rest = all.filter((_, i) => shown[i]);
  for (let batch = BATCH; rest.length; batch *= 2) {
    await pause();
    await typeset(rest.splice(0, batch));
  }
  shrinkToLine();
  markScrolling();
  window.formulas.shown = { time: performance.now(), count: window.formulas.count() };
}

// Once all formulas that are shown have been typeset.
window.formulasTypeset = new Promise((resolve) => {
  document.addEventListener("DOMContentLoaded", async () => {
    if (window.MathJax?.startup) {
      await MathJax.startup.promise;
      for (const formula of document.querySelectorAll(".math")) waiting.add(formula);
      await typesetShown();
    }
    resolve();
    // Not when the window is resized: the sidebars slide, and the text has its width only after that.
    let width = null;
    const marked = new ResizeObserver(([{ contentRect }]) => {
      if (contentRect.width !== width) {
        shrinkToLine();
        markScrolling();
      }
      width = contentRect.width;
    });
    for (const article of document.querySelectorAll("article")) marked.observe(article);
  });
});

// Until its fonts are there a formula may be too wide for its cell or its line.
document.fonts.addEventListener("loadingdone", () => {
  shrinkToLine();
  markScrolling();
});

// What was collapsed had no width. Only boxes within it are measured: a print opens hundreds at once, and for each of them
// the whole page would be laid out again. Its formulas are typeset, and broken into lines, once they are seen.
document.addEventListener(
  "toggle",
  ({ target }) => {
    shrinkToLine([...target.querySelectorAll("mjx-container")]);
    markScrolling([...target.querySelectorAll("div, pre, mjx-container")]);
  },
  true,
);
window.addEventListener("beforeprint", () => {
  for (const each of document.querySelectorAll("details")) each.open = true;
  const formulas = take([...waiting]);
  if (formulas.length) MathJax.typeset(formulas);
  settle(formulas);
  shrinkToCells();
});
