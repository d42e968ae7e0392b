"use strict";
/* Alarms with what is wrong with the connection, and the events. */
(() => {
  const { find, element, write, seconds } = Page;
  const MOST_EVENTS = 200;
  const LATCHED = "latched — advisory — reset at the terminal or by control datagram";

  Panels.alarms = (run) => {
    const { names, limits } = run;
    let shownAlarms = null;

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
      const lasting = run.alarms.map((a) => [a.name, a.actuator, a.active, a.latched, a.text]);
      const shown = JSON.stringify([lasting, trouble && trouble.kind]);
      if (shown === shownAlarms) {
        if (trouble) write(find(".alerts").firstElementChild, trouble.words);
        return;
      }
      shownAlarms = shown;
      const lines = trouble ? [element("li", trouble.kind, trouble.words)] : [];
      const active = run.alarms.filter((alarm) => alarm.active).length;
      const howMany = `${active} alarms are active, ${run.alarms.length - active} latched.`;
      if (run.alarms.length > 6) lines.push(element("li", "count", howMany));
      const order = [...run.alarms].sort((a, b) => Number(b.active) - Number(a.active));
      const called = ({ name, actuator }) =>
        `${run.kinds.get(name)?.title ?? name}${actuator == null ? "" : ` · ${names[actuator] ?? ""}`}`;
      for (const alarm of order) {
        const line = element("li", alarm.active ? "active" : "latched");
        line.append(element("strong", "", called(alarm)));
        line.append(element("span", "words", alarm.text));
        const since = alarm.since_s == null ? "" : `since t = ${seconds(alarm.since_s)}`;
        line.append(element("span", "note", alarm.active ? since : LATCHED));
        lines.push(line);
      }
      const watched = [...run.kinds.values()].some(
        ({ quantity, limit }) => ["amplitude", "delay"].includes(quantity) && limits[limit] != null,
      );
      const calm = watched ? "No alarm." : "No alarm. No limit is set for amplitude or delay.";
      if (!lines.length) lines.push(element("li", "calm", calm));
      find(".alerts").replaceChildren(...lines);
      // Which alarms there are is spoken; their numbers, which go on changing, are not.
      const spoken = order.map((alarm) => `${alarm.active ? "Alarm" : "Latched"}: ${called(alarm)}.`);
      write(find(".spoken"), run.alarms.length > 6 ? howMany : spoken.join(" "));
      run.panels.moving.mark();
    }

    return { write: writeAlarms, addEvents, forget: () => find(".events").replaceChildren() };
  };
})();
