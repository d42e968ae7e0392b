"use strict";
/* What every part of the live page uses: its nodes, how numbers are written, buttons. Every text goes to textContent: a name is
 * never read as markup. */
const Page = (() => {
  const OWN = ["value", "error", "second", "third"]; // colours of the actuators, names of charts.css

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

  // ------------------------------------------------------------------------------------------------ buttons

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

  return {
    OWN,
    root,
    find,
    text,
    element,
    write,
    DASH,
    fixed,
    seconds,
    gain,
    millis,
    count,
    between,
    age,
    nice,
    steady,
    choice,
  };
})();

/* The parts of one run, by name: each is made once, from what the run is (see run.js). */
const Panels = {};
