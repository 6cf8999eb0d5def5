// The 3-D scene of a flight, for the live page and for the replay of a report. All places are NED in metres, attitudes
// are quaternions w, x, y, z of the body (forward, right, down) in NED. Nothing is drawn before render().
"use strict";
(() => {
  const GROUND_D = 0;
  const PROCESSOR_MS = 100;
  const PROCESSOR_REST = 4; // pause before the next picture, in multiples of the time that the last one took
  const LONGEST_MS = 1000;
  const CLICK_PX = 4; // a pointer that moved further turns the camera and picks nothing
  // x east, y up, z south are the axes of three.js
  const NED_TO_SCENE = new THREE.Matrix4().set(0, 1, 0, 0, 0, 0, -1, 0, -1, 0, 0, 0, 0, 0, 0, 1);

  class Scene {
    /**
     * @param canvas  the element to draw on; its parent is positioned and also takes the legend
     * @param options rotors: [{position: [x, y, z] in the body frame, spin: +1 or -1}], armLength, cableLength (m),
     *                theme: "dark", "light" or "auto"
     * @throws Error if the browser offers no WebGL
     */
    constructor(canvas, options = {}) {
      this.canvas = canvas;
      const arm = options.armLength || 0.126;
      this.layout = {
        armLength: arm,
        cableLength: options.cableLength || 0.7,
        rotors: options.rotors || Plumbline.frameOf(arm, 4),
      };
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
      this.byProcessor = drawnByProcessor(this.renderer.getContext());
      /** The least time between two pictures, ms: if the processor draws, pictures take time from the flights. */
      this.interval = this.byProcessor ? PROCESSOR_MS : 0;
      this.scene = new THREE.Scene();
      this.world = new THREE.Group();
      this.world.quaternion.setFromRotationMatrix(NED_TO_SCENE);
      this.world.updateMatrixWorld();
      this.scene.add(this.world);
      this.eye = new THREE.PerspectiveCamera(42, 1, 0.03, 2000);
      this.controls = new THREE.OrbitControls(this.eye, canvas);
      this.controls.enableDamping = false;
      this.controls.maxPolarAngle = Math.PI / 2 - 0.01;
      this.controls.minDistance = 2 * arm;
      this.controls.maxDistance = 600;
      this.crafts = new Map();
      this.tracks = new Map();
      this.vehicles = new Map(); // id -> its state in the last show()
      this.followed = null;
      this.lastFollowed = null;
      this.picked = [];
      this.size = [0, 0];
      this.themeName = options.theme || "auto";
      this.theme = Plumbline.sceneTheme.themeOf(this.themeName);
      this.hemisphere = new THREE.HemisphereLight(0xffffff, 0x8899aa, this.theme.fillLight);
      this.sun = new THREE.DirectionalLight(0xffffff, this.theme.keyLight);
      this.sun.position.set(3, 8, 4);
      this.scene.add(this.hemisphere, this.sun);
      this.scene.fog = new THREE.Fog(this.theme.background, 10, 60);
      this.places = new Plumbline.ScenePlaces(this.world, this.theme);
      this.legend = makeLegend(canvas.parentElement);
      this.listen();
      this.applyTheme();
      this.mode = "orbit";
      this.look([0, 0, -0.6], 3.6 * (this.layout.cableLength + arm));
    }

    listen() {
      this.media = matchMedia("(prefers-color-scheme: light)");
      this.onMedia = () => this.themeName === "auto" && this.setTheme("auto");
      this.media.addEventListener("change", this.onMedia);
      this.down = null;
      this.onDown = (event) => { this.down = [event.clientX, event.clientY]; };
      this.onUp = (event) => {
        if (!this.down) return;
        const moved = Math.hypot(event.clientX - this.down[0], event.clientY - this.down[1]);
        if (moved <= CLICK_PX) this.pick(event);
      };
      this.canvas.addEventListener("pointerdown", this.onDown);
      this.canvas.addEventListener("click", this.onUp);
    }

    // ---- what is shown

    /**
     * @param state {time (s), vehicles: [{id, position, attitude, rotors: [0 ... 1 of the limit],
     *              load: {position, attached} or null, taut, asked: place or null, cableLength and layout if they
     *              differ from those of the scene}], wind: [N, E, D] m/s or null}
     */
    show(state) {
      const told = new Set();
      for (const vehicle of state.vehicles) {
        told.add(vehicle.id);
        let craft = this.crafts.get(vehicle.id);
        if (craft && vehicle.layout && craft.layout.rotors.length !== vehicle.layout.rotors.length) {
          craft.dispose();
          craft = null;
        }
        if (!craft) {
          craft = new Plumbline.SceneCraft(this.world, vehicle.layout || this.layout, this.theme);
          this.crafts.set(vehicle.id, craft);
          if (this.followed === null) this.followed = vehicle.id;
        }
        craft.show(vehicle, state.time, GROUND_D);
        this.vehicles.set(vehicle.id, vehicle);
      }
      for (const [id, craft] of this.crafts) {
        if (told.has(id)) continue;
        craft.dispose();
        this.crafts.delete(id);
        this.vehicles.delete(id);
        if (this.followed === id) this.followed = null;
      }
      const first = this.vehicles.get(this.followed);
      this.places.showWind(state.wind || null, first ? centreOf(first) : null, state.time);
      this.moveEye(first);
    }

    /**
     * Sets whole paths: arrays N, E, D, N, ...; `error` has one number (m) per point of `flown`, which
     * determines its colour; with `colour` (of CSS), the whole path has this colour.
     * @param id of the vehicle, if there are several
     */
    setTrack(track, id = 1) {
      const { flown, asked } = this.trackOf(id);
      flown.set(track.flown || [], track.error || null, track.colour || null);
      asked.set(track.asked || []);
      this.levelScale();
    }

    /** Appends a point to the paths of a vehicle that flies now; each place may be null. */
    extendTrack(id, flownPlace, error, askedPlace) {
      const { flown, asked } = this.trackOf(id);
      if (flownPlace && flown.add(...flownPlace, error)) this.levelScale();
      if (askedPlace) asked.add(...askedPlace);
      if (Number.isFinite(error) && !this.legend.shown) this.levelScale();
    }

    /** Removes the paths of a vehicle. */
    clearTrack(id = 1) {
      const { flown, asked } = this.trackOf(id);
      flown.clear();
      asked.clear();
      this.levelScale();
    }

    trackOf(id) {
      if (!this.tracks.has(id)) {
        this.tracks.set(id, {
          flown: new Plumbline.SceneFlownTrack(this.world, this.theme),
          asked: new Plumbline.SceneAskedTrack(this.world, this.theme),
        });
      }
      return this.tracks.get(id);
    }

    /** Gives all tracks the same scale of errors, and updates its legend. */
    levelScale() {
      const flown = [...this.tracks.values()].map((track) => track.flown);
      const full = Math.max(0.01, ...flown.map((track) => track.full));
      for (const track of flown) {
        if (track.full === full) continue;
        track.full = full;
        track.recolour();
      }
      const some = flown.some((track) => track.size > 1 && track.errors.some(Number.isFinite));
      this.legend.show(some, full, this.theme);
    }

    /**
     * @param fence null or {zones: [{kind: "inclusion" or "exclusion", polygon: [[N, E], ...]} or {kind, centre: [N, E],
     *              radius}], radius: greatest distance from home or null, height: greatest height or null}
     */
    setFence(fence) {
      this.places.setFence(fence);
    }

    /** @param points places [N, E, D] */
    setRally(points) {
      this.places.setRally(points);
    }

    /** @param places [N, E, D] that the mission names, one after the other */
    setWaypoints(places) {
      this.places.setWaypoints(places);
    }

    /** Marks the place to which the load was commanded; null: none. */
    setGoal(place) {
      this.places.setGoal(place);
    }

    /** @param name "dark", "light" or "auto" */
    setTheme(name) {
      this.themeName = name;
      this.theme = Plumbline.sceneTheme.themeOf(name);
      this.applyTheme();
      this.places.setTheme(this.theme);
      for (const craft of this.crafts.values()) craft.setTheme(this.theme);
      for (const { flown, asked } of this.tracks.values()) {
        flown.setTheme(this.theme);
        asked.setTheme(this.theme);
      }
      for (const [id, vehicle] of this.vehicles) this.crafts.get(id).show(vehicle, this.crafts.get(id).time || 0, GROUND_D);
      this.levelScale();
    }

    applyTheme() {
      this.scene.background = new THREE.Color(this.theme.background);
      this.scene.fog.color.set(this.theme.background);
      this.hemisphere.intensity = this.theme.fillLight;
      this.sun.intensity = this.theme.keyLight;
    }

    // ---- cameras

    /**
     * "orbit" stays where the user put it, "follow" moves with the vehicle, "top" looks down, north up.
     * @param id the vehicle that is followed; the first one by default
     */
    camera(mode, id = null) {
      if (id !== null) this.followed = id;
      const from = this.mode;
      this.mode = mode;
      this.lastFollowed = null;
      this.controls.enableRotate = mode !== "top";
      const vehicle = this.vehicles.get(this.followed);
      const target = this.controls.target.clone();
      if (vehicle && mode === "follow") target.copy(toScene(centreOf(vehicle)));
      const distance = this.eye.position.distanceTo(this.controls.target);
      if (mode === "top") {
        this.controls.target.copy(target);
        this.eye.position.copy(target).add(new THREE.Vector3(0, distance, 0.001 * distance));
      } else if (from === "top") {
        const near = mode === "follow" ? Math.min(distance, 5 * this.reach) : distance;
        this.look(toNed(target), near);
      } else if (mode === "follow") {
        const away = this.eye.position.clone().sub(this.controls.target).setLength(Math.min(distance, 5 * this.reach));
        this.controls.target.copy(target);
        this.eye.position.copy(target).add(away);
      }
      this.controls.update();
    }

    get reach() {
      return this.layout.cableLength + this.layout.armLength;
    }

    /** Looks at `place` from the south-east and above, from `distance`. */
    look(place, distance) {
      const target = toScene(place);
      this.controls.target.copy(target);
      this.eye.position.copy(target).add(new THREE.Vector3(0.56, 0.36, 0.75).setLength(distance));
      this.controls.update();
    }

    moveEye(vehicle) {
      if (!vehicle || this.mode !== "follow") return;
      const now = toScene(centreOf(vehicle));
      const before = this.lastFollowed || this.controls.target.clone();
      const step = now.clone().sub(before);
      this.controls.target.add(step);
      this.eye.position.add(step);
      this.lastFollowed = now;
    }

    /** Brings all paths and vehicles into the picture, and `also`: places at which nothing is drawn yet. */
    fit(also = []) {
      const box = { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
      const take = (place) => place.forEach((value, axis) => {
        box.low[axis] = Math.min(box.low[axis], value);
        box.high[axis] = Math.max(box.high[axis], value);
      });
      for (const { flown, asked } of this.tracks.values()) {
        for (const points of [flown.points, asked.points]) {
          for (let i = 0; i + 2 < points.length; i += 3) take([points[i], points[i + 1], points[i + 2]]);
        }
      }
      for (const vehicle of this.vehicles.values()) {
        take(vehicle.position);
        if (vehicle.load && vehicle.load.position) take(vehicle.load.position);
      }
      also.forEach(take);
      if (!Number.isFinite(box.low[0])) return;
      const centre = box.low.map((low, axis) => 0.5 * (low + box.high[axis]));
      const radius = 0.5 * Math.hypot(...box.low.map((low, axis) => box.high[axis] - low)) + this.layout.armLength;
      this.resize();
      const narrow = Math.min(1, this.eye.aspect);
      const distance = Math.max(1.12 * radius / Math.sin((this.eye.fov * Math.PI) / 360) / narrow, 3 * this.reach);
      this.look(centre, distance);
      if (this.mode === "top") this.camera("top");
      this.lastFollowed = null;
    }

    // ---- places and pixels

    /**
     * Calls back with ([N, E, D] at the height of the load, [N, E, 0] on the ground or null, number of clicks) when
     * the user clicks.
     */
    onPick(callback) {
      this.picked.push(callback);
    }

    pick(event) {
      const frame = this.canvas.getBoundingClientRect();
      const x = (2 * (event.clientX - frame.left)) / frame.width - 1;
      const y = 1 - (2 * (event.clientY - frame.top)) / frame.height;
      const ray = new THREE.Raycaster();
      ray.setFromCamera(new THREE.Vector2(x, y), this.eye);
      const vehicle = this.vehicles.get(this.followed);
      const height = vehicle && vehicle.load && vehicle.load.position ? -vehicle.load.position[2] : 0;
      const ground = meet(ray.ray, 0);
      const level = meet(ray.ray, Math.max(height, 0)) || ground;
      if (!level) return;
      for (const callback of this.picked) callback(level, ground, event.detail);
    }

    /** Where a place appears: [x, y] in CSS pixels of the canvas, or null behind the camera. */
    project(place) {
      this.eye.updateMatrixWorld();
      const seen = toScene(place).project(this.eye);
      if (seen.z > 1) return null;
      return [0.5 * (seen.x + 1) * this.canvas.clientWidth, 0.5 * (1 - seen.y) * this.canvas.clientHeight];
    }

    resize() {
      const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
      const ratio = Math.min(globalThis.devicePixelRatio || 1, 2);
      if (width === 0 || height === 0) return;
      if (this.size[0] === width && this.size[1] === height && this.renderer.getPixelRatio() === ratio) return;
      this.size = [width, height];
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
      this.eye.aspect = width / height;
      this.eye.updateProjectionMatrix();
    }

    /** Draws the state of the last show(). */
    render() {
      this.resize();
      const distance = this.eye.position.distanceTo(this.controls.target);
      this.scene.fog.near = 3 * distance + 2;
      this.scene.fog.far = 14 * distance + 12;
      this.places.spreadGround(this.controls.target, distance);
      const began = performance.now();
      this.renderer.render(this.scene, this.eye);
      if (!this.byProcessor) return;
      const gl = this.renderer.getContext();
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // returns when the picture is drawn
      const rest = PROCESSOR_REST * (performance.now() - began);
      this.interval = Math.min(Math.max(PROCESSOR_MS, rest), LONGEST_MS);
    }

    dispose() {
      this.media.removeEventListener("change", this.onMedia);
      this.canvas.removeEventListener("pointerdown", this.onDown);
      this.canvas.removeEventListener("click", this.onUp);
      this.controls.dispose();
      for (const craft of this.crafts.values()) craft.dispose();
      for (const { flown, asked } of this.tracks.values()) {
        flown.dispose();
        asked.dispose();
      }
      this.places.dispose();
      this.legend.remove();
      this.renderer.dispose();
    }
  }

  /**
   * The rotors of a vehicle with arms of `arm` m, counterclockwise from the rear: four in a plus, more with the
   * gap between two of them ahead.
   */
  Plumbline.frameOf = (arm, count) => Array.from({ length: count }, (_, i) => {
    const angle = Math.PI + ((count === 4 ? 2 * i : 2 * i - 1) * Math.PI) / count;
    return { position: [arm * Math.cos(angle), -arm * Math.sin(angle), 0], spin: i % 2 ? 1 : -1 };
  });

  function toScene([n, e, d]) {
    return new THREE.Vector3(e, -d, -n);
  }

  function toNed(vector) {
    return [-vector.z, vector.x, -vector.y];
  }

  /** The point between vehicle and load. */
  function centreOf(vehicle) {
    const load = vehicle.load && vehicle.load.attached !== false ? vehicle.load.position : null;
    return load ? vehicle.position.map((value, axis) => 0.5 * (value + load[axis])) : vehicle.position;
  }

  /** Where a ray meets the horizontal plane at `height`, in NED, or null. */
  function meet(ray, height) {
    const found = ray.intersectPlane(new THREE.Plane(new THREE.Vector3(0, 1, 0), -height), new THREE.Vector3());
    return found ? toNed(found) : null;
  }

  /** Whether there is no graphics card, so that drawing takes processor time. */
  function drawnByProcessor(gl) {
    const named = gl.getExtension("WEBGL_debug_renderer_info");
    const renderer = gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
  }

  function makeLegend(parent) {
    const box = document.createElement("div");
    box.className = "scene-legend";
    Object.assign(box.style, {
      position: "absolute", left: "12px", bottom: "12px", pointerEvents: "none", display: "none",
      font: "12px system-ui, -apple-system, 'Segoe UI', sans-serif" });
    const title = document.createElement("div");
    title.textContent = "error of the load";
    const bar = document.createElement("div");
    Object.assign(bar.style, { width: "150px", height: "8px", borderRadius: "4px", margin: "4px 0" });
    const ends = document.createElement("div");
    Object.assign(ends.style, { display: "flex", justifyContent: "space-between", fontVariantNumeric: "tabular-nums" });
    const low = document.createElement("span"), high = document.createElement("span");
    low.textContent = "0";
    ends.append(low, high);
    box.append(title, bar, ends);
    parent.append(box);
    return {
      shown: false,
      show(some, full, theme) {
        this.shown = some;
        box.style.display = some ? "block" : "none";
        box.style.color = theme.label;
        const stops = theme.scale.map((colour) => `#${colour.toString(16).padStart(6, "0")}`);
        bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
        high.textContent = full >= 1 ? `${full} m` : `${Math.round(full * 1000)} mm`;
      },
      remove() {
        box.remove();
      },
    };
  }

  Plumbline.Scene = Scene;
  // the names of the buttons on every page
  Plumbline.CAMERAS = [["orbit", "Orbit"], ["follow", "Follow"], ["top", "From above"]];
  Plumbline.WHOLE = "Whole path"; // brings the whole path into the picture
})();
