"use strict";
/* What came in: counts, pace, age, log. */
(() => {
  const { find, element, write, DASH, fixed, count, age } = Page;

  Panels.health = (run) => {
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
      const h = run.frame.health;
      const some = (value) => (value ? "odd" : "");
      healthRow("received", count(h.received));
      healthRow(
        "lost",
        count(h.lost),
        run.alarms.some((a) => a.active && run.isAbout(a, "lost")) ? "bad" : some(h.lost),
      );
      healthRow("repeated", count(h.repeated), some(h.repeated));
      healthRow("reordered", count(h.reordered), some(h.reordered));
      healthRow("malformed", count(h.malformed), some(h.malformed));
      healthRow("refused", count(h.refused), some(h.refused));
      healthRow("filled", count(h.filled), some(h.filled));
      healthRow("restarts", count(h.restarts), some(h.restarts));
      const off = h.pace_hz != null && Math.abs(h.pace_hz / run.hello.rate_hz - 1) > 0.05;
      const pace = h.pace_hz == null ? DASH : `${fixed(h.pace_hz, 1)} of ${Charts.short(run.hello.rate_hz)} Hz`;
      healthRow("pace", pace, off ? "odd" : "");
      healthRow(
        "last sample",
        h.age_s == null ? DASH : `${age(h.age_s)} ago`,
        run.frame.state === "silent" ? "bad" : "",
      );
      healthRow("readings", count(h.readings));
      healthRow("log", h.log ?? "none", h.log_code === "stopped" ? "bad" : "");
      healthRow("not logged", count(h.log_dropped), h.log_dropped ? "bad" : "");
      for (const [name, words] of [
        ["unsent", "not sent"],
        ["not_written", "not written"],
      ]) {
        if (h[name]) healthRow(words, count(h[name]), "bad");
      }
    }

    return { write: writeHealth };
  };
})();
