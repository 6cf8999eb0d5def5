/* The scene of a replay with its cameras and the readings at the time shown.

   stage = new Plumbline.Stage(element, layout)    throws if the browser offers no WebGL
   stage.show(state)          as Scene.show
   stage.readings([[name, text, colour], ...], phase)    with a colour, its swatch stands before the name
   stage.camera(mode), stage.fit(places)
   stage.note(text)           a short text over the scene; empty: none
   stage.scene                the Scene; drawn again when something has changed */
(function () {
  "use strict";
  const Plumbline = (window.Plumbline = window.Plumbline || {});

  class Stage {
    constructor(element, layout) {
      const canvas = document.createElement("canvas");
      canvas.id = "scene";
      canvas.tabIndex = -1;
      const picture = document.createElement("div"); // parts over the picture stay over it where the others move below it
      picture.className = "picture";
      picture.append(canvas);
      element.prepend(picture);
      try {
        this.scene = new Plumbline.Scene(canvas, {
          rotors: layout.rotors, armLength: layout.arm, cableLength: layout.cable, theme: "auto" });
      } catch (error) {
        picture.remove();
        throw error;
      }
      this._readings = element.appendChild(document.createElement("dl"));
      this._readings.className = "over readings";
      this._note = element.appendChild(document.createElement("div"));
      this._note.className = "over note";
      this._note.hidden = true;
      this._cameras(element);
      this._values = new Map();
      this._places = [];
      this._dirty = true;
      const changed = () => { this._dirty = true; };
      this.scene.controls.addEventListener("change", changed);
      new ResizeObserver(changed).observe(canvas);
      Plumbline.Theme.onChange(changed);
      let drawnAt = 0;
      const frame = (now) => {
        requestAnimationFrame(frame);
        if (!this._dirty || now - drawnAt < this.scene.interval) return;
        this._dirty = false;
        drawnAt = now;
        this.scene.render();
      };
      requestAnimationFrame(frame);
    }

    _cameras(element) {
      const box = element.appendChild(document.createElement("div"));
      box.className = "over cameras";
      this._modes = new Map(Plumbline.CAMERAS.map(([mode, name]) => {
        const button = box.appendChild(document.createElement("button"));
        button.type = "button";
        button.textContent = name;
        button.setAttribute("aria-pressed", String(mode === "orbit"));
        button.addEventListener("click", () => this.camera(mode));
        return [mode, button];
      }));
      const fit = box.appendChild(document.createElement("button"));
      fit.type = "button";
      fit.textContent = Plumbline.WHOLE;
      fit.addEventListener("click", () => {
        if (this.scene.mode === "follow") this.camera("orbit"); // "follow" would leave the whole path immediately
        this.fit();
      });
    }

    /** "orbit", "follow" or "top". */
    camera(mode) {
      this.scene.camera(mode);
      for (const [other, button] of this._modes) button.setAttribute("aria-pressed", String(other === mode));
      this._dirty = true;
    }

    /** Brings the whole flight into the picture: paths, and `places` [N, E, D] where vehicles will be. */
    fit(places = this._places) {
      this._places = places;
      this.scene.fit(places);
      this._dirty = true;
    }

    show(state) {
      this.scene.show(state);
      this._dirty = true;
    }

    readings(rows, phase) {
      if (!this._phase) {
        this._phase = this._readings.appendChild(document.createElement("dt"));
        this._phase.className = "phase";
      }
      if (this._phase.textContent !== phase) this._phase.textContent = phase;
      for (const [name, text, colour] of rows) {
        let value = this._values.get(name);
        if (!value) {
          const term = this._readings.appendChild(document.createElement("dt"));
          term.textContent = term.title = name;
          value = this._readings.appendChild(document.createElement("dd"));
          this._values.set(name, value);
        }
        if (colour) value.previousSibling.style.setProperty("--swatch", colour);
        if (value.textContent !== text) value.textContent = text;
      }
    }

    note(text) {
      this._note.hidden = !text;
      this._note.textContent = text;
    }
  }

  Plumbline.Stage = Stage;
})();
