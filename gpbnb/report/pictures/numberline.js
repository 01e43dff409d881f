// Rounding to t digits with whole numbers of any length, so that no digit of the picture is itself rounded.
const BASES = [2n, 10n, 16n];
const TEETH = 300; // more of them are one dark band

// A number as typed, as a quotient of whole numbers.
function quotient(x) {
  const [digits, power] = x.toExponential().split("e");
  const [whole, part = ""] = digits.split(".");
  const shift = Number(power) - part.length;
  const above = BigInt(whole + part);
  return shift < 0 ? [above, 10n ** BigInt(-shift)] : [above * 10n ** BigInt(shift), 1n];
}

// Least e with x < b^e, the neighbours of x among numbers k·b^(e-t), and the one that the rule takes.
function round(x, b, t, chop) {
  const [above, below] = quotient(x);
  let e = 0;
  const power = (k) => (k < 0 ? [1n, b ** BigInt(-k)] : [b ** BigInt(k), 1n]);
  const reaches = (k) => above * power(k)[1] >= below * power(k)[0];
  while (reaches(e)) e++;
  while (!reaches(e - 1)) e--;
  const [spacing, parts] = power(e - t);
  const [n, d] = [above * parts, below * spacing];
  const k = n / d;
  const up = !chop && 2n * (n % d) >= d;
  const taken = up ? k + 1n : k;
  const error = taken * d - n;
  // Numbers near x: five on each side, and below the power of the base those that lie closer together.
  const gap = Number(spacing) / Number(parts);
  const [lowest, highest] = [b ** BigInt(t - 1), b ** BigInt(t)];
  const near = [];
  for (let i = k - 4n; i <= k + 5n; i++) if (i >= lowest && i <= highest) near.push(Number(i) * gap);
  for (let i = 1n; i <= lowest + 4n - k && i <= highest - lowest && i < 5n; i++) near.unshift(Number(lowest * b - i) * (gap / Number(b)));
  for (let i = 1n; i <= k + 5n - highest && i <= highest - lowest && i < 5n; i++) near.push(Number(lowest + i) * gap * Number(b));
  return { e, taken, near, error: Number(error < 0n ? -error : error) / Number(n), gap };
}

function compute({ base, t, chop, x }) {
  const b = BASES[base];
  const { e, taken, near, error, gap } = round(x, b, t, chop === 1);
  const beta = Number(b) ** (1 - t) / (chop ? 1 : 2);
  const digits = taken.toString(Number(b)).toUpperCase();
  const power = e - t + digits.length - 1;
  const kept = digits.slice(0, t);
  const written = `${kept[0]}${t > 1 ? `.${kept.slice(1)}` : ""} × ${b}${gpbnbCalculators.superscript(power)}`;
  const digitsKept = t === 1 ? "one digit" : `${t} digits`;
  const rounded = Number((Number(taken) * gap).toPrecision(15));
  return { base, t, chop, x, e, beta, error, near, rounded, written, digits: digitsKept, share: error / beta };
}

function draw({ add, svg, width, values, set, scale, show, superscript }) {
  const { base, t, chop, x, e, beta, error, rounded } = values;
  const b = Number(BASES[base]);
  const [left, right] = [44, width - 14];

  // The numbers near x, and where x goes.
  const near = scale(values.near[0], values.near.at(-1), left, right, false, 80);
  const line = 62;
  add("text", { x: 4, y: 16 }, "Numbers of the format near x");
  add("line", { class: "line", x1: left, x2: right, y1: line, y2: line });
  for (const number of values.near) {
    const p = near.place(number);
    add("line", { class: "line number", x1: p, x2: p, y1: line - 8, y2: line + 8 });
  }
  const [px, pr] = [near.place(x), near.place(rounded)];
  add("text", { x: pr, y: line + 26, "text-anchor": "middle", class: "text-1" }, show(rounded));
  add("circle", { class: "mark-1 rounded", cx: pr, cy: line, r: 5 });
  add("path", { class: "line", d: `M${px.toFixed(1)} ${line - 20}L${pr.toFixed(1)} ${line - 6}` });
  add("path", { class: "mark-0 given", d: `M${px.toFixed(1)} ${line - 8}l-6 -13h12z` });
  add("text", { x: px, y: line - 26, "text-anchor": "middle", class: "text-0" }, `x = ${show(x)}`);

  // The error over one power of the base.
  const [top, bottom] = [132, 292];
  const along = scale(0, Math.log10(b), left, right, true, 70);
  const up = (value) => bottom - (value / (1.25 * beta)) * (bottom - top);
  const below = e - 1;
  const place = (number) => along.place(Math.min(b, Math.max(1, number / b ** below)));
  const [first, last] = [place(values.near[0]), place(values.near.at(-1))];
  add("rect", { class: "range", x: first, y: top, width: Math.max(2, last - first), height: bottom - top });
  add("text", { x: 4, y: top - 16 }, "Relative error, in units of β");
  for (const share of [0, 0.5, 1]) {
    add("line", { class: share === 1 ? "curve curve-2 bound" : "grid", x1: left, x2: right, y1: up(share * beta), y2: up(share * beta) });
    add("text", { x: left - 6, y: up(share * beta) + 4, "text-anchor": "end" }, String(share));
  }
  const step = b ** (1 - t);
  const teeth = (b - 1) / step;
  let path = "";
  const to = (m, value) => (path += `${path ? "L" : "M"}${along.place(m).toFixed(1)} ${up(value).toFixed(1)}`);
  const points = teeth > 60 ? 1 : 8;
  if (teeth <= TEETH) {
    for (let i = 0; i < teeth; i++) {
      const m = 1 + i * step;
      const turn = chop ? m + step : m + step / 2;
      for (let j = 0; j <= points; j++) to(m + ((turn - m) * j) / points, ((turn - m) * j) / points / (m + ((turn - m) * j) / points));
      if (chop) to(m + step, 0);
      else for (let j = points - 1; j >= 0; j--) to(m + step - ((step / 2) * j) / points, ((step / 2) * j) / points / (m + step - ((step / 2) * j) / points));
    }
  } else {
    to(1, 0);
    for (let i = 0; i <= 200; i++) to(b ** (i / 200), Math.min(beta / b ** (i / 200), beta / (1 + beta)));
    to(b, 0);
  }
  add("path", { class: teeth > TEETH ? "mark-1 teeth" : "curve curve-5 teeth", d: path });
  add("circle", { class: "curve-0 here", cx: place(x), cy: up(error), r: 5 });
  const named = (power) => (power === 0 ? "1" : power === 1 ? String(b) : `${b}${superscript(power)}`);
  add("text", { x: left, y: bottom + 20, "text-anchor": "middle" }, named(below));
  add("text", { x: right, y: bottom + 20, "text-anchor": "end" }, named(e));
  add("text", { x: (left + right) / 2, y: bottom + 20, "text-anchor": "middle" }, "number x, logarithmic");
  add("text", { x: right, y: up(beta) - 6, "text-anchor": "end", class: "text-2" }, "β");

  const drag = (event) => {
    if (!event.buttons && event.pointerType === "mouse") return;
    const box = svg.getBoundingClientRect();
    if (event.clientY - box.top < top - 30) return;
    const share = Math.min(1, Math.max(0, (event.clientX - box.left - left) / (right - left)));
    const moved = b ** (below + share);
    set("x", String(Number(Math.min(moved, b ** (below + 1) * (1 - 1e-6)).toPrecision(4))));
  };
  svg.addEventListener("pointerdown", drag);
  svg.addEventListener("pointermove", drag);
  return bottom + 32;
}
