/* The maps of a sweep: a cell shows its figures and the command that flies one of its flights. */
(function () {
  "use strict";
  const SVG = "http://www.w3.org/2000/svg";
  const MOST_NUMBERS = 144; // with up to so many cells, each shows its number
  const NUMBER_PX = 38, CELL_PX = 14, DIGIT_PX = 7; // least widths of a cell with a number, of one without, of a digit
  const KINDS = [
    { key: "completed", name: "flights completed", unit: "%" },
    { key: "median", name: "load error, median", unit: "mm" },
    { key: "worst", name: "load error, worst", unit: "mm" },
  ];
  /** The figures of a map: its step response, if it has one, has its own range of colours. */
  const kindsOf = (map) => KINDS.map((kind) => ({ ...kind, values: map[kind.key] })).concat(
    map.steps.map((step) => ({ ...step, name: `${step.name}, median`, own: true })));
  // vermilion to blue for shares; light to dark for errors, by their logarithm
  const SHARES = [[213, 94, 0], [246, 227, 197], [0, 114, 178]];
  const ERRORS = [[253, 231, 37], [53, 183, 121], [33, 130, 142], [68, 1, 84]];

  function mixed(stops, share) {
    const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1), i = Math.min(Math.floor(at), stops.length - 2);
    return stops[i].map((value, k) => Math.round(value + (at - i) * (stops[i + 1][k] - value)));
  }

  function colourOf(kind, value) {
    if (value === null) return null;
    if (kind.own) {
      const known = kind.values.filter((other) => other !== null);
      const low = Math.min(...known), high = Math.max(...known); // less than a tenth is no great difference
      return mixed(ERRORS, (value - low) / (Math.max(high - low, 0.1 * high) || 1));
    }
    if (kind.key === "completed") return mixed(SHARES, value / 100);
    return mixed(ERRORS, Math.log10(Math.max(value, 1)) / 3); // 1 mm ... 1 m
  }

  const number = (value) => (value === null ? "–" : value >= 10 || value === 0 ? value.toFixed(0) : value.toFixed(1));
  const numberOf = (kind, value) => (kind.own && value !== null ? value.toPrecision(3) : number(value));
  const short = (value) => String(Number(value.toPrecision(4)));

  function draw(tag, attributes, parent, text) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    parent.append(made);
    return made;
  }

  const quoted = (word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\"'\"'")}'`);

  function commandOf(map, shown) {
    const words = ["--law", map.reference, "--seed", String(shown.seed)];
    map.varied.forEach((name, i) => words.push("--set", `${name}=${shown.values[i]}`));
    return [map.base, ...words.map(quoted)].join(" ");
  }

  function labelled(map, axis, i) {
    return `${map.names[axis]} ${short(map.axes[axis][i])}${map.units[axis] ? ` ${map.units[axis]}` : ""}`;
  }

  function toldOf(map, i, j) {
    const at = map.names.length > 1 ? i * map.axes[1].length + j : i;
    const where = [labelled(map, 0, i), ...(map.names.length > 1 ? [labelled(map, 1, j)] : [])].join(", ");
    if (!map.flown[at]) return `${where}: not flown`;
    return `${where}: ${map.flown[at]} flights, ${number(map.completed[at])} % completed (95 % interval ${map.interval[at]} %); ` +
      [`load error median ${number(map.median[at])} mm, worst ${number(map.worst[at])} mm`,
        ...map.steps.map((step) => `${step.name} ${numberOf({ own: true }, step.values[at])} ${step.unit}`)].join(", ");
  }

  let picked = null; // the cell whose command is shown: {map, at}

  function choose(data, map, i, j) {
    const at = map.names.length > 1 ? i * map.axes[1].length + j : i, shown = map.shown[at];
    picked = { map, at };
    const box = document.getElementById("chosen");
    box.hidden = !shown;
    if (!shown) return;
    box.querySelector("h3").textContent = `Flight ${shown.index}: ${shown.outcome}, law ${map.law}, seed ${shown.seed}`;
    box.querySelector("p").textContent = toldOf(map, i, j);
    box.querySelector("code").textContent = commandOf(map, shown);
  }

  /** Draws the map as wide as its card, or wider where the cells need it. */
  function show(data, map, host, kind) {
    const [xs, ys] = [map.axes[0], map.axes[1] || [0]], flat = map.names.length === 1;
    const left = flat ? 12 : 74, right = 8, bottom = 44, top = 8, frame = host.querySelector(".frame");
    const numbers = xs.length * ys.length <= MOST_NUMBERS;
    const width = Math.max(frame.clientWidth, left + right + xs.length * (numbers ? NUMBER_PX : CELL_PX));
    const w = (width - left - right) / xs.length, h = flat ? 64 : Math.min(Math.max(440 / ys.length, CELL_PX), 56);
    const height = top + h * ys.length + bottom;
    const svg = document.createElementNS(SVG, "svg");
    Object.entries({ width, height, viewBox: `0 0 ${width} ${height}`, role: "group" }).forEach(
      ([name, value]) => svg.setAttribute(name, value));
    svg.setAttribute("aria-label", `${kind.name}, law ${map.law}`);
    const said = host.querySelector(".said");
    xs.forEach((_, i) => ys.forEach((__, j) => {
      const at = flat ? i : i * ys.length + j, value = kind.values[at], rgb = colourOf(kind, value);
      const x = left + i * w, y = top + (ys.length - 1 - j) * h;
      const cell = draw("rect", { x, y, width: w, height: h, class: "cell", tabindex: 0, role: "button",
        fill: rgb ? `rgb(${rgb.join(",")})` : "var(--line)", "data-cell": at }, svg);
      cell.setAttribute("aria-label", toldOf(map, i, j));
      const tell = () => { said.textContent = toldOf(map, i, j); };
      cell.addEventListener("mouseenter", tell);
      cell.addEventListener("focus", tell);
      const pick = () => {
        for (const other of document.querySelectorAll("rect.chosen")) other.classList.remove("chosen");
        cell.classList.add("chosen");
        tell();
        choose(data, map, i, j);
      };
      cell.addEventListener("click", pick);
      cell.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); pick(); } });
      if (picked && picked.map === map && picked.at === at) cell.classList.add("chosen");
      if (!numbers) return;
      const dark = rgb && 0.3 * rgb[0] + 0.59 * rgb[1] + 0.11 * rgb[2] >= 128;
      draw("text", { x: x + w / 2, y: y + h / 2 + 4, "text-anchor": "middle", class: rgb ? (dark ? "dark" : "pale") : "" }, svg, numberOf(kind, value));
    }));
    const longest = DIGIT_PX * (Math.max(...xs.map((value) => short(value).length)) + 1);
    const stride = Math.ceil(longest / w), low = top + h * ys.length;
    xs.forEach((value, i) => i % stride || draw("text", { x: left + (i + 0.5) * w, y: low + 16, "text-anchor": "middle" }, svg, short(value)));
    const title = (axis) => map.names[axis] + (map.units[axis] ? ` (${map.units[axis]})` : "");
    draw("text", { x: (left + Math.min(width, frame.clientWidth)) / 2, y: low + 36, "text-anchor": "middle" }, svg, title(0));
    if (!flat) {
      const skip = Math.max(1, Math.ceil(ys.length / 20));
      ys.forEach((value, j) => j % skip || draw("text", { x: left - 6, y: top + (ys.length - 0.5 - j) * h + 4, "text-anchor": "end" }, svg, short(value)));
      draw("text", { x: 14, y: top + h * ys.length / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${top + h * ys.length / 2})` }, svg, title(1));
    }
    frame.replaceChildren(svg);
  }

  function add(data, map) {
    const host = document.createElement("div");
    host.className = "card map";
    const head = document.createElement("h3");
    head.textContent = `law ${map.law}: ${map.names.join(" and ")}`;
    const choice = document.createElement("div");
    choice.className = "choice";
    const said = document.createElement("p");
    said.className = "said";
    const frame = document.createElement("div");
    frame.className = "frame";
    host.append(head, choice, frame, said);
    const kinds = kindsOf(map);
    let shown = kinds[0];
    kinds.forEach((kind) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${kind.name} (${kind.unit})`;
      button.addEventListener("click", () => {
        for (const other of choice.children) other.setAttribute("aria-pressed", String(other === button));
        shown = kind;
        show(data, map, host, kind);
      });
      choice.append(button);
    });
    document.getElementById("maps").append(host);
    // if every flight completes, only the errors are worth seeing
    const every = map.completed.every((share) => share === null || share === 100);
    choice.children[every ? KINDS.length - 1 : 0].click();
    const fade = () => { // the cells would cover a shadow like that of the other cards
      const { scrollLeft: before, scrollWidth, clientWidth } = frame;
      frame.classList.toggle("before", before > 1);
      frame.classList.toggle("after", scrollWidth - clientWidth - before > 1);
    };
    frame.addEventListener("scroll", fade);
    fade();
    let width = frame.clientWidth;
    new ResizeObserver(() => {
      if (frame.clientWidth === width) return;
      width = frame.clientWidth;
      show(data, map, host, shown);
      fade();
    }).observe(frame);
  }

  /** Copies a text to the clipboard, or selects it so that it can be copied by hand. */
  function copy(button) {
    const code = button.parentElement.querySelector("code");
    const range = document.createRange();
    range.selectNodeContents(code);
    const selection = window.getSelection();
    selection.removeAllRanges();
    selection.addRange(range);
    const done = navigator.clipboard ? navigator.clipboard.writeText(code.textContent) : Promise.reject();
    done.then(() => { button.textContent = "copied"; }, () => { button.textContent = "marked"; });
  }

  const data = JSON.parse(document.getElementById("sweep-data").textContent);
  if (document.getElementById("maps")) data.maps.forEach((map) => add(data, map));
  for (const button of document.querySelectorAll(".copy")) button.addEventListener("click", () => copy(button));
  document.documentElement.dataset.ready = "1";
})();
