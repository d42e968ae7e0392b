"use strict";
/* What the live page keeps of the last half hour, and how it is thinned for drawing. */
const Kept = (() => {
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
      begin,
      put,
      take,
      clear: () => {
        n = 0;
      },
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
      const joins =
        self.end_s != null &&
        self.rate_hz === block.rate_hz &&
        Math.abs((start - self.end_s) * block.rate_hz - 1) < 0.5;
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
    const push = (k, v) => {
      at.push(k);
      kept.push(Number.isFinite(v) ? v : null);
    };
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

  return { ladder, samples, extremes, thinned };
})();
