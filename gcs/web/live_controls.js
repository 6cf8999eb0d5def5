// The controls: each sends a MAVLink command that another ground station could send too. A refusal shows its reason.
"use strict";
(() => {
  const BUTTONS = [
    ["start", "Fly the mission", "main"], ["takeoff", "Lift"], ["hold", "Hold"], ["resume", "Continue"],
    ["return", "Return"], ["land", "Land"], ["arm", "Arm"], ["disarm", "Disarm"], ["release", "Release the load", "grave"],
  ];
  // the wind blows towards this side: [row, column, label, north, east]
  const PAD = [
    [1, 2, "N", 1, 0], [2, 1, "W", 0, -1], [2, 3, "E", 0, 1], [3, 2, "S", -1, 0],
    [1, 1, "NW", 0.707, -0.707], [1, 3, "NE", 0.707, 0.707], [3, 1, "SW", -0.707, -0.707], [3, 3, "SE", -0.707, 0.707],
  ];
  const GUST_S = 0.6;
  const byId = (id) => document.getElementById(id);

  class Controls {
    /** @param ask function(action, arguments) that sends a request for the chosen vehicle */
    constructor(ask) {
      this.ask = ask;
      this.sliders = new Map();
      this.failed = 0;
      this.buildButtons();
      this.buildPad();
    }

    buildButtons() {
      for (const [action, text, kind] of BUTTONS) {
        const button = makeButton(text, kind, () => this.ask(action, {}));
        button.dataset.action = action;
        byId("flight-buttons").append(button);
      }
    }

    buildPad() {
      const strength = byId("gust");
      const tell = () => { byId("gust-value").textContent = `${strength.value} m/s for ${GUST_S} s`; };
      strength.addEventListener("input", tell);
      tell();
      for (const [row, column, text, north, east] of PAD) {
        const button = makeButton(text, "", () => this.ask("push", {
          north: north * Number(strength.value), east: east * Number(strength.value), seconds: GUST_S }));
        button.style.gridArea = `${row} / ${column}`;
        button.setAttribute("aria-label", `Push to the ${text}`);
        byId("pad").append(button);
      }
    }

    /** Makes the sliders that the server offers. */
    offer(controls) {
      byId("sliders").replaceChildren();
      this.sliders.clear();
      for (const control of controls) {
        const label = document.createElement("label"), output = document.createElement("output");
        const input = document.createElement("input");
        Object.assign(input, { type: "range", min: control.low, max: control.high, step: control.step, disabled: true });
        input.dataset.parameter = control.name;
        if (control.default === null) input.dataset.relative = "yes";
        label.title = control.name;
        label.append(`${control.label} `, output, input);
        const show = () => { output.textContent = `${Number(Number(input.value).toFixed(3))} ${control.unit}`; };
        input.addEventListener("input", show);
        input.addEventListener("change", () => this.ask("set", { name: control.name, value: Number(input.value) }));
        byId("sliders").append(label);
        this.sliders.set(control.name, { input, show });
      }
    }

    /** Makes a button for each of `count` rotors. */
    offerRotors(count) {
      if (this.rotors && this.rotors.length === count) return;
      const box = byId("failures");
      for (const old of box.querySelectorAll("button")) old.remove();
      this.rotors = Array.from({ length: count }, (_, index) => {
        const button = makeButton(String(index + 1), "grave", () => {
          this.ask("fail", { rotor: index + 1, failed: button.getAttribute("aria-pressed") !== "true" });
        });
        button.setAttribute("aria-pressed", "false");
        button.setAttribute("aria-label", `Stop rotor ${index + 1}`);
        box.append(button);
        return button;
      });
    }

    /** Sets the sliders to the parameters that the vehicle reports. */
    setParameters(parameters) {
      for (const [name, { input, show }] of this.sliders) {
        const value = parameters[name];
        input.disabled = value === undefined;
        if (value === undefined || document.activeElement === input && input.matches(":active")) continue;
        if (input.dataset.relative) { // relative to the first value of the vehicle
          Object.assign(input, { min: 0.2 * value, max: 2.5 * value, step: value / 20 });
          delete input.dataset.relative;
        }
        if (value > Number(input.max)) input.max = value;
        if (value < Number(input.min)) input.min = value;
        input.value = value;
        show();
      }
      const failed = parameters.SIM_ENGINE_FAIL || 0;
      (this.rotors || []).forEach((button, index) => {
        button.setAttribute("aria-pressed", String(Boolean((failed >> index) & 1)));
      });
    }

    showAnswer(record) {
      const box = byId("answer");
      box.textContent = record.ok && record.action === "push" ? "push: a gust blows" : record.text;
      box.classList.toggle("bad", !record.ok);
    }

    /**
     * Enables the controls, except those that the vehicle would refuse now; the title of a disabled one says why.
     * @param why why nothing can be commanded, empty if something can
     * @param unavailable the reasons of single actions
     */
    enable(why, unavailable) {
      for (const button of document.querySelectorAll("#commands button, #world button")) {
        const reason = why || unavailable[button.dataset.action] || "";
        if (button.title !== reason) button.title = reason;
        button.disabled = Boolean(reason);
      }
      if (why) for (const { input } of this.sliders.values()) input.disabled = true;
    }
  }

  function makeButton(text, kind, act) {
    const button = document.createElement("button");
    button.className = `do ${kind || ""}`.trim();
    button.textContent = text;
    button.addEventListener("click", act);
    return button;
  }

  Plumbline.LiveControls = Controls;
})();
