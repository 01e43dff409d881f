// Calculators of the page. Their formulas come after, made from sympy; here is what is the same for all of them.
window.gpbnbCalculators ??= (() => {
  "use strict";
  const known = new Map();
  const SVG = "http://www.w3.org/2000/svg";
  const POINTS = 121;
  const SPOKEN_AFTER = 400; // ms without a change, so that a moved slider does not speak at every step

  const superscript = (n) => String(n).replace(/[-\d]/g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));

  function show(x) {
    if (Number.isNaN(x)) return "—";
    if (!Number.isFinite(x)) return "∞";
    if (Number.isInteger(x) && Math.abs(x) < 1e6) return String(x);
    const [mantissa, exponent] = x.toExponential(3).split("e");
    const rounded = Number(`${mantissa}e${exponent}`);
    if (Math.abs(rounded) >= 1e-3 && Math.abs(rounded) < 1e5) return String(rounded);
    return `${mantissa}\u00a0×\u00a010${superscript(Number(exponent))}`;
  }

  // A number as typed, or a message: what came, what is needed, the cure.
  function read(input, typed) {
    if (input.choices.length) return Number(typed);
    const text = typed.trim().replace(/\u2212/g, "-");
    const needed = `needed ${input.whole ? "a whole number" : "a number"} from ${limit(input.least)} to ${limit(input.most)}`;
    const cure = input.cure ? `; ${input.cure}` : "";
    if (!text) throw new Error(`Got nothing; ${needed}.`);
    if (!/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(text)) {
      const form = /^[\d.,\s]+$/.test(text) ? "with a point as decimal mark and no separators" : "such as 10, 0.5 or 1e-3";
      throw new Error(`Got “${shorten(typed.trim())}”; ${needed}, ${form}.`);
    }
    const value = Number(text);
    if (value < input.least || value > input.most) throw new Error(`Got ${shorten(text)}; ${needed}${cure}.`);
    if (input.whole && !Number.isInteger(value)) throw new Error(`Got ${shorten(text)}; ${needed}; round it.`);
    return value;
  }

  const shorten = (text) => (text.length > 24 ? `${text.slice(0, 23)}…` : text);
  const limit = (x) => (x !== 0 && (Math.abs(x) >= 1e6 || Math.abs(x) < 1e-3) ? x.toExponential().replace("+", "") : String(x));
  const fill = (template, values) => template.replace(/\{(\w+)\}/g, (_, name) => show(values[name]));

  function element(name, attributes, text) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    return made;
  }

  // Positions along an axis, and where its ticks are.
  function scale(low, high, from, to, log, apart) {
    const [a, b] = log ? [Math.log10(low), Math.log10(high)] : [low, high];
    const place = (x) => from + (((log ? Math.log10(x) : x) - a) / (b - a || 1)) * (to - from);
    const wanted = Math.max(2, Math.floor(Math.abs(to - from) / apart));
    let step = Math.max(log ? 1 : 10 ** Math.floor(Math.log10((b - a) / wanted || 1)), 1e-9);
    for (const factor of [1, 2, 5, 10, 20, 50, 100]) {
      if ((b - a) / (step * factor) <= wanted) {
        step *= factor;
        break;
      }
    }
    const ticks = [];
    for (let i = Math.ceil(a / step - 1e-9); i * step <= b + 1e-9 * step; i++) ticks.push(Number((i * step).toPrecision(12)));
    return { place, ticks: ticks.map((t) => (log ? [10 ** t, `10${superscript(t)}`] : [t, String(t)])) };
  }

  function sweep(spec, values) {
    const input = spec.inputs.find((each) => each.name === spec.figure.sweep);
    let [low, high] = input.slider;
    low = Math.min(low, values[input.name]);
    high = Math.max(high, values[input.name]);
    const at = new Set();
    for (let i = 0; i < POINTS; i++) {
      const share = i / (POINTS - 1);
      const x = input.log ? low * (high / low) ** share : low + (high - low) * share;
      at.add(input.whole ? Math.round(x) : x);
    }
    return [...at].map((x) => ({ x, values: spec.compute({ ...values, [input.name]: x }) }));
  }

  function draw(spec, box, values) {
    const { sweep: name, curves, axis } = spec.figure;
    const input = spec.inputs.find((each) => each.name === name);
    const width = Math.max(box.clientWidth, 240);
    const height = Math.min(340, Math.max(240, 0.55 * width));
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, width, height, "aria-hidden": "true" });
    const points = sweep(spec, values);
    const drawn = (v) => Number.isFinite(v) && v > 0;
    const heights = points.flatMap((p) => curves.map(([curve]) => p.values[curve])).filter(drawn);
    if (!heights.length) return;
    const bottom = 10 ** Math.floor(Math.log10(Math.min(...heights)));
    const top = 10 ** Math.ceil(Math.log10(Math.max(...heights)) + 1e-9);
    const x = scale(points[0].x, points.at(-1).x, 58, width - 14, input.log, 70);
    const y = scale(bottom, top > bottom ? top : 10 * bottom, height - 44, 28, true, 36);
    for (const [value, label] of x.ticks) {
      const at = x.place(value);
      svg.append(element("line", { class: "grid", x1: at, x2: at, y1: 28, y2: height - 44 }));
      svg.append(element("text", { x: at, y: height - 26, "text-anchor": "middle" }, label));
    }
    for (const [value, label] of y.ticks) {
      const at = y.place(value);
      svg.append(element("line", { class: "grid", x1: 58, x2: width - 14, y1: at, y2: at }));
      svg.append(element("text", { x: 52, y: at + 4, "text-anchor": "end" }, label));
    }
    svg.append(element("text", { x: 4, y: 14 }, axis));
    svg.append(element("text", { x: width - 14, y: height - 6, "text-anchor": "end" }, input.label));
    curves.forEach(([curve], i) => {
      let path = "";
      let pen = "M";
      for (const p of points) {
        const value = p.values[curve];
        if (drawn(value)) path += `${pen}${x.place(p.x).toFixed(1)} ${y.place(value).toFixed(1)}`;
        pen = drawn(value) ? "L" : "M";
      }
      svg.append(element("path", { class: `curve curve-${i}`, d: path }));
      const here = values[curve];
      if (drawn(here)) svg.append(element("circle", { class: `curve-${i}`, cx: x.place(values[name]), cy: y.place(here), r: 5 }));
    });
    box.replaceChildren(svg);
    const said = curves.map(([curve, label]) => `${label}: ${show(points[0].values[curve])} to ${show(points.at(-1).values[curve])}`);
    box.setAttribute(
      "aria-label",
      `${spec.figure.title}, ${input.label} from ${show(points[0].x)} to ${show(points.at(-1).x)}. ${said.join("; ")}.`,
    );
  }

  function legend(spec, list) {
    spec.figure.curves.forEach(([, label], i) => {
      const item = document.createElement("li");
      const swatch = element("svg", { width: 30, height: 10, "aria-hidden": "true" });
      swatch.append(element("path", { class: `curve curve-${i}`, d: "M0 5H30" }));
      item.append(swatch, label);
      list.append(item);
    });
  }

  function bring(spec) {
    const form = document.getElementById(`calculator-${spec.id}`);
    const box = form.querySelector(".calculator-drawing");
    const sentence = form.querySelector("output");
    const of = (name, part = "") => form.querySelector(`#calculator-${spec.id}-${name}${part}`);
    let latest = null;
    let timer = 0;

    const toSlider = (input, value) => (input.log ? Math.log10(value) : value);
    function fromSlider(input, position) {
      const value = input.log ? Number((10 ** position).toPrecision(3)) : Number(position.toPrecision(6));
      return Math.min(input.most, Math.max(input.least, input.whole ? Math.round(value) : value));
    }

    function say(text, now) {
      clearTimeout(timer);
      if (now) sentence.textContent = text;
      else timer = setTimeout(() => (sentence.textContent = text), SPOKEN_AFTER);
    }

    function update(now = false) {
      const given = {};
      const wrong = [];
      for (const input of spec.inputs) {
        const field = of(input.name);
        const note = of(input.name, "-error");
        let message = "";
        try {
          given[input.name] = read(input, field.value);
        } catch (error) {
          message = error.message;
          wrong.push(input.label);
        }
        if (!note) continue;
        if (note.textContent !== message) note.textContent = message;
        if (message) field.setAttribute("aria-invalid", "true");
        else {
          field.removeAttribute("aria-invalid");
          const slider = of(input.name, "-slider");
          if (document.activeElement !== slider) slider.value = toSlider(input, given[input.name]);
          slider.setAttribute("aria-valuetext", show(given[input.name]));
        }
      }
      latest = wrong.length ? null : spec.compute(given);
      for (const name of spec.results) {
        const cell = form.querySelector(`td[data-name="${name}"]`);
        const none = latest && Number.isNaN(latest[name]);
        cell.textContent = !latest ? "—" : none && spec.missing[name] ? fill(spec.missing[name], latest) : show(latest[name]);
        cell.classList.toggle("calculator-none", Boolean(none));
      }
      if (!latest) {
        form.dataset.state = "waiting";
        say(`Nothing computed: see what is said below ${wrong.join(" and ")}.`, now);
        return;
      }
      form.dataset.state = "computed";
      draw(spec, box, latest);
      say(fill(spec.sentence, latest), now);
    }

    for (const input of spec.inputs) {
      of(input.name).addEventListener("input", () => update());
      of(input.name, "-slider")?.addEventListener("input", (event) => {
        of(input.name).value = String(fromSlider(input, event.target.valueAsNumber));
        update();
      });
    }
    form.addEventListener("submit", (event) => event.preventDefault());
    const table = form.parentElement.querySelector(".calculator-examples");
    for (const cell of table.querySelectorAll("[data-numbers]")) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = cell.textContent;
      button.title = "Put these numbers into the form";
      button.addEventListener("click", () => {
        for (const [name, value] of Object.entries(JSON.parse(cell.dataset.numbers))) of(name).value = String(value);
        update();
        form.scrollIntoView({ block: "nearest" });
      });
      cell.replaceChildren(button);
    }
    form.hidden = false;
    legend(spec, form.querySelector(".calculator-legend"));
    update(true);
    new ResizeObserver(() => latest && draw(spec, box, latest)).observe(box);
  }

  return {
    add(spec, compute) {
      spec.compute = compute;
      known.set(spec.id, spec);
      bring(spec);
    },
    compute: (id, given) => known.get(id).compute(given),
    show,
  };
})();
