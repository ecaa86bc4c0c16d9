// Decodes the payload's text into numbers. Runs in the worker. The byte
// layout is described in the crate's README.

/** Bytes of a block of text: 13 bits in two of 91 characters, least significant first. */
function decodeBase91(text, length) {
  const digits = new Uint8Array(128);
  let digit = 0;
  for (let code = 33; code < 127; code++) {
    if (code !== 38 && code !== 60 && code !== 62) digits[code] = digit++;
  }
  const bytes = new Uint8Array(length);
  let bits = 0, count = 0, at = 0;
  for (let i = 0; i + 1 < text.length && at < length; i += 2) {
    bits |= (digits[text.charCodeAt(i)] + 91 * digits[text.charCodeAt(i + 1)]) << count;
    count += 13;
    while (count >= 8 && at < length) {
      bytes[at++] = bits;
      bits >>>= 8;
      count -= 8;
    }
  }
  if (at < length) throw new Error("a block of the file is truncated");
  return bytes;
}

/** Decompresses gzip; calls `progress` with 0 to 1. The gzip checksum detects damage. */
async function gunzip(blocks, length, progress) {
  const stream = new Blob(blocks).stream().pipeThrough(new DecompressionStream("gzip"));
  const reader = stream.getReader();
  const bytes = new Uint8Array(length);
  let at = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    if (at + value.length > length) throw new Error("the payload is longer than declared");
    bytes.set(value, at);
    at += value.length;
    progress(at / length);
  }
  if (at !== length) throw new Error("the payload is shorter than declared");
  return bytes;
}

/** Reads [channels, planes, rows] bytes as [rows, channels] signed integers. */
function readPlanes(bytes, at, rows, channels, planes) {
  const values = new Int32Array(rows * channels);
  for (let channel = 0; channel < channels; channel++) {
    for (let plane = 0; plane < planes; plane++) {
      const shift = 8 * plane;
      for (let row = 0, i = channel; row < rows; row++, i += channels) {
        values[i] |= bytes[at++] << shift;
      }
    }
  }
  for (let i = 0; i < values.length; i++) values[i] = (values[i] >>> 1) ^ -(values[i] & 1);
  return values;
}

/** Real part of the unit quaternion with the given imaginary parts, in steps. */
function impliedReal(x, y, z, step) {
  const one = 1 / step;
  return Math.floor(Math.sqrt(Math.max(0, one * one - (x * x + y * y + z * z))) + 0.5);
}

/** Throws if `fits` is false. The code below relies on the header's counts being consistent. */
function check(fits, what) {
  if (!fits) throw new Error(`the payload is damaged: ${what}`);
}

/** The header, with counts that fit a payload of `size` bytes. */
function readHeader(text, size) {
  let header;
  try {
    header = JSON.parse(text);
  } catch (error) {
    throw new Error(`the payload is damaged: its header is no JSON (${error.message})`);
  }
  const isCount = (value, most) => Number.isInteger(value) && value >= 0 && value <= most;
  const isList = (value) => Array.isArray(value);
  check(header !== null && typeof header === "object", "no header");
  check(isCount(header.frames, 65535) && header.frames > 0, "number of frames");
  // Rows may take no bytes at all if they are all equal.
  check(isList(header.groups) && header.groups.length === 4 && header.groups.every((n) => isCount(n, size + 65536)), "groups");
  check(isList(header.attributes), "attributes");
  for (const entry of header.attributes) {
    check(entry !== null && typeof entry === "object" && typeof entry.name === "string", "an attribute");
    const { table, channels, step, base_channels: stored, base_planes, knot_planes, moving_rows, knots, gap_bytes } = entry;
    check(table === "geometry" || table === "appearance", "table of an attribute");
    check(isCount(channels, 64) && channels > 0, "channels");
    check(stored === channels || (stored === 3 && channels === 4), "stored channels");
    check(isCount(base_planes, 4) && isCount(knot_planes, 4), "bytes per number");
    check([moving_rows, knots, gap_bytes].every((n) => isCount(n, size)), "counts of moving rows, knots or \
        gaps");
    check(Number.isFinite(step) && step > 0, "step");
  }
  return header;
}

/** One attribute: first frame of every row, and the knots of the rows that move. */
function readAttribute(entry, rows, frames, bytes, start) {
  const { channels, step } = entry;
  let at = start;
  const needed = rows * entry.base_channels * entry.base_planes + (entry.moving_rows > 0 ? (rows + 7) >> 3 : 0) +
    entry.gap_bytes + entry.knots * channels * entry.knot_planes;
  check(at + needed <= bytes.length, "an attribute is truncated");
  const stored = readPlanes(bytes, at, rows, entry.base_channels, entry.base_planes);
  at += stored.length * entry.base_planes;
  if (entry.base_delta) {
    for (let i = entry.base_channels; i < stored.length; i++) {
      stored[i] = (stored[i] + stored[i - entry.base_channels]) | 0;
    }
  }
  let base = stored;
  if (entry.base_channels < channels) {
    base = new Int32Array(rows * 4);
    for (let row = 0; row < rows; row++) {
      const x = stored[3 * row], y = stored[3 * row + 1], z = stored[3 * row + 2];
      base[4 * row] = impliedReal(x, y, z, step);
      base[4 * row + 1] = x;
      base[4 * row + 2] = y;
      base[4 * row + 3] = z;
    }
  }

  const movingRows = new Uint32Array(entry.moving_rows);
  if (entry.moving_rows > 0) {
    let i = 0;
    for (let row = 0; row < rows; row++) {
      if ((bytes[at + (row >> 3)] >> (row & 7)) & 1) movingRows[i++] = row;
    }
    check(i === entry.moving_rows, "number of moving rows");
    at += (rows + 7) >> 3;
  }
  // Knot 0 of every moving row is its first frame, so that every segment has two ends.
  const first = new Uint32Array(entry.moving_rows + 1);
  const knotFrames = new Uint16Array(entry.knots + entry.moving_rows);
  let ended = 0;
  for (let knot = 0, end = at + entry.gap_bytes; at < end; at++) {
    check(ended < entry.moving_rows, "more tracks than moving rows");
    if (knot === first[ended]) knotFrames[knot++] = 0;
    if (bytes[at] > 0) {
      const frame = knotFrames[knot - 1] + bytes[at];
      check(frame < frames && knot < knotFrames.length, "a knot after the last frame");
      knotFrames[knot++] = frame;
    } else {
      first[++ended] = knot;
    }
  }
  check(ended === entry.moving_rows && first[ended] === knotFrames.length, "number of knots");
  const differences = readPlanes(bytes, at, entry.knots, channels, entry.knot_planes);
  at += differences.length * entry.knot_planes;

  const values = new Int32Array((entry.knots + entry.moving_rows) * channels);
  let before = new Int32Array(frames * channels), dense = new Int32Array(frames * channels);
  for (let i = 0, d = 0; i < entry.moving_rows; i++) {
    const row = movingRows[i];
    for (let c = 0; c < channels; c++) values[first[i] * channels + c] = base[row * channels + c];
    for (let knot = first[i] + 1; knot < first[i + 1]; knot++) {
      const from = knotFrames[knot - 1] * channels, to = knotFrames[knot] * channels;
      for (let c = 0; c < channels; c++, d++) {
        let moved = differences[d];
        if (entry.knot_delta) moved = (moved + before[to + c] - before[from + c]) | 0;
        values[knot * channels + c] = (values[(knot - 1) * channels + c] + moved) | 0;
      }
    }
    if (entry.knot_delta) {
      everyFrame(knotFrames, values, first[i], first[i + 1], channels, dense);
      [before, dense] = [dense, before];
    }
  }
  return { ...entry, rows, base, movingRows, first, knotFrames, values, end: at };
}

/** Values of a moving row at every frame, rounded as in the encoder; the next moving row is stored relative to them. */
function everyFrame(knotFrames, values, start, end, channels, out) {
  for (let knot = start + 1; knot < end; knot++) {
    const from = knotFrames[knot - 1], to = knotFrames[knot];
    for (let frame = from; frame < to; frame++) {
      for (let c = 0; c < channels; c++) {
        const a = values[(knot - 1) * channels + c], b = values[knot * channels + c];
        out[frame * channels + c] = Math.floor(a + ((b - a) * (frame - from)) / (to - from) + 0.5);
      }
    }
  }
  const last = values.subarray((end - 1) * channels, end * channels);
  for (let i = knotFrames[end - 1] * channels; i < out.length; i += channels) out.set(last, i);
}

/** The whole payload. */
function readPayload(bytes) {
  const text = (from, to) => new TextDecoder().decode(bytes.subarray(from, to));
  if (bytes.length < 12 || text(0, 8) !== "C4DPLAY1") throw new Error("not a payload of this \
      player");
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(8, true);
  check(12 + length <= bytes.length, "the header is truncated");
  const header = readHeader(text(12, 12 + length), bytes.length);
  const [a, sameMotion, shared, b] = header.groups;
  const rows = { geometry: a + sameMotion + shared + b, appearance: a + 2 * sameMotion + shared + b };
  const attributes = {};
  let at = 12 + length;
  for (const entry of header.attributes) {
    const attribute = readAttribute(entry, rows[entry.table], header.frames, bytes, at);
    at = attribute.end;
    attributes[entry.name] = attribute;
  }
  if (at !== bytes.length) throw new Error("the payload's size differs from the size in its \
      header");
  return { header, rows, attributes };
}

/** FNV-1a over 32-bit integers, for tests that compare decoders. */
function fingerprint(integers) {
  let hash = 0x811c9dc5;
  for (const integer of integers) {
    for (let shift = 0; shift < 32; shift += 8) hash = Math.imul(hash ^ ((integer >>> shift) & 255), 0x01000193);
  }
  return hash >>> 0;
}
