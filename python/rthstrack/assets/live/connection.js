"use strict";
/* The connection to the monitor: its events go to the run; what is wrong with it is told. */
(() => {
  const { root, find, text, element, write, seconds, age } = Page;
  const LOST_MS = 1500;
  const FULL = "Not connected: as many browsers as may are watching already; close one of them.";

  let [run, told, runName, lastFrame, refused, since] = [null, null, null, null, null, performance.now()];

  const STATES = {
    connecting: "Connecting",
    running: "Running",
    waiting: "Waiting",
    silent: "Silent",
    lost: "Lost connection",
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
      run = Run.build(JSON.parse(event.data));
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
