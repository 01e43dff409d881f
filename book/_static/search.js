// Sphinx's search, which leaves out numbers, sorts names of the package before chapters, and cuts its snippets out of code and TeX.
const SEPARATOR = /(?<=\d)(?:,|\{,\}|\\,|\u2009|\u202f)(?=\d{3}(?!\d))/g; // as in book/_ext/gpbnb_search.py
const SNIPPET = 240; // characters
const BLOCKS = "p, li, dd, dt, figcaption, th, td, h1, h2, h3";

let asked = "";
const parseQuery = Search._parseQuery;
Search._parseQuery = (query) => {
  const joined = query.replace(SEPARATOR, "");
  asked = joined.toLowerCase().trim();
  const [, words, excluded, marked, names] = parseQuery(joined);
  for (const number of splitQuery(joined).filter((word) => /^\d+$/.test(word))) {
    words.add(number);
    marked.add(number);
  }
  return [joined, words, excluded, marked, names];
};

// Titles that contain what was asked, then the front page, chapters, the bibliography, the ledger, the reference of the package.
const RANKS = [["book/api", 0], ["book/ledger-", 1000], ["book/bibliography", 1500], ["book/index", 3000]];
const rank = (page) => RANKS.find(([start]) => page.startsWith(start))?.[1] ?? 2000;
Scorer.score = ([page, title, , , score]) => score + rank(page) + (rank(page) >= 2000 && title.toLowerCase().includes(asked) ? 2000 : 0);

// A formula reads as text where it is a number or a letter, and is left out otherwise.
function readable(block) {
  const copy = block.cloneNode(true);
  for (const hidden of copy.querySelectorAll("script, style, pre, .headerlink, details, table, ul, ol, dl")) hidden.remove();
  for (const formula of copy.querySelectorAll(".math")) {
    const text = formula.textContent.replace(/\\[()[\]]/g, "").replaceAll("{,}", ",").trim();
    formula.replaceWith(/[\\{}^_&]/.test(text) ? "…" : text);
  }
  return copy.textContent.replace(/\s+/g, " ").replace(/(… ?)+/g, "… ").trim();
}
Search.makeSearchSummary = (html, words, anchor) => {
  const page = new DOMParser().parseFromString(html, "text/html");
  const place = (anchor && page.getElementById(anchor.slice(1))) || page.querySelector("article");
  if (!place) return null;
  // A word may go on, a number may not: 33 is not found in 333.
  const ends = (word) => (/^\d+$/.test(word) ? "(?!\\p{N})" : "");
  const begins = [...words].map((word) => new RegExp(`(?<![\\p{L}\\p{N}])${_escapeRegExp(word)}${ends(word)}`, "iu"));
  let best = { found: 0 };
  for (const block of place.querySelectorAll(BLOCKS)) {
    const text = readable(block).replace(SEPARATOR, "");
    const found = begins.filter((each) => each.test(text)).length;
    const sentence = /[.?!:]$/.test(text); // a sentence says more than a heading or a cell
    if (found && (found > best.found || (found === best.found && sentence && !best.sentence))) best = { found, sentence, block, text };
  }
  // What no text holds may be in code: a line of it is shown.
  const lines = [...place.querySelectorAll("pre")].flatMap((code) => code.textContent.split("\n"));
  const line = best.found ? "" : lines.find((each) => begins.some((word) => word.test(each)))?.trim();
  const summary = document.createElement("p");
  summary.className = "context";
  summary.textContent = line || cut(readable(best.block ?? place.querySelector("p") ?? place), begins);
  return summary;
};
// The sentence with the first word that was found, and what follows it.
function cut(text, begins) {
  const joined = (part) => part.replace(SEPARATOR, "");
  const sentences = text.split(/(?<=[.?!])(?<!\b(?:Fig|Eq|ch|cf|vs|e\.g|i\.e)\.) /);
  const first = Math.max(0, sentences.findIndex((each) => begins.some((word) => word.test(joined(each)))));
  let snippet = sentences.slice(first).join(" ");
  if (snippet.length > SNIPPET) snippet = `${snippet.slice(0, snippet.lastIndexOf(" ", SNIPPET))} …`;
  return first ? `… ${snippet}` : snippet;
}
