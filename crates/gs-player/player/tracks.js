// The scene at one time, as texels. Runs in the worker.
//
// Geometry texels of a row: centre; unit quaternion (x, y, z, w); standard deviations.
// Appearance texels of a row: colour and opacity; then one texel per SH coefficient above degree 0.

const GEOMETRY_TEXELS = 3;
/** Texels of a line of the textures; every WebGL 2 device has at least this width. */
const LINE_TEXELS = 2048;

/** Contents of a texture: `texels` RGBA texels for each of `rows` rows, a whole number of rows per line. */
function makeTable(rows, texels) {
  const perLine = Math.floor(LINE_TEXELS / texels);
  const lines = Math.max(1, Math.ceil(rows / perLine));
  const data = new Float32Array(lines * perLine * texels * 4);
  // A whole number of rows fits in a line, so the texels of a row are contiguous.
  return { texels, perLine, lines, width: perLine * texels, data };
}

class Stage {
  constructor(payload) {
    const { header, rows, attributes } = payload;
    this.header = header;
    this.attributes = attributes;
    const coefficients = (header.sh_degree + 1) ** 2;
    this.geometry = makeTable(rows.geometry, GEOMETRY_TEXELS);
    this.appearance = makeTable(rows.appearance, coefficients);
    this.rows = rows;
    // Last knot of each moving row; the search starts there, because time mostly moves forward.
    this.cursors = {};
    // Values of the moving rows at the current time.
    this.now = {};
    for (const [name, attribute] of Object.entries(attributes)) {
      this.cursors[name] = attribute.first.slice(0, attribute.movingRows.length);
      this.now[name] = new Float64Array(attribute.movingRows.length * attribute.channels);
      this.write(name, Uint32Array.from({ length: attribute.rows }, (_, row) => row), Float64Array.from(attribute.base));
    }
    this.moving = {
      geometry: this.movingLines("geometry", this.geometry),
      appearance: this.movingLines("appearance", this.appearance),
    };
  }

  /** Ranges of lines that contain a moving row, as [first, count]. */
  movingLines(table, { perLine, lines }) {
    const moving = new Uint8Array(lines);
    for (const attribute of Object.values(this.attributes)) {
      if (attribute.table !== table) continue;
      for (const row of attribute.movingRows) moving[Math.floor(row / perLine)] = 1;
    }
    const stretches = [];
    for (let line = 0; line < lines; line++) {
      if (!moving[line]) continue;
      const last = stretches.at(-1);
      if (last && last[0] + last[1] === line) last[1]++;
      else stretches.push([line, 1]);
    }
    return stretches;
  }

  /** Writes the values of rows, given in steps, to their texels. */
  write(name, rows, values) {
    const { step, channels } = this.attributes[name];
    const geometry = this.geometry.data, appearance = this.appearance.data;
    const toGeometry = GEOMETRY_TEXELS * 4, toAppearance = this.appearance.texels * 4;
    const count = rows.length;
    switch (name) {
      case "position": {
        const [x, y, z] = this.header.origin;
        for (let i = 0, v = 0; i < count; i++, v += 3) {
          const at = rows[i] * toGeometry;
          geometry[at] = x + values[v] * step;
          geometry[at + 1] = y + values[v + 1] * step;
          geometry[at + 2] = z + values[v + 2] * step;
        }
        break;
      }
      case "rotation":
        for (let i = 0, v = 0; i < count; i++, v += 4) {
          const at = rows[i] * toGeometry;
          const w = values[v], x = values[v + 1], y = values[v + 2], z = values[v + 3];
          const scale = 1 / Math.max(1e-12, Math.sqrt(w * w + x * x + y * y + z * z));
          geometry[at + 4] = x * scale;
          geometry[at + 5] = y * scale;
          geometry[at + 6] = z * scale;
          geometry[at + 7] = w * scale;
        }
        break;
      case "scale":
        for (let i = 0, v = 0; i < count; i++) {
          const at = rows[i] * toGeometry + 8;
          for (let c = 0; c < 3; c++, v++) geometry[at + c] = Math.exp(values[v] * step);
        }
        break;
      case "opacity":
        for (let i = 0; i < count; i++) appearance[rows[i] * toAppearance + 3] = values[i] * step;
        break;
      case "color":
        for (let i = 0, v = 0; i < count; i++) {
          const at = rows[i] * toAppearance;
          for (let c = 0; c < 3; c++, v++) appearance[at + c] = values[v] * step;
        }
        break;
      case "shading":
        for (let i = 0, v = 0; i < count; i++) {
          for (let k = 0, texel = rows[i] * toAppearance + 4; k < channels; k += 3, texel += 4) {
            for (let c = 0; c < 3; c++, v++) appearance[texel + c] = values[v] * step;
          }
        }
        break;
    }
  }

  /** Sets the scene to `time`, in frames, including fractions. */
  seek(time) {
    for (const name of Object.keys(this.attributes)) {
      this.evaluate(this.attributes[name], this.cursors[name], time, this.now[name]);
      this.write(name, this.attributes[name].movingRows, this.now[name]);
    }
  }

  /** The values of an attribute's moving rows at `time`, in steps. */
  evaluate({ channels, movingRows, first, knotFrames, values }, cursors, time, out) {
    for (let i = 0, at = 0; i < movingRows.length; i++) {
      const last = first[i + 1] - 1;
      let knot = cursors[i];
      while (knot < last && knotFrames[knot + 1] <= time) knot++;
      while (knot > first[i] && knotFrames[knot] > time) knot--;
      cursors[i] = knot;
      const a = knot * channels;
      if (knot === last) {
        for (let c = 0; c < channels; c++) out[at++] = values[a + c];
      } else {
        const share = (time - knotFrames[knot]) / (knotFrames[knot + 1] - knotFrames[knot]);
        for (let c = 0; c < channels; c++) out[at++] = values[a + c] + (values[a + channels + c] - values[a + c]) * share;
      }
    }
  }
}

/** Copies the ranges of lines of a table into a contiguous buffer. */
function copyLines(table, stretches, out) {
  const floats = table.width * 4;
  let at = 0;
  for (const [line, count] of stretches) {
    out.set(table.data.subarray(line * floats, (line + count) * floats), at);
    at += count * floats;
  }
}
