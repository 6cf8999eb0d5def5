// The present state in words and numbers. Everything from a link is written as text, never as markup.
"use strict";
(() => {
  const LEAST_WIND = 0.3; // m/s; an estimate of no wind is never exactly 0
  const TOAST_S = 6; // by the vehicle's clock
  const MOST_TEXTS = 40;
  const SHOWN_TEXTS = 8;
  const NO_VEHICLE = "waiting for a vehicle", NO_SERVER = "the server of this page has ended";
  const WARNING = 4, ERROR = 3; // MAV_SEVERITY
  const byId = (id) => document.getElementById(id);

  function figure(id, value, unit, warn = false) {
    const box = byId(id);
    const text = value === null ? "–" : value;
    if (box.dataset.text === text && box.dataset.unit === unit) return;
    box.dataset.text = text;
    box.dataset.unit = unit;
    box.classList.toggle("warn", warn);
    box.replaceChildren(document.createTextNode(text));
    if (value === null) return;
    const small = document.createElement("small");
    small.textContent = unit;
    box.append(small);
  }

  function number(value, factor, digits) {
    return value === null || value === undefined ? null : (value * factor).toFixed(digits);
  }

  function length(id, metres) {
    if (metres === null || metres === undefined) figure(id, null, "");
    else if (Math.abs(metres) < 1) figure(id, (metres * 1000).toFixed(Math.abs(metres) < 0.1 ? 1 : 0), "mm");
    else figure(id, metres.toFixed(2), "m");
  }

  function put(box, text) {
    if (box.textContent !== text) box.textContent = text;
  }

  function levelOf(text) {
    if (text.severity <= ERROR) return "bad";
    return text.severity <= WARNING ? "warn" : "";
  }

  class Panels {
    constructor() {
      this.session = {};
      this.texts = [];
      this.bars = [];
      this.banner = "";
      this.serverEnded = false;
    }

    /** Whether what is shown is no longer true: the server has ended, and not because the flight is over. */
    get isStale() {
      return this.serverEnded && !this.session.outcome;
    }

    /** Shows from now on whether the server has ended; `state` is the last one of the vehicle, null if there is none. */
    setServer(hasEnded, state) {
      if (this.serverEnded === hasEnded) return;
      this.serverEnded = hasEnded;
      document.body.classList.toggle("stale", this.isStale);
      if (state) this.show(state);
      else {
        this.showBanner(null);
        if (!this.session.outcome) this.showChip(hasEnded ? NO_SERVER : NO_VEHICLE, hasEnded ? "bad" : "");
      }
    }

    setSession(session) {
      this.session = session;
      put(byId("mission"), session.title || session.mission || "Plumbline");
      const words = [];
      if (session.kind === "fly") {
        if (session.law) words.push(`law ${session.law}`, `sensors ${session.sensors}`, `vehicle ${session.vehicle_name}`);
        if (session.seed !== undefined) words.push(`seed ${session.seed}`);
        if (session.law) words.push(session.speed ? `${session.speed}× real time` : "as fast as it goes");
      } else {
        words.push("live");
      }
      put(byId("about"), words.join(" · "));
      document.title = session.mission ? `${session.mission} · Plumbline` : "Plumbline";
    }

    show(state) {
      length("error", state.error);
      length("estimator", state.estimator_error);
      figure("tension", number(state.tension, 1, 2), "N");
      figure("swing", number(state.swing, 1, 1), "°");
      figure("height", state.load ? number(-state.load.position[2], 1, 2) : null, "m");
      figure("speed", number(state.velocity, 1, 2), "m/s");
      this.showPhase(state);
      this.showRotors(state);
      this.showLink(state);
      this.showWind(state.wind);
      this.showBanner(state);
      this.showToast(state);
    }

    /** Shows the latest text of the vehicle over the picture for TOAST_S. */
    showToast(state) {
      const box = byId("toast"), last = this.texts[0];
      const age = last && last.time !== null && state.time !== null ? state.time - last.time : Infinity;
      box.hidden = this.isStale || !(age >= -1 && age < TOAST_S);
      if (box.hidden) return;
      put(box, last.text);
      box.className = levelOf(last);
    }

    showPhase(state) {
      if (this.isStale) {
        this.showChip(NO_SERVER, "bad");
        return;
      }
      let text = state.phase || state.mode || "on the ground", kind = state.armed ? "live" : "";
      if (this.session.outcome) {
        text = this.session.outcome;
        kind = text === "completed" ? "good" : "bad";
      } else if (state.link.lost) {
        text = "link lost";
        kind = "bad";
      } else if (state.phase === "failsafe") {
        kind = "bad";
      } else if (!state.armed && this.session.kind === "fly" && this.session.stage) {
        text = this.session.stage;
      } else if (state.phase === "mission" && state.items) {
        text = `mission, item ${state.item}`;
      }
      if (state.load && !state.load.attached) text += ", without the load";
      else if (state.armed && state.taut === false) text += ", cable slack";
      this.showChip(text, kind);
    }

    showChip(text, kind) {
      const chip = byId("phase");
      put(chip, text);
      chip.className = `chip ${kind}`;
    }

    showRotors(state) {
      const use = state.rotors || [];
      const box = byId("bars");
      while (this.bars.length < use.length) {
        const bar = document.createElement("div");
        bar.className = "bar";
        const fill = document.createElement("i"), name = document.createElement("span"), text = document.createElement("b");
        name.textContent = this.bars.length + 1;
        bar.append(fill, name, text);
        box.append(bar);
        this.bars.push({ bar, fill, text });
      }
      use.forEach((share, index) => {
        const { bar, fill, text } = this.bars[index];
        fill.style.transform = `scaleY(${Math.min(Math.max(share, 0), 1)})`;
        bar.classList.toggle("full", share > 0.95);
        put(text, `${Math.round(share * 100)} %`);
      });
      put(byId("limit"), state.force_max ? `of ${state.force_max.toFixed(2)} N` : "shares of the thrust");
    }

    showLink(state) {
      const { link } = state;
      const words = [`vehicle ${state.id}`];
      if (state.time !== null) words.push(`${state.time.toFixed(1)} s`);
      if (link.pace !== null) words.push(`real-time factor ${link.pace.toFixed(2)}`);
      words.push(`${link.rate} messages/s`);
      if (link.loss > 0) words.push(`${(100 * link.loss).toFixed(1)} % lost`);
      if (link.lost) words.push(`silent for ${link.age.toFixed(0)} s`);
      const box = byId("link");
      put(box, this.isStale ? NO_SERVER : words.join(" · "));
      box.classList.toggle("bad", this.isStale || (link.lost && !this.session.outcome));
    }

    showWind(wind) {
      const box = byId("wind");
      const speed = wind ? Math.hypot(...wind) : 0;
      box.hidden = speed < LEAST_WIND;
      if (!box.hidden) put(box, `wind ${speed.toFixed(1)} m/s`);
    }

    showBanner(state) {
      const { outcome, reason, report } = this.session;
      let text = "", good = false;
      if (outcome) {
        text = reason ? `${outcome}: ${reason}` : outcome;
        good = outcome === "completed";
        if (this.serverEnded) text += `; ${NO_SERVER}`; // and serves no report
      } else if (this.isStale) {
        text = "The server of this page has ended";
        if (state) text += "; the page shows the last state that it has received";
      } else if (state && state.link.lost) {
        text = `Nothing heard of the vehicle for ${state.link.age.toFixed(0)} s`;
      }
      const box = byId("banner");
      if (this.banner === text + report) return;
      this.banner = text + report;
      box.hidden = !text;
      box.classList.toggle("good", good);
      box.replaceChildren(document.createTextNode(text));
      if (outcome && report && !this.serverEnded) {
        const link = document.createElement("a");
        link.href = report;
        link.target = "_blank";
        link.rel = "noopener";
        link.textContent = "Open the report";
        box.append(link);
      }
    }

    addText(record) {
      this.texts.unshift(record);
      this.texts.length = Math.min(this.texts.length, MOST_TEXTS);
      const list = byId("texts");
      list.replaceChildren(...this.texts.slice(0, SHOWN_TEXTS).map((one) => {
        const line = document.createElement("li"), time = document.createElement("time"), text = document.createElement("span");
        time.textContent = one.time === null ? "" : `${one.time.toFixed(1)} s`;
        text.textContent = one.text;
        text.className = levelOf(one);
        line.append(time, text);
        return line;
      }));
    }
  }

  Plumbline.LivePanels = Panels;
})();
