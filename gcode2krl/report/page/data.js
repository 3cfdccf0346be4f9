// The page's data: what columns.py packed, as typed arrays.

const MISSING = -(2 ** 31);
const byId = (id) => document.getElementById(id);
const head = JSON.parse(byId("head").textContent);

async function inflated(id) {
  const text = atob(byId(id).textContent.trim());
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// One column: the lowest bytes of all differences, then the second, third and fourth.
function column(bytes, start, rows, step) {
  const values = new Float64Array(rows);
  let whole = 0;
  for (let i = 0; i < rows; i++) {
    const at = start + i;
    whole = (whole + (bytes[at] | (bytes[at + rows] << 8) | (bytes[at + 2 * rows] << 16) | (bytes[at + 3 * rows] << 24))) | 0;
    values[i] = whole === MISSING ? NaN : whole * step;
  }
  return values;
}

async function readColumns(id, described, rows) {
  if (rows === 0) return {};
  const bytes = await inflated(id);
  return Object.fromEntries(described.map(({ name, step }, number) => [name, column(bytes, 4 * rows * number, rows, step)]));
}

// The corners of the solids by which the finished part differs from the nominal one.
async function readSolids() {
  if (!head.solids) return {};
  return readColumns("solids", head.solids.columns, head.solids.counts.reduce((sum, count) => sum + count, 0));
}

// The corners of the meshes that stand in the cell, by name.
async function readMeshes() {
  if (!head.meshes) return {};
  const { counts, columns } = head.meshes;
  const { x, y, z } = await readColumns("meshes", columns, Object.values(counts).reduce((sum, count) => sum + count, 0));
  let first = 0;
  return Object.fromEntries(Object.entries(counts).map(([name, count]) => {
    const corners = new Float32Array(3 * count);
    for (let i = 0; i < count; i++, first++) corners.set([x[first], y[first], z[first]], 3 * i);
    return [name, corners];
  }));
}

// How the part comes about, and what is known of its cells.
async function readPart() {
  if (!head.part) return null;
  const { events, columns, places } = head.part;
  return Promise.all([readColumns("part", events.columns, events.rows), readColumns("part-cells", columns, places)]);
}

async function readLines() {
  if (!head.has_text) return [];
  const lines = new TextDecoder().decode(await inflated("gcode")).split(/\r\n|\n|\r/);
  return lines.at(-1) === "" ? lines.slice(0, -1) : lines;
}

// The last row whose value in a rising column is at most the given one.
function rowAt(rising, value) {
  let low = 0, high = rising.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (rising[middle] <= value) low = middle;
    else high = middle - 1;
  }
  return low;
}

const rounded = (value) => {
  if (!Number.isFinite(value)) return "not known";
  const size = Math.abs(value);
  return value.toFixed(size >= 100 ? 0 : size >= 10 ? 1 : 2);
};
