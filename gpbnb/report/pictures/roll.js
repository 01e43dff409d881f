// What rolling does to a drift in 1/f noise, and what an error of the phase of the deroll does to the drift.
// Density of the samples of 1/f noise.
const densityOf = (f, data) => (Math.PI * data.level * data.interval) / Math.sin(Math.PI * f * data.interval);

function compute({ period, phase }, data) {
  const density = densityOf(1 / period, data);
  const rolled = Math.sqrt((6 * density) / data.year ** 3) * data.year;
  const unrolled = data.unrolled;
  const angle = (phase * Math.PI) / 648000;
  const [big, small] = data.drifts;
  const lost = -2 * Math.sin(angle / 2) ** 2;
  const error = [big * lost - small * Math.sin(angle), big * Math.sin(angle) + small * lost];
  return { period, phase, density, rolled, unrolled, gain: unrolled / rolled, along: error[0], across: error[1], size: Math.hypot(...error) };
}

function draw({ add, width, values, data, scale, axes, show }) {
  const { period, density, phase } = values;
  const [left, right, top, bottom] = [58, width - 14, 30, 230];
  const [low, high] = [1 / data.year, 0.5 / data.interval];
  const [most, least] = [low, high].map((f) => densityOf(f, data));
  const x = scale(Math.log10(low), Math.log10(high), left, right, true, 60);
  const y = scale(Math.floor(Math.log10(least)), Math.ceil(Math.log10(most)), bottom, top, true, 34);
  add("text", { x: 4, y: 14 }, "Density of the readout noise (mas²/Hz)");
  axes(add, x, y, { left, right, top, bottom });
  add("text", { x: right, y: bottom + 36, "text-anchor": "end" }, "frequency (Hz)");
  const point = (f) => `${x.place(f).toFixed(1)} ${y.place(densityOf(f, data)).toFixed(1)}`;
  const points = Array.from({ length: 61 }, (_, i) => point(low ** (1 - i / 60) * high ** (i / 60)));
  add("path", { class: "curve curve-5 noise", d: `M${points.join("L")}` });
  // The drift lies at the lowest frequencies; rolling moves it to the roll frequency.
  const [from, to] = [x.place(low), x.place(1 / period)];
  add("line", { class: "curve curve-1", x1: from, x2: from, y1: y.place(most), y2: bottom });
  add("line", { class: "curve curve-0", x1: to, x2: to, y1: y.place(density), y2: bottom });
  add("circle", { class: "curve-1", cx: from, cy: y.place(most), r: 5 });
  add("circle", { class: "curve-0 here", cx: to, cy: y.place(density), r: 5 });
  add("text", { x: from + 10, y: y.place(most) - 6, class: "text-1" }, "drift, not rolled");
  const end = to > (left + right) / 2 ? "end" : "start";
  add("text", { x: end === "end" ? to - 8 : to + 8, y: bottom - 10, "text-anchor": end, class: "text-0" }, `rolled in ${show(period)} s`);

  // A wrong phase turns the large drift into the small one.
  const [above, below] = [bottom + 92, bottom + 252];
  const turn = scale(0, Math.log10(data.most_phase), left, right, true, 60);
  const across = (arcseconds) => compute({ period, phase: arcseconds }, data).across;
  const ends = [across(1), across(data.most_phase)].map(Math.log10);
  const error = scale(Math.floor(ends[0]), Math.ceil(ends[1]), below, above, true, 34);
  add("text", { x: 4, y: above - 16 }, "False drift across the true one (mas a year)");
  axes(add, turn, error, { left, right, top: above, bottom: below });
  add("text", { x: right, y: below + 36, "text-anchor": "end" }, "error of the phase (arcseconds)");
  const limit = error.place(data.tolerance);
  add("line", { class: "limit", x1: left, x2: right, y1: limit, y2: limit });
  add("text", { x: right - 4, y: limit + 18, "text-anchor": "end" }, "tolerance");
  let path = "";
  for (let i = 0; i <= 60; i++) {
    const arcseconds = data.most_phase ** (i / 60);
    path += `${i ? "L" : "M"}${turn.place(arcseconds).toFixed(1)} ${error.place(across(arcseconds)).toFixed(1)}`;
  }
  add("path", { class: "curve curve-5 across", d: path });
  add("circle", { class: "curve-0 turned", cx: turn.place(phase), cy: error.place(values.across), r: 5 });
  return below + 46;
}
