"use strict";
/* The charts of the report and of the live page, drawn with uPlot.
 *
 * Charts.group(...)   one horizontal axis for several charts: zooming one zooms all
 * Charts.lines(...)   curves over time or frequency, with limits, marks, shaded parts and intervals
 * Charts.loop(...)    one signal against another, same scale both ways
 * Charts.number(...)  a number with four significant digits
 *
 * Colours are the custom properties --chart-NAME of charts.css, so that dark mode and print need no code of their own.
 * Every text goes to the canvas or to textContent: a channel's name is never read as markup.
 */
const Charts = (() => {
  const COLOURS = [
    "ink",
    "muted",
    "rule",
    "surface",
    "shade",
    "over",
    "target",
    "measured",
    "error",
    "value",
    "second",
    "third",
    "doubtful",
    "interval",
    "limit",
  ];
  const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
  const Y_AXIS = 70;
  const colour = {};
  const charts = new Set();

  function readColours() {
    const style = getComputedStyle(document.documentElement);
    for (const name of COLOURS) colour[name] = style.getPropertyValue(`--chart-${name}`).trim();
  }

  function repaint() {
    readColours();
    for (const chart of charts) chart.redraw(true, true);
  }

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);

  /* Paper is white and as wide as it is, whatever the screen was; charts on it are less high. */
  let onPaper = false;
  /* No lower than the label of the vertical axis needs. */
  const paperHeight = (height) => (onPaper ? Math.max(Math.round(0.66 * height), 138) : height);

  function paper(printing) {
    onPaper = printing;
    document.documentElement.classList.toggle("on-paper", printing);
    readColours();
    for (const chart of charts) chart.fit();
    for (const chart of charts) chart.redraw(true, true);
  }
  addEventListener("beforeprint", () => paper(true));
  addEventListener("afterprint", () => paper(false));

  // ------------------------------------------------------------------------------------------------ numbers

  const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
  const raised = (power) => String(power).replace(/[-\d]/g, (c) => RAISED[c]);
  const signed = (text) => text.replace("-", "−");

  function number(value, digits = 4) {
    if (value == null || !Number.isFinite(value)) return "not determined";
    if (value === 0) return "0";
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
    const power = Number(exponent);
    if (power < -4 || power >= 6) return `${signed(mantissa)}×10${raised(power)}`;
    return signed(value.toFixed(Math.max(digits - 1 - power, 0)));
  }

  /* A number without the zeros that say nothing: 15, 0.9, 1.25. */
  const short = (value) => signed(String(Number(value.toPrecision(4))));

  /* Tick labels, all with the decimals that their spacing needs. */
  function tickLabels(u, ticks) {
    const shown = ticks.filter((t) => t != null);
    const largest = Math.max(...shown.map(Math.abs));
    if (!(largest > 0)) return ticks.map((t) => (t == null ? null : "0"));
    const power = largest >= 1e5 || largest < 1e-3 ? Math.floor(Math.log10(largest)) : 0;
    const step = (shown.length > 1 ? Math.abs(shown[1] - shown[0]) : largest) / 10 ** power;
    let places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    while (places < 12 && Math.abs(step * 10 ** places - Math.round(step * 10 ** places)) > 1e-6) places++;
    const tail = power ? `×10${raised(power)}` : "";
    return ticks.map((t) => (t == null ? null : t === 0 ? "0" : signed((t / 10 ** power).toFixed(places)) + tail));
  }

  function logLabel(t) {
    if (t >= 1e-3 && t < 1e5) return String(Number(t.toPrecision(6)));
    const power = Math.floor(Math.log10(t) + 1e-9);
    const lead = Math.round(t / 10 ** power);
    return `${lead === 1 ? "" : `${lead}×`}10${raised(power)}`;
  }

  const FEWEST_TICKS = 3;

  /* How many ticks an axis has room for. */
  const roomFor = (u, axis, across, up) =>
    axis === 0 ? u.bbox.width / devicePixelRatio / across : u.bbox.height / devicePixelRatio / up;

  /* Ticks at even steps of 1, 2 or 5: as many as there is room for, and never fewer than three. */
  function evenTicks(u, axis, min, max) {
    if (!(max > min)) return [min];
    const rough = (max - min) / Math.max(roomFor(u, axis, 70, 32), 2);
    let power = Math.floor(Math.log10(rough));
    let lead = [1, 2, 5, 10].findIndex((s) => s * 10 ** power >= rough * (1 - 1e-9));
    for (;;) {
      /* A power below zero divides, so that 0.3 is not 0.30000000000000004. */
      const at = (k) => (power < 0 ? (k * [1, 2, 5, 10][lead]) / 10 ** -power : k * [1, 2, 5, 10][lead] * 10 ** power);
      const step = at(1);
      const ticks = [];
      for (let k = Math.ceil(min / step - 1e-9); at(k) <= max + 1e-9 * step; k++) ticks.push(at(k));
      if (ticks.length >= FEWEST_TICKS || step < 1e-12 * Math.max(Math.abs(min), Math.abs(max))) return ticks;
      if (lead > 0) lead--;
      else [power, lead] = [power - 1, 2];
    }
  }

  /* Ticks of a logarithmic axis: even steps inside one decade, 1 2 5 over a few, whole decades over many. */
  function logTicks(u, axis, min, max) {
    const room = roomFor(u, axis, 55, 26);
    const decades = Math.log10(max / min);
    if (decades < 0.8) return evenTicks(u, axis, min, max);
    const stride = Math.max(1, Math.ceil(decades / Math.max(room, 1)));
    const [first, last] = [Math.floor(Math.log10(min)), Math.log10(max) + 1e-9];
    const at = (leads, every) => {
      const ticks = [];
      for (let power = first; power <= last; power++) {
        if (power % every !== 0) continue;
        for (const lead of leads) {
          const tick = Number(`${lead}e${power}`);
          if (tick >= min * (1 - 1e-12) && tick <= max * (1 + 1e-12)) ticks.push(tick);
        }
      }
      return ticks;
    };
    const choices = [() => at([1], stride), () => at([1], 1), () => at([1, 3], 1), () => at([1, 2, 5], 1)];
    if (room / decades > 3.2) choices.splice(0, 3);
    for (const choice of choices) {
      const ticks = choice();
      if (ticks.length >= FEWEST_TICKS) return ticks;
    }
    return evenTicks(u, axis, min, max);
  }

  // ------------------------------------------------------------------------------------------------ one axis for many

  /* extent and home are [from, to]; home is the first view, and where a double click leads back to. */
  function group({ extent, home = extent, log = false, smallest = 0 }) {
    const members = new Set();
    const listeners = new Set();
    const there = log ? Math.log : (v) => v;
    const back = log ? Math.exp : (v) => v;
    const self = {
      key: `group-${Math.random().toString(36).slice(2)}`,
      log,
      extent,
      home,
      min: home[0],
      max: home[1],
      members,
      set(from, to) {
        let min = Math.max(from, self.extent[0]);
        let max = Math.min(to, self.extent[1]);
        if (!(max - min > smallest)) [min, max] = [self.min, self.max];
        const moved = min !== self.min || max !== self.max;
        [self.min, self.max] = [min, max];
        for (const u of members) {
          if (u.scales.x.min !== min || u.scales.x.max !== max) u.setScale("x", { min, max });
        }
        if (moved) for (const listener of listeners) listener(min, max);
      },
      reset: () => self.set(...self.home),
      /* part of the width to go right, factor by which the width grows */
      move(part, factor = 1) {
        const [a, b] = [there(self.min), there(self.max)];
        const half = ((b - a) * factor) / 2;
        let middle = (a + b) / 2 + part * (b - a);
        const [first, last] = self.extent.map(there);
        middle = Math.min(Math.max(middle, first + half), Math.max(last - half, first + half));
        self.set(back(middle - half), back(middle + half));
      },
      onChange: (listener) => listeners.add(listener),
    };
    return self;
  }

  function keyboard(host, linked) {
    host.tabIndex = 0;
    host.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const action = {
        ArrowLeft: () => linked.move(-0.1),
        ArrowRight: () => linked.move(0.1),
        "+": () => linked.move(0, 0.5),
        "=": () => linked.move(0, 0.5),
        "-": () => linked.move(0, 2),
        0: linked.reset,
        Home: linked.reset,
        Escape: linked.reset,
      }[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
  }

  // ------------------------------------------------------------------------------------------------ parts of a chart

  function axis(side, { label, log, values }) {
    const horizontal = side === 2;
    return {
      side,
      label,
      scale: horizontal ? "x" : "y",
      stroke: () => colour.muted,
      font: `12px ${FONT}`,
      labelFont: `12px ${FONT}`,
      size: horizontal ? 28 : Y_AXIS - 18,
      labelSize: 18,
      labelGap: 0,
      gap: 4,
      space: horizontal ? 70 : 32,
      grid: { stroke: () => colour.rule, width: 1 },
      ticks: { show: false },
      border: { show: true, stroke: () => colour.rule, width: 1 },
      splits: log ? logTicks : evenTicks,
      filter: (u, ticks) => ticks,
      values: values || (log ? (u, ticks) => ticks.map(logLabel) : tickLabels),
    };
  }

  function clipped(u, draw) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    draw(ctx, bbox, devicePixelRatio);
    ctx.restore();
  }

  function write(ctx, text, x, y, align, baseline, style) {
    ctx.font = `${11 * devicePixelRatio}px ${FONT}`;
    ctx.textAlign = align;
    ctx.textBaseline = baseline;
    ctx.lineWidth = 3 * devicePixelRatio;
    ctx.lineJoin = "round";
    ctx.strokeStyle = colour.surface;
    ctx.strokeText(text, x, y);
    ctx.fillStyle = style;
    ctx.fillText(text, x, y);
  }

  function drawShades(u, shades) {
    clipped(u, (ctx, box) => {
      for (const { from, to, kind } of shades) {
        ctx.fillStyle = colour[kind || "shade"];
        const a = u.valToPos(Math.max(from, u.scales.x.min), "x", true);
        const b = u.valToPos(Math.min(to, u.scales.x.max), "x", true);
        if (b > a) ctx.fillRect(a, box.top, b - a, box.height);
      }
    });
  }

  /* Cividis, which all kinds of colour vision read alike. */
  const RAMP = [
    [0, 34, 78],
    [53, 69, 108],
    [102, 105, 112],
    [148, 142, 119],
    [200, 184, 102],
    [254, 232, 56],
  ];
  function rampColour(part) {
    const at = Math.min(Math.max(part, 0), 1) * (RAMP.length - 1);
    const i = Math.min(Math.floor(at), RAMP.length - 2);
    return `rgb(${RAMP[i].map((v, k) => Math.round(v + (at - i) * (RAMP[i + 1][k] - v))).join(",")})`;
  }

  /* Cells over the horizontal axis and bands of the vertical one, and above them what the colours mean. */
  function drawCells(u, cells) {
    const known = cells.bands.flatMap((band) => band.values.filter((v) => v != null)).sort((a, b) => a - b);
    if (!known.length) return;
    /* Both ends of the colours are quantiles: one odd cell is not to take the contrast of the others. */
    const [low, high] = [0.02, 0.98].map((share) => known[Math.round(share * (known.length - 1))]);
    const span = high - low || 1;
    clipped(u, (ctx) => {
      for (const { band, first, hop, values } of cells.bands) {
        const [top, bottom] = [band[1], band[0]].map((f) => u.valToPos(f, "y", true));
        values.forEach((value, i) => {
          if (value == null) return;
          const [a, b] = [first + (i - 0.5) * hop, first + (i + 0.5) * hop].map((x) => u.valToPos(x, "x", true));
          ctx.fillStyle = rampColour((value - low) / span);
          ctx.fillRect(a, top, b - a + 0.5, bottom - top + 0.5);
        });
      }
    });
    const { ctx, bbox } = u;
    const ratio = devicePixelRatio;
    const [y, height] = [bbox.top - 20 * ratio, 10 * ratio];
    const width = Math.min(160 * ratio, bbox.width / 3);
    ctx.save();
    write(ctx, cells.label, bbox.left, y + height / 2, "left", "middle", colour.ink);
    const x = bbox.left + ctx.measureText(`${cells.label}  ${number(low)} `).width;
    write(ctx, number(low), x - 5 * ratio, y + height / 2, "right", "middle", colour.muted);
    for (let i = 0; i < 64; i++) {
      ctx.fillStyle = rampColour(i / 63);
      ctx.fillRect(x + (i * width) / 64, y, width / 64 + 0.5, height);
    }
    write(ctx, number(high), x + width + 5 * ratio, y + height / 2, "left", "middle", colour.muted);
    ctx.restore();
  }

  function level(ctx, box, y, style, dash, ratio) {
    ctx.strokeStyle = style;
    ctx.lineWidth = 1.25 * ratio;
    ctx.setLineDash(dash.map((d) => d * ratio));
    ctx.beginPath();
    ctx.moveTo(box.left, y);
    ctx.lineTo(box.left + box.width, y);
    ctx.stroke();
    ctx.setLineDash([]);
  }

  /* A level's label: above its line, or below where there is no room above. */
  function beside(u, ctx, box, ratio, value, label, edge, style) {
    const y = u.valToPos(value, "y", true);
    const below = y - box.top < 16 * ratio;
    const x = edge === "left" ? box.left + 5 * ratio : box.left + box.width - 4 * ratio;
    write(ctx, label, x, y + (below ? 4 : -3) * ratio, edge, below ? "top" : "bottom", style);
  }

  /* references: what is ideal, or the summary; dotted and behind the curves. */
  function drawReferences(u, references) {
    clipped(u, (ctx, box, ratio) => {
      for (const { value } of references) level(ctx, box, u.valToPos(value, "y", true), colour.muted, [1.5, 3], ratio);
    });
  }

  /* limits: what is allowed; dashed, and told even when out of view. The labels of both, above everything. */
  function drawLimits(u, references, limits) {
    clipped(u, (ctx, box, ratio) => {
      const right = box.left + box.width - 4 * ratio;
      const { min, max } = u.scales.y;
      for (const { value } of limits) level(ctx, box, u.valToPos(value, "y", true), colour.limit, [7, 4], ratio);
      for (const { value, label } of references) {
        if (!label || value < min || value > max) continue;
        beside(u, ctx, box, ratio, value, label, "left", colour.muted);
      }
      for (const { value, label } of limits) {
        if (value > max) {
          write(ctx, `▲ ${label}`, right, box.top + 3 * ratio, "right", "top", colour.limit);
        } else if (value < min) {
          write(ctx, `▼ ${label}`, right, box.top + box.height - 3 * ratio, "right", "bottom", colour.limit);
        } else {
          beside(u, ctx, box, ratio, value, label, "right", colour.limit);
        }
      }
    });
  }

  function drawMarks(u, marks) {
    clipped(u, (ctx, box, ratio) => {
      for (const { at, label } of marks) {
        if (at < u.scales.x.min || at > u.scales.x.max) continue;
        const x = u.valToPos(at, "x", true);
        ctx.strokeStyle = colour.ink;
        ctx.lineWidth = ratio;
        ctx.setLineDash([4 * ratio, 3 * ratio]);
        ctx.beginPath();
        ctx.moveTo(x, box.top);
        ctx.lineTo(x, box.top + box.height);
        ctx.stroke();
        ctx.setLineDash([]);
        if (!label) continue;
        const left = x > box.left + box.width * 0.8;
        write(ctx, label, x + (left ? -5 : 5) * ratio, box.top + 4 * ratio, left ? "right" : "left", "top", colour.ink);
      }
    });
  }

  /* A limit belongs into the view unless the curve would become a flat line by it. */
  function valueRange(o) {
    return (u, low, high) => {
      if (low == null || high == null) return o.y.fixed || (o.y.log ? [0.1, 10] : [-1, 1]);
      if (o.y.fixed) return o.y.fixed;
      if (o.y.log) {
        const floor = Math.max(low, high * 10 ** -(o.y.decades || 12));
        const air = Math.max((high / floor) ** 0.05, 1.2);
        return [floor / air, high * air];
      }
      let [min, max] = [low, high];
      const span = Math.max(high - low, 1e-9 * Math.max(Math.abs(low), Math.abs(high)), 1e-300);
      for (const value of o.y.include || []) [min, max] = [Math.min(min, value), Math.max(max, value)];
      for (const { value } of [...(o.limits || []), ...(o.references || [])]) {
        if (value > max && value - min < 5 * span) max = value;
        if (value < min && max - value < 5 * span) min = value;
      }
      const short = (o.y.least || 0) - (max - min);
      if (short > 0) [min, max] = [min - short / 2, max + short / 2];
      const air = max > min ? 0.07 * (max - min) : Math.abs(max) * 0.1 || 1;
      return [o.y.zero ? Math.min(0, min) : min - air, max + air];
    };
  }

  function register(u, host, fit) {
    const chart = { u, host, fit, redraw: (paths, axes) => u.redraw(paths, axes) };
    charts.add(chart);
    new ResizeObserver(() => fit()).observe(host);
    host.chart = chart;
    return chart;
  }

  /* Curves over one horizontal axis.
   *   x: {label, unit, group}   y: {label, unit, log, decades, zero, fixed, include, least}   height
   *     log with at most so many decades; from zero; a fixed range; values to include; the least span shown
   *   data: [x, y1, y2, ...], null where there is no value
   *   series: [{label, colour, swatch, width, dash, fill, unit, auto, silent}]   colour: a name of COLOURS
   *   intervals: [[upper, lower]] pairs of series (from 1) with the area between them filled
   *   references, limits: [{value, label}]   marks: [{at, label}]   shades: [{from, to, kind}]
   *   cells: {label, bands: [{band: [low, high], first, hop, values}]}   coloured areas in place of curves
   * The lists may be changed later; chart.redraw(false, true) shows it. chart.setData(data) for new data. */
  function lines(host, o) {
    if (charts.size === 0) readColours();
    const linked = o.x.group || null;
    const log = Boolean(linked && linked.log);
    o.references = o.references || [];
    o.limits = o.limits || [];
    o.marks = o.marks || [];
    o.shades = o.shades || [];
    const xScale = { time: false, distr: log ? 3 : 1, range: (u, min, max) => [min, max] };
    if (linked) xScale.auto = false;
    const live = (name, unit) => (u, v) => (v == null ? "" : `${number(v)}${unit ? ` ${unit}` : ""}`);
    const options = {
      width: Math.max(host.clientWidth, 200),
      height: paperHeight(o.height || 220),
      padding: [o.cells ? 28 : 8, 10, 0, 0],
      scales: { x: xScale, y: { distr: o.y.log ? 3 : 1, range: valueRange(o) } },
      axes: [axis(2, { label: o.x.label, log }), axis(3, { label: o.y.label, log: o.y.log })],
      series: [{ label: o.x.name || "at", value: live("x", o.x.unit) }].concat(
        o.series.map((s) => ({
          label: s.label,
          stroke: () => colour[s.colour],
          fill: s.fill ? () => colour[s.fill] : undefined,
          width: s.width || 1.25,
          dash: s.dash,
          auto: s.auto !== false,
          value: live(s.label, s.unit ?? o.y.unit),
          class: s.silent ? "silent" : undefined,
          points: { show: s.points ?? false, size: 4, filter: s.points ? undefined : lonely },
          spanGaps: false,
        })),
      ),
      bands: (o.intervals || []).map((pair) => ({ series: pair, fill: () => colour.interval })),
      legend: {
        show: !o.cells,
        live: true,
        markers: { width: 2, stroke: (u, i) => swatch(o, i), fill: (u, i) => swatch(o, i) },
      },
      cursor: {
        y: false,
        drag: { x: true, y: false, dist: 4 },
        points: { size: 7, width: 0, fill: (u, i) => swatch(o, i) },
        sync: linked
          ? {
              key: linked.key,
              scales: ["x", null],
              setSeries: false,
              filters: { pub: (type) => type === "mousemove" || type === "mouseleave" },
            }
          : undefined,
        bind: {
          dblclick: () => () => {
            if (linked) linked.reset();
            else chart.u.setData(chart.u.data);
            return null;
          },
        },
      },
      hooks: {
        drawClear: [(u) => drawShades(u, o.shades)],
        drawAxes: [(u) => drawReferences(u, o.references), (u) => o.cells && drawCells(u, o.cells)],
        draw: [
          (u) => {
            drawMarks(u, o.marks);
            drawLimits(u, o.references, o.limits);
          },
        ],
        setScale: [
          (u, key) => {
            if (linked && key === "x" && linked.members.has(u)) linked.set(u.scales.x.min, u.scales.x.max);
          },
        ],
        setLegend: [(u) => host.classList.toggle("hovered", u.cursor.idx != null)],
      },
    };
    const u = new uPlot(options, o.data, host);
    const chart = register(u, host, () => {
      const [width, height] = [host.clientWidth, paperHeight(o.height || 220)];
      if (width > 0 && (width !== u.width || height !== u.height)) u.setSize({ width, height });
    });
    chart.setData = (data) => u.setData(data, !linked);
    chart.linked = linked;
    if (linked) {
      u.setScale("x", { min: linked.min, max: linked.max });
      linked.members.add(u);
      keyboard(host, linked);
    }
    return chart;
  }

  const swatch = (o, i) => `var(--chart-${o.series[i - 1].swatch || o.series[i - 1].colour})`;

  /* A single value between two gaps draws no line, so it gets a point. */
  function lonely(u, i, shown) {
    const y = u.data[i];
    const [first, last] = [u.series[i].idxs[0] ?? 0, u.series[i].idxs[1] ?? y.length - 1];
    if (shown || last - first > 20000) return null;
    const alone = [];
    for (let k = first; k <= last; k++) {
      if (y[k] != null && y[k - 1] == null && y[k + 1] == null) alone.push(k);
    }
    return alone.length ? alone : null;
  }

  /* One signal against another. data: [x, y]; x, y: {label}. The dashed line is y = x. Drag zooms, double click resets.
   * chart.setData(x, y) draws other samples; both axes keep the same scale. */
  function loop(host, o) {
    if (charts.size === 0) readColours();
    const side = () => Math.max(Math.min(host.clientWidth, o.size || 460), 200);
    const extremes = (values) => {
      let [min, max] = [Infinity, -Infinity];
      for (const v of values) {
        if (v < min) min = v;
        if (v > max) max = v;
      }
      return min <= max ? [min, max] : [-1, 1];
    };

    /* Strokes of bounded length: one path of 100,000 crossing segments takes a browser seconds. */
    function trace(u) {
      const [xs, ys] = u.data[1];
      clipped(u, (ctx, box, ratio) => {
        const { x, y } = u.scales;
        const kx = box.width / (x.max - x.min);
        const ky = box.height / (y.max - y.min);
        ctx.strokeStyle = colour[o.colour || "value"];
        ctx.lineWidth = (o.width || 1) * ratio;
        ctx.lineJoin = "round";
        let [px, py, drawn] = [NaN, NaN, 0];
        ctx.beginPath();
        for (let k = 0; k < xs.length; k++) {
          const qx = box.left + (xs[k] - x.min) * kx;
          const qy = box.top + box.height - (ys[k] - y.min) * ky;
          if (Math.abs(qx - px) < 0.5 && Math.abs(qy - py) < 0.5 && k < xs.length - 1) continue;
          if (drawn === 0) ctx.moveTo(qx, qy);
          else ctx.lineTo(qx, qy);
          if (++drawn % 400 === 0) {
            ctx.stroke();
            ctx.beginPath();
            ctx.moveTo(qx, qy);
          }
          [px, py] = [qx, qy];
        }
        ctx.stroke();
      });
      return null;
    }

    function diagonal(u) {
      clipped(u, (ctx, box, ratio) => {
        const low = Math.max(u.scales.x.min, u.scales.y.min);
        const high = Math.min(u.scales.x.max, u.scales.y.max);
        if (!(high > low)) return;
        ctx.strokeStyle = colour.muted;
        ctx.lineWidth = ratio;
        ctx.setLineDash([5 * ratio, 4 * ratio]);
        ctx.beginPath();
        ctx.moveTo(u.valToPos(low, "x", true), u.valToPos(low, "y", true));
        ctx.lineTo(u.valToPos(high, "x", true), u.valToPos(high, "y", true));
        ctx.stroke();
        ctx.setLineDash([]);
      });
    }

    let home = [
      [-1, 1],
      [-1, 1],
    ];
    function frame(xs, ys) {
      const [a, b] = [extremes(xs), extremes(ys)];
      const span = 1.08 * Math.max(a[1] - a[0], b[1] - b[0], 1e-12 * Math.max(Math.abs(a[1]), Math.abs(b[1])), 1e-300);
      home = [a, b].map(([min, max]) => [(min + max - span) / 2, (min + max + span) / 2]);
    }
    function show(u, [x, y]) {
      u.setScale("x", { min: x[0], max: x[1] });
      u.setScale("y", { min: y[0], max: y[1] });
    }

    frame(...o.data);
    const size = side();
    const u = new uPlot(
      {
        mode: 2,
        width: size,
        height: size - (Y_AXIS - 44),
        padding: [8, 10, 0, 0],
        scales: {
          x: { time: false, auto: false, min: home[0][0], max: home[0][1] },
          y: { auto: false, min: home[1][0], max: home[1][1] },
        },
        axes: [axis(2, { label: o.x.label }), axis(3, { label: o.y.label })],
        series: [
          {},
          {
            facets: [
              { scale: "x", auto: false },
              { scale: "y", auto: false },
            ],
            paths: trace,
            stroke: () => colour.value,
            points: { show: false },
          },
        ],
        legend: { show: false },
        cursor: {
          points: { show: false },
          drag: { x: true, y: true, dist: 4 },
          bind: {
            dblclick: () => () => {
              show(u, home);
              return null;
            },
          },
        },
        hooks: { drawAxes: [diagonal] },
      },
      [null, o.data],
      host,
    );
    const chart = register(u, host, () => {
      const now = side();
      if (host.clientWidth > 0 && now !== u.width) u.setSize({ width: now, height: now - (Y_AXIS - 44) });
    });
    chart.setData = (xs, ys) => {
      frame(xs, ys);
      u.batch(() => {
        u.setData([null, [xs, ys]], false);
        show(u, home); // draws anew even where the range stays
      });
    };
    return chart;
  }

  return { group, lines, loop, number, short };
})();
