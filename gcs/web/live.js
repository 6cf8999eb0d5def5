// The live page: takes records from its server and updates scene, panels, plots and controls.
"use strict";
(() => {
  const AT = Plumbline.SAMPLE_AT;
  const PANELS_MS = 100;
  const PLOTS_MS = 150;
  const MOST_SAMPLES = 12000;
  const RETRY_MS = 1000;
  const byId = (id) => document.getElementById(id);

  const page = {
    session: {}, vehicles: new Map(), chosen: null, requests: 0, socket: null,
    frames: 0, // frames drawn so far
  };
  let scene = null;
  let noPicture = ""; // why the scene is not drawn
  function loseScene(why) {
    noPicture = `${why}: the numbers and plots work without the picture.`;
    byId("hint").textContent = noPicture;
  }
  try {
    scene = new Plumbline.Scene(byId("scene"), { theme: "auto" });
    scene.camera("follow");
  } catch (error) {
    loseScene("This browser offers no WebGL");
  }
  byId("scene").addEventListener("webglcontextlost", () => loseScene("The browser has stopped drawing (WebGL)"));
  const panels = new Plumbline.LivePanels();
  const plots = new Plumbline.LivePlots(byId("signals"), byId("strips"));
  const controls = new Plumbline.LiveControls(ask);

  function vehicleOf(id) {
    if (!page.vehicles.has(id)) {
      page.vehicles.set(id, { id, record: null, state: null, before: null, samples: [], at: 0, every: 20 });
      if (page.chosen === null) page.chosen = id;
      showVehicles();
    }
    return page.vehicles.get(id);
  }

  // ---- the server's records

  const TAKE = {
    hello(record) {
      controls.offer(record.controls);
      page.enabled = undefined; // the sliders are new
      enable();
    },
    session(record) {
      const isOver = Boolean(record.outcome && !page.session.outcome);
      page.session = record;
      panels.setSession(record);
      if (record.outcome) {
        panels.showBanner(null);
        const chosen = page.vehicles.get(page.chosen);
        if (chosen && chosen.state) panels.show(chosen.state);
        if (scene && isOver) {
          scene.camera("orbit");
          pressCamera("orbit");
          scene.fit();
        }
        if (isOver) plots.showAll();
      }
      enable();
    },
    vehicle(record) {
      const vehicle = vehicleOf(record.id);
      vehicle.record = record;
      vehicle.layout = layoutOf(vehicle);
      if (record.id === page.chosen) choose(record.id);
    },
    history(record) {
      const vehicle = vehicleOf(record.vehicle);
      vehicle.samples = [];
      if (scene) scene.clearTrack(record.vehicle);
      addSamples(vehicle, record.samples);
    },
    state(record) {
      const now = performance.now();
      for (const state of record.vehicles) {
        const vehicle = vehicleOf(state.id);
        if (vehicle.state && state.time !== vehicle.state.time) {
          vehicle.every = 0.8 * vehicle.every + 0.2 * Math.min(now - vehicle.at, 200);
          vehicle.before = vehicle.state;
          vehicle.at = now;
        }
        vehicle.state = state;
        if (vehicle.record && rotorsOf(vehicle) !== vehicle.layout.rotors.length) vehicle.layout = layoutOf(vehicle);
        if (state.id === page.chosen) controls.offerRotors(rotorsOf(vehicle));
      }
      for (const [id, samples] of Object.entries(record.samples)) addSamples(vehicleOf(Number(id)), samples);
      enable();
    },
    text(record) {
      if (record.vehicle === page.chosen || page.chosen === null) panels.addText(record);
    },
    result(record) {
      controls.showAnswer(record);
      if (!record.ok && record.action === "goto" && scene) scene.setGoal(null);
      const vehicle = page.vehicles.get(page.chosen);
      if (!record.ok && vehicle && vehicle.record) controls.setParameters(vehicle.record.parameters);
    },
  };

  function addSamples(vehicle, samples) {
    for (const sample of samples) {
      const last = vehicle.samples[vehicle.samples.length - 1];
      if (last && sample[AT.time] <= last[AT.time] && sample[AT.time] > last[AT.time] - 1) continue; // already known
      if (last && sample[AT.time] < last[AT.time]) { // the vehicle was restarted
        vehicle.samples = [];
        if (scene) scene.clearTrack(vehicle.id);
      }
      vehicle.samples.push(sample);
      if (scene && moved(last, sample)) scene.extendTrack(vehicle.id, sample[AT.load], sample[AT.error], sample[AT.asked]);
    }
    if (vehicle.samples.length > MOST_SAMPLES) vehicle.samples.splice(0, MOST_SAMPLES / 4);
  }

  /** The reported number of rotors of a vehicle; 4 until it is known. */
  function rotorsOf(vehicle) {
    return vehicle.state && vehicle.state.rotors ? vehicle.state.rotors.length : 4;
  }

  /** The layout of a vehicle for the scene. */
  function layoutOf(vehicle) {
    const { arm, cable } = vehicle.record.layout;
    return { armLength: arm, cableLength: cable, rotors: Plumbline.frameOf(arm, rotorsOf(vehicle)) };
  }

  /** Whether the path gets another point: a load that does not move adds none. */
  function moved(last, sample) {
    if (!sample[AT.load]) return false;
    if (!last || !last[AT.load]) return true;
    return Math.hypot(...sample[AT.load].map((value, axis) => value - last[AT.load][axis])) > 1e-4
      || sample[AT.error] !== last[AT.error];
  }

  function showVehicles() {
    const box = byId("vehicles");
    box.hidden = page.vehicles.size < 2;
    box.replaceChildren(...[...page.vehicles.keys()].sort((a, b) => a - b).map((id) => {
      const button = document.createElement("button");
      button.className = id === page.chosen ? "do main" : "do";
      button.textContent = `Vehicle ${id}`;
      button.addEventListener("click", () => choose(id));
      return button;
    }));
  }

  function choose(id) {
    page.chosen = id;
    const { record } = vehicleOf(id);
    showVehicles();
    if (scene && scene.followed !== id) scene.camera(scene.mode, id);
    if (!record) return;
    if (scene) {
      scene.setFence(record.fence);
      scene.setRally(record.rally);
      scene.setWaypoints(record.waypoints);
    }
    controls.setParameters(record.parameters);
    enable();
  }

  // ---- commands of the user

  function isConnected() {
    return page.socket !== null && page.socket.readyState === WebSocket.OPEN;
  }

  function ask(action, words) {
    if (!isConnected() || page.chosen === null) return;
    page.requests += 1;
    page.socket.send(JSON.stringify({ vehicle: page.chosen, request: page.requests, action, arguments: words }));
  }

  /** Why nothing can be commanded; empty if the chosen vehicle takes commands. */
  function commandProblem() {
    const vehicle = page.vehicles.get(page.chosen);
    if (!isConnected()) return "the server of this page has ended";
    if (page.session.outcome) return "the flight is over";
    return vehicle && vehicle.state ? "" : "no vehicle has reported yet";
  }

  function enable() {
    const vehicle = page.vehicles.get(page.chosen), why = commandProblem();
    const unavailable = vehicle && vehicle.state ? vehicle.state.unavailable : {};
    controls.enable(why, unavailable);
    const hint = noPicture || (why ? "" : `${unavailable.goto ? "" : "Double-click: take the load there. "}Drag: turn. Wheel: zoom.`);
    if (byId("hint").textContent !== hint) byId("hint").textContent = hint;
    if (page.enabled === !why) return;
    page.enabled = !why;
    if (!why && vehicle.record) controls.setParameters(vehicle.record.parameters);
  }

  if (scene) {
    scene.onPick((place, ground, clicks) => {
      if (clicks !== 2 || commandProblem()) return;
      const goal = place.map((value) => Math.round(value * 1000) / 1000);
      scene.setGoal(goal);
      ask("goto", { place: goal });
    });
  }

  function pressCamera(mode) {
    for (const button of document.querySelectorAll("#cameras [aria-pressed]")) {
      button.setAttribute("aria-pressed", String(button.dataset.camera === mode));
    }
  }

  function addCamera(name, act) {
    const button = document.createElement("button");
    button.textContent = name;
    button.addEventListener("click", () => { if (scene) act(); });
    byId("cameras").append(button);
    return button;
  }

  for (const [mode, name] of Plumbline.CAMERAS) {
    const button = addCamera(name, () => {
      scene.camera(mode);
      pressCamera(mode);
    });
    button.dataset.camera = mode;
    button.setAttribute("aria-pressed", String(mode === "follow"));
  }
  addCamera(Plumbline.WHOLE, () => {
    if (scene.mode === "follow") scene.camera("orbit");
    scene.fit();
    pressCamera(scene.mode);
  });

  // ---- frames

  /** The state interpolated between the last two received, so that the picture moves evenly. */
  function between(vehicle, now) {
    const { state, before } = vehicle;
    if (!before || !before.position || !state.position || !before.load || !state.load) return state;
    const share = Math.min(Math.max((now - vehicle.at) / Math.max(vehicle.every, 1), 0), 1);
    const mix = (a, b) => (a && b ? b.map((value, i) => a[i] + share * (value - a[i])) : b);
    const attitude = mix(before.attitude, state.attitude);
    const norm = attitude ? Math.hypot(...attitude) : 1;
    return {
      ...state, time: before.time + share * (state.time - before.time),
      position: mix(before.position, state.position),
      attitude: attitude && norm > 0.5 ? attitude.map((value) => value / norm) : state.attitude,
      load: { ...state.load, position: mix(before.load.position, state.load.position) },
      asked: mix(before.asked, state.asked),
    };
  }

  let sceneAt = 0, panelsAt = 0, plotsAt = 0;
  function frame(now) {
    requestAnimationFrame(frame);
    const chosen = page.vehicles.get(page.chosen);
    if (scene && now - sceneAt >= scene.interval) {
      sceneAt = now;
      const shown = [];
      for (const vehicle of page.vehicles.values()) {
        if (!vehicle.state || !vehicle.state.position) continue;
        const state = between(vehicle, now);
        shown.push({
          id: vehicle.id, position: state.position, attitude: state.attitude || [1, 0, 0, 0],
          rotors: state.armed ? state.rotors || [] : [], load: state.load, taut: state.taut, asked: state.asked,
          layout: vehicle.layout, cableLength: state.cable, time: state.time });
      }
      if (shown.length) {
        const wind = chosen && chosen.state ? chosen.state.wind : null;
        scene.show({ time: shown[0].time || 0, vehicles: shown, wind });
      }
      scene.render();
      page.frames += 1;
    }
    if (now - panelsAt > PANELS_MS && chosen && chosen.state) {
      panelsAt = now;
      panels.show(chosen.state);
    }
    if (now - plotsAt > PLOTS_MS && chosen) {
      plotsAt = now;
      plots.setSamples(chosen.samples);
    }
  }

  /** Shows whether the server of the page has ended, until it says otherwise. */
  function showServer(hasEnded) {
    const chosen = page.vehicles.get(page.chosen);
    panels.setServer(hasEnded, chosen ? chosen.state : null);
    if (hasEnded) byId("hint").textContent = noPicture; // nothing can be commanded
  }

  function connect() {
    const socket = new WebSocket(new URL("socket", location.href.replace(/^http/, "ws")));
    page.socket = socket;
    socket.addEventListener("open", () => showServer(false));
    socket.addEventListener("message", (event) => {
      const record = JSON.parse(event.data);
      if (TAKE[record.type]) TAKE[record.type](record);
    });
    socket.addEventListener("close", () => {
      enable();
      showServer(true);
      setTimeout(connect, RETRY_MS);
    });
  }

  Plumbline.live = { page, scene, panels, plots, ask };
  connect();
  requestAnimationFrame(frame);
})();
