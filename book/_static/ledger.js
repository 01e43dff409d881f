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
  // The address leads to what is shown: it can be sent, and is there again when the reader returns.
  const write = () => {
    const asked = new URLSearchParams([...new FormData(form)].filter(([, value]) => value.trim())).toString();
    history.replaceState(null, "", `${location.pathname}${asked && "?"}${asked}${location.hash}`);
  };
  const showAll = () => {
    for (const control of form.querySelectorAll("input, select")) control.value = "";
    show();
    write();
  };
  // A link to a hidden statement clears the filters.
  const lead = () => {
    const id = decodeURIComponent(location.hash.slice(1));
    const row = rows.find((each) => each.row.id === id)?.row;
    if (row?.hidden) showAll();
    row?.scrollIntoView();
  };

  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", () => {
    show();
    write();
  });
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

// Hundreds of squares are one stop of the keyboard: arrows go from one to the next. What a square stands for is written below.
for (const box of document.querySelectorAll(".squares")) {
  const all = [...box.querySelectorAll("a.square")];
  const said = box.querySelector(".squares-said");
  const tell = ({ target }) => {
    if (target.matches("a.square")) said.textContent = target.getAttribute("aria-label");
  };
  all.forEach((square, i) => (square.tabIndex = i ? -1 : 0));
  box.addEventListener("focusin", tell);
  box.addEventListener("pointerover", tell);
  box.addEventListener("keydown", (event) => {
    const at = all.indexOf(document.activeElement);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: all.length - 1 }[event.key];
    if (at < 0 || !all[to]) return;
    event.preventDefault();
    all[at].tabIndex = -1;
    all[to].tabIndex = 0;
    all[to].focus();
  });
}
