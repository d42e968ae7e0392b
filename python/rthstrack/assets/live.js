"use strict";
/* The live page: takes the monitor's events, keeps the last half hour, and draws it. All numbers come from the
 * monitor; here they are only written and thinned. Every text goes to textContent: a name is never read as markup. */
(() => {
  const LOST_MS = 1500;
  const KEPT_S = 1800;
  const MOST_KEPT = 800000; // readings of all actuators together
  const MOST_SCOPE = 65536; // samples of a signal
  const MOST_EVENTS = 200;
  const DRAW_MS = 45;
  const WRITE_MS = 150; // numbers that change more often cannot be read
  const OWN = ["value", "error", "second", "third"]; // colours of the actuators, names of charts.css
  const DASHES = [undefined, [8, 3], [3, 3], [8, 3, 2, 3]];
  const WORDS = {
    delay: "Delay", amplitude: "Amplitude", critical_delay: "Critical delay", lost: "Lost samples", silence: "Silence",
    unjudged: "Not judged",
  };
  const FULL = "Not connected: as many browsers as may are watching already; close one of them.";
  const LATCHED = "latched — advisory — reset at the terminal or by control datagram";

  const root = document.documentElement;
  const find = (selector) => document.querySelector(selector);
  const text = (name) => find(`[data-text="${name}"]`);

  function element(name, className, words) {
    const made = document.createElement(name);
    if (className) made.className = className;
    if (words != null) made.textContent = words;
    return made;
  }

  function write(node, words) {
    if (node.textContent !== words) node.textContent = words;
  }

  // ------------------------------------------------------------------------------------------------ numbers

  const DASH = "–";
  const signed = (words) => words.replace("-", "−");
  const fixed = (value, places) => (value == null ? DASH : signed(value.toFixed(places)));
  const seconds = (value) => (value == null ? DASH : `${fixed(value, 2)} s`);
  const gain = (value) => (value == null ? DASH : Math.abs(value) < 100 ? fixed(value, 3) : Charts.number(value));
  const millis = (value) => (value == null ? DASH : fixed(1e3 * value, Math.abs(value) < 0.1 ? 2 : 1));
  const count = (value) => (value == null ? DASH : String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f"));
  const between = (low, high, write) => (low == null || high == null ? "" : `${write(low)} to ${write(high)}`);
  const age = (value) => (value < 120 ? `${value.toFixed(value < 10 ? 1 : 0)} s` : `${(value / 60).toFixed(0)} min`);

  /* The smallest of 1, 2, 5 times a power of ten that is at least `value`. */
  function nice(value) {
    const unit = 10 ** Math.floor(Math.log10(value));
    return unit * [1, 2, 5, 10].find((step) => step * unit >= value * (1 - 1e-9));
  }

  /* A range that stands still while it can: widened at once, narrowed when less than a third of it is used. */
  function steady(last, low, high, least) {
    if (!(low <= high)) return last || [-least / 2, least / 2];
    const size = Math.max(Math.abs(low), Math.abs(high));
    const span = Math.max(high - low, least, 1e-9 * size) || 1; // a signal of zeros has a span too
    if (last && low >= last[0] && high <= last[1] && last[1] - last[0] <= 3 * span) return last;
    const more = (span - (high - low)) / 2 + 0.03 * span;
    const step = nice(span / 10);
    return [Math.floor((low - more) / step) * step, Math.ceil((high + more) / step) * step];
  }

  // ------------------------------------------------------------------------------------------------ what is kept

  /* Rows of numbers over time in a ring, and above them rungs that hold the extremes of 4, 16, 64 and 256 rows, so that
   * any span is drawn from a few thousand points. */
  function ladder(nColumns, atLeast) {
    const capacity = 256 * Math.ceil(atLeast / 256);
    const rungs = [1, 4, 16, 64, 256].map((stride) => {
      const size = capacity / stride;
      const columns = (Type) => Array.from({ length: nColumns }, () => new Type(size));
      const low = columns(Float32Array);
      const high = stride === 1 ? low : columns(Float32Array);
      return { stride, size, low, high, time: new Float64Array(size), hole: columns(Uint8Array) };
    });
    let n = 0;

    function begin(time) {
      for (const rung of rungs) {
        if (n % rung.stride !== 0) continue;
        const slot = (n / rung.stride) % rung.size;
        rung.time[slot] = time;
        for (let c = 0; c < nColumns; c++) {
          rung.low[c][slot] = rung.high[c][slot] = NaN;
          rung.hole[c][slot] = 0;
        }
      }
      n++;
    }

    /* A value of the row begun last; null is a hole. */
    function put(c, value) {
      for (const { stride, size, low, high, hole } of rungs) {
        const slot = Math.floor((n - 1) / stride) % size;
        if (value == null) {
          hole[c][slot] = 1;
          continue;
        }
        if (!(low[c][slot] <= value)) low[c][slot] = value;
        if (!(high[c][slot] >= value)) high[c][slot] = value;
      }
    }

    const timeOf = (row) => rungs[0].time[row % capacity];

    function firstAtLeast(time) {
      let [a, b] = [Math.max(0, n - capacity), n];
      while (a < b) {
        const middle = Math.floor((a + b) / 2);
        if (timeOf(middle) < time) a = middle + 1;
        else b = middle;
      }
      return a;
    }

    /* Fills arrays with what to draw of [from, to], at most `most` points: `times`, and for every {column, out} its
     * values. Returns the extremes. */
    function take(from, to, most, times, wanted) {
      let first = Math.max(firstAtLeast(from) - 1, 0, n - capacity);
      const end = Math.min(firstAtLeast(to) + 1, n);
      const fits = ({ stride }) => ((end - first) / stride) * (stride > 1 ? 3 : 1) <= most;
      const rung = rungs.find(fits) || rungs[rungs.length - 1];
      const { stride, size } = rung;
      first = Math.floor(first / stride);
      if (first * stride < n - capacity) first++;
      const last = Math.ceil(end / stride);
      times.length = 0;
      for (const { out } of wanted) out.length = 0;
      let [least, greatest] = [Infinity, -Infinity];
      for (let k = first; k < last; k++) {
        const slot = k % size;
        times.push(rung.time[slot]);
        for (const one of wanted) {
          const { column, out } = one;
          const [low, high, hole] = [rung.low[column][slot], rung.high[column][slot], rung.hole[column][slot]];
          if (low < least) least = low;
          if (high > greatest) greatest = high;
          // First the extreme nearer to what came before; of a group with a hole, the larger, and then the hole.
          const before = out[out.length - 1] ?? 0;
          const highFirst = hole ? Math.abs(high) > Math.abs(low) : Math.abs(high - before) < Math.abs(low - before);
          out.push(low !== low ? null : highFirst ? high : low);
          one.next = low !== low || hole ? null : highFirst ? low : high;
        }
        if (stride === 1) continue;
        const next = k + 1 < Math.ceil(n / stride) ? rung.time[(k + 1) % size] : timeOf(n - 1);
        times.push((rung.time[slot] + next) / 2);
        for (const { out, next } of wanted) out.push(next);
      }
      return [least, greatest];
    }

    return {
      begin, put, take,
      clear: () => { n = 0; },
      first: () => (n ? timeOf(Math.max(0, n - capacity)) : null),
      last: () => (n ? timeOf(n - 1) : null),
    };
  }

  /* The last samples of both signals of every actuator. */
  function samples(nActuators, size) {
    const signals = () => Array.from({ length: nActuators }, () => new Float32Array(size));
    const self = { target: signals(), measured: signals(), n: 0, end_s: null, rate_hz: 0, add, clear, take };

    function clear() {
      [self.n, self.end_s] = [0, null];
    }

    function add(block) {
      const length = block.target.length ? block.target[0].length : 0;
      if (length === 0) return;
      const start = block.end_s - (length - 1) / block.rate_hz;
      const joins = self.end_s != null && self.rate_hz === block.rate_hz
        && Math.abs((start - self.end_s) * block.rate_hz - 1) < 0.5;
      if (!joins) clear();
      const skipped = Math.max(0, length - size);
      for (const name of ["target", "measured"]) {
        for (let a = 0; a < nActuators; a++) {
          const [ring, values] = [self[name][a], block[name][a]];
          for (let k = skipped; k < length; k++) ring[(self.n + k) % size] = values[k] ?? NaN;
        }
      }
      self.n += length;
      [self.end_s, self.rate_hz] = [block.end_s, block.rate_hz];
    }

    /* The last `span` seconds of one signal, oldest first. */
    function take(name, actuator, span) {
      const length = Math.min(self.n, size, Math.floor(span * self.rate_hz) + 1);
      const [ring, first] = [self[name][actuator], (self.n - length) % size];
      const out = new Float32Array(length);
      const head = Math.min(length, size - first);
      out.set(ring.subarray(first, first + head));
      out.set(ring.subarray(0, length - head), head);
      return out;
    }

    return self;
  }

  function extremes(...lists) {
    let [low, high] = [Infinity, -Infinity];
    for (const values of lists) {
      for (const v of values) {
        if (v < low) low = v;
        if (v > high) high = v;
      }
    }
    return [low, high];
  }

  /* The extremes of every `stride` samples, at the same places in every signal; `offset` samples are gone already, so
   * that groups keep theirs while the signal rolls. */
  function thinned(values, stride, offset) {
    const [at, kept] = [[], []];
    const push = (k, v) => { at.push(k); kept.push(Number.isFinite(v) ? v : null); };
    for (let start = -(offset % stride); start < values.length; start += stride) {
      const [from, end] = [Math.max(start, 0), Math.min(start + stride, values.length)];
      let [low, high] = [from, from];
      for (let k = from + 1; k < end; k++) {
        if (!(values[k] >= values[low])) low = k;
        if (!(values[k] <= values[high])) high = k;
      }
      push(from, values[Math.min(low, high)]);
      push((from + end) / 2, values[Math.max(low, high)]);
    }
    return [at, kept];
  }

  // ------------------------------------------------------------------------------------------------ one run

  /* Buttons of which one is down. options: [[value, words]]. */
  function choice(name, options, chosen, onChange) {
    const field = find(`[data-choice="${name}"]`);
    for (const [value, words] of options) {
      const label = element("label");
      const input = element("input");
      Object.assign(input, { type: "radio", name, checked: value === chosen });
      input.addEventListener("change", () => onChange(value));
      label.append(input, element("span", "", words));
      field.append(label);
    }
    field.hidden = options.length < 2;
  }

  function card(name, number, onChoose) {
    const host = element("div", "card");
    host.style.setProperty("--own", `var(--chart-${OWN[number % OWN.length]})`);
    host.setAttribute("role", "radio");
    host.tabIndex = -1;
    const title = element("div", "title");
    const verdict = element("span", "verdict", DASH);
    const label = element("span", "name", name);
    label.title = name;
    title.append(label, verdict);
    const numbers = element("dl", "numbers");
    const part = (key, words, unit) => {
      const group = element("div");
      const [value, big, interval] = [element("span", "", DASH), element("dd", "big"), element("dd", "interval")];
      value.dataset.value = `${key}-${number}`;
      big.append(value, element("span", "unit", unit));
      group.append(element("dt", "", words), big, interval);
      numbers.append(group);
      return { group, value, interval };
    };
    const amplitude = part("amplitude", "Amplitude A", "");
    const delay = part("delay", "Delay d", "ms");
    const reason = element("div", "reason");
    host.append(title, numbers, reason);
    host.addEventListener("click", () => onChoose(number));
    return { host, verdict, amplitude, delay, reason };
  }

  function build(hello) {
    const n = hello.n_actuators;
    const names = Array.from({ length: n }, (_, a) => String((hello.names || [])[a] ?? `actuator ${a}`));
    const limits = hello.limits || {};
    const COLUMNS = 6; // of an actuator: A, d, and both their intervals; delays in ms
    const history = ladder(COLUMNS * n, Math.max(1024, Math.min(KEPT_S * hello.update_hz, MOST_KEPT / n)));
    const kept = samples(n, Math.min(MOST_SCOPE, Math.ceil(1.05 * hello.rate_hz * Math.max(hello.window_s, 4)) + 16));
    const latest = new Array(n).fill(null);
    const state = { focus: 0, all: n > 1 && n <= 8, span: 30, scope: hello.window_s, log: true, follow: true };
    let [frame, spectrum, row, alarms, shownAlarms] = [null, null, null, [], null];

    write(text("source"), `rthstrack monitor · ${hello.source}`);
    write(text("facts"), [
      `${Charts.short(hello.rate_hz)} Hz`, `window ${Charts.short(hello.window_s)} s`,
      `${Charts.short(hello.update_hz)} readings a second`, String(hello.estimator).replaceAll("_", " "),
      hello.band_hz ? `${hello.band_hz.map(Charts.short).join(" to ")} Hz` : null,
      hello.latency_s ? `${Charts.short(1e3 * hello.latency_s)} ms through the filter` : null,
    ].filter(Boolean).join(" · "));

    // ---------------------------------------------------------------------------------------------- choices

    const cards = names.map((name, a) => card(name, a, (chosen) => focus(chosen)));
    find(".cards").replaceChildren(...cards.map(({ host }) => host));
    cards.forEach(({ host }, a) => host.addEventListener("keydown", (event) => {
      const to = {
        ArrowRight: a + 1, ArrowDown: a + 1, ArrowLeft: a - 1, ArrowUp: a - 1, Home: 0, End: n - 1, " ": a, Enter: a,
      }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      focus((to + n) % n);
      cards[state.focus].host.focus();
    }));
    choice("which", n > 1 ? [[true, "all"], [false, "the chosen one"]] : [], state.all, (all) => {
      state.all = all;
      curves();
    });
    choice("span", [[30, "30 s"], [120, "2 min"], [600, "10 min"], [Infinity, "all kept"]], state.span, (span) => {
      state.span = span;
      follow();
    });
    const spans = [...new Set([2, 4, hello.window_s])].sort((a, b) => a - b);
    const spanWords = (s) => (s === hello.window_s ? `window, ${Charts.short(s)} s` : `${s} s`);
    choice("scope", spans.map((s) => [s, spanWords(s)]), state.scope,
      (scope) => { state.scope = scope; redraw(); });
    choice("scale", [[true, "logarithmic"], [false, "linear"]], true, (log) => {
      state.log = log;
      host("spectrum-log").parentElement.hidden = !log;
      host("spectrum-linear").parentElement.hidden = log;
      redraw();
    });
    find(".follow").addEventListener("click", follow);

    // ---------------------------------------------------------------------------------------------- charts

    const host = (name) => find(`[data-chart="${name}"]`);
    const height = Math.min(Math.max((innerHeight - 460) / 3, 175), 260); // three below one another fit most screens
    const rolling = Charts.group({ extent: [0, state.span] });
    const delayLimit = limits.delay_s == null ? null : 1e3 * limits.delay_s;
    const pair = (value, around, words) => {
      if (value == null) return [];
      return [around + value, around - value].map((at) => ({ value: at, label: words(Charts.short(value)) }));
    };
    const amplitudeLimits = pair(limits.amplitude, 1, (value) => `limit 1 ± ${value}`);
    const delayLimits = pair(delayLimit, 0, (value) => `limit ${value} ms`);
    if (limits.critical_delay_s != null) {
      const critical = 1e3 * limits.critical_delay_s;
      const share = limits.critical_fraction;
      if (share != null) delayLimits.push({ value: share * critical, label: `${Charts.short(share)} × critical` });
      delayLimits.push({ value: critical, label: `critical ${Charts.short(critical)} ms` });
    }

    function movingChart(name, label, axisLabel, unit, ideal, column, least, over) {
      const wanted = names.map((_, a) => ({ column: COLUMNS * a + column, out: [] }));
      const edges = [3 + 2 * column, 2 + 2 * column].map((offset) => ({ offset, out: [] }));
      const times = [];
      const options = {
        x: { label: axisLabel, name: "t", unit: "s", group: rolling },
        y: { label, unit, fixed: [ideal - least / 2, ideal + least / 2] },
        height: axisLabel ? height : height - 18,
        data: [times, ...[...wanted, ...edges].map(({ out }) => out)],
        references: [{ value: ideal }], limits: [...over],
        series: [
          ...names.map((words, a) => ({
            label: words, colour: OWN[a % OWN.length], width: 1.5,
            dash: DASHES[Math.floor(a / OWN.length) % DASHES.length],
          })),
          ...edges.map(() => ({ label: "interval", colour: "interval", width: 0.5, silent: true })),
        ],
        intervals: [[n + 1, n + 2]],
      };
      const { u } = Charts.lines(host(name), options);
      return { u, options, wanted, edges, times, ideal, least, name, limits: over };
    }
    const moving = [
      movingChart("amplitude", "Amplitude A (-)", undefined, "", 1, 0, 0.05, amplitudeLimits),
      movingChart("delay", "Delay d (ms)", "Time (s)", "ms", 0, 1, 2, delayLimits),
    ];
    /* The label of an axis with the unit of the chosen actuator, where the layout names one. */
    const inUnit = (words) => () => {
      const unit = (hello.units || [])[state.focus];
      return unit ? `${words} (${unit})` : words;
    };
    const scopeAxis = {
      x: { label: "Time (s)", name: "t", unit: "s" }, y: { label: inUnit("Displacement"), fixed: [-1, 1] },
    };
    const bothSignals = [{ label: "target", colour: "target" }, { label: "measured", colour: "measured" }];
    const scope = { ...scopeAxis, height, data: [[], [], []], series: bothSignals };
    scope.u = Charts.lines(host("scope"), scope).u;
    const loop = Charts.loop(host("loop"), {
      x: { label: inUnit("Target") }, y: { label: inUnit("Measured") }, data: [[0], [0]], size: 330,
    });
    const spectra = [true, false].map((log) => {
      const group = Charts.group({ extent: [0, hello.rate_hz / 2], home: hello.band_hz || [0, hello.rate_hz / 2] });
      const figure = host(log ? "spectrum-log" : "spectrum-linear");
      const options = {
        x: { label: "Frequency (Hz)", name: "f", unit: "Hz", group },
        y: { label: inUnit("Amplitude"), log, decades: 5, zero: !log },
        height: height + 30, data: [[], [], []], series: bothSignals,
      };
      return { u: Charts.lines(figure, options).u, group, log, free: true };
    });
    for (const one of spectra) {
      one.group.reset = () => { one.free = true; one.group.set(...one.group.home); };
      one.group.onChange(() => { if (!one.placing) one.free = false; });
    }

    let placing = false;
    rolling.reset = follow;
    rolling.onChange(() => {
      if (placing) return;
      state.follow = false;
      find(".follow").hidden = false;
    });

    function follow() {
      state.follow = true;
      find(".follow").hidden = true;
      redraw();
    }

    function curves() {
      for (const { u } of moving) {
        names.forEach((_, a) => {
          const shown = state.all || a === state.focus;
          u.series[a + 1].width = state.all && a === state.focus ? 2.5 : 1.5;
          if (u.series[a + 1].show !== shown) u.setSeries(a + 1, { show: shown });
        });
      }
      redraw();
    }

    function focus(a) {
      state.focus = a;
      cards.forEach(({ host }, k) => {
        host.setAttribute("aria-checked", String(k === a));
        host.tabIndex = k === a ? 0 : -1;
      });
      for (const node of document.querySelectorAll(".whose")) write(node, n > 1 ? names[a] : "");
      curves();
    }

    // ---------------------------------------------------------------------------------------------- drawing

    const place = ({ u }) => Math.max(Math.round(u.bbox.width / devicePixelRatio), 100);

    function timeView() {
      const [first, last] = [history.first() ?? 0, history.last() ?? Math.min(state.span, 30)];
      const view = [Number.isFinite(state.span) ? last - state.span : Math.min(first, last - 1), last];
      rolling.extent = [Math.min(first, view[0]), Math.max(last, view[1])];
      return state.follow ? view : [rolling.min, rolling.max];
    }

    function drawMoving() {
      const [from, to] = timeView();
      for (const chart of moving) {
        const { wanted, edges, times, options, ideal, least, limits } = chart;
        for (const edge of edges) edge.column = COLUMNS * state.focus + edge.offset;
        const shown = wanted.filter((_, a) => state.all || a === state.focus);
        for (const one of wanted) if (!shown.includes(one)) one.out.length = 0;
        const [low, high] = history.take(from, to, 3 * place(chart), times, [...shown, ...edges]);
        options.y.fixed = chart.range = steady(chart.range, ...withLimits(low, high, ideal, least, limits), least);
        options.limits = told(limits, options.y.fixed, ideal);
        options.shades = holes(times, wanted[state.focus].out);
        options.marks = alarms
          .filter((a) => a.name.endsWith(chart.name) && a.since_s != null && (state.all || a.actuator === state.focus))
          .map((a) => ({ at: a.since_s }));
        chart.u.setData(options.data, false);
      }
      placing = true;
      rolling.set(from, to);
      for (const { u } of moving) u.setScale("x", { min: rolling.min, max: rolling.max });
      placing = false;
    }

    /* What is ideal belongs into the view; a limit too, unless the curve would become a flat line by it. */
    function withLimits(low, high, ideal, least, limits) {
      const [min, max] = [Math.min(low, ideal), Math.max(high, ideal)];
      const reach = 3 * Math.max(max - min, least);
      const near = limits.map(({ value }) => value).filter((value) => value < max + reach && value > min - reach);
      const [bottom, top] = [Math.min(min, ...near), Math.max(max, ...near)];
      return [bottom, top > max ? top + 0.13 * (top - bottom) : top]; // room for the label above its line
    }

    /* The limits in view, and to either side the nearest one where none is: its label stands at the edge. */
    function told(limits, [min, max], ideal) {
      const side = (sign) => {
        const there = limits.filter(({ value }) => sign * (value - ideal) > 0);
        const inView = there.filter(({ value }) => value >= min && value <= max);
        return inView.length ? inView : there.sort((a, b) => sign * (a.value - b.value)).slice(0, 1);
      };
      return [...side(1), ...side(-1)];
    }

    /* Where the chosen actuator has no number: grey. */
    function holes(times, values) {
      const found = [];
      for (let k = 0; k < values.length; k++) {
        if (values[k] != null) continue;
        const from = times[k];
        while (k < values.length && values[k] == null) k++;
        found.push({ from, to: times[Math.min(k, values.length - 1)] });
      }
      return found;
    }

    function drawScope() {
      if (kept.end_s == null) return;
      const [target, measured] = ["target", "measured"].map((name) => kept.take(name, state.focus, state.scope));
      const first = kept.n - target.length;
      const start = kept.end_s - (target.length - 1) / kept.rate_hz;
      scope.y.fixed = scope.range = steady(scope.range, ...extremes(target, measured), 0);
      const stride = Math.ceil(target.length / (2 * place(scope)));
      const times = (places) => places.map((k) => start + k / kept.rate_hz);
      if (stride <= 2) {
        scope.data = [times(Float64Array.from(target, (_, k) => k)), plain(target), plain(measured)];
      } else {
        const [[at, low], [, high]] = [target, measured].map((values) => thinned(values, stride, first));
        scope.data = [times(at), low, high];
      }
      scope.u.batch(() => {
        scope.u.setData(scope.data, false);
        scope.u.setScale("x", { min: kept.end_s - state.scope, max: kept.end_s });
      });
    }

    const plain = (values) => Array.from(values, (v) => (Number.isFinite(v) ? v : null));

    function drawLoop() {
      if (kept.end_s == null) return;
      const [target, measured] = ["target", "measured"].map((name) => kept.take(name, state.focus, state.scope));
      loop.range = steady(loop.range, ...extremes(target, measured), 0);
      const [min, max] = loop.range;
      loop.u.batch(() => {
        loop.u.setData([null, [target, measured]], false);
        loop.u.setScale("x", { min, max });
        loop.u.setScale("y", { min, max });
      });
    }

    function drawSpectrum() {
      if (!spectrum || !spectrum.frequency_hz.length) return;
      const one = spectra[state.log ? 0 : 1];
      const f = spectrum.frequency_hz;
      const [target, measured] = [spectrum.target[state.focus], spectrum.measured[state.focus]];
      const top = f[f.length - 1];
      one.group.extent = [0, top];
      // First what moves: up to twice the highest frequency with a thousandth of the peak.
      const peak = Math.max(extremes(target)[1], extremes(measured)[1]);
      let k = f.length - 1;
      while (k > 1 && !(target[k] > 1e-3 * peak)) k--;
      one.reach = steady(one.reach && [0, one.reach], 0, 2 * f[k], f[1] * 8)[1];
      const [from, to] = hello.band_hz || [0, one.reach];
      one.group.home = [from, Math.min(to, top)];
      const clean = (values) => Array.from(values, (v) => (v != null && (v > 0 || !one.log) ? v : null));
      one.u.setData([f, clean(target), clean(measured)], false);
      one.placing = true;
      if (one.free) one.group.set(...one.group.home);
      one.u.setScale("x", { min: one.group.min, max: one.group.max });
      one.placing = false;
    }

    let [asked, drawnAt, cost, all, turn] = [false, 0, 0, true, 0];

    /* Everything anew, also what draws less often. */
    function redraw() {
      all = true;
      want();
    }

    function want() {
      if (asked) return;
      asked = true;
      requestAnimationFrame(tick);
    }

    /* At most 20 times a second, and never more than half of the browser's time. */
    function tick(now) {
      if (now - drawnAt < Math.max(DRAW_MS, 2 * cost)) {
        requestAnimationFrame(tick);
        return;
      }
      [asked, drawnAt] = [false, now];
      const start = performance.now();
      turn++;
      // Long spans hardly move from one frame to the next.
      if (all || turn % 2 === 0 || (rolling.max - rolling.min) / place(moving[0]) < 0.1) drawMoving();
      if (all || turn % 2 === 0) drawScope();
      if (all || turn % 2 === 1) drawLoop();
      if (all || spectrumIsNew) drawSpectrum();
      [all, spectrumIsNew] = [false, false];
      cost = 0.8 * cost + 0.2 * (performance.now() - start);
      root.dataset.frames = String(Number(root.dataset.frames || 0) + 1);
      root.dataset.cost = cost.toFixed(1);
    }
    let spectrumIsNew = false;

    // ---------------------------------------------------------------------------------------------- words and numbers

    function writeCard(a) {
      const { host, verdict, amplitude, delay, reason } = cards[a];
      const one = latest[a];
      const about = (name) => alarms.filter((alarm) => alarm.actuator === a && alarm.name.endsWith(name));
      let worst = "";
      for (const [name, { group }] of [["amplitude", amplitude], ["delay", delay]]) {
        const [active, latched] = [about(name).some((x) => x.active), about(name).some((x) => x.latched && !x.active)];
        group.classList.toggle("over", active);
        group.classList.toggle("after", latched);
        if (active) worst = "alarm";
        else if (latched && !worst) worst = "latched";
      }
      if (about("unjudged").some((x) => x.active)) worst = "alarm";
      else if (about("unjudged").length && !worst) worst = "latched";
      const valid = Boolean(one && one.valid);
      host.classList.toggle("invalid", one != null && !valid);
      write(verdict, worst || (one == null ? "no reading yet" : valid ? "valid" : "not valid"));
      verdict.className = `verdict${worst ? " alarm" : valid ? "" : " not"}`;
      if (one == null) return;
      write(amplitude.value, gain(one.amplitude));
      write(delay.value, millis(one.delay));
      write(amplitude.interval, between(one.amplitudeLow, one.amplitudeHigh, gain));
      write(delay.interval, between(one.delayLow, one.delayHigh, millis));
      const words = one.reason || [
        one.frequency == null ? null : `at ${fixed(one.frequency, 2)} Hz`,
        one.phase == null ? null : `phase ${fixed((180 / Math.PI) * one.phase, 1)}°`,
      ].filter(Boolean).join(", ");
      write(reason, words);
      if (reason.title !== words) reason.title = words;
    }

    const rows = new Map();
    function healthRow(name, words, kind = "") {
      if (!rows.has(name)) {
        const [line, value] = [element("tr"), element("td")];
        const head = element("th", "", name);
        head.scope = "row";
        line.append(head, value);
        find(".health tbody").append(line);
        rows.set(name, { line, value });
      }
      const { line, value } = rows.get(name);
      write(value, words);
      if (line.className !== kind) line.className = kind;
    }

    function writeHealth() {
      const h = frame.health;
      const some = (value) => (value ? "odd" : "");
      healthRow("received", count(h.received));
      healthRow("lost", count(h.lost), alarms.some((a) => a.active && a.name === "lost") ? "bad" : some(h.lost));
      healthRow("repeated", count(h.repeated), some(h.repeated));
      healthRow("reordered", count(h.reordered), some(h.reordered));
      healthRow("malformed", count(h.malformed), some(h.malformed));
      healthRow("refused", count(h.refused), some(h.refused));
      healthRow("filled", count(h.filled), some(h.filled));
      healthRow("restarts", count(h.restarts), some(h.restarts));
      const off = h.pace_hz != null && Math.abs(h.pace_hz / hello.rate_hz - 1) > 0.05;
      const pace = h.pace_hz == null ? DASH : `${fixed(h.pace_hz, 1)} of ${Charts.short(hello.rate_hz)} Hz`;
      healthRow("pace", pace, off ? "odd" : "");
      healthRow("last sample", h.age_s == null ? DASH : `${age(h.age_s)} ago`, frame.state === "silent" ? "bad" : "");
      healthRow("readings", count(h.readings));
      healthRow("log", h.log ?? "none", h.log && h.log !== "writing" ? "bad" : "");
      healthRow("not logged", count(h.log_dropped), h.log_dropped ? "bad" : "");
      for (const [name, words] of [["unsent", "not sent"], ["not_written", "not written"]]) {
        if (h[name]) healthRow(words, count(h[name]), "bad");
      }
    }

    function writeAll() {
      write(text("time"), frame.time_s == null ? DASH : `t = ${seconds(frame.time_s)}`);
      for (let a = 0; a < n; a++) writeCard(a);
      writeHealth();
    }

    function addEvents(events) {
      const list = find(".events");
      for (const event of events) {
        const line = element("li");
        line.append(element("time", "", seconds(event.time_s)), element("span", "", event.text));
        list.prepend(line);
      }
      while (list.childElementCount > MOST_EVENTS) list.lastElementChild.remove();
    }

    /* Anew only where something changed, so that it can be read, copied and spoken. */
    function writeAlarms(trouble) {
      const lasting = alarms.map((a) => [a.name, a.actuator, a.active, a.latched, a.text]);
      const shown = JSON.stringify([lasting, trouble && trouble.kind]);
      if (shown === shownAlarms) {
        if (trouble) write(find(".alerts").firstElementChild, trouble.words);
        return;
      }
      shownAlarms = shown;
      const lines = trouble ? [element("li", trouble.kind, trouble.words)] : [];
      const active = alarms.filter((alarm) => alarm.active).length;
      const howMany = `${active} alarms are active, ${alarms.length - active} latched.`;
      if (alarms.length > 6) lines.push(element("li", "count", howMany));
      const order = [...alarms].sort((a, b) => Number(b.active) - Number(a.active));
      const called = ({ name, actuator }) =>
        `${WORDS[name] ?? name}${actuator == null ? "" : ` · ${names[actuator] ?? actuator}`}`;
      for (const alarm of order) {
        const line = element("li", alarm.active ? "active" : "latched");
        line.append(element("strong", "", called(alarm)));
        line.append(element("span", "words", alarm.text));
        const since = alarm.since_s == null ? "" : `since t = ${seconds(alarm.since_s)}`;
        line.append(element("span", "note", alarm.active ? since : LATCHED));
        lines.push(line);
      }
      const watched = ["delay_s", "amplitude", "critical_delay_s"].some((name) => limits[name] != null);
      const calm = watched ? "No alarm." : "No alarm. No limit is set for amplitude or delay.";
      if (!lines.length) lines.push(element("li", "calm", calm));
      find(".alerts").replaceChildren(...lines);
      // Which alarms there are is spoken; their numbers, which go on changing, are not.
      const spoken = order.map((alarm) => `${alarm.active ? "Alarm" : "Latched"}: ${called(alarm)}.`);
      write(find(".spoken"), alarms.length > 6 ? howMany : spoken.join(" "));
      for (const { name } of moving) {
        host(name).parentElement.classList.toggle("over", alarms.some((a) => a.active && a.name.endsWith(name)));
      }
    }

    // ---------------------------------------------------------------------------------------------- what comes in

    function addReading([index, time, centre, actuator, A, d, phase, f, aLow, aHigh, dLow, dHigh, valid, reason]) {
      if (!(actuator >= 0 && actuator < n)) return;
      if (index !== row) {
        const last = history.last();
        if (last != null && time - last > 0.5 + 4 / hello.update_hz) leaveGap(last);
        history.begin(time);
        row = index;
      }
      const milli = (value) => (value == null ? null : 1e3 * value);
      const shown = valid ? [A, milli(d), aLow, aHigh, milli(dLow), milli(dHigh)] : [];
      for (let k = 0; k < COLUMNS; k++) history.put(COLUMNS * actuator + k, shown[k] ?? null);
      latest[actuator] = {
        amplitude: A, delay: d, phase, frequency: f, centre, valid, reason,
        amplitudeLow: aLow, amplitudeHigh: aHigh, delayLow: dLow, delayHigh: dHigh,
      };
    }

    /* So that no line is drawn across a time of which nothing is known. */
    function leaveGap(time) {
      history.begin(time);
      for (let c = 0; c < COLUMNS * n; c++) history.put(c, null);
    }

    function forget() {
      history.clear();
      kept.clear();
      row = null;
      follow();
    }

    let writtenAt = 0;
    function take(received) {
      frame = received;
      for (const reading of frame.readings) addReading(reading);
      if (frame.scope) kept.add(frame.scope);
      if (frame.spectrum) [spectrum, spectrumIsNew] = [frame.spectrum, true];
      if (frame.events.length) addEvents(frame.events);
      alarms = frame.alarms.filter((alarm) => alarm.active || alarm.latched);
      const now = performance.now();
      if (now - writtenAt > WRITE_MS) {
        writtenAt = now;
        writeAll();
      }
      want();
    }

    focus(0);
    return {
      take, writeAlarms,
      forget() {
        forget();
        latest.fill(null);
        find(".events").replaceChildren();
      },
      alarmed: () => alarms.some((alarm) => alarm.active),
      frame: () => frame,
      catchUp: () => { if (frame) writeAll(); },
    };
  }

  // ------------------------------------------------------------------------------------------------ the connection

  let [run, told, runName, lastFrame, refused, since] = [null, null, null, null, null, performance.now()];

  const STATES = {
    connecting: "Connecting", running: "Running", waiting: "Waiting", silent: "Silent", lost: "Lost connection",
  };

  /* What to tell beside the state; the numbers' age belongs to it. */
  function trouble(state, frame) {
    const of = frame && frame.time_s != null ? ` The numbers are those of t = ${seconds(frame.time_s)}.` : "";
    const ago = age((performance.now() - (lastFrame ?? since)) / 1000);
    return {
      connecting: null,
      running: null,
      waiting: { kind: "calling", words: "Waiting for the first sample." },
      silent: { kind: "trouble", words: `Silent: no sample for ${age((frame && frame.health.age_s) || 0)}.${of}` },
      lost: { kind: "trouble", words: refused || `Lost connection to the monitor, ${ago} ago; trying again.${of}` },
    }[state];
  }

  function judge() {
    const quiet = performance.now() - (lastFrame ?? since) > LOST_MS;
    const frame = run ? run.frame() : null;
    const state = quiet ? "lost" : frame && lastFrame != null ? frame.state : "connecting";
    if (root.dataset.state !== state) {
      root.dataset.state = state;
      write(text("state"), STATES[state] ?? String(state));
      if (run) run.catchUp();
    }
    if (run) run.writeAlarms(trouble(state, frame));
    else if (quiet) find(".alerts").replaceChildren(element("li", "trouble", trouble(state, null).words));
    const title = `${run && run.alarmed() ? "ALARM · " : ""}${STATES[state] ?? state} · rthstrack monitor`;
    if (document.title !== title) document.title = title;
  }

  function greet(event) {
    const name = (event.lastEventId || "").split("-")[0];
    if (told != null && told !== event.data) {
      location.reload(); // another monitor: its page may be another too
      return;
    }
    if (told == null) {
      run = build(JSON.parse(event.data));
      root.dataset.ready = "true";
    } else if (name !== runName) {
      run.forget();
    }
    [told, runName] = [event.data, name];
  }

  function connect() {
    const stream = new EventSource("events");
    stream.addEventListener("hello", greet);
    stream.addEventListener("frame", (event) => {
      if (!run) return;
      [lastFrame, refused] = [performance.now(), null];
      run.take(JSON.parse(event.data));
      judge();
    });
    stream.addEventListener("error", async () => {
      if (stream.readyState !== EventSource.CLOSED) return; // else the browser tries again by itself
      stream.close();
      try {
        const answer = await fetch("events", { method: "HEAD" });
        refused = answer.status === 503 ? FULL : null;
      } catch {
        refused = null;
      }
      setTimeout(connect, 1000);
    });
  }

  setInterval(judge, 200);
  connect();
})();
