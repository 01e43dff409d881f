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

// MathJax 3 breaks no lines. A long formula may break before a relation or a sign and after a comma, within brackets
// only if these are long: what lies between two such places is held together, and the style sheet lets the rest wrap.
const LONG = 9; // em
const LONG_BRACKETS = 12; // em
const OPENS = ":scope > mjx-c:is(.mjx-c28, .mjx-c5B, .mjx-c7B)";
const CLOSES = ":is(:scope, :scope:is(mjx-msup, mjx-msub, mjx-msubsup) > mjx-mo) > mjx-c:is(.mjx-c29, .mjx-c5D, .mjx-c7D)";
const COMMA = ":scope > mjx-c:is(.mjx-c2C, .mjx-c3B)";

function breakFormulas(boxes = document.querySelectorAll("article mjx-container")) {
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
window.addEventListener("beforeprint", shrinkToCells);
window.addEventListener("load", async () => {
  await window.MathJax?.startup?.promise;
  breakFormulas();
  // Not when the window is resized: the sidebars slide, and the text has its width only after that.
  let width = null;
  const marked = new ResizeObserver(([{ contentRect }]) => {
    if (contentRect.width !== width) markScrolling();
    width = contentRect.width;
  });
  for (const article of document.querySelectorAll("article")) marked.observe(article);
});

// A collapsed derivation has no width to break its formulas at until it is opened. On paper all of them are open.
document.addEventListener(
  "toggle",
  ({ target }) => {
    breakFormulas(target.querySelectorAll("mjx-container"));
    markScrolling();
  },
  true,
);
window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((each) => (each.open = true)));
