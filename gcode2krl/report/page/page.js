// What links the views: one chosen row of the samples, told to all of them.

const PASS = "pass";
const MOST_ERRORS = 50;  // that are marked in the views

class Page {
  constructor(columns, lines, solids, meshes, part) {
    this.columns = columns;
    this.solidColumns = solids;
    this.meshes = meshes;
    this.partColumns = part;
    this.row = 0;
    this.rows = head.rows;
    this.stretch = null;
    this.hidden = { passes: new Set(), tools: new Set() };
    this.listing = head.has_text ? new Listing(byId("listing"), lines, (line) => this.goToLine(line)) : null;
    if (!this.listing) {
      byId("listing").textContent = "The G-code is not at hand.";
      byId("listing").tabIndex = -1;
    }
    if (this.rows) this.startViews();
    this.listenToKeys();
    document.querySelectorAll("button.go").forEach((button) => button.addEventListener("click", () => this.go(button.dataset)));
  }

  startViews() {
    this.firstOfLine = new Map();
    for (let i = this.rows - 1; i >= 0; i--) this.firstOfLine.set(this.columns.line[i], i);
    this.linesInOrder = Array.from(this.firstOfLine.keys()).filter((line) => line > 0).sort((a, b) => a - b);
    try {
      this.scene = new Scene(byId("scene"), this.columns);
    } catch (error) {
      byId("scene-note").textContent = "No 3D view: this browser offers no WebGL.";
    }
    if (this.scene) this.addBodies();
    const errors = this.errorRows();
    this.plots = new Plots(byId("plots"), this.columns, errors, (row) => this.select(row), (stretch) => this.lookAt(stretch));
    this.fillColours();
    this.fillMenu();
    this.listenToTools();
    this.listenToPrinter();
    this.paint();
    if (errors.length) {
      this.scene?.markErrors(errors);
      byId("scene-note").textContent ||= "\u2715 error";
      this.part?.follow();
    }
    this.select(errors[0] ?? this.worstRow());
  }

  addBodies() {
    const { scene } = this;
    if (head.stock) {
      this.stock = stockBox(head.stock);
      scene.scene.add(this.stock);
    }
    if (head.axes) {
      this.axes = toolAxes(head.axes);
      scene.scene.add(this.axes);
    }
    if (head.robot) {
      this.robot = new Robot(head.robot, this.columns, head.near, this.meshes);
      this.robot.wanted = true;
      scene.scene.add(this.robot.root, this.robot.obstacles);
      this.robot.show(this.firstFeed());
      scene.scene.updateMatrixWorld(true);
      scene.robotBox = new THREE.Box3().setFromObject(this.robot.root);
    }
    if (head.solids) {
      this.solids = solidsOf(head.solids, this.solidColumns);
      scene.scene.add(this.solids);
    }
    if (head.part) {
      this.part = scene.part = new Part(this, ...this.partColumns);
      scene.fit("part");
    }
    byId("show-stock").parentElement.hidden = !this.stock;
    byId("show-robot").parentElement.hidden = !this.robot;
    byId("show-cell").parentElement.hidden = !head.robot?.obstacles.length;
    document.querySelector('[data-view="robot"]').hidden = !this.robot;
    let down = null;
    scene.canvas.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
    scene.canvas.addEventListener("click", (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return;
      const box = scene.canvas.getBoundingClientRect();
      const place = [event.clientX - box.left, event.clientY - box.top];
      const onPath = scene.hidesPath ? -1 : scene.rowUnder(...place), row = onPath >= 0 || !this.part ? onPath : this.part.rowUnder(...place);
      if (row >= 0) this.select(row);
    });
  }

  firstFeed() {
    return Math.max(this.columns.pass.findIndex((pass) => pass >= 0), 0);
  }

  // Where lines with errors move the tool: of each line the sample that is farthest beyond a joint limit, else that nearest to a hit.
  errorRows() {
    const { line, margin, clearance } = this.columns;
    const lines = head.marked.filter(([number, severity]) => severity === "error" && this.firstOfLine.has(number));
    return lines.slice(0, MOST_ERRORS).map(([number]) => {
      const first = this.firstOfLine.get(number);
      const lowest = (values) => {
        let at = first;
        for (let i = first; values && line[i] === number; i++) if (values[i] < values[at]) at = i;
        return at;
      };
      const beyond = lowest(margin);
      return margin?.[beyond] < 0 ? beyond : lowest(clearance);
    });
  }

  // Where the tool bends away or is loaded most; without either, where it first cuts.
  worstRow() {
    const values = this.columns.deflection ?? this.columns.force;
    if (!values) return this.firstFeed();
    let worst = this.firstFeed();
    for (let i = 0; i < this.rows; i++) if (values[i] > values[worst]) worst = i;
    return worst;
  }

  // ---- choosing a row

  select(row) {
    const { columns } = this;
    this.row = Math.max(0, Math.min(row, this.rows - 1));
    const line = columns.line[this.row];
    let first = this.row, last = this.row;
    while (first > 0 && columns.line[first - 1] === line && this.row - first < 5000) first--;
    while (last < this.rows - 1 && columns.line[last + 1] === line && last - this.row < 5000) last++;
    this.robot?.show(this.row);
    this.part?.show(this.row);
    this.scene?.showRow(this.row, Math.max(first - 1, 0), last);
    this.plots.mark(this.row);
    this.listing?.choose(line);
    byId("slider").value = this.row;
    byId("readout").textContent = this.words();
    byId("slider").setAttribute("aria-valuetext", `${columns.time[this.row].toFixed(2)} s, line ${line}`);
  }

  words() {
    const { columns, row } = this;
    const parts = [`${columns.time[row].toFixed(2)} s`];
    if (columns.line[row] > 0) parts.push(`line ${columns.line[row]}`);
    const near = this.robot?.nearest(row);
    if (near?.gap <= 0) parts.push(`${near.who} hits ${near.what}`);
    parts.push(["x", "y", "z"].map((axis) => `${axis.toUpperCase()} ${columns[axis][row].toFixed(2)}`).join(" "));
    head.quantities.filter(({ name }) => name !== "clearance").forEach(({ name, label, unit }) => {
      parts.push(`${name === "margin" ? "margin" : label} ${rounded(columns[name][row])}${unit === "°" ? "" : " "}${unit}`);
    });
    if (near?.gap > 0) parts.push(`${near.who} ${rounded(near.gap)} mm from ${near.what}`);
    if (this.robot && !this.robot.reached) parts.push("out of the robot's reach");
    return parts.join("  ·  ");
  }

  // Go to where a line's motion begins, or that of the next line that moves.
  goToLine(line) {
    if (!this.rows) { this.listing?.choose(line); return; }
    const next = this.linesInOrder[this.linesInOrder.length && rowAt(this.linesInOrder, line)];
    const there = this.firstOfLine.has(line) ? line : this.linesInOrder.find((one) => one > line) ?? next;
    if (there !== undefined) this.select(this.firstOfLine.get(there));
  }

  go({ line, row }) {
    byId("look").scrollIntoView({ block: "start" });
    if (row !== undefined) this.select(Number(row));
    else this.goToLine(Number(line));
  }

  stepLine(way) {
    const { line } = this.columns;
    let row = this.row;
    while (row > 0 && row < this.rows - 1 && line[row] === line[this.row]) row += way;
    if (way < 0) while (row > 0 && line[row - 1] === line[row]) row--;
    this.select(row);
  }

  // ---- colours

  fillColours() {
    const choices = [...head.quantities.map(({ name, label }) => [name, label])];
    if (head.passes.length > 1) choices.push([PASS, "pass"]);
    choices.forEach(([name, label]) => byId("colour").add(new Option(label, name)));
    const wanted = ["deflection", "force", "speed"].find((name) => head.quantities.some((q) => q.name === name));
    byId("colour").value = wanted;
  }

  quantity() {
    return head.quantities.find(({ name }) => name === byId("colour").value);
  }

  paint() {
    const quantity = this.quantity(), { pass, tool } = this.columns;
    const steps = PASS_COLOURS.length, showsRapids = byId("show-rapids").checked;
    const values = quantity ? this.columns[quantity.name] : null;
    const shades = new Float32Array(this.rows);
    for (let i = 0; i < this.rows; i++) {
      const isOut = this.stretch && (i < this.stretch[0] || i > this.stretch[1]);
      if (pass[i] < 0) shades[i] = showsRapids ? (isOut ? PALE : RAPID) : NONE;
      else if (this.hidden.passes.has(pass[i]) || this.hidden.tools.has(tool[i])) shades[i] = NONE;
      else if (isOut) shades[i] = PALE;
      else if (!quantity) shades[i] = ((pass[i] % steps) + 0.5) / steps;
      else shades[i] = shadeOf(quantity, values[i]);
    }
    this.scene?.paint(shades, quantity ? head.palette : PASS_COLOURS, quantity ? 0 : steps);
    this.listing?.setHeat(this.heat(shades, quantity));
    this.legend(quantity);
  }

  // The darkest colour of each line.
  heat(shades, quantity) {
    const worst = new Map(), { line } = this.columns;
    for (let i = 0; i < this.rows; i++) {
      if (shades[i] >= 0 && !(worst.get(line[i]) >= shades[i])) worst.set(line[i], shades[i]);
    }
    const palette = quantity ? head.palette : PASS_COLOURS;
    const css = (shade) => `rgb(${mixed(palette, shade, quantity ? 0 : PASS_COLOURS.length).slice(0, 3).map(Math.round)})`;
    return { has: (one) => worst.has(one), get: (one) => css(worst.get(one)) };
  }

  legend(quantity) {
    const bar = byId("legend-bar"), pen = bar.getContext("2d");
    const palette = quantity ? head.palette : PASS_COLOURS, steps = quantity ? 0 : PASS_COLOURS.length;
    for (let x = 0; x < bar.width; x++) {
      const share = x / (bar.width - 1);
      pen.fillStyle = `rgb(${mixed(palette, quantity?.lowIsBad ? 1 - share : share, steps).slice(0, 3).map(Math.round)})`;
      pen.fillRect(x, 0, 1, bar.height);
    }
    byId("legend-name").textContent = quantity ? `${quantity.label} (${quantity.unit})` : "pass, in turn";
    byId("legend-low").textContent = quantity ? rounded(quantity.low) : "";
    byId("legend-high").textContent = quantity ? rounded(quantity.high) : "";
    const beyond = quantity && quantity.beyond !== null;
    byId("legend-note").textContent = beyond ? `${quantity.lowIsBad && quantity.name !== "speed" ? "smallest" : "largest"} ${rounded(quantity.beyond)} ${quantity.unit}` : "";
  }

  // ---- what is shown

  fillMenu() {
    const menu = document.querySelector("#passes .menu");
    const add = (label, colour, onChange, onOnly) => {
      const row = menu.appendChild(document.createElement("div"));
      const name = row.appendChild(document.createElement("label"));
      const box = name.appendChild(document.createElement("input"));
      box.type = "checkbox";
      box.checked = true;
      if (colour) name.appendChild(document.createElement("b")).style.background = colour;
      name.append(` ${label}`);
      box.addEventListener("change", () => { onChange(box.checked); this.paint(); });
      const only = row.appendChild(document.createElement("button"));
      only.type = "button";
      only.textContent = "only";
      only.setAttribute("aria-label", `only ${label}`);
      only.addEventListener("click", () => onOnly(box));
      return box;
    };
    const switches = (set, key) => (on) => (on ? set.delete(key) : set.add(key));
    const group = (entries, set) => {
      const boxes = entries.map(([key, label, colour]) => add(label, colour, switches(set, key), (own) => {
        const isAlone = own.checked && boxes.every((box) => box === own || !box.checked);
        boxes.forEach((box, k) => {
          box.checked = isAlone || box === own;
          switches(set, entries[k][0])(box.checked);
        });
        this.paint();
      }));
    };
    if (head.tools.length > 1) group(head.tools.map((tool) => [tool, `tool T${tool}`, null]), this.hidden.tools);
    group(head.passes.map(({ name }, k) => [k, name, PASS_COLOURS[k % PASS_COLOURS.length]]), this.hidden.passes);
    document.addEventListener("click", (event) => {
      if (!byId("passes").contains(event.target)) byId("passes").open = false;
    });
  }

  lookAt(stretch) {
    this.stretch = stretch;
    this.paint();
  }

  listenToTools() {
    byId("colour").addEventListener("change", () => this.paint());
    byId("show-rapids").addEventListener("change", () => this.paint());
    byId("show-stock").addEventListener("change", (event) => { this.stock.visible = event.target.checked; this.part?.show(this.row); this.scene.changed(false); });
    byId("show-axes")?.addEventListener("change", (event) => { this.axes.visible = event.target.checked; this.scene.changed(false); });
    byId("show-solids")?.addEventListener("change", (event) => { this.solids.visible = event.target.checked; this.scene.changed(false); });
    byId("show-cell").addEventListener("change", (event) => { this.robot.obstacles.visible = event.target.checked; this.scene.changed(false); });
    byId("show-robot").addEventListener("change", (event) => {
      this.robot.wanted = event.target.checked;
      this.select(this.row);
    });
    document.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => {
      const { view } = button.dataset;
      if (view === "closer" || view === "further") this.scene?.zoom(view === "closer" ? 0.8 : 1.25);
      else this.scene?.fit(view);
    }));
    byId("slider").addEventListener("input", (event) => this.select(Number(event.target.value)));
    byId("play").addEventListener("click", () => this.play(!this.playing));
  }

  // ---- printing: as wide as a sheet, and drawn at once, since a browser does not wait for it

  listenToPrinter() {
    const fit = (isPrinted) => {
      document.body.classList.toggle("printed", isPrinted);
      this.plots.resize();
      this.scene?.resize();
      this.scene?.draw(0);
    };
    window.addEventListener("beforeprint", () => fit(true));
    window.addEventListener("afterprint", () => fit(false));
  }

  // ---- playing and keys

  play(on) {
    this.playing = on;
    byId("play").textContent = on ? "pause" : "play";
    byId("play").setAttribute("aria-pressed", String(on));
    if (!on) return;
    const { time } = this.columns, end = time[this.rows - 1];
    if (this.row >= this.rows - 1) this.select(0);
    let clock = time[this.row], last = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      clock += ((now - last) / 1000) * Number(byId("pace").value);
      last = now;
      this.select(rowAt(time, clock));
      if (clock >= end) this.play(false);
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  listenToKeys() {
    const listing = byId("listing");
    const inListing = () => document.activeElement === listing;
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !this.rows) return;
      const at = event.target, kind = at.tagName;
      if (kind === "SELECT" || (kind === "INPUT" && at.type !== "range")) return;
      const second = (way) => this.select(rowAt(this.columns.time, this.columns.time[this.row] + way));
      const steps = event.shiftKey ? 10 : 1;
      const actions = {
        ArrowRight: () => this.select(this.row + steps),
        ArrowLeft: () => this.select(this.row - steps),
        PageDown: () => second(1),
        PageUp: () => second(-1),
        n: () => this.stepLine(1),
        b: () => this.stepLine(-1),
      };
      if (inListing()) {
        actions.ArrowDown = actions.n;
        actions.ArrowUp = actions.b;
      }
      if (kind !== "BUTTON" && kind !== "SUMMARY") actions[" "] = () => this.play(!this.playing);
      const action = actions[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
  }
}

function shadeOf({ low, high, lowIsBad }, value) {
  if (!Number.isFinite(value)) return RAPID;
  const share = Math.min(Math.max((value - low) / (high - low), 0), 1);
  return lowIsBad ? 1 - share : share;
}

function say(words) {
  const place = byId("trouble");
  place.textContent = words;
  place.hidden = false;
}

if (typeof DecompressionStream === "undefined") {
  say("This browser is too old for the 3D view, the plots and the G-code: Chrome or Edge 103, Firefox 113, Safari 16.4 or newer shows them.");
} else {
  const reads = [readColumns("columns", head.columns, head.rows), readLines(), readSolids(), readMeshes(), readPart()];
  window.report = new Page(...await Promise.all(reads));
}
