// Level of detail: fewer rows that look the same, in place and in colour.

const MOST_SKIPPED = 160;

// Rows that a polyline needs so that no row left out is further than tolerance from it (mm), nor its shade
// (0 to 1) further than shadeTolerance. Stretches that are told apart by kind are never joined.
function keptRows(points, shade, kind, tolerance, shadeTolerance) {
  const rows = shade.length, kept = new Uint32Array(rows);
  if (rows === 0) return kept;
  const limit = tolerance * tolerance;
  let count = 0, anchor = 0;
  kept[count++] = 0;
  for (let end = 1; end < rows; end++) {
    const isBreak = kind[end] !== kind[end - 1] || (end + 1 < rows && kind[end + 1] !== kind[end]);
    if (!isBreak && end - anchor <= MOST_SKIPPED && fits(points, shade, anchor, end, limit, shadeTolerance)) continue;
    if (end - 1 > anchor) kept[count++] = end - 1;
    anchor = end - 1;
    if (isBreak) {
      kept[count++] = end;
      anchor = end;
    }
  }
  if (kept[count - 1] !== rows - 1) kept[count++] = rows - 1;
  return kept.slice(0, count);
}

function fits(points, shade, first, last, limit, shadeTolerance) {
  const x0 = points[3 * first], y0 = points[3 * first + 1], z0 = points[3 * first + 2];
  const dx = points[3 * last] - x0, dy = points[3 * last + 1] - y0, dz = points[3 * last + 2] - z0;
  const length = dx * dx + dy * dy + dz * dz;
  const span = last - first, tint = shade[last] - shade[first];
  for (let i = first + 1; i < last; i++) {
    const off = shade[i] - shade[first] - (tint * (i - first)) / span;
    if (off > shadeTolerance || off < -shadeTolerance) return false;
    const x = points[3 * i] - x0, y = points[3 * i + 1] - y0, z = points[3 * i + 2] - z0;
    const along = length > 0 ? Math.min(1, Math.max(0, (x * dx + y * dy + z * dz) / length)) : 0;
    const ex = x - along * dx, ey = y - along * dy, ez = z - along * dz;
    if (ex * ex + ey * ey + ez * ez > limit) return false;
  }
  return true;
}

// The finest level with at most so many rows, null where all rows are not more. The last one tried may have more.
function levelWithin(points, shade, kind, tolerance, most) {
  if (shade.length <= most) return null;
  let rows;
  for (let round = 0; round < 6; round++) {
    rows = keptRows(points, shade, kind, tolerance * 2.5 ** round, 0.03 * 1.8 ** round);
    if (rows.length <= most) break;
  }
  return rows;
}
