// The part as it stands at a row: cut by the core, in cells that became otherwise at rows; drawn by the shader.

const MOVING_TRIANGLES = 12000;  // while something moves and a processor draws
const WHOLE = [1e9, -1e9, 1e9];  // a section leaves what is below in x and z, and above in y: where the usual view looks at it
const NEARLY_ALL_CUT = 0.05;  // what stands, of the raw part: then there is little to be seen but the path
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
uniform vec3 cut; uniform float foot, fine; uniform bool isClosed; in vec3 place, seen; in vec4 tint; out vec4 painted;
void main() {
  vec3 across = cross(dFdx(seen), dFdy(seen)), side = normalize(cross(dFdx(place), dFdy(place)));
  vec3 normal = normalize(across);
  if (dot(normal, cameraPosition - seen) < 0.0) normal = -normal;
  if (place.z < foot + fine && abs(side.z) > 0.5) discard;  // cut through
  vec3 gap = abs(place - cut), at = place;
  bool isCut = (gap.x < fine && abs(side.x) > 0.9) || (gap.y < fine && abs(side.y) > 0.9) || (gap.z < fine && abs(side.z) > 0.9);
  if (isClosed) {  // who sees it from inside looks through the section
    if (place.x > cut.x || place.y < cut.y || place.z > cut.z) discard;
    isCut = !gl_FrontFacing;
    for (int k = 0; k < 3; k++) if (isCut && abs(cut[k]) < 1e8) at = mix(cameraPosition, place, (cut[k] - cameraPosition[k]) / (place[k] - cameraPosition[k]));
  }
  float stripe = mod(at.x + at.y + at.z, 40.0 * fine) < 12.0 * fine ? 0.62 : 0.74;
  float light = 0.58 + 0.42 * max(dot(normal, normalize(vec3(-1.0, -2.0, 3.0))), 0.0);
  painted = vec4(isCut ? vec3(stripe) : tint.rgb / tint.a * light, 1.0);
}`;

class Part {
  constructor(page, events, cells) {
    const Shape = head.part.cubes ? Surface : Heights;
    Object.assign(this, { page, cells, cell: events.cell, row: events.row });
    this.shape = new Shape(events, cells, page.scene.software);
    this.sort(events.shown ?? events.row);
    this.event = new Int32Array(this.shape.count).fill(-1);
    this.lastOf = new Int32Array(this.shape.count).fill(-1);
    this.order.forEach((event) => { this.lastOf[this.cell[event]] = event; });
    this.done = 0;
    this.makeMesh();
    this.wire();
    this.cutUpTo(this.order.length);
    if (this.volume() < NEARLY_ALL_CUT * this.shape.rawVolume) byId("show-path").checked = true;
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
    const { page, shape } = this, span = Math.hypot(...shape.ends.map(([low, high]) => high - low));
    this.material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: PART_VERTEX,
      fragmentShader: PART_FRAGMENT,
      side: THREE.DoubleSide,
      uniforms: {
        foot: { value: shape.foot },
        fine: { value: span / 4000 },
        isClosed: { value: Boolean(head.part.cubes) },
        cut: { value: new THREE.Vector3(...WHOLE) },
      },
    });
    this.mesh = new THREE.Mesh(shape.fine, this.material);
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
    // whoever moves in time wants to see the part at that time, and the robot, which hides the finished part
    const robot = byId("show-robot");
    let isFirst = true;
    robot.checked = false;
    if (page.robot) page.robot.wanted = false;
    robot.addEventListener("change", () => { isFirst = false; });
    const follow = this.follow = () => {
      byId("show-finished").checked = false;
      if (isFirst && page.robot) robot.checked = page.robot.wanted = true;
      isFirst = false;
    };
    byId("slider").addEventListener("input", follow, true);
    byId("play").addEventListener("click", follow, true);
  }

  // Show the part cut off at a share of its size along an axis; -1 shows it whole.
  section(axis, share) {
    const { ends, cut } = this.shape;
    WHOLE.forEach((place, k) => { cut[k] = place; });
    if (axis >= 0) cut[axis] = ends[axis][0] + share * (ends[axis][1] - ends[axis][0]);
    this.material.uniforms.cut.value.set(...cut);
    this.shape.place();
    this.page.scene.changed(false);
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
      this.shape.reset();
      this.event.fill(-1);
      this.done = 0;
    }
    for (; this.done < count; this.done++) {
      const event = this.order[this.done];
      this.shape.apply(event);
      this.event[this.cell[event]] = event;
    }
    this.shape.place();
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
      const isLeft = quantity === "nominal" && one === lastOf[cell] && off[cell] !== 0;
      const isRaw = (one < 0 || row[one] < 0) && !isLeft;
      if (isRaw) colour = UNCUT;
      else if (quantity === "tool") colour = tools[head.tools.indexOf(columns.tool[row[one]]) % tools.length];
      else if (scale) colour = palette[Math.round(255 * Math.max(shadeOf(scale, columns[quantity][row[one]]), 0))];
      else if (off && one !== lastOf[cell]) colour = NOT_YET;
      else if (off) colour = Number.isNaN(off[cell]) ? NOT_KNOWN : palette[Math.round(127.5 * (1 + Math.min(Math.max(off[cell] / end, -1), 1)))];
      data[4 * cell] = colour[0]; data[4 * cell + 1] = colour[1]; data[4 * cell + 2] = colour[2]; data[4 * cell + 3] = isRaw ? 6 : 50 + 205 * (steep?.[cell] || 0);
    }
    this.shape.paint(new Uint32Array(data.buffer));
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
    const shown = quantity === "tool" ? head.tools.map((tool, k) => [PASS_COLOURS[k % PASS_COLOURS.length], `T${tool}`]) : [];
    shown.push([cssOf(UNCUT), "not cut"]);
    if (end && !this.isFinished) shown.push([cssOf(NOT_YET), "cut again later"]);
    byId("part-tools").replaceChildren(...shown.map(([colour, words]) => {
      const item = document.createElement("span"), swatch = item.appendChild(document.createElement("b"));
      swatch.className = "swatch";
      swatch.style.background = colour;
      item.append(`${words} `);
      return item;
    }));
    const stands = this.volume();
    byId("part-volume").textContent = `${rounded(stands / 1000)} cm³ stand, ${rounded((this.shape.rawVolume - stands) / 1000)} cm³ cut`;
  }

  // mm³ of what stands.
  volume() { return this.shape.volume(); }

  // What it is within, in space.
  get box() {
    const [low, high] = [0, 1].map((side) => new THREE.Vector3(...this.shape.ends.map((end) => end[side])));
    return new THREE.Box3(low, high).applyMatrix4(this.mesh.matrix);
  }

  detail(isFine) { this.mesh.geometry = this.shape.detail(isFine); }

  // ---- what is clicked

  // The row that left the surface under a place on the canvas, -1 beside the part; says what is known of it.
  rowUnder(x, y) {
    const cell = this.mesh.visible ? this.shape.under(this.rayThrough(x, y)) : -1, event = cell < 0 ? -1 : this.event[cell];
    const note = byId("part-note"), isCut = event >= 0 && this.row[event] >= 0;
    const isLast = event === this.lastOf[cell], nominal = isLast ? this.cells.nominal?.[cell] : NaN;
    const differs = cell >= 0 && Number.isFinite(nominal) ? `${signed(nominal)} mm to nominal` : "";
    note.textContent = cell >= 0 && !isCut ? ["not cut", differs].filter(Boolean).join(" · ") : "";
    if (!isCut) return -1;
    const row = isLast ? this.cells.left[cell] : this.row[event];
    const { columns } = this.page, words = [`line ${columns.line[row]}`, `${columns.time[row].toFixed(2)} s`];
    if (columns.force) words.push(`force ${rounded(columns.force[row])} N`);
    if (isLast && this.cells.error) words.push(`error ${signed(this.cells.error[cell])} mm`);
    if (differs) words.push(differs);
    note.textContent = words.join(" · ");
    return row;
  }

  // The ray from the eye through a place on the canvas, in the frame of the part.
  rayThrough(x, y) {
    const { camera, canvas } = this.page.scene, inverse = this.mesh.matrix.clone().invert();
    const from = camera.position.clone().applyMatrix4(inverse);
    const through = new THREE.Vector3((2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight, 0.5).unproject(camera);
    return new THREE.Ray(from, through.applyMatrix4(inverse).sub(from).normalize());
  }

}

const signed = (value) => (Number.isFinite(value) ? `${value < 0 ? "-" : "+"}${Math.abs(value).toFixed(3)}` : "not known");

const cssOf = (colour) => `rgb(${colour})`;

const tableOf = (palette) => Array.from({ length: 256 }, (_, k) => mixed(palette, k / 255, 0));
