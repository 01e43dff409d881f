// The stored run with the most bits that are not more than asked for, and when its error passes the tolerance.
function compute({ t, chop, quantity }, data) {
  const runs = data.runs.filter((run) => run.chop === chop);
  const run = runs.filter((each) => each.t <= t).at(-1) ?? runs[0];
  const errors = run.errors[quantity];
  const first = errors.findIndex((error) => error > data.tolerance);
  const last = errors.findLastIndex((error) => error > data.tolerance);
  const day = (i) => gpbnbCalculators.show((data.steps[i] * data.interval) / 86400);
  const ulp = data.angle_bound / 2 ** run.t;
  const name = quantity ? "drift angle" : "drift rate";
  const unit = quantity ? "mas" : "mas a year";
  const stored = run.t === t ? "" : `No run with ${t} bits is stored; this is the one with ${run.t}. `;
  const when =
    first < 0
      ? `stays below ${data.tolerance} ${unit} at every checkpoint`
      : `exceeds ${data.tolerance} ${unit} ` +
        (first ? `between day ${day(first - 1)} and day ${day(first)}` : "from the first step") +
        (last === errors.length - 1 ? ", and still does at the end" : `, for the last time at the checkpoint on day ${day(last)}`);
  const steps = data.step / ulp;
  const place =
    steps >= 1
      ? `One step adds ${gpbnbCalculators.show(steps)} units in the last place of the angle`
      : `One step adds less than one unit in the last place of the angle, ${gpbnbCalculators.show(steps)}`;
  return { t, chop, quantity, bits: run.t, ulp, errors: run.errors, end: errors.at(-1), unit, name, stored, when, place };
}

// Places a line apart for names of curves, as close as possible to their ends, which are sorted from the highest on.
function apart(ends, top) {
  const line = 12.6;
  for (const each of ends) each.place = each.end;
  for (let round = 0; round < 200; round++) {
    for (let i = 1; i < ends.length; i++) {
      const overlap = Math.max(0, line - (ends[i].place - ends[i - 1].place));
      ends[i - 1].place -= overlap / 2;
      ends[i].place += overlap / 2;
    }
  }
  ends.forEach((each, i) => (each.place = Math.max(each.place, i ? ends[i - 1].place + line : top)));
}

function draw({ add, width, values, data, scale, axes, show, superscript }) {
  const { quantity, bits, chop, ulp } = values;
  const [left, right, top, bottom] = [58, width - 40, 30, 270];
  const every = data.runs.flatMap((run) => run.errors[quantity]).filter((error) => error > 0);
  const y = scale(Math.floor(Math.log10(Math.min(...every))), Math.ceil(Math.log10(Math.max(...every))), bottom, top, true, 30);
  const days = data.steps.map((step) => (step * data.interval) / 86400);
  const x = scale(Math.log10(days[0]), Math.log10(days.at(-1)), left, right, true, 60);
  add("text", { x: 4, y: 14 }, `Error of the ${values.name} (${values.unit})`);
  axes(add, x, y, { left, right, top, bottom });
  add("text", { x: right, y: bottom + 36, "text-anchor": "end" }, "days");
  const curve = (errors) => {
    let path = "";
    errors.forEach((error, i) => {
      if (error > 0) path += `${path ? "L" : "M"}${x.place(days[i]).toFixed(1)} ${y.place(error).toFixed(1)}`;
    });
    return path;
  };
  const shown = data.runs.filter((run) => run.chop === chop);
  for (const run of shown) if (run.t !== bits) add("path", { class: "faint", d: curve(run.errors[quantity]) });
  // Each curve has its bits at its end, moved apart where curves end close together.
  const ends = shown.map((run) => ({ bits: run.t, end: y.place(run.errors[quantity].at(-1)) })).sort((a, b) => a.end - b.end);
  apart(ends, top - 4);
  add("text", { x: width - 4, y: 14, "text-anchor": "end" }, "bits");
  for (const each of ends) {
    add("path", { class: "faint", d: `M${right} ${each.end.toFixed(1)}L${right + 12} ${each.place.toFixed(1)}` });
    const own = each.bits === bits ? { class: "ending text-0", "font-weight": 600 } : { class: "ending" };
    add("text", { x: right + 14, y: each.place + 4, ...own }, String(each.bits));
  }
  const limit = y.place(data.tolerance);
  add("line", { class: "limit", x1: left, x2: right, y1: limit, y2: limit });
  add("text", { x: left + 6, y: limit - 6 }, "tolerance");
  add("path", { class: "curve curve-5 chosen", d: curve(values.errors[quantity]) });
  values.errors[quantity].forEach((error, i) => {
    if (error > 0) add("circle", { class: "curve-0", cx: x.place(days[i]), cy: y.place(error), r: 3.5 });
  });

  // The last place of an angle of a year's drift, beside what one step adds to it.
  const low = Math.log10(data.angle_bound) - 53 * Math.log10(2);
  const edge = width - 14;
  const ladder = scale(Math.floor(low), 0, left, edge, true, 60);
  const line = bottom + 110;
  add("text", { x: 4, y: line - 46 }, `Last place of ${data.drift} mas, and one step (mas)`);
  add("line", { class: "line", x1: left, x2: edge, y1: line, y2: line });
  for (const [at, label] of ladder.ticks) {
    add("line", { class: "line", x1: at, x2: at, y1: line, y2: line + 5 });
    add("text", { x: at, y: line + 22, "text-anchor": "middle" }, label);
  }
  for (const run of shown) {
    const at = ladder.place(data.angle_bound / 2 ** run.t);
    add("line", { class: "faint", x1: at, x2: at, y1: line - 6, y2: line });
  }
  const [step, unit] = [ladder.place(data.step), ladder.place(ulp)];
  add("path", { class: "mark-1 step", d: `M${step.toFixed(1)} ${line}l-6 -13h12z` });
  add("text", { x: step, y: line - 18, "text-anchor": step > (left + right) / 2 ? "end" : "start", class: "text-1" }, `one step, ${show(data.step)}`);
  add("path", { class: "mark-0 ulp", d: `M${unit.toFixed(1)} ${line}l-6 13h12z` });
  const end = unit > (left + right) / 2 ? "end" : "start";
  add("text", { x: unit, y: line + 40, "text-anchor": end, class: "text-0" }, `last place with ${bits} bits, 2${superscript(data.exponent - bits)}`);
  return line + 52;
}
