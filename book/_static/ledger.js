// Search and filters above the tables of the ledger, and formulas typeset when they come into view. Without this script
// the page shows every row. The script runs before MathJax, which removes the source of formulas from the text.
const GREEK = { α: "alpha", β: "beta", γ: "gamma", δ: "delta", ε: "epsilon", η: "eta", θ: "theta", μ: "mu", σ: "sigma", φ: "varphi", ω: "omega" };
const plain = (text) => text.toLowerCase().replace(/[α-ω]/g, (letter) => GREEK[letter] ?? letter);

for (const form of document.querySelectorAll("form.ledger-form")) {
  const tables = [...form.parentElement.querySelectorAll("table")];
  const rows = tables.flatMap((table) => {
    return [...table.tBodies[0].rows].map((row) => ({ row, text: plain(`${row.id} ${row.textContent}`), values: row.dataset }));
  });
  const filters = [...form.querySelectorAll("select")];
  const count = form.querySelector("output");

  const show = () => {
    const words = plain(form.elements.words.value).split(/\s+/);
    let shown = 0;
    for (const { row, text, values } of rows) {
      const fits = filters.every(({ name, value }) => !value || values[name] === value);
      row.hidden = !fits || !words.every((word) => text.includes(word));
      shown += !row.hidden;
    }
    for (const table of tables) table.hidden = !table.querySelector("tbody tr:not([hidden])");
    count.value = `${shown} of ${rows.length} statements shown`;
  };
  const showAll = () => {
    for (const control of form.querySelectorAll("input, select")) control.value = "";
    show();
  };
  // A link to a hidden statement clears the filters.
  const lead = () => {
    const id = decodeURIComponent(location.hash.slice(1));
    const row = rows.find((each) => each.row.id === id)?.row;
    if (row?.hidden) showAll();
    row?.scrollIntoView();
  };

  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", show);
  form.querySelector("button").addEventListener("click", showAll);
  window.addEventListener("hashchange", lead);
  form.hidden = false;
  // A link such as ledger-2016.html?verdict=wrong sets the filters.
  for (const [name, value] of new URLSearchParams(location.search)) {
    if (form.elements[name]) form.elements[name].value = value;
  }
  show();
  setFormulas(rows.map(({ row }) => row), lead);
}

// Typesetting a thousand formulas at once blocks the page for seconds: the formulas of a row are typeset when it comes
// near the window, and all of them before the page is printed.
function setFormulas(rows, whenReady) {
  const waiting = new Map();
  for (const row of rows) {
    const formulas = [...row.querySelectorAll("span.math")];
    for (const formula of formulas) formula.classList.remove("math");
    if (formulas.length) waiting.set(row, formulas);
  }
  const take = (near) => {
    const formulas = near.flatMap((row) => waiting.get(row) ?? []);
    for (const row of near) {
      waiting.delete(row);
      watch.unobserve(row);
    }
    for (const formula of formulas) formula.classList.add("math");
    return formulas;
  };
  const reach = (formulas) => {
    const boxes = formulas.map((formula) => formula.firstElementChild).filter(Boolean);
    breakFormulas(boxes);
    markScrolling(boxes);
  };
  let last = Promise.resolve();
  const watch = new IntersectionObserver(
    (seen) => {
      const formulas = take(seen.filter((each) => each.isIntersecting).map((each) => each.target));
      if (formulas.length) last = last.then(() => MathJax.typesetPromise(formulas)).then(() => reach(formulas));
    },
    { rootMargin: "150%" },
  );
  window.addEventListener("load", async () => {
    await window.MathJax?.startup?.promise;
    if (!window.MathJax?.typesetPromise) return;
    whenReady();
    for (const row of waiting.keys()) watch.observe(row);
    window.addEventListener("beforeprint", () => {
      const formulas = take([...waiting.keys()]);
      MathJax.typeset(formulas);
      reach(formulas);
      shrinkToCells();
    });
  });
}
