// The operations of a step, and the way of one rounding error through the later ones to the new states.
const ROW = 34;
const TOP = 46;

function compute({ operation, state }, data) {
  const offset = data.lines.findIndex((line) => line.formula);
  const at = offset + operation;
  const line = data.lines[at];
  const share = (sums) => (100 * sums[state]) / data.bounds[state];
  // Results that the error reaches, in order.
  const reached = [at];
  data.lines.forEach((each, i) => i > at && each.operands.some((k) => reached.includes(k)) && reached.push(i));
  return {
    at,
    offset,
    state,
    reached,
    formula: `${line.name} = ${line.formula}`,
    error: line.error,
    unit: line.unit,
    bits: data.bits,
    first: Math.abs(line.effects[0]),
    second: Math.abs(line.effects[1]),
    name: data.states[state],
    sum: line.sums[state],
    total_unit: data.units[state],
    share: share(line.sums),
    shares: data.lines.map((each) => (each.sums ? share(each.sums) : 0)),
  };
}

function draw({ add, width, values, data, set, show }) {
  const { at, reached, shares, offset } = values;
  const dot = Math.min(70, 0.2 * width);
  const [left, right] = [Math.max(176, 0.42 * width), width - 58];
  const y = (k) => TOP + ROW * k;
  add("text", { x: 4, y: 16 }, "Operations in order");
  add("text", { x: width - 4, y: 16, "text-anchor": "end" }, "share of the bound");
  const arc = (from, to, more) => {
    const bulge = Math.min(dot - 6, 16 + 9 * (to - from));
    add("path", { d: `M${dot} ${y(from)}C${dot - bulge} ${y(from)} ${dot - bulge} ${y(to)} ${dot} ${y(to)}`, ...more });
  };
  const every = data.lines.flatMap((line, to) => line.operands.map((from) => [from, to]));
  const way = ([from, to]) => reached.includes(from) && reached.includes(to);
  for (const [from, to] of every.filter((each) => !way(each))) arc(from, to, { class: "faint" });
  for (const [from, to] of every.filter(way)) arc(from, to, { class: "curve curve-0 way" });
  const most = Math.max(...shares);
  data.lines.forEach((line, k) => {
    const on = reached.includes(k);
    const chosen = k === at;
    const words = line.formula ? `${line.name} = ${line.formula}` : k < data.states.length ? `${line.name}, ${data.states[k]}` : `${line.name}, measurement`;
    add("circle", { class: `${on ? "curve-0" : "curve-4"}${chosen ? " here" : ""}`, cx: dot, cy: y(k), r: chosen ? 7 : 5 });
    add("text", { x: dot + 14, y: y(k) + 4, class: on ? "text-0" : "", ...(chosen && { "font-weight": 600 }) }, words);
    if (!line.formula) return;
    const length = Math.max(1, (shares[k] / most) * (right - left));
    add("rect", { class: `${chosen ? "mark-0" : "mark-1"} share`, x: left, y: y(k) - 7, width: length, height: 14 });
    add("text", { x: left + length + 5, y: y(k) + 4 }, `${show(Number(shares[k].toPrecision(2)))} %`);
    const touch = add("rect", { x: 0, y: y(k) - ROW / 2, width, height: ROW, fill: "transparent", cursor: "pointer", class: "touch" });
    touch.addEventListener("click", () => set("operation", String(k - offset)));
  });
  return y(data.lines.length - 1) + 24;
}
