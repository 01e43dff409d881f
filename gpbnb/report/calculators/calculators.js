// Calculators and pictures of the page. What each computes comes after; here is what is the same for all of them.
window.gpbnbCalculators ??= (() => {
  "use strict";
  const known = new Map();
  const SVG = "http://www.w3.org/2000/svg";
  const POINTS = 121;
  const MOST_TICKS = 100;
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
    // Each character can be read in one way only, so that long texts are tested at once.
    if (!/^[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?$/i.test(text)) {
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
  const say = (value) => (typeof value === "string" ? value : show(value));
  const fill = (template, values) => template.replace(/\{(\w+)\}/g, (_, name) => say(values[name]));

  function element(name, attributes, text) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    return made;
  }

  // Positions along an axis from a to b, and its ticks. A logarithmic axis is given by exponents, because a power of ten
  // beyond the range of numbers, above the largest or below the smallest result, has no other form.
  function scale(a, b, from, to, log, apart) {
    const along = (t) => from + ((t - a) / (b - a || 1)) * (to - from);
    const wanted = Math.max(2, Math.floor(Math.abs(to - from) / apart));
    let step = Math.max(log ? 1 : 10 ** Math.floor(Math.log10((b - a) / wanted || 1)), 1e-9);
    for (const factor of [1, 2, 5, 10, 20, 50, 100]) {
      if ((b - a) / (step * factor) <= wanted) {
        step *= factor;
        break;
      }
    }
    const first = Math.ceil(a / step - 1e-9);
    const count = Math.min(Math.floor(b / step + 1e-9) - first + 1, MOST_TICKS);
    const at = new Set();
    for (let i = 0; i < count; i++) at.add(Number(((first + i) * step).toPrecision(12)));
    // Where neighbouring ticks agree in 12 digits, the rounded ones may be the same, or beyond the axis.
    const ticks = [...at].filter((t) => t >= a - 1e-9 * step && t <= b + 1e-9 * step);
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

  function sweep(spec, values) {
    const input = spec.inputs.find((each) => each.name === spec.figure.sweep);
    let [low, high] = input.slider;
    low = Math.min(low, values[input.name]);
    high = Math.max(high, values[input.name]);
    const at = new Set();
    for (let i = 0; i < POINTS; i++) {
      const share = i / (POINTS - 1);
      const x = input.log ? low ** (1 - share) * high ** share : low + (high - low) * share;
      at.add(input.whole ? Math.round(x) : x);
    }
    return [...at].map((x) => ({ x, values: spec.compute({ ...values, [input.name]: x }) }));
  }

  function draw(spec, box, values) {
    const { sweep: name, curves, axis } = spec.figure;
    const input = spec.inputs.find((each) => each.name === name);
    const width = Math.max(box.clientWidth, 240);
    const height = Math.min(340, Math.max(240, 0.55 * width));
    box.classList.remove("calculator-old");
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, width, height, "aria-hidden": "true" });
    const points = sweep(spec, values);
    const drawn = (v) => Number.isFinite(v) && v > 0;
    const heights = points.flatMap((p) => curves.map(([curve]) => p.values[curve])).filter(drawn);
    if (!heights.length) {
      box.replaceChildren();
      box.setAttribute("aria-label", `${spec.figure.title}: no result is a positive number, so there is no curve.`);
      return;
    }
    const bottom = Math.floor(Math.log10(Math.min(...heights)));
    const top = Math.ceil(Math.log10(Math.max(...heights)) + 1e-9);
    const [low, high] = [points[0].x, points.at(-1).x].map((end) => (input.log ? Math.log10(end) : end));
    const x = scale(low, high, 58, width - 14, input.log, 70);
    const y = scale(bottom, top, height - 44, 28, true, 36);
    const add = (name, attributes, text) => svg.appendChild(element(name, attributes, text));
    axes(add, x, y, { left: 58, right: width - 14, top: 28, bottom: height - 44 });
    add("text", { x: 4, y: 14 }, axis);
    add("text", { x: width - 14, y: height - 6, "text-anchor": "end" }, input.label);
    curves.forEach(([curve], i) => {
      let path = "";
      let pen = "M";
      for (const p of points) {
        const value = p.values[curve];
        if (drawn(value)) path += `${pen}${x.place(p.x).toFixed(1)} ${y.place(value).toFixed(1)}`;
        pen = drawn(value) ? "L" : "M";
      }
      add("path", { class: `curve curve-${i}`, d: path });
      const here = values[curve];
      if (drawn(here)) add("circle", { class: `curve-${i}`, cx: x.place(values[name]), cy: y.place(here), r: 5 });
    });
    box.replaceChildren(svg);
    const said = curves.map(([curve, label]) => `${label}: ${show(points[0].values[curve])} to ${show(points.at(-1).values[curve])}`);
    box.setAttribute(
      "aria-label",
      `${spec.figure.title}, ${input.label} from ${show(points[0].x)} to ${show(points.at(-1).x)}. ${said.join("; ")}.`,
    );
  }

  // A picture draws itself: its own function gets an empty drawing, the numbers, and a way to set them.
  function drawPicture(spec, box, values, set) {
    const width = Math.max(box.clientWidth, 240);
    box.classList.remove("calculator-old");
    const svg = element("svg", { width, "aria-hidden": "true" });
    box.replaceChildren(svg);
    const add = (name, attributes, text) => svg.appendChild(element(name, attributes, text));
    const height = spec.draw({ add, svg, width, values, data: spec.data, set, scale, axes, show, superscript });
    svg.setAttribute("height", height);
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    box.setAttribute("aria-label", `${spec.figure.title}. ${fill(spec.sentence, values)}`);
  }

  // The curve of earlier numbers stays, but looks and sounds old.
  function age(box) {
    if (box.classList.contains("calculator-old")) return;
    box.classList.add("calculator-old");
    box.setAttribute("aria-label", `Figure of earlier numbers, because a field is not valid. ${box.getAttribute("aria-label")}`);
  }

  function legend(spec, list) {
    (spec.figure.curves ?? []).forEach(([, label], i) => {
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
    let drawn = null; // the numbers of the figure
    let timer = 0;

    const toSlider = (input, value) => (input.log ? Math.log10(value) : value);
    function fromSlider(input, position) {
      const value = input.log ? Number((10 ** position).toPrecision(3)) : Number(position.toPrecision(6));
      return Math.min(input.most, Math.max(input.least, input.whole ? Math.round(value) : value));
    }

    function speak(text, now) {
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
        age(box);
        speak(`Nothing computed: see what is said below ${wrong.join(" and ")}.`, now);
        return;
      }
      form.dataset.state = "computed";
      drawn = latest;
      redraw();
      speak(fill(spec.sentence, latest), now);
    }

    function redraw() {
      if (spec.draw) drawPicture(spec, box, drawn, set);
      else draw(spec, box, drawn);
    }

    function set(name, text) {
      of(name).value = text;
      update();
    }

    for (const input of spec.inputs) {
      of(input.name).addEventListener("input", () => update());
      of(input.name, "-slider")?.addEventListener("input", (event) => {
        of(input.name).value = String(fromSlider(input, event.target.valueAsNumber));
        update();
      });
    }
    form.addEventListener("submit", (event) => event.preventDefault());
    for (const cell of form.parentElement.querySelectorAll(".calculator-examples [data-numbers]")) {
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
    new ResizeObserver(() => {
      if (drawn) redraw();
      if (!latest) age(box);
    }).observe(box);
  }

  return {
    add(spec, compute, draw) {
      spec.compute = (given) => compute(given, spec.data);
      spec.draw = draw;
      known.set(spec.id, spec);
      bring(spec);
    },
    compute: (id, given) => known.get(id).compute(given),
    show,
    superscript,
  };
})();
