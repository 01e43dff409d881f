// Search and filters above the tables of the ledger. Loaded before MathJax, which takes the source of formulas away.
const GREEK = { α: "alpha", β: "beta", γ: "gamma", δ: "delta", ε: "epsilon", η: "eta", θ: "theta", μ: "mu", σ: "sigma", φ: "varphi", ω: "omega" };
const plain = (text) => text.toLowerCase().replace(/[α-ω]/g, (letter) => GREEK[letter] ?? letter);

for (const form of document.querySelectorAll("form.ledger-form")) {
  const tables = [...form.parentElement.querySelectorAll("table")];
  const rows = tables.flatMap((table) => {
    const { document: name, part } = table.dataset;
    return [...table.tBodies[0].rows].map((row) => ({
      row,
      text: plain(`${row.id} ${row.textContent} ${name}`),
      values: { document: [name, `${name} ${part}`], ...row.dataset },
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
  const target = () => rows.find(({ row }) => row.id === decodeURIComponent(location.hash.slice(1)))?.row;
  const lead = () => {
    const row = target();
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
  // Formulas move the rows when they are set.
  window.addEventListener("load", () => window.MathJax?.startup?.promise?.then(lead));
  form.hidden = false;
  show();
}
