/* Plots over time for the live page and the report: a thin wrapper of uPlot (global `uPlot`, see vendor/).

   group = new Plumbline.ChartGroup({live: false})
       Shared by several plots: the zoom, the cursor of the pointer, the time that the scene shows.
       group.setTime(t)            a line at time t in all plots (null: none); the values beside the names are those at t
       group.zoom(from, to)        the span that all plots show; group.reset(): everything (also by a double click)
       group.onHover(callback)     callback(t) while the pointer is over a plot, callback(null) when it leaves
       group.onPick(callback)      callback(t) when a plot is clicked
       group.onZoom(callback)      callback(from, to) when the shown span changes
       group.setBands(bands)       [{from, to, name, kind}]: phases, drawn behind the lines of all plots
       group.setMarks(marks)       [{time, level}]: text messages; level "bad", "warn" or anything else

   chart = new Plumbline.Chart(element, {title, unit, series, time, bands, marks, sync, height, digits, least, zero})
       series   [{name, values, dash: true|false, color: 0 ... 6 or "ink"|"faint", width, quiet}], values at `time`;
                quiet: without a name and a value beside the title; about: a longer text, shown as the tooltip of the name
       time     array of seconds, rising; NaN or null in values: a gap
       sync     a ChartGroup; without it the plot stands alone and bands and marks are its own
       digits   decimals of the values beside the names; null: three significant digits
       least    least span of the vertical axis, so that rounding noise does not fill it
       zero     the vertical axis always shows zero
   chart.setData(time, [values, ...])   replaces everything
   chart.setCursor(t)                   as group.setTime of its group
   chart.onCursor(callback)             as group.onHover of its group
   chart.shown                          {from, to} of the horizontal axis
   chart.destroy()

   Colours follow the theme: Plumbline.Theme.name is "light" or "dark" (prefers-color-scheme; light on paper),
   Plumbline.Theme.onChange(callback). All text is set as text, never as HTML. */
(function () {
  "use strict";
  const Plumbline = (window.Plumbline = window.Plumbline || {});

  // Okabe and Ito's palette, and the same hues for a dark ground
  const PALETTES = {
    light: {
      lines: ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#b07900", "#3d9bd6", "#6b5fb5"],
      ink: "#22272e", faint: "#9aa3ac", grid: "#e3e7eb", axis: "#5d6670", mark: "#8a939c",
      bad: "#c03d00", warn: "#9a6b00",
      bands: { calm: "#f1f3f5", busy: "#e6f1fa", earth: "#faf2e2", home: "#e6f4eb", alarm: "#fbe0da" },
    },
    dark: {
      lines: ["#ff9355", "#5cb8f2", "#3fd0a4", "#e9a5cf", "#eec04f", "#9bd3f7", "#b3a8f0"],
      ink: "#e6e9ec", faint: "#77828d", grid: "#2b3138", axis: "#9aa4ae", mark: "#77828d",
      bad: "#ff8a5c", warn: "#f0c24b",
      bands: { calm: "#20252b", busy: "#18293a", earth: "#2e2818", home: "#183026", alarm: "#47201a" },
    },
  };

  const Theme = (Plumbline.Theme = {
    name: "light",
    listeners: [],
    get palette() { return PALETTES[Theme.name]; },
    onChange(callback) { Theme.listeners.push(callback); },
    set(name) {
      if (name === Theme.name) return;
      Theme.name = name;
      for (const callback of Theme.listeners) callback(name);
    },
  });
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const preferred = () => Theme.set(dark.matches ? "dark" : "light");
  preferred();
  dark.addEventListener("change", preferred);
  window.addEventListener("beforeprint", () => Theme.set("light"));
  window.addEventListener("afterprint", preferred);

  const colour = (key) => (typeof key === "number" ? Theme.palette.lines[key % 7] : Theme.palette[key]);
  // uPlot expects null in gaps
  const gapped = (values) => Array.from(values, (v) => (v === null || Number.isNaN(v) ? null : v));

  const plain = (value, digits) => (
    digits === null ? String(Number(value.toPrecision(3))) : (Number(value.toFixed(digits)) + 0).toFixed(digits)); // no -0.00

  const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
  const LONGEST_LABEL = 6; // characters that always fit into the space beside a plot

  /** Labels of the vertical axis; numbers too long for the space beside it share the power of ten of the greatest. */
  Plumbline.tickLabels = function (ticks) {
    const labels = ticks.map((v) => String(Number(v.toPrecision(6))));
    const most = Math.max(...ticks.map(Math.abs));
    const unfit = labels.some((label) => label.length > LONGEST_LABEL) && (most < 0.01 || most >= 1e5);
    if (!unfit || !(most > 0)) return labels;
    const power = Math.floor(Math.log10(most) + 1e-9);
    const raised = Array.from(String(power), (sign) => RAISED[sign]).join("");
    return ticks.map((v) => (v === 0 ? "0" : `${Number((v / 10 ** power).toPrecision(3))}·10${raised}`));
  };

  function element(kind, className, text) {
    const made = document.createElement(kind);
    if (className) made.className = className;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  /** Index of the last of the rising `times` that is not later than t; 0 before the first. */
  Plumbline.indexAt = function (times, t) {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= t) low = middle; else high = middle - 1;
    }
    return low;
  };

  class ChartGroup {
    constructor() {
      this.charts = [];
      this.time = null;
      this.shown = null; // [from, to], null: everything
      this.bands = [];
      this.marks = [];
      this._hover = []; this._pick = []; this._zoom = [];
    }
    onHover(callback) { this._hover.push(callback); }
    onPick(callback) { this._pick.push(callback); }
    onZoom(callback) { this._zoom.push(callback); }
    setBands(bands) { this.bands = bands; for (const chart of this.charts) chart.redraw(); }
    setMarks(marks) { this.marks = marks; for (const chart of this.charts) chart.redraw(); }
    setTime(t) {
      this.time = t;
      for (const chart of this.charts) chart._showTime(t);
    }
    zoom(from, to) {
      if (this._busy || !(to > from)) return;
      this._busy = true; // a plot whose scale is set reports the new scale in turn
      this.shown = [from, to];
      for (const chart of this.charts) chart._setShown(from, to);
      this._busy = false;
      for (const callback of this._zoom) callback(from, to);
    }
    reset() {
      const spans = this.charts.map((chart) => chart.extent).filter(Boolean);
      if (!spans.length) return;
      this.zoom(Math.min(...spans.map((s) => s[0])), Math.max(...spans.map((s) => s[1])));
      this.shown = null;
    }
    _hovered(from, t) {
      for (const chart of this.charts) if (chart !== from) chart._pointAt(t);
      for (const chart of this.charts) chart._values(t === null ? this.time : t);
      for (const callback of this._hover) callback(t);
    }
    _picked(t) { for (const callback of this._pick) callback(t); }
  }

  class Chart {
    constructor(host, options) {
      this.group = options.sync || new ChartGroup();
      if (options.bands) this.group.bands = options.bands;
      if (options.marks) this.group.marks = options.marks;
      this._options = Object.assign({ height: 150, digits: 2, least: 0, unit: "" }, options);
      this._series = options.series;
      this._root = element("div", "chart");
      this._head = element("div", "chart-head");
      this._head.append(element("b", "chart-title", options.title));
      if (options.unit) this._head.append(element("span", "chart-unit", options.unit));
      this._keys = this._series.map((one, i) => {
        const key = element("button", "chart-key");
        key.type = "button";
        key.title = one.about ? `${one.about}: show or hide` : "show or hide";
        key._swatch = element("i", one.dash ? "dashed" : "");
        key._value = element("output");
        key.append(key._swatch, element("span", "", one.name), key._value);
        key.hidden = Boolean(one.quiet);
        key.addEventListener("click", () => this._toggle(i));
        this._head.append(key);
        return key;
      });
      this._body = element("div", "chart-body");
      this._body.setAttribute("role", "img");
      this._body.setAttribute("aria-label", options.title);
      this._root.append(this._head, this._body);
      host.append(this._root);
      this._playhead = element("div", "chart-playhead");
      this._hidden = new Set();
      this._data = [gapped(options.time || []), ...this._series.map((one) => gapped(one.values || []))];
      this._build();
      this.group.charts.push(this);
      Theme.onChange(() => this.plot && this._build());
      this._sizes = new ResizeObserver(() => this._resize());
      this._sizes.observe(this._body);
    }

    get extent() {
      const time = this._data[0];
      return time.length ? [time[0], Math.max(time[time.length - 1], time[0] + 1e-3)] : null;
    }

    get shown() { return { from: this.plot.scales.x.min, to: this.plot.scales.x.max }; }

    setData(time, values) {
      this._data = [gapped(time), ...values.map(gapped)];
      this.plot.setData(this._data, this.group.shown === null);
      if (this.group.shown) this._setShown(...this.group.shown);
      this._showTime(this.group.time);
    }

    setCursor(t) { this.group.setTime(t); }
    onCursor(callback) { this.group.onHover(callback); }
    redraw() { this.plot.redraw(false); }

    destroy() {
      this._sizes.disconnect();
      this.plot.destroy();
      this.plot = null;
      this._root.remove();
      this.group.charts = this.group.charts.filter((chart) => chart !== this);
    }

    _toggle(i) {
      if (this._hidden.has(i)) this._hidden.delete(i); else this._hidden.add(i);
      this._keys[i].classList.toggle("off", this._hidden.has(i));
      this.plot.setSeries(i + 1, { show: !this._hidden.has(i) });
    }

    _build() {
      if (this.plot) this.plot.destroy();
      const palette = Theme.palette;
      const axis = {
        stroke: palette.axis, font: "11px system-ui, sans-serif",
        grid: { stroke: palette.grid, width: 1 }, ticks: { show: false },
      };
      this._keys.forEach((key, i) => {
        key._swatch.style.borderColor = colour(this._colourOf(i));
      });
      this.plot = new uPlot({
        width: Math.max(this._body.clientWidth, 120),
        height: this._options.height,
        legend: { show: false },
        padding: [6, 10, 0, 0],
        cursor: {
          y: false, points: { size: 5 }, drag: { x: true, y: false, setScale: true, dist: 6 },
        },
        scales: { x: { time: false }, y: { range: (_, low, high) => this._range(low, high) } },
        axes: [
          Object.assign({}, axis, { size: 24, gap: 3, values: (_, ticks) => ticks.map((v) => `${+v.toFixed(3)} s`), space: 60 }),
          Object.assign({}, axis, { size: 56, gap: 4, space: 26, values: (_, ticks) => Plumbline.tickLabels(ticks) }),
        ],
        series: [{}, ...this._series.map((one, i) => ({
          stroke: colour(this._colourOf(i)), width: one.width || 1.5, dash: one.dash ? [5, 4] : undefined,
          points: { show: false }, show: !this._hidden.has(i),
        }))],
        hooks: {
          drawClear: [(u) => this._drawBands(u)],
          draw: [(u) => this._drawMarks(u)],
          setScale: [(u, key) => key === "x" && this._scaled(u)],
          setCursor: [(u) => this._moved(u)],
          ready: [(u) => this._ready(u)],
        },
      }, this._data, this._body);
      if (this.group.shown) this._setShown(...this.group.shown);
      this._showTime(this.group.time);
    }

    _colourOf(i) { return this._series[i].color === undefined ? i : this._series[i].color; }

    _range(low, high) {
      if (low === null || high === null || !Number.isFinite(low + high)) return [0, 1];
      if (this._options.zero) { low = Math.min(low, 0); high = Math.max(high, 0); }
      const missing = Math.max(this._options.least - (high - low), 0) / 2;
      const pad = 0.08 * Math.max(high - low, this._options.least, 1e-9);
      return [low === 0 && this._options.zero ? 0 : low - missing - pad, high + missing + pad];
    }

    _ready(u) {
      u.over.append(this._playhead);
      let inside = false;
      u.over.addEventListener("mouseenter", () => { inside = true; });
      u.over.addEventListener("mouseleave", () => { inside = false; this.group._hovered(this, null); });
      this._inside = () => inside;
      let down = 0;
      u.over.addEventListener("mousedown", (event) => { down = event.clientX; });
      u.over.addEventListener("click", (event) => {
        if (Math.abs(event.clientX - down) > 4) return; // the pointer was dragged
        const t = u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x");
        if (Number.isFinite(t)) this.group._picked(t);
      });
      u.over.addEventListener("dblclick", () => this.group.reset());
    }

    _moved(u) {
      if (!this._inside || !this._inside() || u.cursor.left < 0) return;
      this.group._hovered(this, u.posToVal(u.cursor.left, "x"));
    }

    _pointAt(t) {
      if (!this.plot) return;
      if (t === null) { this.plot.setCursor({ left: -10, top: -10 }, false); return; }
      this.plot.setCursor({ left: this.plot.valToPos(t, "x"), top: 10 }, false);
    }

    _values(t) {
      const time = this._data[0];
      const at = t === null || !time.length ? -1 : Plumbline.indexAt(time, t);
      this._keys.forEach((key, i) => {
        const value = at < 0 ? null : this._data[i + 1][at];
        const text = value === null || value === undefined ? "–" : plain(value, this._options.digits);
        if (key._value.textContent !== text) key._value.textContent = text;
      });
    }

    _showTime(t) {
      if (!this.plot) return;
      const seen = t !== null && t >= this.plot.scales.x.min && t <= this.plot.scales.x.max;
      this._playhead.style.display = seen ? "" : "none";
      if (seen) this._playhead.style.transform = `translateX(${this.plot.valToPos(t, "x")}px)`;
      this._values(t);
    }

    _scaled(u) {
      this._showTime(this.group.time);
      if (u.scales.x.min !== null && u === this.plot) this.group.zoom(u.scales.x.min, u.scales.x.max);
    }

    _setShown(from, to) {
      const x = this.plot.scales.x;
      if (x.min !== from || x.max !== to) this.plot.setScale("x", { min: from, max: to });
    }

    _resize() {
      const width = this._body.clientWidth;
      if (width > 0 && this.plot && width !== this.plot.width) {
        this.plot.setSize({ width, height: this._options.height });
        this._showTime(this.group.time);
      }
    }

    _drawBands(u) {
      const { ctx, bbox } = u, kinds = Theme.palette.bands;
      ctx.save();
      for (const band of this.group.bands) {
        const left = Math.max(u.valToPos(band.from, "x", true), bbox.left);
        const right = Math.min(u.valToPos(band.to, "x", true), bbox.left + bbox.width);
        if (!(right > left) || !kinds[band.kind]) continue;
        ctx.fillStyle = kinds[band.kind];
        ctx.fillRect(left, bbox.top, right - left, bbox.height);
      }
      ctx.restore();
    }

    _drawMarks(u) {
      const { ctx, bbox } = u, palette = Theme.palette, scale = window.devicePixelRatio || 1;
      ctx.save();
      for (const mark of this.group.marks) {
        const x = u.valToPos(mark.time, "x", true);
        if (!(x >= bbox.left && x <= bbox.left + bbox.width)) continue;
        ctx.strokeStyle = ctx.fillStyle = palette[mark.level] || palette.mark;
        ctx.globalAlpha = 0.5;
        ctx.lineWidth = scale;
        ctx.setLineDash([2 * scale, 3 * scale]);
        ctx.beginPath();
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
        ctx.stroke();
        ctx.globalAlpha = 1;
        ctx.beginPath();
        ctx.moveTo(x - 4 * scale, bbox.top);
        ctx.lineTo(x + 4 * scale, bbox.top);
        ctx.lineTo(x, bbox.top + 6 * scale);
        ctx.fill();
      }
      ctx.restore();
    }
  }

  Plumbline.ChartGroup = ChartGroup;
  Plumbline.Chart = Chart;
})();
