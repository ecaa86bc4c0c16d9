// The scene at a time, as texels. Runs in the worker.
//
// Geometry texels of a row: centre; unit quaternion (x, y, z, w); standard deviations.
// Look texels of a row: colour and opacity; then one texel per SH coefficient above degree 0.

const GEOMETRY_TEXELS = 3;
/** Texels of a line of the textures; every WebGL 2 device has at least this width. */
const LINE_TEXELS = 2048;

/** A texture's mirror: `texels` RGBA texels for each of `rows` rows, a whole number of rows in a line. */
function makeTable(rows, texels) {
  const perLine = Math.floor(LINE_TEXELS / texels);
  const lines = Math.max(1, Math.ceil(rows / perLine));
  const data = new Float32Array(lines * perLine * texels * 4);
  // A whole number of rows fits in a line, so a row's texels lie one after the other, lines included.
  return { texels, perLine, lines, width: perLine * texels, data };
}

class Stage {
  constructor(payload) {
    const { header, rows, attributes } = payload;
    this.header = header;
    this.attributes = attributes;
    const coefficients = (header.sh_degree + 1) ** 2;
    this.geometry = makeTable(rows.geometry, GEOMETRY_TEXELS);
    this.look = makeTable(rows.look, coefficients);
    this.rows = rows;
    // Where the playhead was, per mover: times mostly go forward.
    this.cursors = {};
    for (const [name, attribute] of Object.entries(attributes)) {
      this.cursors[name] = attribute.first.slice(0, attribute.movers.length);
      const value = new Float64Array(attribute.channels);
      for (let row = 0; row < attribute.rows; row++) {
        for (let c = 0; c < value.length; c++) value[c] = attribute.base[row * value.length + c];
        this.write(name, row, value);
      }
    }
    this.moving = {
      geometry: this.movingLines("geometry", this.geometry),
      look: this.movingLines("look", this.look),
    };
  }

  /** Stretches of lines that hold a moving row, as [first, count]. */
  movingLines(table, { perLine, lines }) {
    const moving = new Uint8Array(lines);
    for (const attribute of Object.values(this.attributes)) {
      if (attribute.table !== table) continue;
      for (const row of attribute.movers) moving[Math.floor(row / perLine)] = 1;
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

  /** Puts a row's value, in steps, where the shader finds it. */
  write(name, row, value) {
    const { step } = this.attributes[name];
    const geometry = this.geometry.data, look = this.look.data;
    const g = row * GEOMETRY_TEXELS * 4, l = row * this.look.texels * 4;
    switch (name) {
      case "position":
        for (let c = 0; c < 3; c++) geometry[g + c] = this.header.origin[c] + value[c] * step;
        break;
      case "rotation": {
        const w = value[0], x = value[1], y = value[2], z = value[3];
        const scale = 1 / Math.max(1e-12, Math.sqrt(w * w + x * x + y * y + z * z));
        geometry[g + 4] = x * scale;
        geometry[g + 5] = y * scale;
        geometry[g + 6] = z * scale;
        geometry[g + 7] = w * scale;
        break;
      }
      case "scale":
        for (let c = 0; c < 3; c++) geometry[g + 8 + c] = Math.exp(value[c] * step);
        break;
      case "opacity":
        look[l + 3] = value[0] * step;
        break;
      case "color":
        for (let c = 0; c < 3; c++) look[l + c] = value[c] * step;
        break;
      case "shading":
        for (let k = 0, texel = l + 4; k < value.length; k += 3, texel += 4) {
          for (let c = 0; c < 3; c++) look[texel + c] = value[k + c] * step;
        }
        break;
    }
  }

  /** Moves everything to `time`, in frames, fractions included. */
  seek(time) {
    for (const [name, attribute] of Object.entries(this.attributes)) {
      const { channels, movers, first, knotFrames, values } = attribute;
      const cursors = this.cursors[name];
      const value = new Float64Array(channels);
      for (let mover = 0; mover < movers.length; mover++) {
        const last = first[mover + 1] - 1;
        let knot = cursors[mover];
        while (knot < last && knotFrames[knot + 1] <= time) knot++;
        while (knot > first[mover] && knotFrames[knot] > time) knot--;
        cursors[mover] = knot;
        const a = knot * channels;
        if (knot === last) {
          for (let c = 0; c < channels; c++) value[c] = values[a + c];
        } else {
          const share = (time - knotFrames[knot]) / (knotFrames[knot + 1] - knotFrames[knot]);
          for (let c = 0; c < channels; c++) value[c] = values[a + c] + (values[a + channels + c] - values[a + c]) * share;
        }
        this.write(name, movers[mover], value);
      }
    }
  }
}

/** Copies the stretches of lines of a table one after the other. */
function copyLines(table, stretches, out) {
  const floats = table.width * 4;
  let at = 0;
  for (const [line, count] of stretches) {
    out.set(table.data.subarray(line * floats, (line + count) * floats), at);
    at += count * floats;
  }
}
