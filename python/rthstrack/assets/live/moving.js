"use strict";
/* Gain and delay over time with their intervals, limits and alarms; the view rolls until somebody moves it. */
(() => {
  const { OWN, find, steady } = Page;
  const DASHES = [undefined, [8, 3], [3, 3], [8, 3, 2, 3]];

  Panels.moving = (run) => {
    const { n, names, limits, state } = run;
    const COLUMNS = run.columns;
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
        height: axisLabel ? run.height : run.height - 18,
        data: [times, ...[...wanted, ...edges].map(({ out }) => out)],
        references: [{ value: ideal }],
        limits: [...over],
        series: [
          ...names.map((words, a) => ({
            label: words,
            colour: OWN[a % OWN.length],
            width: 1.5,
            dash: DASHES[Math.floor(a / OWN.length) % DASHES.length],
          })),
          ...edges.map(() => ({ label: "interval", colour: "interval", width: 0.5, silent: true })),
        ],
        intervals: [[n + 1, n + 2]],
      };
      const { u } = Charts.lines(run.host(name), options);
      return { u, options, wanted, edges, times, ideal, least, name, limits: over };
    }
    const moving = [
      movingChart("amplitude", "Amplitude A (-)", undefined, "", 1, 0, 0.05, amplitudeLimits),
      movingChart("delay", "Delay d (ms)", "Time (s)", "ms", 0, 1, 2, delayLimits),
    ];

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
      run.redraw();
    }

    function curves() {
      for (const { u } of moving) {
        names.forEach((_, a) => {
          const shown = state.all || a === state.focus;
          u.series[a + 1].width = state.all && a === state.focus ? 2.5 : 1.5;
          if (u.series[a + 1].show !== shown) u.setSeries(a + 1, { show: shown });
        });
      }
      run.redraw();
    }

    function timeView() {
      const [first, last] = [run.history.first() ?? 0, run.history.last() ?? Math.min(state.span, 30)];
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
        const [low, high] = run.history.take(from, to, 3 * run.place(chart), times, [...shown, ...edges]);
        options.y.fixed = chart.range = steady(chart.range, ...withLimits(low, high, ideal, least, limits), least);
        options.limits = told(limits, options.y.fixed, ideal);
        options.shades = holes(times, wanted[state.focus].out);
        options.marks = run.alarms
          .filter((a) => run.isAbout(a, chart.name) && a.since_s != null && (state.all || a.actuator === state.focus))
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

    /* Whether one frame moves the curves by much of a pixel. */
    const isFast = () => (rolling.max - rolling.min) / run.place(moving[0]) < 0.1;

    /* Which of the two have an alarm. */
    function mark() {
      for (const { name } of moving) {
        run.host(name).parentElement.classList.toggle(
          "over",
          run.alarms.some((a) => a.active && run.isAbout(a, name)),
        );
      }
    }

    find(".follow").addEventListener("click", follow);
    return { draw: drawMoving, curves, follow, isFast, mark };
  };
})();
