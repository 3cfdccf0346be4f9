// Stock, gouges, rest, what stands in the cell, and the robot: capsules that turn about the joint axes.

const LINK_COLOUR = 0xe8a468, FOOT_COLOUR = 0x70777f, SPINDLE_COLOUR = 0x4a5560, CABLE_COLOUR = 0x2f2f2f, CUTTER_COLOUR = 0xb8c0c8;
const OBSTACLE_COLOUR = 0x8f9aa5, HIT_COLOUR = 0xd00000, NEAR_COLOUR = 0xe69f00;

class Robot {
  constructor(sketch, columns, near, meshes) {
    this.columns = columns;
    this.near = near;
    this.named = new Map();
    this.axes = sketch.axes.map(({ point, along }) => ({
      point: new THREE.Vector3(...point),
      along: new THREE.Vector3(...along),
    }));
    this.root = new THREE.Group();
    this.root.matrixAutoUpdate = false;
    this.root.matrix.fromArray(sketch.root);
    this.world = new THREE.Group();
    this.world.matrixAutoUpdate = false;
    this.world.matrix.fromArray(sketch.world);
    this.links = [this.root];
    for (let k = 0; k < 6; k++) {
      const link = new THREE.Group();
      link.matrixAutoUpdate = false;
      this.links[k].add(link);
      this.links.push(link);
    }
    sketch.links.forEach((one) => {
      const colour = one.name === "spindle" ? SPINDLE_COLOUR : one.link === 0 || one.link === 6 ? FOOT_COLOUR : LINK_COLOUR;
      const mesh = capsule(new THREE.Vector3(...one.from), new THREE.Vector3(...one.to), one.radius, colour);
      this.links[one.link].add(this.keep(one.name, mesh));
    });
    this.obstacles = new THREE.Group();
    this.obstacles.add(this.world);
    sketch.obstacles.forEach((one) => {
      const mesh = one.low ? obstacle(one) : meshes[one.name] && solid(one, meshes[one.name]);
      if (mesh) (one.stands ? this.world : this.obstacles).add(this.keep(one.name, mesh));
    });
    this.cables = sketch.cables.map((one) => {
      const shape = new THREE.CylinderGeometry(one.radius, one.radius, 1, 12);
      const mesh = new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ color: CABLE_COLOUR, transparent: true, opacity: 0.35, depthWrite: false }));
      this.root.add(this.keep("the cables", mesh));
      return { mesh, from: new THREE.Vector3(...one.from), to: new THREE.Vector3(...one.to) };
    });
    this.tools = {};
    Object.entries(sketch.tools).forEach(([number, tool]) => tool && this.addTool(number, tool));
  }

  // Remember what is drawn of a name, so that it can turn red.
  keep(name, mesh) {
    if (!this.named.has(name)) this.named.set(name, []);
    this.named.get(name).push(mesh);
    mesh.userData.colour = mesh.material.color.getHex();
    return mesh;
  }

  addTool(number, tool) {
    const tip = new THREE.Vector3(...tool.tip), axis = new THREE.Vector3(...tool.axis);
    const group = new THREE.Group();
    const cylinder = (name, from, to, diameter, colour) => {
      const mesh = new THREE.Mesh(
        new THREE.CylinderGeometry(diameter / 2, diameter / 2, to - from, 20),
        new THREE.MeshLambertMaterial({ color: colour }),
      );
      mesh.position.copy(tip).addScaledVector(axis, (from + to) / 2);
      mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), axis);
      group.add(this.keep(name, mesh));
    };
    cylinder(tool.cutter, 0, tool.length, tool.diameter, CUTTER_COLOUR);
    const { holder } = tool;
    if (holder && holder.to > tool.length) cylinder(holder.name, tool.length, holder.to, holder.diameter, SPINDLE_COLOUR);
    if (tool.radius) {
      const face = tip.clone().addScaledVector(axis, tool.length);
      const back = face.clone().addScaledVector(axis, 4 * tool.radius);
      group.add(capsule(face.clone().addScaledVector(axis, tool.radius), back, tool.radius, SPINDLE_COLOUR));
      const middle = face.clone().lerp(back, 0.6);
      group.add(capsule(middle, new THREE.Vector3(...tool.flange), 0.6 * tool.radius, SPINDLE_COLOUR));
    }
    group.userData.tip = tip;
    this.links[6].add(group);
    this.tools[number] = group;
  }

  // Move to a row; hidden where the robot does not reach it.
  show(row) {
    const turn = new THREE.Matrix4(), there = new THREE.Matrix4(), back = new THREE.Matrix4();
    this.reached = true;
    this.axes.forEach(({ point, along }, k) => {
      const angle = this.columns[`q${k + 1}`][row];
      if (!Number.isFinite(angle)) { this.reached = false; return; }
      turn.makeRotationAxis(along, angle);
      there.makeTranslation(point.x, point.y, point.z);
      back.makeTranslation(-point.x, -point.y, -point.z);
      this.links[k + 1].matrix.copy(there).multiply(turn).multiply(back);
      this.links[k + 1].matrixWorldNeedsUpdate = true;
    });
    this.stretchCables();
    this.carry("root", row);
    this.carry("world", row);
    const number = String(this.columns.tool[row]);
    Object.entries(this.tools).forEach(([name, group]) => { group.visible = name === number; });
    this.root.visible = this.wanted && this.reached;
    this.shown = this.tools[number];
    this.colour(row);
  }

  // Lay the cables from where A3 has their first ends to where the flange has the second.
  stretchCables() {
    const turned = (point, links) => links.reduceRight((at, link) => at.applyMatrix4(link.matrix), point.clone());
    this.cables.forEach(({ mesh, from, to }) => {
      const start = turned(from, this.links.slice(1, 4)), end = turned(to, this.links.slice(1));
      const along = end.clone().sub(start), length = Math.max(along.length(), 1e-6);
      mesh.position.copy(start).lerp(end, 0.5);
      mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
      mesh.scale.set(1, length, 1);
    });
  }

  // Put the robot root or $WORLD where the external axes have it at a row; they stay without such columns.
  carry(name, row) {
    if (!this.columns[`${name}0`]) return;
    const [x, y, z, ...turn] = [0, 1, 2, 3, 4, 5, 6].map((k) => this.columns[`${name}${k}`][row]);
    this[name].matrix.compose(new THREE.Vector3(x, y, z), new THREE.Quaternion(...turn), new THREE.Vector3(1, 1, 1));
    this[name].matrixWorldNeedsUpdate = true;
  }

  // What is nearest to something at a row, by name, with the distance; null where nothing is near.
  nearest(row) {
    const link = this.near && this.columns.nearLink[row];
    if (!this.near || !(link >= 0)) return null;
    const who = this.near.links[link], what = this.near.obstacles[this.columns.nearObstacle[row]];
    return { who, what, gap: this.columns.clearance[row] };
  }

  // What hits something at this row is red, and so is what it hits.
  colour(row) {
    this.named.forEach((meshes) => meshes.forEach((mesh) => mesh.material.color.setHex(mesh.userData.colour)));
    const found = this.nearest(row);
    if (!found || found.gap > this.near.clearance) return;
    const names = [found.who, found.what.replace(/ of the arm itself$/, "")];
    const colour = found.gap <= 0 ? HIT_COLOUR : NEAR_COLOUR;
    names.forEach((name) => this.named.get(name)?.forEach((mesh) => mesh.material.color.setHex(colour)));
  }

  // Where the drawn tool's tip is, in $BASE.
  tip() {
    if (!this.shown) return null;
    this.root.updateMatrixWorld(true);
    return this.shown.userData.tip.clone().applyMatrix4(this.shown.matrixWorld).toArray();
  }
}

function capsule(from, to, radius, colour) {
  const along = to.clone().sub(from), length = along.length();
  const mesh = new THREE.Mesh(
    new THREE.CapsuleGeometry(radius, length, 4, 16),
    new THREE.MeshLambertMaterial({ color: colour, transparent: true, opacity: 0.5, depthWrite: false }),
  );
  mesh.position.copy(from).addScaledVector(along, 0.5);
  if (length > 0) mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
  return mesh;
}

function obstacle({ frame, low, high }) {
  const size = high.map((value, k) => value - low[k]);
  const opacity = size.some((side) => side <= 1) ? 0.15 : 0.45;  // a table or a fence must not hide the work
  const mesh = new THREE.Mesh(
    new THREE.BoxGeometry(...size),
    new THREE.MeshLambertMaterial({ color: OBSTACLE_COLOUR, transparent: true, opacity, depthWrite: false, side: THREE.DoubleSide }),
  );
  mesh.matrixAutoUpdate = false;
  mesh.matrix.fromArray(frame).multiply(new THREE.Matrix4().makeTranslation(...low.map((value, k) => (value + high[k]) / 2)));
  return mesh;
}

// A mesh in its frame; with few triangles, so its faces are flat.
function solid({ frame }, corners) {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  shape.computeVertexNormals();
  const material = new THREE.MeshLambertMaterial({ color: OBSTACLE_COLOUR, transparent: true, opacity: 0.6, side: THREE.DoubleSide });
  const mesh = new THREE.Mesh(shape, material);
  mesh.matrixAutoUpdate = false;
  mesh.matrix.fromArray(frame);
  return mesh;
}

function stockBox([low, high]) {
  const size = high.map((value, k) => value - low[k]);
  const shape = new THREE.BoxGeometry(...size);
  const group = new THREE.Group();
  const faces = new THREE.MeshLambertMaterial({ color: 0xc9b48a, transparent: true, opacity: 0.22, depthWrite: false, side: THREE.DoubleSide });
  group.add(new THREE.Mesh(shape, faces), new THREE.LineSegments(new THREE.EdgesGeometry(shape), new THREE.LineBasicMaterial({ color: 0x8a7a55 })));
  group.position.set(...low.map((value, k) => (value + high[k]) / 2));
  return group;
}

const SOLID_COLOURS = { gouge: 0xd55e00, rest: 0x0072b2 };

// Gouges and rest as solids, each with flat faces.
function solidsOf({ counts, kinds }, { x, y, z }) {
  const group = new THREE.Group();
  let first = 0;
  counts.forEach((count, number) => {
    const corners = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) corners.set([x[first + i], y[first + i], z[first + i]], 3 * i);
    first += count;
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    shape.computeVertexNormals();
    const material = new THREE.MeshLambertMaterial({ color: SOLID_COLOURS[kinds[number]], transparent: true, opacity: 0.8, side: THREE.DoubleSide });
    group.add(new THREE.Mesh(shape, material));
  });
  return group;
}
