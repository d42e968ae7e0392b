"use strict";
/* A card an actuator: its latest reading, whether it is valid, and what alarms say. One is chosen. */
(() => {
  const { OWN, find, element, write, DASH, fixed, gain, millis, between } = Page;

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

  Panels.cards = (run) => {
    const { n, names } = run;
    const cards = names.map((name, a) => card(name, a, (chosen) => run.focus(chosen)));
    find(".cards").replaceChildren(...cards.map(({ host }) => host));
    cards.forEach(({ host }, a) =>
      host.addEventListener("keydown", (event) => {
        const to = {
          ArrowRight: a + 1,
          ArrowDown: a + 1,
          ArrowLeft: a - 1,
          ArrowUp: a - 1,
          Home: 0,
          End: n - 1,
          " ": a,
          Enter: a,
        }[event.key];
        if (to === undefined) return;
        event.preventDefault();
        run.focus((to + n) % n);
        cards[run.state.focus].host.focus();
      }),
    );

    function mark(a) {
      cards.forEach(({ host }, k) => {
        host.setAttribute("aria-checked", String(k === a));
        host.tabIndex = k === a ? 0 : -1;
      });
    }

    function writeCard(a) {
      const { host, verdict, amplitude, delay, reason } = cards[a];
      const one = run.latest[a];
      const mine = run.alarms.filter((alarm) => alarm.actuator === a);
      for (const [name, { group }] of [
        ["amplitude", amplitude],
        ["delay", delay],
      ]) {
        const about = mine.filter((alarm) => run.isAbout(alarm, name));
        group.classList.toggle(
          "over",
          about.some((alarm) => alarm.active),
        );
        group.classList.toggle(
          "after",
          about.some((alarm) => !alarm.active),
        );
      }
      const worst = mine.some((alarm) => alarm.active) ? "alarm" : mine.length ? "latched" : "";
      const valid = Boolean(one && one.valid);
      host.classList.toggle("invalid", one != null && !valid);
      write(verdict, worst || (one == null ? "no reading yet" : valid ? "valid" : "not valid"));
      verdict.className = `verdict${worst ? " alarm" : valid ? "" : " not"}`;
      if (one == null) return;
      write(amplitude.value, gain(one.amplitude));
      write(delay.value, millis(one.delay));
      write(amplitude.interval, between(one.amplitudeLow, one.amplitudeHigh, gain));
      write(delay.interval, between(one.delayLow, one.delayHigh, millis));
      const words =
        one.reason ||
        [
          one.frequency == null ? null : `at ${fixed(one.frequency, 2)} Hz`,
          one.phase == null ? null : `phase ${fixed((180 / Math.PI) * one.phase, 1)}°`,
        ]
          .filter(Boolean)
          .join(", ");
      write(reason, words);
      if (reason.title !== words) reason.title = words;
    }

    return { mark, write: writeCard };
  };
})();
