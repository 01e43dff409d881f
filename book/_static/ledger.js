// Search and filters above the tables of the ledger. Without this script the page shows every row. The script runs
// before formulas are typeset, which removes their source from the text.
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
  window.addEventListener("load", lead);
}
