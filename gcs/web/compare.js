/* The page of gcs compare: the flights together in the scene and in plots. Time is counted from the `begin` of each. */
(function () {
  "use strict";
  const byId = (id) => document.getElementById(id);
  const STEP_S = 0.02, MOST_ROWS = 12000;

  const colourOf = (i) => Plumbline.Theme.palette.lines[(i + 1) % 7];

  /** Values at the times of a grid, linearly interpolated; NaN next to unknown values. */
  function resampled(flight, values, grid) {
    const time = flight.time, found = new Float64Array(grid.length).fill(NaN);
    if (!values) return found;
    grid.forEach((at, k) => {
      const t = at + flight.begin;
      if (t < time[0] || t > time[time.length - 1]) return;
      const i = Plumbline.indexAt(time, t), next = Math.min(i + 1, time.length - 1);
      const share = next === i ? 0 : (t - time[i]) / (time[next] - time[i]);
      found[k] = share === 0 ? values[i] : values[i] + share * (values[next] - values[i]);
    });
    return found;
  }

  function gridOf(flights) {
    const from = Math.min(...flights.map((flight) => flight.span[0] - flight.begin));
    const to = Math.max(...flights.map((flight) => flight.span[1] - flight.begin));
    const step = Math.max(STEP_S, (to - from) / MOST_ROWS);
    return Float64Array.from({ length: Math.ceil((to - from) / step) + 1 }, (_, i) => from + i * step);
  }

  const swing = (flight) => {
    const q = flight.vector("cable"), attached = flight.column("attached"), taut = flight.column("taut");
    return q && q[0].map((_, i) => (
      attached[i] && taut[i] ? (Math.atan2(Math.hypot(q[0][i], q[1][i]), -q[2][i]) * 180) / Math.PI : NaN));
  };
  const tilt = (flight) => {
    const x = flight.column("quat_x"), y = flight.column("quat_y");
    return x && y && x.map((_, i) => (Math.acos(Math.min(Math.max(1 - 2 * (x[i] ** 2 + y[i] ** 2), -1), 1)) * 180) / Math.PI);
  };

  function plots(flights, grid) {
    const axis = (k) => (flight) => flight.error && flight.error[k];
    const millimetres = (values) => values && values.map((value) => 1000 * value);
    const kinds = [
      ["Load error", "mm", (flight) => millimetres(flight.distance), 2],
      ["Load error along x", "mm", (flight) => millimetres(axis(0)(flight)), 2],
      ["Load error along y", "mm", (flight) => millimetres(axis(1)(flight)), 2],
      ["Load error along z", "mm", (flight) => millimetres(axis(2)(flight)), 2],
      ["Cable tension", "N", (flight) => flight.column("tension"), 2],
      ["Cable swing", "°", swing, 1],
      ["Vehicle tilt", "°", tilt, 1],
      ["Force of rotor 1", "N", (flight) => flight.column("rotor_1"), 2],
    ];
    return kinds.map(([title, unit, of, digits]) => ({
      title, unit, digits, least: 0.1, time: grid,
      series: flights.map((flight, i) => ({ name: flight.label, about: flight.name, values: resampled(flight, of(flight), grid), color: i + 1 })),
    }));
  }

  function paint() {
    for (const head of document.querySelectorAll(".run")) {
      head.querySelector("i").style.background = colourOf(Number(head.dataset.run));
    }
  }

  function draw(stage, flights) {
    let id = 0;
    flights.forEach((flight, i) => {
      for (const track of flight.tracks()) {
        stage.scene.setTrack({ flown: track.flown, asked: i === 0 ? track.asked : [], colour: colourOf(i) }, (id += 1));
      }
    });
  }

  async function main() {
    const values = JSON.parse(byId("flight-data").textContent);
    const flights = await Promise.all(values.map((one) => Plumbline.Flight.load(one)));
    let stage = null;
    try {
      stage = new Plumbline.Stage(byId("stage"), flights[0].layout);
    } catch (error) {
      byId("stage").hidden = true; // no WebGL: only the plots and the tables are shown
      byId("no-scene").hidden = false;
    }
    byId("explore").hidden = false;
    paint();
    const grid = gridOf(flights), first = flights[0];
    const phasesOf = (flight) => flight.phases.map(
      (phase) => ({ ...phase, from: phase.from - flight.begin, to: phase.to - flight.begin }));
    const bands = phasesOf(first);
    // the worst of all flights, at the time since its `begin`
    const farthest = flights.filter((flight) => flight.worst).sort((a, b) => b.worst.error_m - a.worst.error_m)[0];
    const worst = farthest && { time: farthest.worst.time - farthest.begin };
    const transport = new Plumbline.Transport(byId("transport"), {
      span: [grid[0], grid[grid.length - 1]], start: 0, bands, marks: [], worst });
    const group = new Plumbline.ChartGroup();
    group.setBands(bands);
    for (const options of plots(flights, grid)) {
      const card = byId("plots").appendChild(document.createElement("div"));
      card.className = "card";
      new Plumbline.Chart(card, Object.assign({ sync: group, height: 150 }, options));
    }
    const show = (t) => {
      if (!stage) return;
      const found = flights.map((flight) => flight.at(t + flight.begin));
      const vehicles = found.flatMap(({ vehicle }, i) => (
        vehicle ? [{ ...vehicle, id: i + 1, colour: colourOf(i), asked: i === 0 ? vehicle.asked : null }] : []));
      stage.show({ time: t, vehicles, wind: null });
      stage.readings(found.map(({ readings }, i) => [
        flights[i].label, Number.isFinite(readings.error) ? `${(1000 * readings.error).toFixed(1)} mm` : "–", colourOf(i)]), first.phaseAt(t + first.begin));
    };
    transport.onTime((t) => { show(t); group.setTime(t); });
    group.onHover((t) => { if (!transport.playing) show(t === null ? transport.time : t); });
    group.onPick((t) => transport.set(t, true));
    byId("whole").addEventListener("click", () => group.reset());
    // the missions of all flights: the first may have ended early
    const missions = flights.flatMap(phasesOf).filter((phase) => phase.kind === "busy");
    if (missions.length) {
      group.zoom(Math.min(...missions.map((one) => one.from)) - 0.5, Math.max(...missions.map((one) => one.to)) + 0.5);
    }
    if (stage) {
      draw(stage, flights);
      stage.fit(flights.flatMap((flight) => flight.corners()));
      Plumbline.Theme.onChange(() => { draw(stage, flights); paint(); show(transport.time); });
    }
    transport.set(worst ? worst.time : 0);
    window.replay = { flights, stage, transport, group };
    document.documentElement.dataset.ready = "1";
  }

  main();
})();
