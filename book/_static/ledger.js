// Search and filters above the tables of the ledger, and formulas set as they come into sight. Without this script the
// page is the same, all rows in sight. It runs before MathJax, which takes the source of formulas out of the text.
const GREEK = { α: "alpha", β: "beta", γ: "gamma", δ: "delta", ε: "epsilon", η: "eta", θ: "theta", μ: "mu", σ: "sigma", φ: "varphi", ω: "omega" };
const plain = (text) => text.toLowerCase().replace(/[α-ω]/g, (letter) => GREEK[letter] ?? letter);

for (const form of document.querySelectorAll("form.ledger-form")) {
  const tables = [...form.parentElement.querySelectorAll("table")];
  const rows = tables.flatMap((table) => {
    const { document: name, part } = table.dataset;
    return [...table.tBodies[0].rows].map((row) => ({
      row,
      text: plain(`${row.id} ${row.textContent} ${name}`),
      values: { ...row.dataset, document: [name, `${name} ${part}`] },
    }));
  });
  const filters = [...form.querySelectorAll("select")];
  const count = form.querySelector("output");

  const show = () => {
    const words = plain(form.elements.words.value).split(/\s+/);
    let shown = 0;
    for (const { row, text, values } of rows) {
      const fits = filters.every(({ name, value }) => !value || [values[name]].flat().includes(value));
      row.hidden = !fits || !words.every((word) => text.includes(word));
      shown += !row.hidden;
    }
    for (const table of tables) table.hidden = !table.querySelector("tbody tr:not([hidden])");
    count.value = `${shown} of ${rows.length} entries shown`;
  };
  // A link to an entry that is filtered away shows everything again.
  const lead = () => {
    const id = decodeURIComponent(location.hash.slice(1));
    const row = rows.find((each) => each.row.id === id)?.row;
    if (row?.hidden) form.reset();
    row?.scrollIntoView();
  };

  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", show);
  form.addEventListener("reset", () => {
    for (const control of form.querySelectorAll("input, select")) control.value = "";
    show();
  });
  window.addEventListener("hashchange", lead);
  form.hidden = false;
  show();
  setFormulas(rows.map(({ row }) => row), lead);
}

// Hundreds of formulas set at once stop the page for seconds: rows near the window come first, the others 60 at a time.
function setFormulas(rows, whenReady) {
  const waiting = new Map();
  for (const row of rows) {
    const formulas = [...row.querySelectorAll("span.math")];
    for (const formula of formulas) formula.classList.remove("math");
    if (formulas.length) waiting.set(row, formulas);
  }
  const near = new Set();
  const watch = new IntersectionObserver(
    (seen) => {
      for (const { isIntersecting, target } of seen) isIntersecting ? near.add(target) : near.delete(target);
    },
    { rootMargin: "100%" },
  );
  for (const row of waiting.keys()) watch.observe(row);

  const set = async () => {
    whenReady();
    while (waiting.size) {
      const inSight = [...near].filter((row) => waiting.has(row));
      const first = (inSight.length ? inSight : [...waiting.keys()]).slice(0, 60);
      const formulas = first.flatMap((row) => waiting.get(row));
      for (const row of first) {
        waiting.delete(row);
        watch.unobserve(row);
      }
      for (const formula of formulas) formula.classList.add("math");
      await MathJax.typesetPromise(formulas);
      await new Promise((resolve) => setTimeout(resolve));
    }
  };
  // Whoever waits for MathJax, a printer say, waits for these formulas too.
  document.addEventListener("DOMContentLoaded", () => {
    if (window.MathJax?.startup?.promise) MathJax.startup.promise = MathJax.startup.promise.then(set);
  });
}
