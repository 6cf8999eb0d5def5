/* report.html: scene, time line, plots and lists, all at one time of the flight. */
(function () {
  "use strict";
  const FAR_M = 5;
  const byId = (id) => document.getElementById(id);
  const text = (value, digits, unit) => (Number.isFinite(value) ? `${value.toFixed(digits)} ${unit}` : "–");
  const length = (value) => (value >= 1 ? text(value, 2, "m") : text(1000 * value, 1, "mm"));

  function list(host, rows, choose) {
    return rows.map((row) => {
      const button = host.appendChild(document.createElement("button"));
      button.type = "button";
      const time = button.appendChild(document.createElement("span"));
      time.className = "time";
      time.textContent = row.time === null ? "–" : `${row.time.toFixed(2)} s`;
      const words = button.appendChild(document.createElement("span"));
      words.textContent = row.text;
      if (row.tone) { words.className = "loud"; words.prepend(`${row.level}: `); }
      if (row.time === null) button.disabled = true; else button.addEventListener("click", () => choose(row.time));
      return { time: row.time, button };
    });
  }

  /** Shows in place of a plot why there is none. */
  function showAbsent(card, { title, absent }) {
    const name = card.appendChild(document.createElement("b"));
    name.className = "chart-title";
    name.textContent = title;
    card.append(`: ${absent}.`);
  }

  /** Marks the last row that has begun at time t. */
  function mark(rows, t) {
    const begun = rows.filter((row) => row.time !== null && row.time <= t + 1e-9);
    const now = begun.length ? begun.reduce((a, b) => (b.time >= a.time ? b : a)) : null;
    for (const row of rows) row.button.setAttribute("aria-current", String(row === now));
  }

  function startOf(flight) {
    const off = flight.phases.find((phase) => phase.kind !== "none");
    return off ? Math.max(off.from - 1, flight.span[0]) : flight.span[0];
  }

  function showTracks(stage, flight) {
    flight.tracks().forEach((track, i) => stage.scene.setTrack(track, i + 1));
    stage.fit(flight.corners());
  }

  /** Whether a flight leads so far that the load would be too small to see in a picture of the whole. */
  function leadsFar(flight) {
    const [low, high] = flight.corners();
    return Boolean(low) && Math.hypot(...low.map((value, axis) => high[axis] - value)) > FAR_M;
  }

  async function main() {
    const flight = await Plumbline.Flight.load(JSON.parse(byId("flight-data").textContent));
    let stage = null;
    try {
      stage = flight.source && new Plumbline.Stage(byId("stage"), flight.layout);
    } catch (error) {
      byId("no-scene").hidden = false; // no WebGL: the still picture and the plots remain
    }
    if (!flight.source && !flight.texts.length) return;
    byId("explore").hidden = false;
    document.documentElement.classList.toggle("staged", Boolean(stage));
    byId("stage").hidden = !stage;

    const marks = flight.texts.map((one) => ({ time: one.time, level: one.tone, text: one.text }));
    const transport = new Plumbline.Transport(byId("transport"), {
      span: flight.span, start: startOf(flight), marks, worst: flight.worst,
      bands: [...flight.phases, ...flight.gaps.map((gap) => ({ ...gap, name: "no telemetry", kind: "gap" }))] });
    const group = new Plumbline.ChartGroup();
    group.setBands(flight.phases);
    group.setMarks(marks);
    for (const options of Plumbline.plotsOf(flight)) {
      const card = byId("plots").appendChild(document.createElement("div"));
      card.className = "card";
      if (options.absent) showAbsent(card, options);
      else new Plumbline.Chart(card, Object.assign({ time: flight.time, sync: group, height: 158 }, options));
    }
    const texts = list(byId("texts"), flight.texts, (t) => transport.set(t, true));
    const steps = list(byId("steps"), flight.steps, (t) => transport.set(t, true));

    const show = (t) => {
      const { known, vehicle, readings } = flight.at(t);
      if (!stage) return;
      const wind = flight.windAt(t);
      stage.show({ time: t, vehicles: vehicle ? [vehicle] : [], wind: wind && [wind[1], wind[0], -wind[2]] });
      stage.readings([
        ["load error", length(readings.error)], ["tension", text(readings.tension, 2, "N")],
        ["swing", text(readings.swing, 1, "°")], ["tilt", text(readings.tilt, 1, "°")],
        ["speed", text(readings.speed, 2, "m/s")], ["rotors", text(100 * readings.rotors, 0, "%")],
      ], flight.phaseAt(t));
      stage.note(!known ? "no telemetry at this time" : readings.attached === false ? "load released" : readings.taut ? "" : "cable slack");
    };
    transport.onTime((t) => {
      show(t);
      group.setTime(t);
      mark(texts, t);
      mark(steps, t);
    });
    // while the pointer is over a plot, the scene shows the time under it, unless it plays
    group.onHover((t) => { if (!transport.playing) show(t === null ? transport.time : t); });
    group.onPick((t) => transport.set(t, true));
    byId("whole").addEventListener("click", () => group.reset());
    const near = byId("near");
    const mission = flight.phases.filter((phase) => phase.kind === "busy");
    near.hidden = !mission.length;
    near.addEventListener("click", () => group.zoom(mission[0].from - 0.5, mission[mission.length - 1].to + 0.5));
    for (const jump of document.querySelectorAll("button[data-time]")) {
      jump.addEventListener("click", () => {
        transport.set(Number(jump.dataset.time), true);
        byId("stage").scrollIntoView({ block: "nearest", behavior: "smooth" });
      });
    }
    if (mission.length) near.click();
    if (stage) showTracks(stage, flight);
    transport.set(flight.worst ? flight.worst.time : startOf(flight));
    if (stage && leadsFar(flight)) stage.camera("follow");
    window.replay = { flight, stage, transport, group };
    document.documentElement.dataset.ready = "1";
  }

  main();
})();
