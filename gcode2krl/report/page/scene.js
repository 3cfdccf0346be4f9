// The path in 3D, drawn on demand: a coarse level while something moves; at rest every row in sight, without
// those that lie within half a pixel of the line between others.

const REST_MS = 250;
const GOAL_MS = 30;
const FEWEST_ROWS = 3000;
const ROWS = { software: { moving: 12000, resting: 30000 }, hardware: { moving: 80000, resting: 250000 } };
const IN_SIGHT = 1.3;
const THICK = 9, OVER_PART = 3;  // pixels of the chosen line, which must not hide what it left
const RAPID = -1, PALE = -2, NONE = -3;
const PASS_COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"];

class Scene {
  constructor(canvas, columns) {
    this.canvas = canvas;
    this.columns = columns;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !isSoftware(), preserveDrawingBuffer: false });
    this.software = isSoftware();
    this.renderer.setClearColor(0xe8ecf0);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, 1, 1e5);
    this.camera.up.set(0, 0, 1);
    this.controls = new CONTROLS.OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.most = this.software ? ROWS.software : ROWS.hardware;
    this.budget = this.most.moving;
    this.frames = 0;
    this.measure();
    this.makePath();
    this.makeMarker();
    this.controls.addEventListener("change", () => this.changed(true));
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
    this.fit("part");
  }

  measure() {
    const { x, y, z } = this.columns, pass = this.columns.pass, rows = x.length;
    this.points = new Float32Array(3 * rows);
    this.box = new THREE.Box3();
    const at = new THREE.Vector3();
    const hasFeed = pass.some((number) => number >= 0);
    for (let i = 0; i < rows; i++) {
      this.points.set([x[i], y[i], z[i]], 3 * i);
      if (pass[i] >= 0 || !hasFeed) this.box.expandByPoint(at.set(x[i], y[i], z[i]));
    }
    this.extent = Math.max(this.box.getSize(at).length(), 1);
    this.shade = new Float32Array(rows);
    this.kind = new Int32Array(rows);
  }

  makePath() {
    this.colours = new THREE.DataTexture(new Uint8Array(4 * 256), 256, 1);
    this.material = lineMaterial(this.colours, this.software ? 2.2 : 2.6);
    this.fine = new Lines(this.material);
    this.coarse = new Lines(this.material);
    const thick = lineMaterial(this.colours, THICK);
    thick.uniforms.is_flat.value = 1;
    thick.depthTest = false;
    this.current = new Lines(thick);
    this.current.mesh.renderOrder = 3;
    this.fine.mesh.renderOrder = this.coarse.mesh.renderOrder = 4;  // over the robot, which must not hide the path
    this.scene.add(this.fine.mesh, this.coarse.mesh, this.current.mesh, axesAt(this.extent));
    this.materials = [this.material, thick];
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x9aa4b0, 2.2));
    const light = new THREE.DirectionalLight(0xffffff, 1.0);
    light.position.set(-1, -2, 3);
    this.scene.add(light);
  }

  makeMarker() {
    this.marker = this.sign("#d55e00", (pen) => pen.arc(32, 32, 22, 0, 2 * Math.PI));
  }

  // A cross at each row with an error.
  markErrors(rows) {
    rows.forEach((row) => {
      const cross = this.sign("#c00000", (pen) => { for (const [x, y] of [[14, 14], [14, 50]]) { pen.moveTo(x, y); pen.lineTo(64 - x, 64 - y); } });
      cross.position.fromArray(this.points, 3 * row);
    });
    this.changed(false);
  }

  // What is drawn on a square of 64 points and always seen, as large from near as from far.
  sign(colour, draw) {
    const picture = document.createElement("canvas");
    picture.width = picture.height = 64;
    const pen = picture.getContext("2d");
    for (const [width, stroke] of [[14, "#ffffff"], [8, colour]]) {
      pen.lineWidth = width;
      pen.strokeStyle = stroke;
      pen.beginPath();
      draw(pen);
      pen.stroke();
    }
    const material = new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(picture), depthTest: false, sizeAttenuation: false });
    const sprite = new THREE.Sprite(material);
    sprite.scale.setScalar(0.035);
    sprite.renderOrder = 10;
    this.scene.add(sprite);
    return sprite;
  }

  // shades: (rows,) 0 to 1 or one of RAPID, PALE, NONE; palette: colours of the scale.
  paint(shades, palette, steps) {
    this.shade = shades;
    const data = this.colours.image.data;
    for (let i = 0; i < 256; i++) data.set(mixed(palette, i / 255, steps), 4 * i);
    this.colours.magFilter = this.colours.minFilter = steps ? THREE.NearestFilter : THREE.LinearFilter;
    this.colours.needsUpdate = true;
    for (let i = 0; i < shades.length; i++) this.kind[i] = shades[i] < 0 ? shades[i] : this.columns.pass[i];
    this.fillCoarse();
    this.isStale = true;
    this.changed(false);
  }

  fillCoarse() {
    this.level = levelWithin(this.points, this.shade, this.kind, this.extent / 4000, this.budget);
    this.coarse.fill(this.points, this.shade, this.level);
  }

  // Every row that is in sight, to half a pixel.
  fillFine() {
    this.isStale = false;
    if (this.shade.length <= this.most.resting) {
      this.fine.fill(this.points, this.shade, null);
      return;
    }
    const [shade, kind] = this.inSight();
    const distance = this.camera.position.distanceTo(this.controls.target);
    const pixel = (2 * distance * Math.tan((this.camera.fov * Math.PI) / 360)) / this.canvas.clientHeight;
    this.fine.fill(this.points, shade, levelWithin(this.points, shade, kind, 0.5 * pixel, this.most.resting));
  }

  // Shades and kinds with NONE where a row is out of sight.
  inSight() {
    const m = this.screenMatrix(), points = this.points;
    const shade = Float32Array.from(this.shade), kind = Int32Array.from(this.kind);
    for (let i = 0; i < shade.length; i++) {
      const a = points[3 * i], b = points[3 * i + 1], c = points[3 * i + 2];
      const w = (m[3] * a + m[7] * b + m[11] * c + m[15]) * IN_SIGHT;
      const isIn = w > 0 && Math.abs(m[0] * a + m[4] * b + m[8] * c + m[12]) < w && Math.abs(m[1] * a + m[5] * b + m[9] * c + m[13]) < w;
      if (!isIn) shade[i] = kind[i] = NONE;
    }
    return [shade, kind];
  }

  screenMatrix() {
    this.camera.updateMatrixWorld();
    return new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse).elements;
  }

  showRow(row, first, last) {
    this.marker.position.fromArray(this.points, 3 * row);
    this.current.fill(this.points.subarray(3 * first, 3 * last + 3), new Float32Array(last - first + 1), null);
    this.changed(true);
  }

  changed(moves) {
    if (moves) {
      this.moving = true;
      this.isStale ||= this.shade.length > this.most.resting;
    }
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => this.draw(now));
  }

  draw(now) {
    this.asked = false;
    clearTimeout(this.rest);
    if (this.moving) {
      this.adapt(now);
      this.rest = setTimeout(() => { this.moving = false; this.last = 0; this.changed(false); }, REST_MS);
    }
    const isFine = !this.moving || this.shade.length <= this.budget;
    this.camera.near = this.camera.position.distanceTo(this.controls.target) / 200;
    this.camera.far = this.camera.near * 200 + 20 * this.extent + 2e4;
    this.camera.updateProjectionMatrix();
    if (isFine && this.isStale) this.fillFine();
    this.fine.mesh.visible = isFine && !this.hidesPath;
    this.coarse.mesh.visible = !isFine && !this.hidesPath;
    this.part?.detail(!this.moving);
    this.materials[1].uniforms.width.value = (this.hidesPath ? OVER_PART : THICK) / 2;
    this.drawn = (isFine ? this.fine : this.coarse).count;
    this.renderer.render(this.scene, this.camera);
    this.frames++;
  }

  // Fewer rows where frames come too late, more where there is time left.
  adapt(now) {
    const took = this.last ? now - this.last : 0;
    this.last = now;
    this.slow = took > 0 && took < 500 ? 0.8 * (this.slow ?? took) + 0.2 * took : this.slow;
    this.since = (this.since ?? 0) + 1;
    if (this.since < 8 || this.shade.length <= FEWEST_ROWS) return;
    this.since = 0;
    if (this.slow > 1.25 * GOAL_MS && this.budget > FEWEST_ROWS) {
      this.budget = Math.max(FEWEST_ROWS, Math.min(this.budget, this.coarse.count) / 2);
      this.fillCoarse();
    }
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setPixelRatio(this.software ? 1 : Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.materials.forEach((material) => material.uniforms.size.value.set(clientWidth / 2, clientHeight / 2));
    this.camera.aspect = clientWidth / clientHeight;
    this.isStale = true;
    this.changed(false);
  }

  fit(view) {
    const box = this.box.clone();
    if (this.part) box.union(this.part.box);
    if (view === "robot" && this.robotBox) box.union(this.robotBox);
    const centre = box.getCenter(new THREE.Vector3());
    const along = { part: [0.55, -1, 0.75], top: [0, -0.001, 1], front: [0, -1, 0.12], side: [1, 0, 0.12], robot: [0.5, -1, 0.35] };
    const eye = new THREE.Vector3(...along[view]).normalize();
    const right = new THREE.Vector3(0, 0, 1).cross(eye).normalize(), up = eye.clone().cross(right);
    const tall = Math.tan((this.camera.fov * Math.PI) / 360), wide = tall * this.camera.aspect;
    let far = 1; // so far that each corner of the box is in view
    for (let k = 0; k < 8; k++) {
      const [x, y, z] = ["x", "y", "z"].map((axis, bit) => (k >> bit & 1 ? box.max : box.min)[axis] - centre[axis]);
      const corner = new THREE.Vector3(x, y, z);
      far = Math.max(far, corner.dot(eye) + Math.max(Math.abs(corner.dot(right)) / wide, Math.abs(corner.dot(up)) / tall));
    }
    this.camera.position.copy(centre).addScaledVector(eye, 1.05 * far);
    this.controls.target.copy(centre);
    this.controls.update();
    this.changed(true);
  }

  zoom(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.changed(true);
  }

  // The visible row nearest to a place on the canvas, -1 where none is near; of near ones the one in front.
  rowUnder(x, y) {
    const reach = 14, { clientWidth, clientHeight } = this.canvas;
    const m = this.screenMatrix();
    let best = -1, least = Infinity;
    for (let i = 0; i < this.shade.length; i++) {
      if (this.shade[i] <= PALE) continue;
      const a = this.points[3 * i], b = this.points[3 * i + 1], c = this.points[3 * i + 2];
      const w = m[3] * a + m[7] * b + m[11] * c + m[15];
      if (w <= 0) continue;
      const px = ((m[0] * a + m[4] * b + m[8] * c + m[12]) / w + 1) * clientWidth / 2 - x;
      const py = (1 - (m[1] * a + m[5] * b + m[9] * c + m[13]) / w) * clientHeight / 2 - y;
      const distance = px * px + py * py;
      if (distance > reach * reach) continue;
      const cost = distance + 40 * (w / this.extent);
      if (cost < least) { least = cost; best = i; }
    }
    return best;
  }
}

// Axes of $BASE with their letters.
function axesAt(extent) {
  const group = new THREE.Group(), length = extent / 5;
  [["X", "#b3261e"], ["Y", "#1b7f3b"], ["Z", "#1a56c4"]].forEach(([letter, colour], k) => {
    const end = new THREE.Vector3().setComponent(k, length);
    const line = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), end]);
    group.add(new THREE.Line(line, new THREE.LineBasicMaterial({ color: colour })));
    const picture = document.createElement("canvas");
    picture.width = picture.height = 64;
    const pen = picture.getContext("2d");
    pen.font = "bold 52px sans-serif";
    pen.fillStyle = colour;
    pen.textAlign = "center";
    pen.fillText(letter, 32, 50);
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(picture), sizeAttenuation: false, depthTest: false }));
    sprite.scale.setScalar(0.028);
    sprite.position.copy(end).multiplyScalar(1.06);
    group.add(sprite);
  });
  return group;
}

// The tool from tip towards holder along the path; red where it points from below the horizon.
function toolAxes(ends) {
  const colour = ([tip, end]) => new THREE.Color(end[2] < tip[2] - 1e-6 ? "#d55e00" : "#e69f00").toArray();
  const lines = new THREE.BufferGeometry();
  lines.setAttribute("position", new THREE.Float32BufferAttribute(ends.flat(2), 3));
  lines.setAttribute("color", new THREE.Float32BufferAttribute(ends.flatMap((one) => [...colour(one), ...colour(one)]), 3));
  const mesh = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ vertexColors: true, depthTest: false }));
  mesh.renderOrder = 3;
  return mesh;
}

function rendererName() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return "";
  const extra = gl.getExtension("WEBGL_debug_renderer_info");
  return String(gl.getParameter(extra ? extra.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

let software;
function isSoftware() {
  software ??= /swiftshader|llvmpipe|softpipe|software|basic render/i.test(rendererName());
  return software;
}
