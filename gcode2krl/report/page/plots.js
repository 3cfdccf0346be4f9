// Plots over time, one below the other: peaks are kept when many samples share a pixel.

const NEAR_PX = 4;
const PLOT_COLOURS = { speed: "#0072b2", force: "#b34700", deflection: "#00795a", margin: "#8a4b78", clearance: "#8c6d1f" };

class Plots {
  constructor(place, columns, errors, onPick, onStretch) {
    Object.assign(this, { place, columns, errors, onPick, onStretch });
    this.time = columns.time;
    this.work = workSpeed(columns);
    this.range = [this.time[0], this.time[this.time.length - 1]];
    this.whole = [...this.range];
    this.plots = head.quantities.map((quantity, number) => this.plot(quantity, number === head.quantities.length - 1));
    this.stretch(...this.range, true);
    new ResizeObserver(() => this.resize()).observe(place);
  }

  height() {
    const room = Math.max(0.38 * window.innerHeight, 200);
    return Math.max(58, Math.floor((room - 26) / head.quantities.length));
  }

  plot(quantity, isLast) {
    const holder = this.place.appendChild(document.createElement("div"));
    holder.className = "one";
    const name = holder.appendChild(document.createElement("div"));
    name.className = "name";
    const isClipped = quantity.name === "speed" && this.columns.speed.some((speed) => speed > this.top(quantity));
    name.textContent = `${quantity.label} (${quantity.unit})${isClipped ? ", rapids clipped \u25b4" : ""}`;
    const axis = { stroke: "#3c4650", grid: { stroke: "#e6e9ec", width: 1 }, ticks: { size: 4 }, font: "11px system-ui, sans-serif" };
    const u = new uPlot({
      width: this.place.clientWidth,
      height: this.height() + (isLast ? 26 : 0),
      padding: [14, 12, isLast ? 0 : 4, 0],
      cursor: { sync: { key: "time" }, drag: { x: true, y: false, setScale: false }, points: { show: false } },
      scales: { x: { time: false }, y: { range: (_, low, high) => this.ends(quantity, low, high) } },
      series: [{}, { stroke: PLOT_COLOURS[quantity.name], width: 1.2, points: { show: false }, spanGaps: false }],
      axes: [
        isLast ? { ...axis, size: 26, label: undefined, values: (_, ticks) => ticks.map((tick) => `${+tick.toFixed(6)} s`) } : { ...axis, size: 0, ticks: { show: false }, values: () => [] },
        { ...axis, size: 56, space: 24 },
      ],
      hooks: {
        setSelect: [(plot) => this.dragged(plot)],
        draw: [(plot) => markErrors(plot, this.errors.map((row) => this.time[row])), (plot) => isClipped && markClipped(plot, this.top(quantity)), () => this.place1 !== undefined && this.mark(this.place1)],
      },
    }, [[], []], holder);
    u.over.addEventListener("mousedown", () => { this.active = u; });
    u.over.addEventListener("click", (event) => this.clicked(u, quantity, event));
    u.over.addEventListener("dblclick", () => this.stretch(...this.whole));
    const now = u.over.appendChild(document.createElement("div"));
    now.className = "now";
    return { u, quantity, now, isLast };
  }

  ends(quantity, low, high) {
    const bottom = quantity.lowIsBad && quantity.name !== "speed" ? Math.min(0, low ?? 0) : 0;
    return [bottom, Math.max(Math.min((high ?? 1) * 1.08, this.top(quantity)), bottom + 1e-6)];
  }

  // Speed is drawn as high as feed moves are, or a feed of 10 mm/s would be a line at the foot of the rapids.
  top({ name }) { return name === "speed" ? this.work * 1.15 : Infinity; }

  // Show the time from start to end, s; the 3D view follows.
  stretch(start, end, isFirst = false) {
    this.range = [start, end];
    const first = rowAt(this.time, start), last = Math.min(rowAt(this.time, end) + 1, this.time.length - 1);
    this.plots.forEach(({ u, quantity }) => {
      const data = peaksKept(this.time, this.columns[quantity.name], first, last, Math.max(u.over.clientWidth, 300));
      u.batch(() => {
        u.setData(data, false);
        u.setScale("x", { min: start, max: end });
      });
    });
    if (!isFirst) this.onStretch(this.isWhole() ? null : [first, last]);
  }

  isWhole() {
    return this.range[0] <= this.whole[0] && this.range[1] >= this.whole[1];
  }

  dragged(u) {
    if (u !== this.active || u.select.width <= NEAR_PX) return;  // the others only show the same stretch
    this.active = null;
    const start = u.posToVal(u.select.left, "x"), end = u.posToVal(u.select.left + u.select.width, "x");
    this.plots.forEach((one) => one.u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false));
    this.wasDrag = true;
    this.stretch(Math.max(start, this.whole[0]), Math.min(end, this.whole[1]));
  }

  // The worst sample within some pixels of the click, so that a click on a peak finds the peak.
  clicked(u, quantity, event) {
    if (this.wasDrag) { this.wasDrag = false; return; }
    const x = event.clientX - u.over.getBoundingClientRect().left;
    const first = rowAt(this.time, u.posToVal(x - NEAR_PX, "x"));
    const last = rowAt(this.time, u.posToVal(x + NEAR_PX, "x"));
    const values = this.columns[quantity.name], sign = quantity.lowIsBad ? -1 : 1;
    let best = rowAt(this.time, u.posToVal(x, "x"));
    for (let i = first; i <= last; i++) if (sign * values[i] > sign * values[best]) best = i;
    this.onPick(best);
  }

  mark(row) {
    this.place1 = row;
    this.plots.forEach(({ u, now }) => {
      const x = u.valToPos(this.time[row], "x");
      now.style.display = x < 0 || x > u.bbox.width / devicePixelRatio ? "none" : "";  // asks for no layout
      now.style.left = `${x - 1}px`;
    });
  }

  // Where a row is on the page, for whoever wants to click there.
  placeOf(name, row) {
    const { u } = this.plots.find(({ quantity }) => quantity.name === name);
    const box = u.over.getBoundingClientRect();
    return [box.left + u.valToPos(this.time[row], "x"), box.top + u.valToPos(this.columns[name][row], "y")];
  }

  resize() {
    const width = this.place.clientWidth;
    if (!width) return;
    this.plots.forEach(({ u, isLast }) => u.setSize({ width, height: this.height() + (isLast ? 26 : 0) }));
    this.stretch(...this.range, true);
  }
}

// The highest speed of feed moves; without any that of all.
function workSpeed({ speed, pass }) {
  const highest = (isCounted) => speed.reduce((most, one, i) => (isCounted(i) && one > most ? one : most), 0);
  return highest((i) => pass[i] >= 0) || highest(() => true);
}

// A line through the plot at each time of an error.
function markErrors(u, times) {
  const pen = u.ctx, { min, max } = u.scales.x;
  pen.save();
  pen.fillStyle = "#c00000";
  times.filter((time) => time >= min && time <= max).forEach((time) => {
    pen.fillRect(u.valToPos(time, "x", true) - 0.5 * devicePixelRatio, u.bbox.top, devicePixelRatio, u.bbox.height);
  });
  pen.restore();
}

// A small triangle at the upper edge over each stretch that leaves the plot.
function markClipped(u, top) {
  const [times, values] = u.data, pen = u.ctx, half = 4 * devicePixelRatio, y = u.bbox.top;
  const { min, max } = u.scales.x;
  pen.save();
  pen.fillStyle = "#d55e00";
  let last = -Infinity;
  for (let i = 0; i < times.length; i++) {
    if (!(values[i] > top) || times[i] < min || times[i] > max) continue;
    const x = u.valToPos(times[i], "x", true);
    if (x - last < 3 * half) continue;
    last = x;
    pen.beginPath();
    pen.moveTo(x - half, y + 1.5 * half);
    pen.lineTo(x + half, y + 1.5 * half);
    pen.lineTo(x, y);
    pen.fill();
  }
  pen.restore();
}

// Time and values of some rows as uPlot takes them: of each pixel's rows the lowest and the highest.
function peaksKept(time, values, first, last, pixels) {
  const x = [], y = [], count = last - first + 1;
  const add = (i) => { x.push(time[i]); y.push(Number.isFinite(values[i]) ? values[i] : null); };
  if (count <= 4 * pixels) {
    for (let i = first; i <= last; i++) add(i);
    return [x, y];
  }
  for (let bin = 0; bin < 2 * pixels; bin++) {
    const from = first + Math.floor((bin * count) / (2 * pixels)), to = first + Math.floor(((bin + 1) * count) / (2 * pixels));
    let low = from, high = from;
    for (let i = from; i < to; i++) {
      if (values[i] < values[low] || Number.isNaN(values[low])) low = i;
      if (values[i] > values[high] || Number.isNaN(values[high])) high = i;
    }
    add(Math.min(low, high));
    if (low !== high) add(Math.max(low, high));
  }
  add(last);
  return [x, y];
}
