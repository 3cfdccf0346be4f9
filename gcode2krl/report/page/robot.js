// Stock, gouges, rest and robot: capsules that turn about the joint axes, one group within the other.

const LINK_COLOUR = 0xe8a468, FOOT_COLOUR = 0x70777f, SPINDLE_COLOUR = 0x4a5560, CUTTER_COLOUR = 0xb8c0c8;

class Robot {
  constructor(sketch, columns) {
    this.columns = columns;
    this.axes = sketch.axes.map(({ point, along }) => ({
      point: new THREE.Vector3(...point),
      along: new THREE.Vector3(...along),
    }));
    this.root = new THREE.Group();
    this.root.matrixAutoUpdate = false;
    this.root.matrix.fromArray(sketch.root);
    this.links = [this.root];
    for (let k = 0; k < 6; k++) {
      const link = new THREE.Group();
      link.matrixAutoUpdate = false;
      this.links[k].add(link);
      this.links.push(link);
    }
    sketch.links.forEach((one) => {
      const colour = one.link === 0 || one.link === 6 ? FOOT_COLOUR : LINK_COLOUR;
      this.links[one.link].add(capsule(new THREE.Vector3(...one.from), new THREE.Vector3(...one.to), one.radius, colour));
    });
    this.tools = {};
    Object.entries(sketch.tools).forEach(([number, tool]) => tool && this.addTool(number, tool));
  }

  addTool(number, tool) {
    const tip = new THREE.Vector3(...tool.tip), axis = new THREE.Vector3(...tool.axis);
    const face = tip.clone().addScaledVector(axis, tool.length);
    const group = new THREE.Group();
    const cutter = new THREE.Mesh(
      new THREE.CylinderGeometry(tool.diameter / 2, tool.diameter / 2, tool.length, 20),
      new THREE.MeshLambertMaterial({ color: CUTTER_COLOUR }),
    );
    cutter.position.copy(tip).addScaledVector(axis, tool.length / 2);
    cutter.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), axis);
    const back = face.clone().addScaledVector(axis, 4 * tool.radius);
    group.add(cutter, capsule(face.clone().addScaledVector(axis, tool.radius), back, tool.radius, SPINDLE_COLOUR));
    const middle = face.clone().lerp(back, 0.6);
    group.add(capsule(middle, new THREE.Vector3(...tool.flange), 0.6 * tool.radius, SPINDLE_COLOUR));
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
    const number = String(this.columns.tool[row]);
    Object.entries(this.tools).forEach(([name, group]) => { group.visible = name === number; });
    this.root.visible = this.wanted && this.reached;
    this.shown = this.tools[number];
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
