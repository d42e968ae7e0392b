"use strict";
/* One run of a monitor: what it is, what is kept of it, its panels, and when they are drawn. */
const Run = (() => {
  const { root, find, text, write, DASH, seconds, choice } = Page;
  const KEPT_S = 1800;
  const MOST_KEPT = 800000; // readings of all actuators together
  const MOST_SCOPE = 65536; // samples of a signal
  const DRAW_MS = 45;
  const WRITE_MS = 150; // numbers that change more often cannot be read
  const COLUMNS = 6; // of an actuator: A, d, and both their intervals; delays in ms

  function build(hello) {
    const n = hello.n_actuators;
    const run = {
      hello,
      n,
      names: Array.from({ length: n }, (_, a) => String((hello.names || [])[a] ?? `actuator ${a + 1}`)),
      limits: hello.limits || {},
      kinds: new Map(hello.alarm_kinds.map((kind) => [kind.name, kind])),
      /* Whether an alarm is about this one of the numbers shown. */
      isAbout: (alarm, quantity) => run.kinds.get(alarm.name)?.quantity === quantity,
      columns: COLUMNS,
      history: Kept.ladder(COLUMNS * n, Math.max(1024, Math.min(KEPT_S * hello.update_hz, MOST_KEPT / n))),
      kept: Kept.samples(n, Math.min(MOST_SCOPE, Math.ceil(1.05 * hello.rate_hz * Math.max(hello.window_s, 4)) + 16)),
      latest: Array.from({ length: n }, () => null),
      state: { focus: 0, all: n > 1 && n <= 8, span: 30, scope: hello.window_s, log: true, follow: true },
      frame: null,
      spectrum: null,
      alarms: [],
      panels: {},
      height: Math.min(Math.max((innerHeight - 460) / 3, 175), 260), // three below one another fit most screens
      bothSignals: [
        { label: "target", colour: "target" },
        { label: "measured", colour: "measured" },
      ],
      host: (name) => find(`[data-chart="${name}"]`),
      place: ({ u }) => Math.max(Math.round(u.bbox.width / devicePixelRatio), 100),
      /* The label of an axis with the unit of the chosen actuator, where the layout names one. */
      inUnit: (words) => () => {
        const unit = (hello.units || [])[run.state.focus];
        return unit ? `${words} (${unit})` : words;
      },
      focus,
      redraw,
    };
    const { state, panels } = run;
    let row = null;

    write(text("source"), `rthstrack monitor · ${hello.source}`);
    write(
      text("facts"),
      [
        `${Charts.short(hello.rate_hz)} Hz`,
        `window ${Charts.short(hello.window_s)} s`,
        `${Charts.short(hello.update_hz)} readings a second`,
        String(hello.estimator).replaceAll("_", " "),
        hello.band_hz ? `${hello.band_hz.map(Charts.short).join(" to ")} Hz` : null,
        hello.latency_s ? `${Charts.short(1e3 * hello.latency_s)} ms through the filter` : null,
      ]
        .filter(Boolean)
        .join(" · "),
    );

    for (const [name, make] of Object.entries(Panels)) panels[name] = make(run);

    choice(
      "which",
      n > 1
        ? [
            [true, "all"],
            [false, "the chosen one"],
          ]
        : [],
      state.all,
      (all) => {
        state.all = all;
        panels.moving.curves();
      },
    );
    choice(
      "span",
      [
        [30, "30 s"],
        [120, "2 min"],
        [600, "10 min"],
        [Infinity, "all kept"],
      ],
      state.span,
      (span) => {
        state.span = span;
        panels.moving.follow();
      },
    );
    const spans = [...new Set([2, 4, hello.window_s])].sort((a, b) => a - b);
    const spanWords = (s) => (s === hello.window_s ? `window, ${Charts.short(s)} s` : `${s} s`);
    choice(
      "scope",
      spans.map((s) => [s, spanWords(s)]),
      state.scope,
      (scope) => {
        state.scope = scope;
        redraw();
      },
    );
    choice(
      "scale",
      [
        [true, "logarithmic"],
        [false, "linear"],
      ],
      true,
      (log) => {
        state.log = log;
        run.host("spectrum-log").parentElement.hidden = !log;
        run.host("spectrum-linear").parentElement.hidden = log;
        redraw();
      },
    );

    function focus(a) {
      state.focus = a;
      panels.cards.mark(a);
      for (const node of document.querySelectorAll(".whose")) write(node, n > 1 ? run.names[a] : "");
      panels.moving.curves();
    }

    // ---------------------------------------------------------------------------------------------- drawing

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
      if (all || turn % 2 === 0 || panels.moving.isFast()) panels.moving.draw();
      if (all || turn % 2 === 0) panels.signals.drawScope();
      if (all || turn % 2 === 1) panels.signals.drawLoop();
      if (all || spectrumIsNew) panels.spectrum.draw();
      [all, spectrumIsNew] = [false, false];
      cost = 0.8 * cost + 0.2 * (performance.now() - start);
      root.dataset.frames = String(Number(root.dataset.frames || 0) + 1);
      root.dataset.cost = cost.toFixed(1);
    }
    let spectrumIsNew = false;

    function writeAll() {
      write(text("time"), run.frame.time_s == null ? DASH : `t = ${seconds(run.frame.time_s)}`);
      for (let a = 0; a < n; a++) panels.cards.write(a);
      panels.health.write();
    }

    // ---------------------------------------------------------------------------------------------- what comes in

    function addReading([index, time, centre, actuator, A, d, phase, f, aLow, aHigh, dLow, dHigh, valid, reason]) {
      if (!(actuator >= 0 && actuator < run.n)) return;
      if (index !== row) {
        const last = run.history.last();
        if (last != null && time - last > 0.5 + 4 / run.hello.update_hz) leaveGap(last);
        run.history.begin(time);
        row = index;
      }
      const milli = (value) => (value == null ? null : 1e3 * value);
      const shown = valid ? [A, milli(d), aLow, aHigh, milli(dLow), milli(dHigh)] : [];
      for (let k = 0; k < COLUMNS; k++) run.history.put(COLUMNS * actuator + k, shown[k] ?? null);
      run.latest[actuator] = {
        amplitude: A,
        delay: d,
        phase,
        frequency: f,
        centre,
        valid,
        reason,
        amplitudeLow: aLow,
        amplitudeHigh: aHigh,
        delayLow: dLow,
        delayHigh: dHigh,
      };
    }

    /* So that no line is drawn across a time of which nothing is known. */
    function leaveGap(time) {
      run.history.begin(time);
      for (let c = 0; c < COLUMNS * run.n; c++) run.history.put(c, null);
    }

    function forget() {
      run.history.clear();
      run.kept.clear();
      row = null;
      panels.moving.follow();
    }

    let writtenAt = 0;
    function take(frame) {
      run.frame = frame;
      for (const reading of frame.readings) addReading(reading);
      if (frame.scope) run.kept.add(frame.scope);
      if (frame.spectrum) [run.spectrum, spectrumIsNew] = [frame.spectrum, true];
      if (frame.events.length) panels.alarms.addEvents(frame.events);
      run.alarms = frame.alarms.filter((alarm) => alarm.active || alarm.latched);
      const now = performance.now();
      if (now - writtenAt > WRITE_MS) {
        writtenAt = now;
        writeAll();
      }
      want();
    }

    focus(0);
    return {
      take,
      writeAlarms: (trouble) => panels.alarms.write(trouble),
      forget() {
        forget();
        run.latest.fill(null);
        panels.alarms.forget();
      },
      alarmed: () => run.alarms.some((alarm) => alarm.active),
      frame: () => run.frame,
      catchUp: () => {
        if (run.frame) writeAll();
      },
    };
  }

  return { build };
})();
