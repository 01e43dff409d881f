// Calculators and pictures: forms that compute while one types. Each names its formula and describes its own fields:
//
//   <form class="calculator" data-calculator="rounding" aria-label="Unit roundoff" hidden>
//   <label>Digits t <input name="t" value="10" data-least="1" data-most="90" data-slider="1 60" data-whole></label>
//   <button type="button" data-values='{"t": 53}'>IEEE double</button>
//   <td data-name="gamma" data-missing="none: nβ is {total}"></td> <output data-says="At most {beta}."></output>
//   </form>
//
// A slider of an input with data-log moves by decades. A picture puts its own functions into window.gpbnbPictures.
(() => {
  "use strict";
  const SVG = "http://www.w3.org/2000/svg";
  const DAY = 86400;
  const MOST_DIGITS = 2000;
  const MOST_TICKS = 100;
  const SPOKEN_AFTER = 400; // ms without a change, so that a moved slider does not speak at every step

  // -- formulas, from the fields of a form to its results ------------------------------------------

  const unit = ({ b, chop }, t) => (chop ? 1 : 0.5) * b ** (1 - t);

  function rounding(given) {
    const beta = unit(given, given.t);
    const total = given.n * beta;
    return { beta, sharper: beta / (1 + beta), total, gamma: total < 1 ? total / (1 - total) : NaN };
  }

  // Digits that (125) asks for as printed, after each correction, and with inputs that a closed loop of norm f forgets.
  function kalman(given) {
    const { k, n, m, x, u, f, goal } = given;
    const memory = f < 1 ? -Math.expm1(k * Math.log(f)) / (1 - f) : k;
    const once = k * (3 * m + 6 * n + 5);
    const carried = (k * (k * (m + 3 * n + 2) + 5 * m + 9 * n + 8)) / 2;
    const inputs = (k * (5 * k ** 2 * (m + 3 * n + 2) + 3 * k * (8 * m + 15 * n + 13) + 7 * m + 5)) / 6;
    const rows = [
      [k * (3 * m + 7 * n + 6), (k * (k * (3 * m + 7 * n + 6) - 3 * m - n - 4)) / 2],
      [once, (k * (k * (3 * m + 6 * n + 5) - 3 * m - 2 * n - 3)) / 2],
      [once, (k * (3 * k * (3 * m + 6 * n + 5) + 3 * m + 2 * n + 3)) / 2],
      [carried, inputs],
      [carried, Math.min(inputs, 2 * carried * memory)],
    ];
    const found = { memory };
    rows.forEach(([a, b], i) => {
      const size = a * x + b * u;
      let digits = 1;
      while (digits <= MOST_DIGITS && !(size * unit(given, digits) <= goal)) digits++;
      if (digits > MOST_DIGITS) digits = NaN;
      Object.assign(found, { [`a${i + 1}`]: a, [`b${i + 1}`]: b, [`digits${i + 1}`]: digits });
    });
    return found;
  }

  function deroll(given) {
    const rate = (2 * Math.PI) / given.period;
    const e = Math.floor(Math.log(rate) / Math.log(given.b)) + 1;
    const error = unit(given, given.t - e + 1);
    const phase = error * given.duration * DAY;
    return {
      rate, error, phase, beat: (2 * Math.PI) / error / (365 * DAY),
      lost: 2 * Math.sin(phase / 2) ** 2, across: given.drift * crossed(phase),
    };
  }

  // 6 (3ψ sin ψ - ψ² cos ψ + 4 cos ψ - 4) / ψ³, the drift across for a drift of 1; its power series where it cancels.
  function crossed(psi) {
    if (psi > 2) return (6 * (3 * psi * Math.sin(psi) - (psi ** 2 - 4) * Math.cos(psi) - 4)) / psi ** 3;
    let [sum, term] = [0, psi];
    for (let k = 0; k < 15; k++) {
      sum += (term * 6 * (k + 1)) / ((2 * k + 3) * (k + 2));
      term *= -(psi ** 2) / ((2 * k + 2) * (2 * k + 3));
    }
    return sum;
  }

  function integration({ sigma, omega, rate }) {
    const mu = omega / rate;
    const walk = langevin(mu / 2);
    const exact = sigma * Math.sqrt(walk / rate);
    const printed = (sigma * Math.sqrt(omega / 6)) / rate;
    return { mu, walk, exact, printed, ratio: printed / exact };
  }

  // coth y - 1/y, which cancels for small y; there it is y/(3 + y²/(5 + y²/(7 + …))).
  function langevin(y) {
    if (y > 2) return (1 + Math.exp(-2 * y)) / (1 - Math.exp(-2 * y)) - 1 / y;
    let below = 25;
    for (let odd = 23; odd >= 3; odd -= 2) below = odd + y ** 2 / below;
    return y / below;
  }

  const formulas = { rounding, kalman, deroll, integration };

  // -- numbers and words ---------------------------------------------------------------------------

  const superscript = (n) => String(n).replace(/[-\d]/g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));

  // Four significant digits, or all of a whole number below a million.
  function show(x) {
    if (Number.isNaN(x)) return "—";
    if (!Number.isFinite(x)) return "∞";
    if (Number.isInteger(x) && Math.abs(x) < 1e6) return String(x);
    const [mantissa, exponent] = x.toExponential(3).split("e");
    const rounded = Number(`${mantissa}e${exponent}`);
    if (Math.abs(rounded) >= 1e-3 && Math.abs(rounded) < 1e5) return String(rounded);
    return `${mantissa}\u00a0×\u00a010${superscript(Number(exponent))}`;
  }

  const shorten = (text) => (text.length > 24 ? `${text.slice(0, 23)}…` : text);
  const limit = (x) => (x !== 0 && (Math.abs(x) >= 1e6 || Math.abs(x) < 1e-3) ? x.toExponential().replace("+", "") : String(x));
  const fill = (template, values) =>
    template.replace(/\{(\w+)\}/g, (_, name) => (typeof values[name] === "string" ? values[name] : show(values[name])));
  const range = ({ least, most }) => `${limit(Number(least))} to ${limit(Number(most))}`;
  const taken = (given) => `${given.whole === undefined ? "a number" : "a whole number"} from ${range(given)}`;

  // A number as typed, or an error: what came, what is needed, the cure.
  function read(field) {
    if (field.tagName === "SELECT") return Number(field.value);
    const { least, most, whole, cure } = field.dataset;
    const text = field.value.trim().replace(/\u2212/g, "-");
    const needed = `needed ${taken(field.dataset)}`;
    if (!text) throw new Error(`Got nothing; ${needed}.`);
    // Each character can be read in one way only, so that long texts are tested at once.
    if (!/^[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?$/i.test(text)) {
      const form = /^[\d.,\s]+$/.test(text) ? "with a point as decimal mark and no separators" : "such as 10, 0.5 or 1e-3";
      throw new Error(`Got “${shorten(field.value.trim())}”; ${needed}, ${form}.`);
    }
    const value = Number(text);
    if (value < Number(least) || value > Number(most)) throw new Error(`Got ${shorten(text)}; ${needed}${cure ? `; ${cure}` : ""}.`);
    if (whole !== undefined && !Number.isInteger(value)) throw new Error(`Got ${shorten(text)}; ${needed}; round it.`);
    return value;
  }

  // -- drawing, for pictures -----------------------------------------------------------------------

  function make(name, attributes, text, namespace = SVG) {
    const made = document.createElementNS(namespace, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    return made;
  }
  const html = (name, attributes, text) => make(name, attributes, text, "http://www.w3.org/1999/xhtml");

  // Positions along an axis from a to b, and its ticks; a logarithmic axis is given by the exponents of its ends.
  function scale(a, b, from, to, log, apart) {
    const along = (t) => from + ((t - a) / (b - a || 1)) * (to - from);
    const wanted = Math.max(2, Math.floor(Math.abs(to - from) / apart));
    const finest = Math.max(log ? 1 : 10 ** Math.floor(Math.log10((b - a) / wanted || 1)), 1e-9);
    const step = finest * ([1, 2, 5, 10, 20, 50, 100].find((factor) => (b - a) / (finest * factor) <= wanted) ?? 1);
    const first = Math.ceil(a / step - 1e-9);
    const count = Math.min(Math.floor(b / step + 1e-9) - first + 1, MOST_TICKS);
    const ticks = Array.from({ length: Math.max(count, 0) }, (_, i) => Number(((first + i) * step).toPrecision(12)));
    return {
      place: (x) => along(log ? Math.log10(x) : x),
      ticks: ticks.map((t) => [along(t), log ? `10${superscript(t)}` : String(t)]),
    };
  }

  // Grid lines at the ticks of two scales within a box, and their labels.
  function axes(add, x, y, { left, right, top, bottom }) {
    for (const [at, label] of x.ticks) {
      add("line", { class: "grid", x1: at, x2: at, y1: top, y2: bottom });
      add("text", { x: at, y: bottom + 18, "text-anchor": "middle" }, label);
    }
    for (const [at, label] of y.ticks) {
      add("line", { class: "grid", x1: left, x2: right, y1: at, y2: at });
      add("text", { x: left - 6, y: at + 4, "text-anchor": "end" }, label);
    }
  }

  // -- forms ---------------------------------------------------------------------------------------

  // Add a slider, a hint and a place for errors to a field.
  function furnish(form, field) {
    const label = field.closest("label");
    const id = `calculator-${form.dataset.calculator}-${field.name}`;
    const box = html("div", { class: "calculator-field" });
    label.replaceWith(box);
    box.append(label);
    field.id = id;
    if (field.tagName === "SELECT") return;
    const words = label.textContent.trim();
    const { slider, log, whole } = field.dataset;
    const [low, high] = slider.split(" ").map((end) => (log === undefined ? Number(end) : Math.log10(end)));
    const step = log !== undefined ? 0.01 : whole !== undefined ? 1 : (high - low) / 1000;
    field.setAttribute("aria-describedby", `${id}-hint ${id}-error`);
    for (const [name, value] of Object.entries({ type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: false })) {
      field.setAttribute(name, value);
    }
    const bar = html("input", { type: "range", id: `${id}-slider`, "aria-label": `${words}, slider`, min: low, max: high, step });
    bar.addEventListener("input", () => {
      const position = bar.valueAsNumber;
      const value = log === undefined ? Number(position.toPrecision(6)) : Number((10 ** position).toPrecision(3));
      const within = Math.min(field.dataset.most, Math.max(field.dataset.least, whole === undefined ? value : Math.round(value)));
      field.value = String(within);
      field.dispatchEvent(new Event("input"));
    });
    box.append(bar, html("small", { id: `${id}-hint` }, range(field.dataset)), html("p", { class: "calculator-error", id: `${id}-error` }));
  }

  // Read a field and say what is wrong with it, or move its slider there.
  function check(field) {
    const box = field.closest(".calculator-field");
    const [bar, error] = [box.querySelector('[type="range"]'), box.querySelector(".calculator-error")];
    let [value, message] = [NaN, ""];
    try {
      value = read(field);
    } catch (fault) {
      message = fault.message;
    }
    field.toggleAttribute("aria-invalid", Boolean(message));
    if (message) field.setAttribute("aria-invalid", "true");
    if (error && error.textContent !== message) error.textContent = message;
    if (bar && !message) {
      if (document.activeElement !== bar) bar.value = field.dataset.log === undefined ? value : Math.log10(value);
      bar.setAttribute("aria-valuetext", show(value));
    }
    return value;
  }

  function open(form) {
    const name = form.dataset.calculator;
    form.id = `calculator-${name}`;
    const { compute, draw, data } = window.gpbnbPictures?.[name] ?? { compute: formulas[name] };
    const fields = [...form.querySelectorAll("label :is(input, select)")];
    const [output, drawing] = [form.querySelector("output"), form.querySelector(".calculator-drawing")];
    let values = null;
    let timer = 0;

    function update(now = false) {
      const given = Object.fromEntries(fields.map((field) => [field.name, check(field)]));
      const wrong = fields.filter((field) => field.hasAttribute("aria-invalid"));
      values = wrong.length ? null : { ...given, ...compute(given, data) };
      form.dataset.state = values ? "computed" : "waiting";
      for (const cell of form.querySelectorAll("[data-name]")) {
        const value = values?.[cell.dataset.name] ?? NaN;
        const why = values && Number.isNaN(value) && cell.dataset.missing;
        cell.textContent = why ? fill(why, values) : show(value);
        cell.classList.toggle("calculator-none", Boolean(why));
      }
      if (drawing) redraw();
      const labels = wrong.map((field) => field.closest("label").textContent.trim());
      const said = values ? fill(output.dataset.says, values) : `Nothing computed: see what is said below ${labels.join(" and ")}.`;
      clearTimeout(timer);
      if (!values) output.textContent = ""; // an old result must not stand beside an error
      if (now) output.textContent = said;
      else timer = setTimeout(() => (output.textContent = said), SPOKEN_AFTER);
    }

    // A drawing of earlier numbers keeps its place, but is not seen or heard.
    function redraw() {
      drawing.classList.toggle("calculator-old", !values);
      drawing.setAttribute("aria-label", `${form.getAttribute("aria-label")}. ${values ? fill(output.dataset.says, values) : "No drawing."}`);
      if (!values) return;
      const width = Math.max(drawing.clientWidth, 240);
      const svg = make("svg", { width, "aria-hidden": "true" });
      drawing.replaceChildren(svg);
      const add = (kind, attributes, text) => svg.appendChild(make(kind, attributes, text));
      const height = draw({ add, svg, width, values, data, set, scale, axes, show, superscript });
      svg.setAttribute("height", height);
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    }

    function set(field, value) {
      form.elements[field].value = String(value);
      update();
    }

    for (const field of fields) {
      furnish(form, field);
      field.addEventListener("input", () => update());
    }
    for (const button of form.querySelectorAll("[data-values]")) {
      button.addEventListener("click", () => {
        for (const [field, value] of Object.entries(JSON.parse(button.dataset.values))) form.elements[field].value = String(value);
        update();
      });
    }
    form.addEventListener("submit", (event) => event.preventDefault());
    form.hidden = false;
    update(true);
    if (drawing) new ResizeObserver(redraw).observe(drawing);
  }

  window.gpbnbCalculators = { formulas, show, superscript };
  document.querySelectorAll("form[data-calculator]").forEach(open);
})();
