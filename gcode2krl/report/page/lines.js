// Segments as rectangles, coloured by a scale: the shader makes the corners.

const LINE_VERTEX = `
in vec3 end; in vec2 shades;
uniform vec2 size; uniform float width; out float shade;
void main() {
  int corner = gl_VertexID & 3;
  float along = corner == 1 || corner == 2 ? 1.0 : 0.0, side = corner > 1 ? 1.0 : -1.0;
  vec4 a = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  vec4 b = projectionMatrix * modelViewMatrix * vec4(end, 1.0);
  float near = 0.001;
  if (a.w < near && b.w >= near) a = mix(a, b, (near - a.w) / (b.w - a.w));
  if (b.w < near && a.w >= near) b = mix(b, a, (near - b.w) / (a.w - b.w));
  vec2 way = b.xy / b.w * size - a.xy / a.w * size;
  way = dot(way, way) > 0.0 ? normalize(way) : vec2(1.0, 0.0);
  float thick = shades.x < -0.5 ? 0.5 * width : width;
  vec4 at = mix(a, b, along);
  at.xy += thick * (side * vec2(-way.y, way.x) + (2.0 * along - 1.0) * 0.4 * way) / size * at.w;
  shade = shades.x < -0.5 ? shades.x : mix(shades.x, shades.y, along);
  gl_Position = at;
}`;
const LINE_FRAGMENT = `
uniform sampler2D colours; uniform vec3 flat_colour; uniform float is_flat; in float shade; out vec4 painted;
void main() {
  vec3 colour = texture(colours, vec2(clamp(shade, 0.002, 0.998), 0.5)).rgb;
  if (shade < -1.5) colour = vec3(0.83, 0.86, 0.88);
  else if (shade < -0.5) colour = vec3(0.62, 0.66, 0.69);
  painted = vec4(mix(colour, flat_colour, is_flat), 1.0);
}`;

// Line segments as thick as stated in pixels, four corners each. Instances would need a quarter of the memory
// and take twenty times as long where the browser draws by software.
class Lines {
  constructor(material) {
    this.geometry = new THREE.BufferGeometry();
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
    this.count = 0;
  }

  // Fill with the segments between consecutive rows, all of them where level is null.
  fill(points, shade, level) {
    const rows = level ? level.length : shade.length;
    if (!this.values || this.values.length < 32 * rows) this.allocate(Math.max(rows, 2));
    const values = this.values;
    let n = 0;
    for (let k = 1; k < rows; k++) {
      const i = level ? level[k - 1] : k - 1, j = level ? level[k] : k;
      const before = shade[i], after = shade[j];
      if (after === NONE) continue;
      const from = n;
      values[n++] = points[3 * i]; values[n++] = points[3 * i + 1]; values[n++] = points[3 * i + 2];
      values[n++] = points[3 * j]; values[n++] = points[3 * j + 1]; values[n++] = points[3 * j + 2];
      values[n++] = after < 0 || before < 0 ? after : before;
      values[n++] = after;
      for (let corner = 1; corner < 4; corner++, n += 8) values.copyWithin(n, from, from + 8);
    }
    this.count = n / 32;
    this.geometry.setDrawRange(0, 6 * this.count);
    this.buffer.clearUpdateRanges();
    this.buffer.addUpdateRange(0, n);
    this.buffer.needsUpdate = true;
  }

  allocate(rows) {
    this.geometry.dispose();
    this.values = new Float32Array(32 * rows);
    this.buffer = new THREE.InterleavedBuffer(this.values, 8);
    this.geometry.setAttribute("position", new THREE.InterleavedBufferAttribute(this.buffer, 3, 0));
    this.geometry.setAttribute("end", new THREE.InterleavedBufferAttribute(this.buffer, 3, 3));
    this.geometry.setAttribute("shades", new THREE.InterleavedBufferAttribute(this.buffer, 2, 6));
    const corners = new Uint32Array(6 * rows);
    for (let k = 0; k < rows; k++) corners.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3], 6 * k);
    this.geometry.setIndex(new THREE.BufferAttribute(corners, 1));
  }
}

function lineMaterial(colours, width) {
  return new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    transparent: true,
    vertexShader: LINE_VERTEX,
    fragmentShader: LINE_FRAGMENT,
    side: THREE.DoubleSide,
    uniforms: {
      size: { value: new THREE.Vector2(400, 300) },
      width: { value: width / 2 },
      colours: { value: colours },
      is_flat: { value: 0 },
      flat_colour: { value: new THREE.Color().setHex(0xffb23e, THREE.LinearSRGBColorSpace) },
    },
  });
}

function mixed(palette, share, steps) {
  const place = share * (steps ? steps : palette.length - 1);
  const first = Math.min(Math.floor(place), palette.length - 1);
  const last = steps ? first : Math.min(first + 1, palette.length - 1);
  const part = (colour, at) => parseInt(palette[colour].slice(at, at + 2), 16);
  const left = place - first;
  return [1, 3, 5].map((at) => (steps ? part(first, at) : part(first, at) * (1 - left) + part(last, at) * left)).concat(255);
}
