/* The plots of a flight: Plumbline.plotsOf(flight) gives options of Plumbline.Chart. Those without data are left out; of
   the first one, `absent` says why there is none. */
(function () {
  "use strict";
  const Plumbline = (window.Plumbline = window.Plumbline || {});
  const AXES = ["x", "y", "z"];
  const METRE = 1; // errors from this size on are shown in metres

  const greatest = (vector) => {
    let most = 0;
    for (const values of vector) for (const value of values) if (Math.abs(value) > most) most = Math.abs(value);
    return most;
  };
  const scaled = (vector, factor) => vector && vector.map((values) => values.map((value) => factor * value));
  const columns = (flight, name, parts) => {
    const found = parts.map((part) => flight.column(`${name}_${part}`));
    return found.some((values) => values === null) ? null : found;
  };
  const lines = (names, vector, more) => (vector || []).map((values, i) => Object.assign({ name: names[i], values, color: i }, more));

  /** Options of a plot of lengths that are small in a good flight: in millimetres, or in metres if they are large. */
  function lengths(title, vector, names, digits, norm) {
    if (!vector) return null;
    const large = greatest(vector) >= METRE, factor = large ? 1 : 1000;
    const series = lines(names, scaled(vector, factor));
    if (norm) series.unshift({ name: "distance", values: norm.map((value) => factor * value), color: "ink", width: 2 });
    return { title, unit: large ? "m" : "mm", series, digits: large ? 3 : digits, least: large ? 0.1 : 1, zero: true };
  }

  function position(flight) {
    const load = flight.vector("load"), asked = flight.vector("asked");
    if (!load) return null;
    return { title: "Load position", unit: asked ? "m, dashed: asked" : "m", digits: 3, least: 0.1,
      series: [...lines(AXES, load), ...lines(AXES, asked, { dash: true, color: "faint", quiet: true })] };
  }

  function velocity(flight) {
    const speed = flight.vector("velocity"), asked = flight.vector("asked_velocity");
    if (!speed) return null;
    return { title: "Load velocity", unit: asked ? "m/s, dashed: asked" : "m/s", digits: 2, least: 0.1,
      series: [...lines(AXES, speed), ...lines(AXES, asked, { dash: true, color: "faint", quiet: true })] };
  }

  function rotors(flight, name, title) {
    const names = flight.rotors.map(String);
    const forces = columns(flight, name, names);
    if (!forces) return null;
    const series = lines(names, forces, { width: 1.1 });
    [1, 2, 0].forEach((colour, i) => { series[i].color = colour; });
    const limits = flight.limits_n || [];
    limits.forEach((limit, i) => series.push({ name: i ? "greatest" : "least", dash: true, color: "faint", quiet: true,
      values: flight.time.map((_, k) => (Number.isFinite(forces[0][k]) ? limit : NaN)) }));
    return { title, unit: limits.length ? "N, dashed: limits" : "N", digits: 2, least: 0.1, series };
  }

  function angles(title, vector, names) {
    return vector && { title, unit: "°", digits: 1, least: 1, series: lines(names, vector) };
  }

  function single(flight, name, title, unit, digits, color, more) {
    const values = flight.column(name);
    return values && Object.assign({ title, unit, digits, series: [{ name, values, color }] }, more);
  }

  function wind(flight) {
    if (!flight.wind.length) return null;
    const rows = Array.from(flight.time, (t) => flight.windAt(t));
    return { title: "Wind", unit: "m/s", digits: 1, least: 1,
      series: lines(["east", "north", "up"], [0, 1, 2].map((axis) => rows.map((row) => (row ? row[axis] : NaN)))) };
  }

  Plumbline.plotsOf = function (flight) {
    const psi = [["Ψ_R", "psi_R"], ["Ψ_q", "psi_q"]].filter(([, name]) => flight.column(name));
    return [
      lengths("Load error", flight.error, AXES, 2, flight.distance)
        || (flight.no_error ? { title: "Load error", absent: flight.no_error } : null),
      position(flight),
      single(flight, "tension", "Cable tension", "N", 2, 3, { least: 0.1, zero: true }),
      rotors(flight, "rotor", "Rotor forces"),
      velocity(flight),
      lengths("Error of the estimate (load)", flight.difference("believed", "load"), AXES, 2),
      angles("Cable from vertical", flight.cableAngles(), ["φ towards y", "θ towards −x"]),
      angles("Vehicle attitude", flight.angles(), ["roll", "pitch", "yaw"]),
      rotors(flight, "command", "Rotor commands"),
      psi.length ? { title: "Error functions of the cascade", digits: null, zero: true,
        series: lines(psi.map(([name]) => name), psi.map(([, name]) => flight.column(name))) } : null,
      single(flight, "voltage", "Battery voltage", "V", 2, 1, { least: 0.1 }),
      single(flight, "charge", "Battery charge", "% of the full battery", 0, 2, { least: 1, zero: true }),
      wind(flight),
    ].filter(Boolean);
  };
})();
