// A part as points of its surface, one in a cube of a lattice, as a tool whose axis turns leaves it.

const HAS_POINT = 16;

class Surface {
  constructor({ cell, x, y, z, state }, { cube }, software) {
    const { cubes: [width, depth, height], low, size, raw } = head.part, count = cube.length;
    Object.assign(this, { low, size, count, cell, share: [x, y, z], state, strides: [1, width, width * depth] });
    this.corner = Array.from({ length: 3 }, (_, k) => Int32Array.from(cube, (one) => Math.floor(one / this.strides[k]) % [width, depth, height][k]));
    this.ends = [width, depth, height].map((many, k) => [low[k] + 0.5 * size[k], low[k] + (many - 0.5) * size[k]]);
    this.foot = -1e9;
    this.cut = [...WHOLE];
    this.makeSquares(cube, width * depth * height);
    this.states = new Uint8Array(count);
    this.points = new Float32Array(3 * count);
    this.tones = new Uint8Array(4 * count);
    const attributes = { position: new THREE.BufferAttribute(this.points, 3), tone: new THREE.BufferAttribute(this.tones, 4, true) };
    const shape = () => {
      const made = new THREE.BufferGeometry();
      Object.entries(attributes).forEach(([name, values]) => made.setAttribute(name, values));
      made.setIndex(new THREE.BufferAttribute(new Uint32Array(18 * count), 1));
      return made;
    };
    this.stride = software ? Math.ceil(Math.sqrt((2 * raw) / MOVING_TRIANGLES)) : 1;
    this.fine = shape();
    this.coarse = this.stride > 1 ? shape() : this.fine;
    if (this.stride > 1) this.makeParents();
    for (let event = 0; event < raw; event++) this.apply(event);
    this.rawVolume = this.volume();
    this.reset();
  }

  // For each place and axis the other three places of the square round the edge that begins at its low corner.
  makeSquares(cube, cubes) {
    const placeOf = new Int32Array(cubes).fill(-1), { strides } = this;
    cube.forEach((one, place) => { placeOf[one] = place; });
    this.others = new Int32Array(9 * cube.length);
    for (let place = 0, n = 0; place < cube.length; place++) {
      for (let axis = 0; axis < 3; axis++) {
        const u = strides[(axis + 1) % 3], v = strides[(axis + 2) % 3];
        for (const step of [u, u + v, v]) this.others[n++] = placeOf[cube[place] - step] ?? -1;
      }
    }
  }

  reset() { this.states.fill(0); }

  apply(event) {
    const place = this.cell[event];
    this.states[place] = this.state[event];
    for (let k = 0; k < 3; k++) this.points[3 * place + k] = this.low[k] + (this.corner[k][place] + this.share[k][event] / 255) * this.size[k];
  }

  // Call back with the corners of each square, which turn left as seen from outside.
  eachSquare(take) {
    const { states, others, count } = this;
    for (let place = 0; place < count; place++) {
      const state = states[place];
      if (state <= HAS_POINT || state === HAS_POINT + 15) continue;
      for (let axis = 0, n = 9 * place; axis < 3; axis++, n += 3) {
        const low = state & 1, high = (state >> (axis + 1)) & 1;
        if (low > high) take(place, others[n], others[n + 1], others[n + 2]);
        else if (low < high) take(place, others[n + 2], others[n + 1], others[n]);
      }
    }
  }

  place() {
    this.fine.attributes.position.needsUpdate = true;
    this.isStale = true;
    if (this.coarse !== this.fine) this.fill(this.coarse, this.nearby());
  }

  detail(isFine) {
    if (isFine || this.coarse === this.fine) {
      if (this.isStale) this.fill(this.fine, null);
      this.isStale = false;
    }
    return isFine ? this.fine : this.coarse;
  }

  // Number the larger cubes of which each holds some places.
  makeParents() {
    const numbers = new Map();
    this.parent = Int32Array.from({ length: this.count }, (_, place) => {
      const [i, j, k] = this.corner.map((one) => Math.floor(one[place] / this.stride)), key = i + 4096 * (j + 4096 * k);
      if (!numbers.has(key)) numbers.set(key, numbers.size);
      return numbers.get(key);
    });
    this.first = new Int32Array(numbers.size);
  }

  // For each place the one that stands for it: the first with a point in the larger cube.
  nearby() {
    const { states, parent, first, count } = this, stands = new Int32Array(count);
    first.fill(-1);
    for (let place = 0; place < count; place++) {
      if (!states[place]) continue;
      if (first[parent[place]] < 0) first[parent[place]] = place;
      stands[place] = first[parent[place]];
    }
    return stands;
  }

  // Write the triangles; between places that stand for others, those that keep three corners.
  fill(shape, stands) {
    const corners = shape.index.array;
    let n = 0;
    const add = (a, b, c) => {
      if (a === b || b === c || c === a) return;
      corners[n] = a; corners[n + 1] = b; corners[n + 2] = c;
      n += 3;
    };
    this.eachSquare((a, b, c, d) => {
      if (stands) { a = stands[a]; b = stands[b]; c = stands[c]; d = stands[d]; }
      add(a, b, c);
      add(a, c, d);
    });
    shape.setDrawRange(0, n);
    shape.index.clearUpdateRanges();
    shape.index.addUpdateRange(0, n);
    shape.index.needsUpdate = true;
  }

  // Colours (places,) as words of four bytes.
  paint(words) {
    new Uint32Array(this.tones.buffer).set(words);
    this.fine.attributes.tone.needsUpdate = true;
  }

  // mm³ of what stands: of the pyramids from the low corner to all triangles.
  volume() {
    const p = this.points, [x, y, z] = this.low;
    let sum = 0;
    const add = (a, b, c) => {
      const ax = p[3 * a] - x, ay = p[3 * a + 1] - y, az = p[3 * a + 2] - z, bx = p[3 * b] - x, by = p[3 * b + 1] - y, bz = p[3 * b + 2] - z;
      const cx = p[3 * c] - x, cy = p[3 * c + 1] - y, cz = p[3 * c + 2] - z;
      sum += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
    };
    this.eachSquare((a, b, c, d) => { add(a, b, c); add(a, c, d); });
    return sum / 6;
  }

  // The place nearest to where a ray enters the part, -1 where it does not, or through the section.
  under(ray) {
    const caster = new THREE.Raycaster(ray.origin, ray.direction), shape = this.detail(true);
    shape.boundingSphere = new THREE.Sphere(new THREE.Vector3(), Infinity);
    const mesh = new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    const hit = caster.intersectObject(mesh).find(({ point }) => point.x <= this.cut[0] && point.y >= this.cut[1] && point.z <= this.cut[2]);
    if (!hit || hit.face.normal.dot(ray.direction) > 0) return -1;
    const away = (place) => hit.point.distanceToSquared(new THREE.Vector3().fromArray(this.points, 3 * place));
    return [hit.face.a, hit.face.b, hit.face.c].reduce((best, one) => (away(one) < away(best) ? one : best));
  }
}
