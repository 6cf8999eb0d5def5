// Running plots of the signals that the user picks, one strip per signal, with one cursor.
"use strict";
(() => {
  const FIELDS = ["time", "load", "position", "asked", "error", "tension", "swing", "velocity", "use", "estimator", "pace"];
  const AT = Object.fromEntries(FIELDS.map((name, index) => [name, index]));
  // read gives the number of a sample, or null
  const SIGNALS = [
    { key: "error", label: "Error", unit: "mm", read: (s) => scaled(s[AT.error], 1000), on: true },
    { key: "tension", label: "Tension", unit: "N", read: (s) => s[AT.tension], on: true },
    { key: "swing", label: "Swing", unit: "°", read: (s) => s[AT.swing], on: true },
    { key: "use", label: "Rotor use", unit: "%", read: (s) => scaled(s[AT.use], 100) },
    { key: "height", label: "Height", unit: "m", read: (s) => (s[AT.load] ? -s[AT.load][2] : null) },
    { key: "velocity", label: "Speed", unit: "m/s", read: (s) => s[AT.velocity] },
    { key: "estimator", label: "Estimator", unit: "mm", read: (s) => scaled(s[AT.estimator], 1000) },
    { key: "pace", label: "Pace", unit: "×", read: (s) => s[AT.pace] },
  ];
  const COLOURS = ["#4ea1ff", "#ffb454", "#54c7ac", "#c792ea", "#ff7a5c", "#8fb8de", "#e0c341", "#93a3b3"];
  const SPANS = [[20, "20 s"], [60, "1 min"], [300, "5 min"], [Infinity, "all"]];
  const HEIGHT = 132;
  const LEAST = 0.1; // least span of an axis: less is noise, in every unit of these signals

  function scaled(value, factor) {
    return value === null || value === undefined ? null : value * factor;
  }

  class Plots {
    constructor(signals, strips) {
      this.strips = strips;
      this.samples = [];
      this.picked = new Set(SIGNALS.filter((signal) => signal.on).map((signal) => signal.key));
      this.span = 20;
      this.plots = new Map();
      this.sync = uPlot.sync("live");
      this.buildChips(signals);
      this.layout();
      new ResizeObserver(() => this.resize()).observe(strips);
      matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.layout());
    }

    buildChips(box) {
      SIGNALS.forEach((signal, index) => {
        const chip = document.createElement("button");
        chip.textContent = signal.label;
        chip.dataset.signal = signal.key;
        chip.style.setProperty("--signal", COLOURS[index]);
        chip.setAttribute("aria-pressed", this.picked.has(signal.key));
        chip.addEventListener("click", () => {
          if (!this.picked.delete(signal.key)) this.picked.add(signal.key);
          chip.setAttribute("aria-pressed", this.picked.has(signal.key));
          this.layout();
        });
        box.append(chip);
      });
      const gap = document.createElement("span");
      gap.className = "gap";
      box.append(gap);
      this.spans = SPANS.map(([seconds, text]) => {
        const button = document.createElement("button");
        button.textContent = text;
        button.style.setProperty("--signal", "var(--accent)");
        button.setAttribute("aria-pressed", seconds === this.span);
        button.addEventListener("click", () => {
          this.show(seconds);
        });
        return button;
      });
      box.append(...this.spans);
    }

    /** Shows the last `seconds`. */
    show(seconds) {
      this.span = seconds;
      this.spans.forEach((button, index) => button.setAttribute("aria-pressed", SPANS[index][0] === seconds));
      this.draw();
    }

    /** Shows the whole flight. */
    showAll() {
      this.show(Infinity);
    }

    /** Makes the strips of the picked signals. */
    layout() {
      for (const plot of this.plots.values()) plot.destroy();
      this.plots.clear();
      this.strips.replaceChildren();
      SIGNALS.forEach((signal, index) => {
        if (!this.picked.has(signal.key)) return;
        const strip = document.createElement("div");
        strip.className = "strip";
        this.strips.append(strip);
        this.plots.set(signal.key, new uPlot(options(signal, COLOURS[index], strip), [[], []], strip));
      });
      this.resize();
      this.draw();
    }

    resize() {
      for (const plot of this.plots.values()) {
        const box = plot.root.parentElement;
        plot.setSize({ width: Math.max(box.clientWidth, 120), height: box.clientHeight || HEIGHT });
      }
    }

    setSamples(samples) {
      this.samples = samples;
      this.draw();
    }

    draw() {
      const last = this.samples.length ? this.samples[this.samples.length - 1][AT.time] : 0;
      const from = last - this.span;
      let first = 0;
      if (Number.isFinite(from)) {
        let low = 0, high = this.samples.length;
        while (low < high) {
          const middle = (low + high) >> 1;
          if (this.samples[middle][AT.time] < from) low = middle + 1;
          else high = middle;
        }
        first = low;
      }
      const step = Math.max(1, Math.floor((this.samples.length - first) / 1200));
      const shown = [];
      for (let i = first; i < this.samples.length; i += step) shown.push(this.samples[i]);
      const times = shown.map((sample) => sample[AT.time]);
      for (const signal of SIGNALS) {
        const plot = this.plots.get(signal.key);
        if (plot) plot.setData([times, shown.map(signal.read)]);
      }
    }
  }

  function options(signal, colour, strip) {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--soft").trim(), line = style.getPropertyValue("--line").trim();
    const axis = {
      stroke: ink, font: "11px system-ui, sans-serif", grid: { stroke: line, width: 1 }, ticks: { show: false } };
    return {
      width: strip.clientWidth || 260, height: HEIGHT, title: "",
      cursor: { sync: { key: "live" }, points: { size: 6 }, drag: { x: false, y: false } },
      scales: { x: { time: false }, y: { range: (_, low, high) => ranged(low, high) } },
      axes: [
        { ...axis, size: 20, gap: 2, values: (_, ticks) => ticks.map((t) => `${+t.toFixed(2)} s`) },
        { ...axis, size: 42, gap: 3, label: `${signal.label}, ${signal.unit}`, labelSize: 14, labelGap: 0,
          values: (_, ticks) => ticks.map((v) => String(Number(v.toPrecision(6)))),
          labelFont: "11px system-ui, sans-serif" },
      ],
      series: [{}, { stroke: colour, width: 1.6, points: { show: false }, spanGaps: false }],
    };
  }

  function ranged(low, high) {
    if (low === null || high === null || !Number.isFinite(low)) return [0, 1];
    const least = Math.min(low, 0), most = Math.max(high, least + LEAST);
    return [low < 0 ? low - 0.08 * (most - low) : least, most + 0.08 * (most - least)];
  }

  Plumbline.LivePlots = Plots;
  Plumbline.SAMPLE_AT = AT;
})();
