"use strict";
(() => {
  // The chart of the time series: zoom by dragging, pinching is the browser's; arrows, + and - from the keyboard.
  const source = document.getElementById("curves");
  if (!source) return;
  const data = JSON.parse(source.textContent);
  const section = document.getElementById("series");
  const svg = document.getElementById("chart");
  const reading = document.getElementById("chart-reading");
  const [caseChoice, quantityChoice, logBox, wholeButton] =
    ["chart-case", "chart-quantity", "chart-log", "chart-whole"].map((id) => document.getElementById(id));
  const legend = document.getElementById("chart-legend");
  const DASHES = ["", "7 3", "4 2 1 2"];
  // Shapes of the filters' points in the order of the figures: circle, square, triangle, diamond, triangles down, left, right.
  const SHAPES = ["M-3 0A3 3 0 1 0 3 0A3 3 0 1 0 -3 0Z", "M-2.7 -2.7H2.7V2.7H-2.7Z", "M0 -3.4L3.2 2.6H-3.2Z", "M0 -3.8L3.2 0L0 3.8L-3.2 0Z", "M0 3.4L3.2 -2.6H-3.2Z", "M-3.4 0L2.6 -3.2V3.2Z", "M3.4 0L-2.6 -3.2V3.2Z"];
  const MARKS = 7;
  const lookOf = (filter) => { const place = data.filters.indexOf(filter), round = Math.floor(place / 7); return { place, colour: `var(--f${place % 7})`, dash: DASHES[round % 3], shape: SHAPES[(place + round) % 7] }; };
  const KINDS = {
    position: { label: "position RMS", unit: "m", log: true, formal: "formal" },
    velocity: { label: "velocity RMS", unit: "m/s", log: true, formal: "formal" },
    nees: { label: "NEES / 6", unit: "", log: false },
    nis: { label: "NIS per degree of freedom", unit: "", log: false },
  };
  ["x", "y", "z", "vx", "vy", "vz"].forEach((name, place) => {
    const axis = data.cases[0].axes[place % 3];
    if (axis) KINDS[name] = { label: `${name} error (${axis}), median run`, unit: place > 2 ? "m/s" : "m", log: false, formal: "± 3 sigma", signed: true };
  });

  const unpack = ([low, high, logarithmic, text]) => {
    const raw = atob(text);
    const values = new Float64Array(raw.length / 2);
    for (let i = 0; i < values.length; i++) {
      const level = raw.charCodeAt(2 * i) + 256 * raw.charCodeAt(2 * i + 1);
      const value = level === 65535 ? NaN : low + (high - low) * level / 65534;
      values[i] = logarithmic ? 10 ** value : value;
    }
    return values;
  };
  const shown = (value) => {
    if (!Number.isFinite(value)) return "\u2013";
    const size = Math.abs(value);
    return (size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(2) : String(Number(value.toPrecision(3)))).replace("-", "\u2212");
  };

  const hidden = new Set();
  let one, times, kind, zoom, cursor = null, lines = [], frame = null;

  const option = (select, value, text) => { const made = document.createElement("option"); made.value = value; made.textContent = text; select.append(made); };
  data.cases.forEach((each, place) => option(caseChoice, place, `${each.number}: ${each.label}`));
  caseChoice.closest("label").hidden = data.cases.length < 2;
  Object.entries(KINDS).forEach(([name, each]) => option(quantityChoice, name, each.unit ? `${each.label} [${each.unit}]` : each.label));

  const choose = () => {
    one = data.cases[caseChoice.value || 0];
    times = unpack(one.time);
    zoom = [times[0], times[times.length - 1]];
    cursor = null;
    legend.replaceChildren(...one.groups.map((names) => {
      const button = document.createElement("button"), look = lookOf(names[0]);
      const shown = () => names.some((name) => !hidden.has(name));
      const sample = element("svg", { viewBox: "0 0 30 10", width: 30, height: 10, "aria-hidden": "true" });
      sample.append(
        element("path", { d: "M0 5H30", style: `stroke:${look.colour}`, "stroke-width": 1.8, "stroke-dasharray": look.dash, fill: "none" }),
        element("path", { d: look.shape, transform: "translate(15 5)", style: `fill:${look.colour}` }));
      button.type = "button";
      button.append(sample, names.join(" = "));
      button.setAttribute("aria-pressed", String(shown()));
      button.addEventListener("click", () => {
        const change = shown() ? "add" : "delete";
        names.forEach((name) => hidden[change](name));
        button.setAttribute("aria-pressed", String(shown()));
        collect();
      });
      return button;
    }));
    collect();
  };

  const collect = () => {
    kind = KINDS[quantityChoice.value];
    const name = quantityChoice.value;
    lines = [];
    for (const names of one.groups) {
      const seen = names.filter((each) => !hidden.has(each));
      if (!seen.length) continue;
      const curves = one.filters[seen[0]], look = { ...lookOf(seen[0]), filter: seen.join(" = ") };
      lines.push({ ...look, values: unpack(curves[name]), width: 1.6, main: true });
      if (!kind.formal) continue;
      const formal = unpack(curves[`${name}_formal`]);
      const parts = kind.signed ? [formal.map((v) => 3 * v), formal.map((v) => -3 * v)] : [formal];
      parts.forEach((values) => lines.push({ ...look, values, width: 1, dash: kind.signed ? "5 3" : "1.5 2.5" }));
    }
    if (one.bound[name]) lines.push({ colour: "var(--ink)", dash: "7 3 1.5 3", values: unpack(one.bound[name]), width: 1.3, filter: "PCRB, perfect model", main: true });
    draw();
  };

  // Index range of the points inside the zoom, with one neighbour on each side.
  const inside = () => {
    let first = 0, last = times.length - 1;
    while (first < last && times[first + 1] < zoom[0]) first++;
    while (last > first && times[last - 1] > zoom[1]) last--;
    return [first, last];
  };
  const steps = (low, high, most) => {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-12) + step * 1e-9; k++) ticks.push(Number((k * step).toPrecision(12)));
    return ticks;
  };
  const decades = (low, high) => {
    const span = Math.log10(high / low), heads = span > 3.5 ? [1] : span > 1.3 ? [1, 3] : [1, 2, 3, 5, 7];
    const ticks = [];
    for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++)
      heads.forEach((head) => { const t = Number((head * 10 ** e).toPrecision(3)); if (t >= low * 0.999 && t <= high * 1.001) ticks.push(t); });
    return ticks.length > 1 ? ticks : steps(low, high, 5);
  };
  const element = (name, attributes, text) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    return made;
  };

  const draw = () => {
    const width = Math.max(280, Math.round(svg.getBoundingClientRect().width)), height = width < 560 ? 260 : 340;
    const box = { left: 58, right: width - 24, top: 12, bottom: height - 40 };
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("height", height);
    const [first, last] = inside();
    const band = one.bands[quantityChoice.value] || [];
    let low = Infinity, high = -Infinity;
    const consider = (v) => { if (Number.isFinite(v) && (!logBox.checked || v > 0)) { low = Math.min(low, v); high = Math.max(high, v); } };
    for (const line of lines) for (let i = first; i <= last; i++) if (times[i] >= zoom[0] && times[i] <= zoom[1]) consider(line.values[i]);
    band.forEach(consider);
    const empty = !(low <= high);
    if (empty) { low = 0.1; high = 1; }
    const logarithmic = logBox.checked && low > 0;
    if (logarithmic) { low /= 1.12; high *= 1.12; } else { const air = (high - low || Math.abs(high) || 1) * 0.06; low -= air; high += air; }
    const fx = (t) => box.left + (box.right - box.left) * (t - zoom[0]) / (zoom[1] - zoom[0] || 1);
    const scale = (v) => logarithmic ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low);
    const fy = (v) => box.bottom - (box.bottom - box.top) * scale(v);
    frame = { box, fx, back: (x) => zoom[0] + (zoom[1] - zoom[0]) * (x - box.left) / (box.right - box.left) };

    const parts = [element("defs", {})];
    parts[0].append(element("clipPath", { id: "chart-clip" }));
    parts[0].firstChild.append(element("rect", { x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top }));
    if (band.length) parts.push(element("rect", { class: "band", x: box.left, width: box.right - box.left, y: Math.max(box.top, fy(band[1])), height: Math.max(0, Math.min(box.bottom, fy(band[0])) - Math.max(box.top, fy(band[1]))) }));
    for (const tick of logarithmic ? decades(low, high) : steps(low, high, 5)) {
      parts.push(element("line", { class: "grid", x1: box.left, x2: box.right, y1: fy(tick), y2: fy(tick) }));
      parts.push(element("text", { x: box.left - 6, y: fy(tick) + 4, "text-anchor": "end" }, shown(tick)));
    }
    for (const tick of steps(zoom[0], zoom[1], width < 560 ? 4 : 8)) {
      parts.push(element("line", { class: "grid", x1: fx(tick), x2: fx(tick), y1: box.top, y2: box.bottom }));
      parts.push(element("text", { x: fx(tick), y: box.bottom + 16, "text-anchor": "middle" }, String(tick).replace("-", "\u2212")));
    }
    parts.push(element("text", { x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle" }, "time [s]"));
    parts.push(element("text", { transform: `translate(13 ${(box.top + box.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, kind.unit ? `${kind.label.split(",")[0]} [${kind.unit}]` : kind.label));
    const inner = element("g", { "clip-path": "url(#chart-clip)" });
    for (const line of lines) {
      let path = "", pen = "M";
      for (let i = first; i <= last; i++) {
        const v = line.values[i];
        if (!Number.isFinite(v) || (logarithmic && v <= 0)) { pen = "M"; continue; }
        path += `${pen}${fx(times[i]).toFixed(1)} ${fy(v).toFixed(1)}`;
        pen = "L";
      }
      inner.append(element("path", { d: path, style: `stroke:${line.colour}`, "stroke-width": line.width, "stroke-dasharray": line.dash }));
      if (!line.main || !line.shape) continue;
      for (let k = 0; k < MARKS; k++) {  // each filter's shapes at epochs of their own, so that those of lines that coincide all show
        const i = nearest(zoom[0] + (zoom[1] - zoom[0]) * (k + (line.place + 0.5) / data.filters.length) / MARKS), v = line.values[i];
        if (Number.isFinite(v) && !(logarithmic && v <= 0)) inner.append(element("path", { class: "mark", d: line.shape, transform: `translate(${fx(times[i]).toFixed(1)} ${fy(v).toFixed(1)})`, style: `fill:${line.colour}` }));
      }
    }
    if (cursor !== null) inner.append(element("line", { class: "cursor", x1: fx(times[cursor]), x2: fx(times[cursor]), y1: box.top, y2: box.bottom }));
    parts.push(inner, element("path", { class: "frame", d: `M${box.left} ${box.top}V${box.bottom}H${box.right}` }));
    if (empty) parts.push(element("text", { x: width / 2, y: height / 2, "text-anchor": "middle" }, "no filter is chosen"));
    svg.replaceChildren(...parts);
    wholeButton.disabled = zoom[0] <= times[0] && zoom[1] >= times[times.length - 1];
    svg.setAttribute("aria-label", `${kind.label} against time from ${shown(zoom[0])} to ${shown(zoom[1])} s of ${lines.filter((l) => l.main).map((l) => l.filter).join(", ")}. Arrow keys read values, plus and minus zoom, 0 shows all.`);
    read();
  };
  const read = () => {
    if (cursor === null) {
      reading.textContent = `${one.kept[0] < one.kept[1] ? `${one.kept[0]} of ${one.kept[1]} stored epochs are in this page. ` : ""}Point at the chart, or use the arrow keys, to read values.`;
      return;
    }
    const values = lines.filter((line) => line.main).map((line) => `${line.filter} ${shown(line.values[cursor])}`);
    const median = kind.signed ? ` (${one.groups.map((names) => names.filter((name) => !hidden.has(name))).filter((names) => names.length).map((names) => `${names.join(" = ")}: run ${one.filters[names[0]].median}`).join(", ")})` : "";
    reading.textContent = `t = ${shown(times[cursor])} s: ${values.join(", ")}${kind.unit ? ` ${kind.unit}` : ""}${median}`;
  };

  const limit = (low, high) => {
    const [start, end] = [times[0], times[times.length - 1]], least = (end - start) / 2000 || 1;
    if (high - low < least) { const middle = (low + high) / 2; low = middle - least / 2; high = middle + least / 2; }
    if (high - low >= end - start) return [start, end];
    if (low < start) return [start, start + high - low];
    return high > end ? [end - (high - low), end] : [low, high];
  };
  const to = (low, high) => { zoom = limit(low, high); draw(); };
  const by = (factor, about) => to(about + (zoom[0] - about) * factor, about + (zoom[1] - about) * factor);
  const nearest = (t) => { let best = 0; times.forEach((each, i) => { if (Math.abs(each - t) < Math.abs(times[best] - t)) best = i; }); return best; };
  const at = (event) => { const r = svg.getBoundingClientRect(); return (event.clientX - r.left) * svg.viewBox.baseVal.width / r.width; };

  let from = null;
  svg.addEventListener("pointerdown", (event) => { if (event.button === 0) { from = at(event); svg.setPointerCapture(event.pointerId); } });
  svg.addEventListener("pointermove", (event) => {
    const x = at(event), { box, back } = frame;
    cursor = nearest(back(Math.min(box.right, Math.max(box.left, x))));
    draw();
    if (from !== null && Math.abs(x - from) > 4) {
      const [left, right] = [Math.max(box.left, Math.min(from, x)), Math.min(box.right, Math.max(from, x))];
      svg.append(element("rect", { class: "selection", x: left, width: Math.max(0, right - left), y: box.top, height: box.bottom - box.top }));
    }
  });
  svg.addEventListener("pointerup", (event) => {
    const x = at(event), start = from;
    from = null;
    if (start !== null && Math.abs(x - start) > 8) { const ends = [start, x].map(frame.back).sort((a, b) => a - b); to(...ends); }
  });
  svg.addEventListener("pointercancel", () => { from = null; draw(); });
  svg.addEventListener("pointerleave", () => { if (from === null) { cursor = null; draw(); } });
  svg.addEventListener("dblclick", () => to(times[0], times[times.length - 1]));
  svg.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const span = zoom[1] - zoom[0], [first, last] = inside();
    const middle = cursor === null ? (zoom[0] + zoom[1]) / 2 : times[cursor];
    const move = (step) => { cursor = cursor === null ? (step > 0 ? first : last) : Math.min(times.length - 1, Math.max(0, cursor + step)); const t = times[cursor]; if (t < zoom[0] || t > zoom[1]) to(...(t < zoom[0] ? [t, t + span] : [t - span, t])); else draw(); };
    const keys = {
      ArrowRight: () => event.shiftKey ? to(zoom[0] + span / 4, zoom[1] + span / 4) : move(1),
      ArrowLeft: () => event.shiftKey ? to(zoom[0] - span / 4, zoom[1] - span / 4) : move(-1),
      "+": () => by(0.5, middle), "=": () => by(0.5, middle), "-": () => by(2, middle),
      0: () => to(times[0], times[times.length - 1]), Escape: () => { cursor = null; to(times[0], times[times.length - 1]); },
    };
    if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
  });

  caseChoice.addEventListener("change", choose);
  quantityChoice.addEventListener("change", () => { logBox.checked = KINDS[quantityChoice.value].log; logBox.disabled = Boolean(KINDS[quantityChoice.value].signed); collect(); });
  logBox.addEventListener("change", draw);
  wholeButton.addEventListener("click", () => to(times[0], times[times.length - 1]));
  addEventListener("resize", draw);
  // The page's own switches for case and filter work here too.
  addEventListener("relnav-case", (event) => { const place = data.cases.findIndex((each) => String(each.number) === event.detail); if (place >= 0) { caseChoice.value = place; choose(); } });
  addEventListener("relnav-filter", (event) => { hidden.clear(); if (event.detail) data.filters.forEach((name) => { if (name !== event.detail) hidden.add(name); }); choose(); });
  section.hidden = false;
  document.querySelector('nav a[href="#series"]').hidden = false;
  logBox.checked = true;
  choose();
})();
