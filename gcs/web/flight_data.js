/* A flight stored in its page (made by gcs/report/replay.py and packing.py): its samples as columns, and what the
   scene shows at any time.

   flight = await Plumbline.Flight.load(values)
   flight.time, flight.column(name)      Float64Array, NaN where nothing is known; column: null if there is none
   flight.vector(name)                   its columns name_x, name_y, name_z, or null
   flight.difference(a, b)               vector a - vector b, or null
   flight.at(t)                          {known, index, vehicle, readings}: for Scene.show, and numbers beside it
   flight.tracks()                       [{flown, asked, error}] for Scene.setTrack, one for each stretch without a gap */
(function () {
  "use strict";
  const Plumbline = (window.Plumbline = window.Plumbline || {});
  const MOST_POINTS = 4000; // of a drawn path

  const norm = (v) => Math.hypot(v[0], v[1], v[2]);
  const DEGREES = 180 / Math.PI;

  /** The columns of gcs/report/packing.py, by name. */
  async function unpack(packed) {
    const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    const n = packed.count, columns = {};
    packed.columns.forEach(({ name, step, gaps }, i) => {
      const values = new Float64Array(n), at = 4 * n * i;
      let rate = 0, whole = 0;
      for (let k = 0; k < n; k++) {
        rate = (rate + (planes[at + k] | (planes[at + n + k] << 8) | (planes[at + 2 * n + k] << 16) | (planes[at + 3 * n + k] << 24))) | 0;
        whole = (whole + rate) | 0;
        values[k] = whole * step;
      }
      for (const [from, to] of gaps) values.fill(NaN, from, to);
      columns[name] = values;
    });
    return columns;
  }

  class Flight {
    static async load(values) {
      return new Flight(values, await unpack(values.samples));
    }

    constructor(values, columns) {
      Object.assign(this, values); // span, phases, texts, steps, worst, no_error, wind, limits_n, source
      this.layout = values.vehicle;
      this._columns = columns;
      this.time = columns.time || new Float64Array(0);
      this._windTimes = values.wind.map((row) => row[0]);
      this.rotors = [];
      while (columns[`rotor_${this.rotors.length + 1}`]) this.rotors.push(this.rotors.length + 1);
      this._most = (values.limits_n && values.limits_n[1]) || values.vehicle.rotor_max_n || 1;
    }

    column(name) { return this._columns[name] || null; }

    vector(name) {
      const parts = ["x", "y", "z"].map((axis) => this.column(`${name}_${axis}`));
      return parts.some((part) => part === null) ? null : parts;
    }

    difference(a, b) {
      const from = this.vector(a), to = this.vector(b);
      return from && to && from.map((values, axis) => values.map((value, i) => value - to[axis][i]));
    }

    /** The lengths of the vectors. */
    static norms(vector) {
      return vector && vector[0].map((_, i) => norm([vector[0][i], vector[1][i], vector[2][i]]));
    }

    /** True minus requested load position; m. NaN where the path leads into the ground to find it. */
    get error() {
      if (this._error !== undefined) return this._error;
      this._error = this.difference("load", "asked");
      const height = this.column("asked_z"), least = this.layout.load_radius;
      if (this._error) this._error = this._error.map((values) => values.map((v, i) => (height[i] < least ? NaN : v)));
      return this._error;
    }

    /** Distance of the load from its requested position; m. */
    get distance() {
      return this._distance === undefined ? (this._distance = Flight.norms(this.error)) : this._distance;
    }

    /** A column interpolated between samples i and i + 1; NaN next to a gap. */
    _between(name, i, share) {
      const values = this.column(name);
      if (!values) return NaN;
      return share === 0 ? values[i] : values[i] + share * (values[i + 1] - values[i]);
    }

    _place(name, i, share) { // ENU to NED
      const [east, north, up] = ["x", "y", "z"].map((axis) => this._between(`${name}_${axis}`, i, share));
      return Number.isFinite(east + north + up) ? [north, east, -up] : null;
    }

    _attitude(i, share) {
      const parts = ["w", "x", "y", "z"].map((part) => this.column(`quat_${part}`));
      if (parts.some((part) => !part) || !parts.every((part) => Number.isFinite(part[i]))) return [1, 0, 0, 0];
      const a = parts.map((part) => part[i]);
      const b = share ? parts.map((part) => part[i + 1]) : a;
      const sign = a.reduce((sum, value, k) => sum + value * b[k], 0) < 0 ? -1 : 1;
      const mixed = a.map((value, k) => value + share * (sign * b[k] - value));
      const length = Math.hypot(...mixed);
      return mixed.map((value) => value / length);
    }

    windAt(t) { // [E, N, U] or null
      const i = this.wind.length ? Plumbline.indexAt(this._windTimes, t) : -1;
      return i < 0 || this.wind[i][0] > t ? null : this.wind[i].slice(1);
    }

    phaseAt(t) {
      const found = this.phases.find((phase) => t >= phase.from && t < phase.to);
      return found ? found.name : this.phases.length ? this.phases[this.phases.length - 1].name : "";
    }

    at(t) {
      const times = this.time, n = times.length;
      if (!n) return { known: false, index: -1, vehicle: null, readings: {} };
      const i = Plumbline.indexAt(times, t);
      const known = Number.isFinite(this.column("load_x")[i]);
      const next = i + 1 < n && Number.isFinite(this.column("load_x")[i + 1]) ? i + 1 : i;
      const share = next === i ? 0 : Math.min(Math.max((t - times[i]) / (times[next] - times[i]), 0), 1);
      // in a gap the vehicle is shown at its last known place
      const seen = known ? i : Math.max(i - 1, 0);
      const part = known ? share : 0;
      const load = this._place("load", seen, part), position = this._place("vehicle", seen, part);
      const attached = this._flag("attached", seen), taut = this._flag("taut", seen);
      const cable = ["x", "y", "z"].map((axis) => this._between(`cable_${axis}`, seen, 0));
      const attitude = this._attitude(seen, part);
      return {
        known, index: seen,
        vehicle: position && {
          id: 1, position, attitude,
          rotors: this.rotors.map((k) => this._between(`rotor_${k}`, seen, 0) / this._most),
          load: load && { position: load, attached },
          taut: attached && taut,
          asked: this._place("asked", seen, part),
        },
        readings: {
          error: this.distance ? this.distance[seen] : NaN,
          tension: attached ? this._between("tension", seen, 0) : NaN,
          swing: attached && taut ? Math.atan2(Math.hypot(cable[0], cable[1]), -cable[2]) * DEGREES : NaN,
          tilt: Math.acos(Math.min(Math.max(1 - 2 * (attitude[1] ** 2 + attitude[2] ** 2), -1), 1)) * DEGREES,
          speed: attached ? norm(["x", "y", "z"].map((axis) => this._between(`velocity_${axis}`, seen, 0))) : this._pace(seen),
          rotors: Math.max(...this.rotors.map((k) => this._between(`rotor_${k}`, seen, 0))) / this._most,
          attached, taut,
        },
      };
    }

    /** Speed of the vehicle, for flight without the load; m/s. */
    _pace(i) {
      const before = Math.max(i - 1, 0), after = Math.min(i + 1, this.time.length - 1);
      const way = ["x", "y", "z"].map((axis) => this.column(`vehicle_${axis}`)[after] - this.column(`vehicle_${axis}`)[before]);
      return norm(way) / (this.time[after] - this.time[before]);
    }

    _flag(name, i) {
      const values = this.column(name);
      return !values || values[i] !== 0;
    }

    /** [{from, to}] of the stretches without telemetry. */
    get gaps() {
      const known = this.column("load_x"), found = [];
      this.time.forEach((t, i) => {
        if (!known || Number.isFinite(known[i]) || i === 0 || i + 1 >= this.time.length) return;
        found.push({ from: this.time[i - 1], to: this.time[i + 1] });
      });
      return found;
    }

    /** Two opposite corners of the box in which the vehicle flew, in NED. */
    corners() {
      const found = [[], []];
      for (const [axis, sign] of [["y", 1], ["x", 1], ["z", -1]]) {
        const values = Array.from(this.column(`vehicle_${axis}`) || []).filter(Number.isFinite);
        found[0].push(sign * values.reduce((a, b) => Math.min(a, b), Infinity));
        found[1].push(sign * values.reduce((a, b) => Math.max(a, b), -Infinity));
      }
      return found.flat().every(Number.isFinite) ? found : [];
    }

    /** Paths of the load while it was carried and of the vehicle without it, in stretches without a gap. */
    tracks() {
      const n = this.time.length, every = Math.max(1, Math.ceil(n / MOST_POINTS)), found = [];
      const most = this.worst ? this.worst.error_m : Infinity; // a landing does not set the scale of the colours
      let open = null, kind = "";
      for (let i = 0; i < n; i++) {
        const attached = this._flag("attached", i);
        const now = Number.isFinite(this.column("load_x")[i]) ? (attached ? "load" : "vehicle") : "";
        if (now !== kind) open = null;
        kind = now;
        if (!now || (i % every && open)) continue;
        if (!open) found.push((open = { flown: [], asked: [], error: [] }));
        open.flown.push(...this._place(now, i, 0));
        const asked = this._place("asked", i, 0);
        if (asked) open.asked.push(...asked);
        open.error.push(attached && this.distance ? Math.min(this.distance[i], most) : NaN);
      }
      return found.map(({ flown, asked, error }) => ({
        flown: new Float32Array(flown), asked: new Float32Array(asked), error: new Float32Array(error),
      }));
    }
  }

  /** Roll, pitch and yaw in degrees as the report defines them (FLU in ENU), from the columns quat_* (FRD in NED). */
  Flight.prototype.angles = function () {
    const [a, b, c, d] = ["w", "x", "y", "z"].map((part) => this.column(`quat_${part}`));
    if (!a || !b || !c || !d) return null;
    const half = Math.SQRT1_2, found = [0, 1, 2].map(() => new Float64Array(a.length));
    for (let i = 0; i < a.length; i++) {
      const w = half * (a[i] + d[i]), x = half * (b[i] + c[i]), y = half * (b[i] - c[i]), z = half * (a[i] - d[i]);
      found[0][i] = Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) * DEGREES;
      found[1][i] = Math.asin(Math.min(Math.max(2 * (w * y - z * x), -1), 1)) * DEGREES;
      found[2][i] = Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) * DEGREES;
    }
    return found;
  };

  /** Cable angles phi_L and theta_L in degrees; NaN where the load is not on the cable. */
  Flight.prototype.cableAngles = function () {
    const q = this.vector("cable"), attached = this.column("attached");
    if (!q) return null;
    const of = (angle) => q[0].map((_, i) => (attached && attached[i] === 0 ? NaN : angle(q[0][i], q[1][i], q[2][i]) * DEGREES));
    return [of((x, y, z) => Math.atan2(y, Math.hypot(x, z))), of((x, y, z) => Math.atan2(-x, -z))];
  };

  Plumbline.Flight = Flight;
})();
