// Back-to-front order by camera depth. Runs in the worker.
//
// Two counting sorts over the 16-bit halves of the depth as a
// 32-bit float: exact, stable, linear time.

class Sorter {
  /** `groups`: rows of the first scene alone, same motion, shared, second scene alone. */
  constructor([a, sameMotion, shared, b]) {
    this.rows = a + sameMotion + shared + b;
    this.firstEnd = a + sameMotion + shared;
    this.secondStart = a;
    this.depths = new Float32Array(this.rows);
    this.keys = new Uint32Array(this.depths.buffer);
    this.visible = new Uint32Array(this.rows);
    this.halfway = new Uint32Array(this.rows);
    this.counts = new Uint32Array(65536);
  }

  /**
   * Fills `first` and `second` with rows of the two scenes, farthest first; of equal depths the higher row first. Returns how many.
   * `view` is the third row of the world-to-camera matrix; rows at depth `near` or less are left out.
   */
  sort(table, view, near, first, second) {
    const { depths, keys, visible, halfway, counts } = this;
    const [x, y, z, w] = view;
    const data = table.data, stride = table.texels * 4;
    let count = 0;
    for (let row = 0, at = 0; row < this.rows; row++, at += stride) {
      depths[row] = x * data[at] + y * data[at + 1] + z * data[at + 2] + w;
      if (depths[row] > near) visible[count++] = row;
    }
    this.pass(visible, halfway, count, 0);
    this.pass(halfway, visible, count, 16);
    let inFirst = 0, inSecond = 0;
    for (let i = count - 1; i >= 0; i--) {
      const row = visible[i];
      if (row < this.firstEnd) first[inFirst++] = row;
      if (row >= this.secondStart) second[inSecond++] = row;
    }
    return [inFirst, inSecond];
  }

  /** One stable counting sort by 16 bits of the keys. */
  pass(from, to, count, shift) {
    const { keys, counts } = this;
    counts.fill(0);
    for (let i = 0; i < count; i++) counts[(keys[from[i]] >>> shift) & 0xffff]++;
    for (let digit = 0, sum = 0; digit < 65536; digit++) {
      const here = counts[digit];
      counts[digit] = sum;
      sum += here;
    }
    for (let i = 0; i < count; i++) to[counts[(keys[from[i]] >>> shift) & 0xffff]++] = from[i];
  }
}
