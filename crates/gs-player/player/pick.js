// The splat that contributes most to a pixel. Runs in the worker; the arithmetic is that of the shaders.

// Documented in gs_core::image_formation; a test compares the values.
const GUARD_BAND = 1.3;
const EPS2D = 0.3;
const EXTENT_SIGMAS = 3.0;
const MIN_DISCRIMINANT = 0.1;
const TILE_SIZE = 16.0;
const MAX_ALPHA = 0.99;
const ALPHA_THRESHOLD = 1.0 / 255.0;
const TRANSMITTANCE_THRESHOLD = 0.0001;

/** Values per projected splat: centre, inverse covariance (xx, xy, yy), opacity, first and last pixel of its tiles, row. */
const PROJECTED = 11;

/** Row of a splat's appearance; see the shader. */
function appearanceRow([a, sameMotion, shared], row, second) {
  if (!second || row < a) return row;
  return row < a + sameMotion ? row + sameMotion + shared : row < a + sameMotion + shared ? row : row + sameMotion;
}

/** The splats of `order` (farthest first), projected, nearest first. */
function project(stage, groups, order, count, second, { rows, eye, focal, principal, near, size }) {
  const geometry = stage.geometry.data, appearance = stage.appearance.data, appearanceStride = stage.appearance.texels * 4;
  const projected = new Float64Array(count * PROJECTED);
  const limit = [0, 1].map((axis) => (GUARD_BAND * size[axis]) / (2 * focal[axis]));
  const tiles = size.map((side) => Math.ceil(side / TILE_SIZE));
  let at = 0;
  for (let i = count - 1; i >= 0; i--) {
    const row = order[i], g = row * GEOMETRY_TEXELS * 4;
    const opacity = appearance[appearanceRow(groups, row, second) * appearanceStride + 3];
    if (opacity < ALPHA_THRESHOLD) continue;
    const ray = [geometry[g] - eye[0], geometry[g + 1] - eye[1], geometry[g + 2] - eye[2]];
    const t = rows.map((axis) => axis[0] * ray[0] + axis[1] * ray[1] + axis[2] * ray[2]);
    if (t[2] <= near) continue;
    const x = geometry[g + 4], y = geometry[g + 5], z = geometry[g + 6], w = geometry[g + 7];
    const axes = [
      [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
      [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
      [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ];
    const clamped = [0, 1].map((axis) => Math.max(-limit[axis], Math.min(limit[axis], t[axis] / t[2])));
    let a = EPS2D, b = 0, c = EPS2D;
    for (let k = 0; k < 3; k++) {
      const scale = geometry[g + 8 + k];
      const seen = rows.map((axis) => scale * (axis[0] * axes[k][0] + axis[1] * axes[k][1] + axis[2] * axes[k][2]));
      const jx = (focal[0] / t[2]) * (seen[0] - clamped[0] * seen[2]);
      const jy = (focal[1] / t[2]) * (seen[1] - clamped[1] * seen[2]);
      a += jx * jx;
      b += jx * jy;
      c += jy * jy;
    }
    const det = a * c - b * b;
    if (!(det > 0) || !(a < 1e30) || !(c < 1e30)) continue;
    const mid = 0.5 * (a + c);
    const radius = Math.ceil(EXTENT_SIGMAS * Math.sqrt(mid + Math.sqrt(Math.max(MIN_DISCRIMINANT, mid * mid - det))));
    const center = [0, 1].map((axis) => (focal[axis] * t[axis]) / t[2] + principal[axis]);
    const edge = (axis, reach) => Math.max(0, Math.min(tiles[axis], Math.trunc((center[axis] - 0.5 + reach) / TILE_SIZE))) * TILE_SIZE;
    projected.set(
      [center[0], center[1], c / det, -b / det, a / det, opacity, edge(0, -radius), edge(0, radius + TILE_SIZE - 1), edge(1, -radius), edge(1, radius + TILE_SIZE - 1), row],
      at,
    );
    at += PROJECTED;
  }
  return projected.subarray(0, at);
}

/** Row with the largest weight αT at a pixel, and that weight; `null` where no splat is. `px`, `py`: centre of the pixel. */
function heaviest(projected, [px, py]) {
  let through = 1, weight = 0, row = null;
  for (let at = 0; at < projected.length; at += PROJECTED) {
    if (px < projected[at + 6] || px >= projected[at + 7] || py < projected[at + 8] || py >= projected[at + 9]) continue;
    const dx = projected[at] - px, dy = projected[at + 1] - py;
    const power = -0.5 * (projected[at + 2] * dx * dx + projected[at + 4] * dy * dy) - projected[at + 3] * dx * dy;
    if (power > 0) continue;
    const alpha = Math.min(MAX_ALPHA, projected[at + 5] * Math.exp(power));
    if (alpha < ALPHA_THRESHOLD) continue;
    if (through * (1 - alpha) < TRANSMITTANCE_THRESHOLD) break;
    if (alpha * through > weight) [weight, row] = [alpha * through, projected[at + 10]];
    through *= 1 - alpha;
  }
  return row === null ? null : { row, weight };
}
