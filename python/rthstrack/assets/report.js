"use strict";
/* The report's page: tabs, and the charts of the tab that is shown. All numbers come from the program that wrote it. */
(() => {
  const drawing = JSON.parse(document.getElementById("drawing").textContent);
  const decoded = new Map();

  /* A column is {block, type, offset}: little-endian samples in base64, the offset taken off before rounding; "steps" are
   * from each whole number to the next. */
  function column(spec) {
    if (!spec) return null;
    if (!decoded.has(spec.block)) {
      const text = atob(document.getElementById(spec.block).textContent.trim());
      const bytes = new Uint8Array(text.length);
      for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
      const types = { f4: Float32Array, f8: Float64Array, u4: Uint32Array, steps: Uint16Array };
      const raw = new types[spec.type](bytes.buffer);
      let sum = 0;
      if (spec.type === "u4") decoded.set(spec.block, raw);
      else if (spec.type === "steps")
        decoded.set(
          spec.block,
          Uint32Array.from(raw, (v) => (sum += v)),
        );
      else
        decoded.set(
          spec.block,
          Float64Array.from(raw, (v) => v + spec.offset),
        );
    }
    return decoded.get(spec.block);
  }

  /* NaN is a gap; on a logarithmic axis so is zero. */
  const gaps = (values, factor = 1) => Array.from(values, (v) => (Number.isFinite(v) ? v * factor : null));
  const positive = (values) => Array.from(values, (v) => (v > 0 ? v : null));
  const where = (values, mask) => Array.from(values, (v, i) => (mask[i] && Number.isFinite(v) ? v : null));

  /* Times of samples 0, 1, 2, ... or of those that `index` names. */
  function times({ start, step, n, index }) {
    const kept = column(index);
    return kept
      ? Float64Array.from(kept, (i) => start + i * step)
      : Float64Array.from({ length: n }, (_, i) => start + i * step);
  }

  function firstAtLeast(sorted, value) {
    let [low, high] = [0, sorted.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (sorted[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  function buttons(panel, name, linked, views) {
    const bar = panel.querySelector(`[data-views="${name}"]`);
    if (!bar) return;
    for (const [label, range] of views) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = label;
      button.addEventListener("click", () => linked.set(...range()));
      bar.append(button);
    }
  }

  /* Both sides of the limit of |delay|, and the critical delay, which only a lag reaches. */
  function delayLimits({ delay, critical_delay: critical }) {
    const format = (v) => `${Charts.short(v)} ms`;
    const limits = limitPair(delay == null ? null : delay * 1e3, 0, format);
    if (critical != null) limits.push({ value: critical * 1e3, label: `critical ${format(critical * 1e3)}` });
    return limits;
  }

  function limitPair(limit, around, format) {
    if (limit == null) return [];
    return [around + limit, around - limit].map((value) => ({ value, label: `limit ${format(value)}` }));
  }

  /* A level that is not determined is no level. */
  const reference = (value, label, factor = 1) => (value == null ? [] : [{ value: value * factor, label }]);

  function drawTime(panel, a, host) {
    const t = a.time;
    const x = times(t);
    const [target, measured] = [column(t.target), column(t.measured)];
    const error = measured.map((v, i) => v - target[i]);
    const linked = Charts.group({ extent: [t.start, t.start + (t.n - 1) * t.step], smallest: 4 * t.step });
    const axis = { label: "Time (s)", name: "t", unit: "s", group: linked };
    buttons(panel, "time", linked, [
      ["Whole record", () => linked.extent],
      ...(t.strongest ? [[t.strongest_label, () => t.strongest]] : []),
    ]);
    Charts.lines(host("history"), {
      x: axis,
      y: { label: t.label, unit: a.unit },
      height: 250,
      data: [x, target, measured],
      series: [
        { label: t.target_label, colour: "target" },
        { label: t.measured_label, colour: "measured" },
      ],
    });
    Charts.lines(host("error"), {
      x: axis,
      y: { label: t.error_label, unit: a.unit },
      height: 170,
      data: [x, error],
      references: [{ value: 0 }],
      series: [{ label: t.error_name, colour: "error" }],
    });
    const loop = Charts.loop(host("loop"), {
      x: { label: t.x_label },
      y: { label: t.y_label },
      data: [target, measured],
      colour: "value",
      size: 500,
    });
    let waiting = false;
    linked.onChange(() => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        const [from, to] = [firstAtLeast(x, linked.min), firstAtLeast(x, linked.max + t.step / 2)];
        loop.setData(target.subarray(from, to), measured.subarray(from, to));
      });
    });
    return axis;
  }

  function drawMoving(a, host, axis) {
    const m = a.moving;
    if (!m) return;
    const x = column(m.time);
    const shades = m.invalid.map(([from, to]) => ({ from, to }));
    /* The published estimate or the one asked for, and in front of it the trusted one with its interval. */
    const chart = (host, name, label, unit, least, factor, whole, limits) => {
      const take = (key) => gaps(column(m[key]), factor);
      const [low, high] = name === "delay" ? ["delay_low_s", "delay_high_s"] : ["amplitude_low", "amplitude_high"];
      const key = name === "delay" ? "delay_s" : "amplitude";
      const second = { label: `trusted ${name}`, colour: "value", width: 1.5 };
      const band = m.trusted_amplitude ? [take(high), take(low)] : [];
      const first = { label: `${m.name} ${name}`, colour: "third", width: 1.5 };
      const edge = { label: "interval", colour: "interval", width: 0.5, silent: true };
      Charts.lines(host, {
        x: axis,
        y: { label, unit, least },
        height: 190,
        shades: [...shades, ...a.over[name].map(([from, to]) => ({ from, to, kind: "over" }))],
        limits,
        data: [x, take(key), take(`trusted_${key}`), ...band],
        references: [{ value: name === "delay" ? 0 : 1 }, ...reference(whole, "whole record", factor)],
        series: [first, second, ...band.map(() => edge)],
        intervals: band.length ? [[3, 4]] : [],
      });
    };
    const overall = a.trusted_delay_s !== null ? [a.trusted_amplitude, a.trusted_delay_s] : [a.amplitude, a.delay_s];
    chart(
      host("moving-amplitude"),
      "amplitude",
      "Amplitude A (-)",
      "",
      0.02,
      1,
      overall[0],
      limitPair(a.limits.amplitude, 1, Charts.short),
    );
    chart(host("moving-delay"), "delay", "Delay d (ms)", "ms", 0.5, 1e3, overall[1], delayLimits(a.limits));
  }

  function drawBoth(a, host, axis) {
    const both = a.both;
    if (!both) return;
    const chart = (name, label, key, factor) =>
      Charts.lines(host(name), {
        x: axis,
        y: { label: "Frequency (Hz)", log: true, fixed: both.extent },
        height: 210,
        data: [axis.group.extent, [null, null]],
        series: [{ label: name, colour: "value" }],
        cells: {
          label,
          bands: both.bands.map((band) => ({
            ...band,
            values: band[key].map((v) => (v == null ? null : v * factor)),
          })),
        },
      });
    chart("both-gain", "Gain (-)", "gain", 1);
    chart("both-delay", "Delay (ms)", "delay_s", 1e3);
  }

  function drawHistories(a, host, axis) {
    const h = a.histories;
    const x = times(h);
    const squared = a.unit ? `${a.unit}²` : "";
    Charts.lines(host("running-errors"), {
      x: axis,
      y: { label: h.error_label, unit: a.unit, zero: true },
      height: 170,
      data: [x, gaps(column(h.max_tracking_error)), gaps(column(h.rms_error))],
      series: [
        { label: "MTE so far", colour: "error" },
        { label: "RMS so far", colour: "third", width: 1.5 },
      ],
    });
    Charts.lines(host("indicator"), {
      x: axis,
      y: { label: h.indicator_label, unit: squared },
      height: 170,
      data: [x, gaps(column(h.tracking_indicator))],
      references: [{ value: 0 }],
      series: [{ label: "TI", colour: "second", width: 1.5 }],
    });
    if (h.energy_error) {
      Charts.lines(host("energy"), {
        x: axis,
        y: { label: "Energy error" },
        height: 170,
        data: [x, gaps(column(h.energy_error))],
        references: [{ value: 0 }],
        series: [{ label: "energy error", colour: "second", width: 1.5 }],
      });
    }
  }

  function drawFrequencies(panel, a, host) {
    const f = a.frequency;
    if (!f) return;
    const linked = Charts.group({ extent: f.extent, home: f.home, log: true });
    const axis = { label: "Frequency (Hz)", name: "f", unit: "Hz", group: linked };
    const marks =
      Number.isFinite(a.equivalent_frequency_hz) && a.equivalent_frequency_hz !== null
        ? [{ at: a.equivalent_frequency_hz, label: `f_eq ${Charts.number(a.equivalent_frequency_hz, 3)} Hz` }]
        : [];
    const bare = marks.map(({ at }) => ({ at }));
    const shades = f.outside.map(([from, to]) => ({ from, to }));
    buttons(panel, "frequency", linked, [
      ["Where the target moves", () => f.home],
      ["All frequencies", () => f.extent],
    ]);
    const s = a.spectrum;
    if (s) {
      const x = column(s.frequency);
      Charts.lines(host("spectra"), {
        x: axis,
        y: { label: s.label, unit: s.unit, log: true, decades: 6 },
        height: 290,
        marks,
        shades,
        data: [x, positive(column(s.target)), positive(column(s.measured))],
        series: [
          { label: a.time.target_label, colour: "target" },
          { label: a.time.measured_label, colour: "measured" },
        ],
      });
      Charts.lines(host("weights"), {
        x: axis,
        y: { label: "Weight (-)", zero: true },
        height: 220,
        marks: bare,
        shades,
        data: [x, gaps(column(s.weights))],
        series: [{ label: "weight w", colour: "second", width: 1.5 }],
      });
    }
    const r = a.response;
    if (!r) return;
    const x = column(r.frequency);
    const coherence = column(r.coherence);
    const sure = coherence.map((c) => (c >= r.low_coherence ? 1 : 0));
    const any = sure.some((v) => v);
    const line = (key, factor) => {
      if (!r.line) return [];
      const [value, slope] = r.line[key];
      const inside = (f) => f >= r.line.band[0] * (1 - 1e-9) && f <= r.line.band[1] * (1 + 1e-9);
      return [Array.from(x, (f) => (inside(f) ? factor * (value + slope * (f - r.line.at)) : null))];
    };
    const curve = (name, label, unit, least, factor, keys, references, limits) => {
      const [values, low, high] = keys.map((key) => Array.from(column(r[key]), (v) => v * factor));
      const straight = line(keys[0], factor);
      const edge = { label: "interval", colour: "interval", width: 0.5, auto: false, silent: true };
      Charts.lines(host(name), {
        x: axis,
        y: { label, unit, least },
        height: 180,
        marks: bare,
        shades,
        references,
        limits,
        data: [x, gaps(values), where(values, sure), gaps(high), gaps(low), ...straight],
        series: [
          { label: name, colour: "doubtful", swatch: "value", auto: !any },
          { label: name, colour: "value", width: 1.75, silent: true },
          edge,
          edge,
          ...straight.map(() => ({ label: "line", colour: "second", dash: [6, 4], width: 1.5 })),
        ],
        intervals: [[3, 4]],
      });
    };
    curve(
      "gain",
      "Gain (-)",
      "",
      0.02,
      1,
      ["gain", "gain_low", "gain_high"],
      [{ value: 1 }, ...reference(a.amplitude, "A")],
      limitPair(a.limits.amplitude, 1, Charts.short),
    );
    curve(
      "delay",
      "Delay (ms)",
      "ms",
      0.5,
      1e3,
      ["delay_s", "delay_low_s", "delay_high_s"],
      [{ value: 0 }, ...reference(a.delay_s, "d", 1e3)],
      delayLimits(a.limits),
    );
    Charts.lines(host("coherence"), {
      x: axis,
      y: { label: "Coherence (-)", fixed: [0, 1.05] },
      height: 150,
      marks: bare,
      shades,
      references: [{ value: r.low_coherence, label: Charts.short(r.low_coherence) }],
      data: [x, gaps(coherence), where(coherence, sure)],
      series: [
        { label: "coherence", colour: "doubtful", swatch: "value" },
        { label: "coherence", colour: "value", width: 1.75, silent: true },
      ],
    });
  }

  const drawn = new Set();
  function draw(number) {
    if (drawn.has(number)) return;
    drawn.add(number);
    const panel = document.getElementById(`assessment-${number}`);
    const host = (name) => panel.querySelector(`[data-chart="${name}"]`);
    const a = drawing[number];
    const axis = drawTime(panel, a, host);
    drawMoving(a, host, axis);
    drawBoth(a, host, axis);
    drawHistories(a, host, axis);
    drawFrequencies(panel, a, host);
    panel.dataset.drawn = "true";
  }

  // ------------------------------------------------------------------------------------------------ tabs

  const tabs = [...document.querySelectorAll('[role="tab"]')];
  const panels = [...document.querySelectorAll(".assessment")];

  function select(number, focus, show = true) {
    panels.forEach((panel, i) => {
      panel.hidden = i !== number;
    });
    tabs.forEach((tab, i) => {
      tab.setAttribute("aria-selected", String(i === number));
      tab.tabIndex = i === number ? 0 : -1;
    });
    document.querySelectorAll("[data-assessment]").forEach((row) => {
      row.classList.toggle("shown", Number(row.dataset.assessment) === number);
    });
    if (tabs[number]) {
      if (focus) tabs[number].focus();
      if (show) tabs[number].scrollIntoView({ block: "nearest", inline: "nearest" });
    }
    draw(number);
  }

  tabs.forEach((tab, i) => {
    tab.addEventListener("click", () => select(i, true));
    tab.addEventListener("keydown", (event) => {
      const to = {
        ArrowRight: i + 1,
        ArrowDown: i + 1,
        ArrowLeft: i - 1,
        ArrowUp: i - 1,
        Home: 0,
        End: tabs.length - 1,
      }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      select((to + tabs.length) % tabs.length, true);
    });
  });

  /* On paper all panels stand one after another. */
  addEventListener("beforeprint", () => panels.forEach((_, i) => draw(i)));

  // ------------------------------------------------------------------------------------------------ summary

  const table = document.querySelector(".summary table");
  const rows = table ? [...table.tBodies[0].rows] : [];

  function sortBy(place, heads) {
    const keys = new Map(rows.map((row) => [row, row.cells[place].dataset.sort]));
    const numeric = [...keys.values()].every((key) => key === "" || Number.isFinite(Number(key)));
    const before = heads[place].getAttribute("aria-sort");
    /* Of numbers the largest come first, of names the first of the alphabet. */
    const descending = before ? before === "ascending" : numeric;
    heads.forEach((head) => head.removeAttribute("aria-sort"));
    heads[place].setAttribute("aria-sort", descending ? "descending" : "ascending");
    const compare = numeric ? (a, b) => a - b : (a, b) => a.localeCompare(b, undefined, { numeric: true });
    rows.sort((one, other) => {
      const [a, b] = [keys.get(one), keys.get(other)];
      if (a === "" || b === "") return (a === "") - (b === "");
      return descending ? compare(b, a) : compare(a, b);
    });
    table.tBodies[0].append(...rows);
  }

  if (table) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, i) => head.querySelector("button").addEventListener("click", () => sortBy(i, heads)));
    const field = document.querySelector("[data-filter]");
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      for (const row of rows) {
        const named = [...row.cells].filter((cell) => !cell.classList.contains("number"));
        const text = named.map((cell) => cell.textContent.toLowerCase()).join(" ");
        row.hidden = !words.every((word) => text.includes(word));
        if (!row.hidden) shown++;
      }
      document.querySelector("[data-matches]").textContent = `${shown} of ${rows.length}`;
    });
  }

  function fromAddress() {
    const asked = /^#assessment-(\d+)$/.exec(location.hash);
    /* The worst is open first. */
    const worst = rows.length ? Number(rows[0].dataset.assessment) : 0;
    const number = asked ? Number(asked[1]) : worst;
    return number < panels.length ? number : worst;
  }
  addEventListener("hashchange", () => select(fromAddress(), false));
  /* A page that is opened as a whole begins at its head. */
  select(fromAddress(), false, location.hash !== "");
  document.documentElement.dataset.ready = "true";
})();
