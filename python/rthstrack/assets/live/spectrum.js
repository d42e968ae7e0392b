"use strict";
/* The chosen actuator's amplitude spectra, on a logarithmic or a linear axis. */
(() => {
  const { steady } = Page;

  Panels.spectrum = (run) => {
    const { state } = run;
    const spectra = [true, false].map((log) => {
      const group = Charts.group({
        extent: [0, run.hello.rate_hz / 2],
        home: run.hello.band_hz || [0, run.hello.rate_hz / 2],
      });
      const figure = run.host(log ? "spectrum-log" : "spectrum-linear");
      const options = {
        x: { label: "Frequency (Hz)", name: "f", unit: "Hz", group },
        y: { label: run.inUnit("Amplitude"), log, decades: 5, zero: !log },
        height: run.height + 30,
        data: [[], [], []],
        series: run.bothSignals,
      };
      return { u: Charts.lines(figure, options).u, group, log, free: true };
    });
    for (const one of spectra) {
      one.group.reset = () => {
        one.free = true;
        one.group.set(...one.group.home);
      };
      one.group.onChange(() => {
        if (!one.placing) one.free = false;
      });
    }

    function drawSpectrum() {
      if (!run.spectrum || !run.spectrum.frequency_hz.length) return;
      const one = spectra[state.log ? 0 : 1];
      const f = run.spectrum.frequency_hz;
      const [target, measured] = [run.spectrum.target[state.focus], run.spectrum.measured[state.focus]];
      const top = f[f.length - 1];
      one.group.extent = [0, top];
      // First what moves: up to twice the highest frequency with a thousandth of the peak.
      const peak = Math.max(Kept.extremes(target)[1], Kept.extremes(measured)[1]);
      let k = f.length - 1;
      while (k > 1 && !(target[k] > 1e-3 * peak)) k--;
      one.reach = steady(one.reach && [0, one.reach], 0, 2 * f[k], f[1] * 8)[1];
      const [from, to] = run.hello.band_hz || [0, one.reach];
      one.group.home = [from, Math.min(to, top)];
      const clean = (values) => Array.from(values, (v) => (v != null && (v > 0 || !one.log) ? v : null));
      one.u.setData([f, clean(target), clean(measured)], false);
      one.placing = true;
      if (one.free) one.group.set(...one.group.home);
      one.u.setScale("x", { min: one.group.min, max: one.group.max });
      one.placing = false;
    }

    return { draw: drawSpectrum };
  };
})();
