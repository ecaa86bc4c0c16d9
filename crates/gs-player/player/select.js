// Splats whose centres lie on the inner side of planes and in one of several spheres. Runs in the worker.

/** `planes`: [nx, ny, nz, d] with n·x ≥ d inside; `spheres`: [x, y, z, r]. Returns marks of the appearances, and how many splats they are. */
function select(stage, groups, second, { planes = [], spheres = [] }) {
  const [a, sameMotion, shared, b] = groups, data = stage.geometry.data;
  const marks = new Uint8Array(stage.rows.appearance);
  const [from, to] = second ? [a, a + sameMotion + shared + b] : [0, a + sameMotion + shared];
  let count = 0;
  for (let row = from; row < to; row++) {
    const at = row * GEOMETRY_TEXELS * 4, x = data[at], y = data[at + 1], z = data[at + 2];
    const inside = planes.every((plane) => plane[0] * x + plane[1] * y + plane[2] * z >= plane[3]) &&
      (spheres.length === 0 || spheres.some((sphere) => Math.hypot(x - sphere[0], y - sphere[1], z - sphere[2]) <= sphere[3]));
    if (!inside) continue;
    marks[appearanceRow(groups, row, second)] = 1;
    count++;
  }
  return { marks, count };
}
