// The part as it stands at a row: a height for each cell of a grid, cut by the core, drawn by the shader.

const MOVING_TRIANGLES = 12000;  // while something moves and a processor draws
const UNCUT = [205, 192, 160], CUT = [196, 203, 210], NOT_YET = [222, 226, 230], NOT_KNOWN = [150, 158, 166];
const OFF = ["#2166ac", "#67a9cf", "#d1e5f0", "#f7f7f7", "#fddbc7", "#ef8a62", "#b2182b"];  // blue: too much is cut
const PART_WORDS = { error: "error by deflection (mm)", nominal: "above the nominal part (mm)", force: "force (N)", tool: "tool", plain: "" };

// The fourth colour is a weight: walls are narrow, and shall be seen.
const PART_VERTEX = `
in vec4 tone; out vec3 place, seen; out vec4 tint;
void main() {
  place = position;
  tint = vec4(tone.rgb * tone.a, tone.a);
  vec4 world = modelMatrix * vec4(position, 1.0);
  seen = world.xyz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;
const PART_FRAGMENT = `
uniform vec3 cut; uniform float foot, fine; in vec3 place, seen; in vec4 tint; out vec4 painted;
void main() {
  vec3 across = cross(dFdx(seen), dFdy(seen)), side = normalize(cross(dFdx(place), dFdy(place)));
  vec3 normal = normalize(across);
  if (dot(normal, cameraPosition - seen) < 0.0) normal = -normal;
  if (place.z < foot + fine && abs(side.z) > 0.5) discard;  // cut through
  vec3 gap = abs(place - cut);
  bool isCut = (gap.x < fine && abs(side.x) > 0.9) || (gap.y < fine && abs(side.y) > 0.9) || (gap.z < fine && abs(side.z) > 0.9);
  float stripe = mod(place.x + place.y + place.z, 40.0 * fine) < 12.0 * fine ? 0.62 : 0.74;
  float light = 0.58 + 0.42 * max(dot(normal, normalize(vec3(-1.0, -2.0, 3.0))), 0.0);
  painted = vec4(isCut ? vec3(stripe) : tint.rgb / tint.a * light, 1.0);
}`;

class Part {
  constructor(page, { cell, row, height }, cells) {
    const { cells: [width, depth], low, size, bottom } = head.part;
    Object.assign(this, { page, width, depth, low, size, bottom, cells, height, cell });
    this.sort(row);
    this.heights = Float32Array.from(cells.raw);
    this.event = new Int32Array(width * depth).fill(-1);
    this.lastOf = new Int32Array(width * depth).fill(-1);
    this.order.forEach((event) => { this.lastOf[cell[event]] = event; });
    this.row = row;
    this.done = 0;
    this.makeMesh();
    this.wire();
  }

  // Events by row, and how many there are up to each.
  sort(row) {
    const rows = this.page.rows;
    this.upTo = new Uint32Array(rows + 1);
    row.forEach((one) => { this.upTo[one + 1]++; });
    for (let i = 0; i < rows; i++) this.upTo[i + 1] += this.upTo[i];
    const next = this.upTo.slice();
    this.order = new Uint32Array(row.length);
    row.forEach((one, event) => { this.order[next[one]++] = event; });
  }

  makeMesh() {
    const { width, depth, page } = this, { software } = page.scene;
    // vertices are cells, with two more around: the edge of the stock, and its foot
    this.points = new Float32Array(3 * (width + 4) * (depth + 4));
    this.tones = new Uint8Array(4 * (width + 4) * (depth + 4));
    this.cut = [Infinity, Infinity, Infinity];
    const span = Math.hypot(width * this.size[0], depth * this.size[1]);
    this.material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: PART_VERTEX,
      fragmentShader: PART_FRAGMENT,
      side: THREE.DoubleSide,
      uniforms: {
        foot: { value: this.bottom },
        fine: { value: span / 4000 },
        cut: { value: new THREE.Vector3(1e9, 1e9, 1e9) },
      },
    });
    const attributes = { position: new THREE.BufferAttribute(this.points, 3), tone: new THREE.BufferAttribute(this.tones, 4, true) };
    this.fine = gridOf(width, depth, 1, attributes);
    const stride = Math.ceil(Math.sqrt((2 * width * depth) / MOVING_TRIANGLES));
    this.coarse = software && stride > 1 ? gridOf(width, depth, stride, attributes) : this.fine;
    this.mesh = new THREE.Mesh(this.fine, this.material);
    this.mesh.frustumCulled = false;
    this.mesh.matrixAutoUpdate = false;
    this.mesh.matrix.fromArray(head.part.frame);
    page.scene.scene.add(this.mesh);
  }

  // ---- what is seen

  wire() {
    const { page } = this, choice = byId("part-colour"), axis = byId("section-axis"), depth = byId("section");
    const again = () => { this.drawn = -1; this.show(page.row); page.scene.changed(false); };
    choice.addEventListener("change", again);
    byId("show-finished").addEventListener("change", again);
    byId("show-path").addEventListener("change", again);
    const section = () => {
      depth.disabled = axis.value === "";
      this.section(axis.value === "" ? -1 : Number(axis.value), Number(depth.value) / 1000);
    };
    axis.addEventListener("change", section);
    depth.addEventListener("input", section);
    // whoever moves in time wants to see the part at that time
    const follow = () => { byId("show-finished").checked = false; };
    byId("slider").addEventListener("input", follow, true);
    byId("play").addEventListener("click", follow, true);
  }

  // Show the part cut off behind a share of its size along an axis; -1 shows it whole.
  section(axis, share) {
    const top = this.cells.raw.reduce((most, one) => Math.max(most, one), -Infinity);
    const ends = [...this.low.map((low, k) => [low, low + this.size[k] * [this.width, this.depth][k]]), [this.bottom, top]];
    this.cut = [Infinity, Infinity, Infinity];
    if (axis >= 0) this.cut[axis] = ends[axis][0] + share * (ends[axis][1] - ends[axis][0]);
    this.material.uniforms.cut.value.set(...this.cut.map((place) => Math.min(place, 1e9)));
    this.place();
    this.page.scene.changed(false);
  }

  // Put the vertices where they are; what lies behind the section is put onto it.
  place() {
    const { width, depth, points, heights, bottom, low, size, cut } = this, across = width + 4;
    const along = (count, axis) => Array.from({ length: count + 4 }, (_, k) => low[axis] + size[axis] * Math.min(Math.max(k - 1.5, 0), count));
    const x = along(width, 0), y = along(depth, 1);
    const height = (i, j) => {
      if (i <= 0 || j <= 0 || i >= width + 3 || j >= depth + 3) return bottom;
      return heights[Math.min(Math.max(j - 2, 0), depth - 1) * width + Math.min(Math.max(i - 2, 0), width - 1)];
    };
    const share = (places, k, end) => Math.max((end - places[k - 1]) / Math.max(places[k] - places[k - 1], 1e-6), 0);
    for (let j = 0, n = 0; j < depth + 4; j++) {
      for (let i = 0; i < across; i++) {
        const overX = x[i] > cut[0], overY = y[j] > cut[1];
        let z = height(i, j);
        if (overX) { const part = share(x, i, cut[0]); z = part > 0 ? part * z + (1 - part) * height(i - 1, j) : bottom; }
        if (overY) { const part = share(y, j, cut[1]); z = part > 0 ? part * z + (1 - part) * height(i, j - 1) : bottom; }
        points[n++] = overX ? cut[0] : x[i];
        points[n++] = overY ? cut[1] : y[j];
        points[n++] = Math.min(z, cut[2]);
      }
    }
    this.fine.attributes.position.needsUpdate = true;
  }

  get isFinished() { return byId("show-finished").checked; }

  show(row) {
    const { scene, stock } = this.page, quantity = byId("part-colour").value;
    scene.hidesPath = quantity !== "" && !byId("show-path").checked;
    this.mesh.visible = quantity !== "";
    if (stock) stock.visible = quantity === "" && byId("show-stock").checked;
    byId("part-legend").hidden = quantity === "";
    document.querySelector(".legend").hidden = scene.hidesPath;
    if (quantity === "") return;
    this.cutUpTo(this.isFinished ? this.order.length : this.upTo[row + 1]);
    if (this.drawn === this.done) return;
    this.drawn = this.done;
    this.paint(quantity);
    this.legend(quantity);
  }

  // Take the first so many events as done; going back begins again, which takes milliseconds.
  cutUpTo(count) {
    if (count < this.done) {
      this.heights.set(this.cells.raw);
      this.event.fill(-1);
      this.done = 0;
    }
    for (; this.done < count; this.done++) {
      const event = this.order[this.done], cell = this.cell[event];
      this.heights[cell] = this.height[event];
      this.event[cell] = event;
    }
    this.place();
  }

  paint(quantity) {
    const { event, row, lastOf } = this, { steep } = this.cells, data = new Uint8Array(4 * this.event.length), { columns } = this.page;
    const off = this.cells[quantity], end = head.part.ends[quantity];
    const scale = head.quantities.find(({ name }) => name === quantity);
    const palette = tableOf(off ? OFF : head.palette);
    const tools = PASS_COLOURS.map((colour) => mixed([colour], 0, 1));
    for (let cell = 0; cell < event.length; cell++) {
      const one = event[cell];
      let colour = CUT;
      if (one < 0) colour = UNCUT;
      else if (quantity === "tool") colour = tools[head.tools.indexOf(columns.tool[row[one]]) % tools.length];
      else if (scale) colour = palette[Math.round(255 * Math.max(shadeOf(scale, columns[quantity][row[one]]), 0))];
      else if (off && one !== lastOf[cell]) colour = NOT_YET;
      else if (off) colour = Number.isNaN(off[cell]) ? NOT_KNOWN : palette[Math.round(127.5 * (1 + Math.min(Math.max(off[cell] / end, -1), 1)))];
      data[4 * cell] = colour[0]; data[4 * cell + 1] = colour[1]; data[4 * cell + 2] = colour[2]; data[4 * cell + 3] = one < 0 ? 6 : 50 + 205 * (steep[cell] || 0);
    }
    const { width, depth, tones } = this, words = new Uint32Array(data.buffer), out = new Uint32Array(tones.buffer);
    for (let j = 0, n = 0; j < depth + 4; j++) {
      const row = Math.min(Math.max(j - 2, 0), depth - 1) * width;
      for (let i = 0; i < width + 4; i++) out[n++] = words[row + Math.min(Math.max(i - 2, 0), width - 1)];
    }
    this.fine.attributes.tone.needsUpdate = true;
  }

  legend(quantity) {
    const bar = byId("part-bar"), pen = bar.getContext("2d"), end = head.part.ends[quantity];
    const scale = head.quantities.find(({ name }) => name === quantity);
    byId("part-name").textContent = PART_WORDS[quantity];
    byId("part-scale").hidden = !end && !scale;
    const palette = tableOf(end ? OFF : head.palette);
    for (let x = 0; x < bar.width; x++) {
      pen.fillStyle = `rgb(${palette[Math.round((255 * x) / (bar.width - 1))].slice(0, 3)})`;
      pen.fillRect(x, 0, 1, bar.height);
    }
    byId("part-low").textContent = end ? `-${rounded(end)} too much` : scale ? rounded(scale.low) : "";
    byId("part-high").textContent = end ? `left +${rounded(end)}` : scale ? rounded(scale.high) : "";
    byId("part-tools").replaceChildren(...(quantity === "tool" ? head.tools : []).map((tool, k) => {
      const item = document.createElement("span"), swatch = item.appendChild(document.createElement("b"));
      swatch.className = "swatch";
      swatch.style.background = PASS_COLOURS[k % PASS_COLOURS.length];
      item.append(`T${tool} `);
      return item;
    }));
    const stands = this.volume();
    byId("part-volume").textContent = `${rounded(stands / 1000)} cm³ stand, ${rounded((this.volume(this.cells.raw) - stands) / 1000)} cm³ are cut`;
  }

  // mm³ of what stands.
  volume(heights = this.heights) {
    return heights.reduce((sum, height) => sum + height - this.bottom, 0) * this.size[0] * this.size[1];
  }

  detail(isFine) { this.mesh.geometry = isFine ? this.fine : this.coarse; }

  // ---- what is clicked

  // The row that left the surface under a place on the canvas, -1 beside the part; says what is known of it.
  rowUnder(x, y) {
    const cell = this.mesh.visible ? this.cellUnder(x, y) : -1, event = cell < 0 ? -1 : this.event[cell];
    const note = byId("part-note");
    note.textContent = "";
    if (cell >= 0 && event < 0) note.textContent = "not cut";
    if (event < 0) return -1;
    const isLast = event === this.lastOf[cell], row = isLast ? this.cells.left[cell] : this.row[event];
    const { columns } = this.page, words = [`line ${columns.line[row]}`, `${columns.time[row].toFixed(2)} s`];
    if (columns.force) words.push(`force ${rounded(columns.force[row])} N`);
    if (isLast && this.cells.error) words.push(`error ${signed(this.cells.error[cell])} mm`);
    if (isLast && Number.isFinite(this.cells.nominal?.[cell])) words.push(`${signed(this.cells.nominal[cell])} mm to nominal`);
    note.textContent = words.join(" · ");
    return row;
  }

  // The cell at which a ray from the eye enters the part.
  cellUnder(x, y) {
    const { camera, canvas } = this.page.scene, inverse = this.mesh.matrix.clone().invert();
    const from = camera.position.clone().applyMatrix4(inverse);
    const through = new THREE.Vector3((2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight, 0.5).unproject(camera);
    const way = through.applyMatrix4(inverse).sub(from).normalize();
    const top = this.heights.reduce((most, one) => Math.max(most, one), -Infinity);
    const high = [this.low[0] + this.size[0] * this.width, this.low[1] + this.size[1] * this.depth, top];
    const box = new THREE.Box3(new THREE.Vector3(...this.low, this.bottom), new THREE.Vector3(...high.map((end, k) => Math.min(end, this.cut[k]))));
    const enters = new THREE.Ray(from, way).intersectBox(box, new THREE.Vector3());
    if (!enters) return -1;
    const step = Math.min(...this.size) / 3, at = enters.addScaledVector(way, 1e-4);
    for (; box.containsPoint(at); at.addScaledVector(way, step)) {
      const i = Math.floor((at.x - this.low[0]) / this.size[0]), j = Math.floor((at.y - this.low[1]) / this.size[1]);
      const cell = Math.min(j, this.depth - 1) * this.width + Math.min(i, this.width - 1);
      if (at.z <= this.heights[cell] && this.heights[cell] > this.bottom) return cell;
    }
    return -1;
  }
}

const signed = (value) => (Number.isFinite(value) ? `${value < 0 ? "-" : "+"}${Math.abs(value).toFixed(3)}` : "not known");

const tableOf = (palette) => Array.from({ length: 256 }, (_, k) => mixed(palette, k / 255, 0));

// Triangles between every so many cells of a grid in both directions; the edges are always there.
function gridOf(width, depth, stride, attributes) {
  const kept = (count) => Array.from({ length: count + 4 }, (_, k) => k).filter((k) => k < 3 || k > count || (k - 2) % stride === 0);
  const x = kept(width), y = kept(depth), corners = new Uint32Array(6 * (x.length - 1) * (y.length - 1));
  let n = 0;
  for (let j = 1; j < y.length; j++) {
    for (let i = 1; i < x.length; i++) {
      const [a, b, c, d] = [[i - 1, j - 1], [i, j - 1], [i, j], [i - 1, j]].map(([p, q]) => y[q] * (width + 4) + x[p]);
      corners.set([a, b, c, a, c, d], n);
      n += 6;
    }
  }
  const shape = new THREE.BufferGeometry();
  shape.setIndex(new THREE.BufferAttribute(corners, 1));
  Object.entries(attributes).forEach(([name, values]) => shape.setAttribute(name, values));
  return shape;
}
