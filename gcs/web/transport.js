/* Play, pause, speed and a time line with phases and text messages.

   transport = new Plumbline.Transport(host, {span: [from, to], start, bands, marks, worst})
       bands  [{from, to, name, kind}], marks  [{time, level, text}], worst  {time} or null
       start  where playing begins if the user has not chosen a time
   transport.time, transport.set(t, chosen)   the time that is shown; chosen: by the user
   transport.toggle(), transport.step(seconds)
   transport.onTime(callback)                 callback(t)
   Keys of the page: space plays, arrows step 0.1 s (with shift 1 s), comma and full stop one sample, Home, End, E.
   Needs the classes of transport.css. */
(function () {
  "use strict";
  const Plumbline = (window.Plumbline = window.Plumbline || {});
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

  function make(kind, className, text) {
    const made = document.createElement(kind);
    made.className = className;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  class Transport {
    constructor(host, options) {
      [this.from, this.to] = options.span;
      this.to = Math.max(this.to, this.from + 1e-3);
      this.time = this.from;
      this.playing = false;
      this.speed = 1;
      this._start = options.start === undefined ? this.from : options.start;
      this._chosen = false;
      this._listeners = [];
      this._worst = options.worst;

      this._play = make("button", "play");
      this._play.type = "button";
      this._play.addEventListener("click", () => this.toggle());
      this._slider = make("input", "slider");
      Object.assign(this._slider, { type: "range", min: this.from, max: this.to, step: "any", value: this.time });
      this._slider.setAttribute("aria-label", "time of the flight");
      this._slider.addEventListener("input", () => this.set(Number(this._slider.value), true));
      this._clock = make("output", "clock");
      this._choice = make("select", "speed");
      this._choice.setAttribute("aria-label", "speed of the replay");
      for (const speed of SPEEDS) {
        const option = make("option", "", `${speed} ×`);
        option.value = speed;
        option.selected = speed === 1;
        this._choice.append(option);
      }
      this._choice.addEventListener("change", () => { this.speed = Number(this._choice.value); });

      const line = make("div", "timeline");
      for (const band of options.bands) line.append(this._band(band));
      for (const mark of options.marks) line.append(this._mark(mark));
      if (options.worst) line.append(this._mark({ time: options.worst.time, level: "worst", text: "greatest error" }));
      line.append(this._slider);
      const row = make("div", "controls");
      row.append(this._play, this._clock, this._choice);
      if (options.worst) {
        const jump = make("button", "jump", "Greatest error");
        jump.type = "button";
        jump.title = "key E";
        jump.addEventListener("click", () => this.set(options.worst.time, true));
        row.append(jump);
      }
      host.append(line, row);
      new ResizeObserver(() => this._nameBands(line)).observe(line);
      document.addEventListener("keydown", (event) => this._key(event));
      this._showPlaying();
    }

    onTime(callback) { this._listeners.push(callback); }

    set(t, chosen = false) {
      this._chosen = this._chosen || chosen;
      this.time = Math.min(Math.max(t, this.from), this.to);
      this._slider.value = this.time;
      this._slider.setAttribute("aria-valuetext", `${this.time.toFixed(2)} s`);
      this._clock.textContent = `${this.time.toFixed(2)} s of ${this.to.toFixed(1)} s`;
      for (const callback of this._listeners) callback(this.time);
    }

    step(seconds) { this.set(this.time + seconds, true); }

    toggle() {
      this.playing = !this.playing;
      this._showPlaying();
      if (!this.playing) return;
      if (!this._chosen) this.set(this._start, true);
      if (this.time >= this.to) this.set(this.from);
      let last = null;
      const frame = (now) => {
        if (!this.playing) return;
        if (last !== null) this.set(this.time + Math.min(now - last, 250) * 1e-3 * this.speed);
        last = now;
        if (this.time >= this.to) { this.playing = false; this._showPlaying(); return; }
        requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }

    _showPlaying() {
      this._play.textContent = this.playing ? "❚❚ Pause" : "▶ Play";
      this._play.title = "space";
    }

    _share(t) { return `${(100 * (t - this.from)) / (this.to - this.from)}%`; }

    _band(band) {
      const made = make("div", `band ${band.kind}`);
      made.style.left = this._share(band.from);
      made.style.width = `calc(${this._share(band.to)} - ${this._share(band.from)})`;
      made.title = band.name;
      if (band.kind !== "none") made.append(make("span", "", band.name));
      return made;
    }

    /** Shows the names of bands where they fit. */
    _nameBands(line) {
      for (const name of line.querySelectorAll(".band span")) {
        name.hidden = false;
        name.hidden = name.offsetWidth > name.parentElement.clientWidth - 2;
      }
    }

    _mark(mark) {
      const made = make("button", `mark ${mark.level || ""}`);
      made.type = "button";
      made.tabIndex = -1; // not needed for the keyboard: the list beside has all texts
      made.style.left = this._share(mark.time);
      made.title = `${mark.time.toFixed(2)} s  ${mark.text}`;
      made.addEventListener("click", () => this.set(mark.time, true));
      return made;
    }

    _key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const where = event.target;
      if (where !== this._slider && where instanceof Element && where.closest("input, select, textarea")) return;
      const far = event.shiftKey ? 1 : 0.1;
      const acts = {
        " ": () => this.toggle(),
        ArrowLeft: () => this.step(-far),
        ArrowRight: () => this.step(far),
        ",": () => this.step(-0.008),
        ".": () => this.step(0.008),
        Home: () => this.set(this.from, true),
        End: () => this.set(this.to, true),
        e: () => this._worst && this.set(this._worst.time, true),
      };
      const act = acts[event.key];
      if (!act) return;
      // the space bar presses a button that was reached by the keyboard, but not one that was clicked
      if (event.key === " " && where instanceof Element && where.closest("button, a, summary")) {
        if (where.matches(":focus-visible")) return;
        where.blur();
      }
      event.preventDefault();
      act();
    }
  }

  Plumbline.Transport = Transport;
})();
