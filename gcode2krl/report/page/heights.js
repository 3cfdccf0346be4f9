// A part as heights over the cells of a grid, as a tool with one axis leaves it.

class Heights {
  constructor({ cell, height }, { raw }, software) {
    const { cells: [width, depth], low, size, bottom } = head.part;
    Object.assign(this, { width, depth, low, size, bottom, cell, height, raw, count: width * depth });
    this.heights = Float32Array.from(raw);
    this.cut = [...WHOLE];
    // vertices are cells, with two more around: the edge of the stock, and its foot
    const vertices = (width + 4) * (depth + 4);
    this.points = new Float32Array(3 * vertices);
    this.tones = new Uint8Array(4 * vertices);
    const attributes = { position: new THREE.BufferAttribute(this.points, 3), tone: new THREE.BufferAttribute(this.tones, 4, true) };
    this.fine = gridOf(width, depth, 1, attributes);
    const stride = Math.ceil(Math.sqrt((2 * width * depth) / MOVING_TRIANGLES));
    this.coarse = software && stride > 1 ? gridOf(width, depth, stride, attributes) : this.fine;
    this.rawVolume = this.volume();
  }

  get foot() { return this.bottom; }

  get top() { return this.raw.reduce((most, one) => Math.max(most, one), -Infinity); }

  // Where it ends along each axis.
  get ends() { return [...this.low.map((low, k) => [low, low + this.size[k] * [this.width, this.depth][k]]), [this.bottom, this.top]]; }

  reset() { this.heights.set(this.raw); }

  apply(event) { this.heights[this.cell[event]] = this.height[event]; }

  // Put the vertices where they are; what lies behind the section is put onto it.
  place() {
    const { width, depth, points, heights, bottom, low, size, cut } = this, across = width + 4;
    const along = (count, axis) => Array.from({ length: count + 4 }, (_, k) => low[axis] + size[axis] * Math.min(Math.max(k - 1.5, 0), count));
    const x = along(width, 0), y = along(depth, 1);
    const height = (i, j) => {
      if (i <= 0 || j <= 0 || i >= width + 3 || j >= depth + 3) return bottom;
      return heights[Math.min(Math.max(j - 2, 0), depth - 1) * width + Math.min(Math.max(i - 2, 0), width - 1)];
    };
    const share = (places, k, beside, end) => {
      const size = (places[k] ?? end) - (places[beside] ?? end);
      return Math.abs(size) < 1e-6 ? 0 : Math.max((end - places[beside]) / size, 0);
    };
    for (let j = 0, n = 0; j < depth + 4; j++) {
      for (let i = 0; i < across; i++) {
        const overX = x[i] > cut[0], overY = y[j] < cut[1];
        let z = height(i, j);
        if (overX) { const part = share(x, i, i - 1, cut[0]); z = part > 0 ? part * z + (1 - part) * height(i - 1, j) : bottom; }
        if (overY) { const part = share(y, j, j + 1, cut[1]); z = part > 0 ? part * z + (1 - part) * height(i, j + 1) : bottom; }
        points[n++] = overX ? cut[0] : x[i];
        points[n++] = overY ? cut[1] : y[j];
        points[n++] = Math.min(z, cut[2]);
      }
    }
    this.fine.attributes.position.needsUpdate = true;
  }

  detail(isFine) { return isFine ? this.fine : this.coarse; }

  // Colours (cells,) as words of four bytes.
  paint(words) {
    const { width, depth } = this, out = new Uint32Array(this.tones.buffer);
    for (let j = 0, n = 0; j < depth + 4; j++) {
      const row = Math.min(Math.max(j - 2, 0), depth - 1) * width;
      for (let i = 0; i < width + 4; i++) out[n++] = words[row + Math.min(Math.max(i - 2, 0), width - 1)];
    }
    this.fine.attributes.tone.needsUpdate = true;
  }

  // mm³ of what stands.
  volume() {
    return this.heights.reduce((sum, height) => sum + height - this.bottom, 0) * this.size[0] * this.size[1];
  }

  // The cell at which a ray enters the part, -1 beside it.
  under(ray) {
    const { ends } = this;
    const low = ends.map(([end], k) => (k === 1 ? Math.max(end, this.cut[k]) : end)), high = ends.map(([, end], k) => (k === 1 ? end : Math.min(end, this.cut[k])));
    const box = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
    const enters = ray.intersectBox(box, new THREE.Vector3());
    if (!enters) return -1;
    const step = Math.min(...this.size) / 3, way = ray.direction, at = enters.addScaledVector(way, 1e-4);
    for (; box.containsPoint(at); at.addScaledVector(way, step)) {
      const i = Math.floor((at.x - this.low[0]) / this.size[0]), j = Math.floor((at.y - this.low[1]) / this.size[1]);
      const cell = Math.min(j, this.depth - 1) * this.width + Math.min(i, this.width - 1);
      if (at.z <= this.heights[cell] && this.heights[cell] > this.bottom) return cell;
    }
    return -1;
  }
}

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
