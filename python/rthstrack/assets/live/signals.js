"use strict";
/* The chosen actuator's last samples: over time, and measured over target. */
(() => {
  const { steady } = Page;

  Panels.signals = (run) => {
    const { state } = run;
    const scopeAxis = {
      x: { label: "Time (s)", name: "t", unit: "s" },
      y: { label: run.inUnit("Displacement"), fixed: [-1, 1] },
    };
    const scope = { ...scopeAxis, height: run.height, data: [[], [], []], series: run.bothSignals };
    scope.u = Charts.lines(run.host("scope"), scope).u;
    const loop = Charts.loop(run.host("loop"), {
      x: { label: run.inUnit("Target") },
      y: { label: run.inUnit("Measured") },
      data: [[0], [0]],
      size: 330,
    });

    function drawScope() {
      if (run.kept.end_s == null) return;
      const [target, measured] = ["target", "measured"].map((name) => run.kept.take(name, state.focus, state.scope));
      const first = run.kept.n - target.length;
      const start = run.kept.end_s - (target.length - 1) / run.kept.rate_hz;
      scope.y.fixed = scope.range = steady(scope.range, ...Kept.extremes(target, measured), 0);
      const stride = Math.ceil(target.length / (2 * run.place(scope)));
      const times = (places) => places.map((k) => start + k / run.kept.rate_hz);
      if (stride <= 2) {
        scope.data = [times(Float64Array.from(target, (_, k) => k)), plain(target), plain(measured)];
      } else {
        const [[at, low], [, high]] = [target, measured].map((values) => Kept.thinned(values, stride, first));
        scope.data = [times(at), low, high];
      }
      scope.u.batch(() => {
        scope.u.setData(scope.data, false);
        scope.u.setScale("x", { min: run.kept.end_s - state.scope, max: run.kept.end_s });
      });
    }

    const plain = (values) => Array.from(values, (v) => (Number.isFinite(v) ? v : null));

    function drawLoop() {
      if (run.kept.end_s == null) return;
      const [target, measured] = ["target", "measured"].map((name) => run.kept.take(name, state.focus, state.scope));
      loop.range = steady(loop.range, ...Kept.extremes(target, measured), 0);
      const [min, max] = loop.range;
      loop.u.batch(() => {
        loop.u.setData([null, [target, measured]], false);
        loop.u.setScale("x", { min, max });
        loop.u.setScale("y", { min, max });
      });
    }

    return { drawScope, drawLoop };
  };
})();
