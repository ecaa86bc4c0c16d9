// Message handling of the worker: receives blocks of text or bytes, then answers requests: for a
// time and a view with texels and draw orders; for pixels with splats; for selections with marks.

let stage = null, sorter = null, shownTime = NaN;
const blocks = [];

/** Buffers returned by the page for reuse. */
const spare = [];
const take = (Kind, length) => {
  const index = spare.findIndex((buffer) => buffer.byteLength === length * 4);
  return index < 0 ? new Kind(length) : new Kind(spare.splice(index, 1)[0]);
};

async function open({ rawBytes }) {
  const begun = performance.now();
  const bytes = await gunzip(blocks.splice(0), rawBytes, (share) => postMessage({ kind: "progress", share }));
  const payload = readPayload(bytes);
  stage = new Stage(payload);
  sorter = new Sorter(payload.header.groups);
  const describe = ({ texels, perLine, lines, width, data }) => ({ texels, perLine, lines, width, data: data.slice() });
  const geometry = describe(stage.geometry), appearance = describe(stage.appearance);
  const overlays = {};
  for (const [name, attribute] of Object.entries(stage.attributes)) {
    if (name.startsWith("overlay:")) overlays[name.slice("overlay:".length)] = Uint8Array.from(attribute.base);
  }
  postMessage(
    { kind: "ready", header: payload.header, geometry, appearance, overlays, moving: stage.moving, decodeTime: performance.now() - begun },
    [geometry.data.buffer, appearance.data.buffer],
  );
}

function frame({ id, time, view, near, returned }) {
  spare.push(...returned);
  const begun = performance.now();
  const answer = { kind: "frame", id, time, geometry: null, appearance: null };
  const transfer = [];
  if (time !== shownTime) {
    stage.seek(time);
    shownTime = time;
    for (const name of ["geometry", "appearance"]) {
      const table = stage[name], stretches = stage.moving[name];
      const lines = stretches.reduce((sum, stretch) => sum + stretch[1], 0);
      if (lines === 0) continue;
      answer[name] = take(Float32Array, lines * table.width * 4);
      copyLines(table, stretches, answer[name]);
      transfer.push(answer[name].buffer);
    }
  }
  const seekTime = performance.now() - begun;
  answer.first = take(Uint32Array, sorter.rows);
  answer.second = take(Uint32Array, sorter.rows);
  answer.counts = sorter.sort(stage.geometry, view, near, answer.first, answer.second);
  answer.times = { seek: seekTime, sort: performance.now() - begun - seekTime };
  transfer.push(answer.first.buffer, answer.second.buffer);
  postMessage(answer, transfer);
}

/** Sets the scene to `time` for a request that draws nothing. */
function seekTo(time) {
  if (time === shownTime) return;
  stage.seek(time);
  // The screen still shows a different time.
  shownTime = NaN;
}

/** For each pixel the splat that contributes most: row in the file or scene that was encoded, centre, depth, share of the pixel. */
function picked({ time, view, second, pixels }) {
  seekTo(time);
  const { groups } = stage.header;
  const orders = [new Uint32Array(sorter.rows), new Uint32Array(sorter.rows)];
  const counts = sorter.sort(stage.geometry, view.rows[2], view.near, ...orders);
  const which = second ? 1 : 0;
  const projected = project(stage, groups, orders[which], counts[which], second, view);
  return pixels.map((pixel) => {
    const found = heaviest(projected, pixel);
    if (!found) return null;
    const at = found.row * GEOMETRY_TEXELS * 4;
    const center = [...stage.geometry.data.subarray(at, at + 3)];
    const depth = view.rows[2].slice(0, 3).reduce((sum, value, k) => sum + value * (center[k] - view.eye[k]), 0);
    const numbers = stage.attributes.row?.base;
    const row = numbers ? numbers[2 * appearanceRow(groups, found.row, second) + which] : null;
    return { row, center, depth, weight: found.weight };
  });
}

/** Marks of the splats that a selection contains. */
function selected({ time, second, shape }) {
  seekTo(time);
  return select(stage, stage.header.groups, second, shape);
}

/** Report of the decoded payload for tests: fingerprints of the integers, sums of the scene at a time. */
function report({ time }) {
  stage.seek(time);
  const attributes = Object.values(stage.attributes).map((attribute) => ({
    name: attribute.name,
    base: fingerprint(attribute.base),
    frames: fingerprint(attribute.knotFrames),
    values: fingerprint(attribute.values),
  }));
  // The screen still shows a different time.
  shownTime = NaN;
  const sum = (data) => data.reduce((total, value) => total + value, 0);
  postMessage({
    kind: "report",
    report: { header: stage.header, time, attributes, sums: { geometry: sum(stage.geometry.data), appearance: sum(stage.appearance.data) } },
  });
}

onmessage = async ({ data }) => {
  try {
    switch (data.kind) {
      case "block":
        blocks.push(decodeBase91(data.text, data.bytes));
        break;
      case "bytes":
        blocks.push(data.bytes);
        break;
      case "open":
        await open(data);
        break;
      case "frame":
        frame(data);
        break;
      case "pick":
        postMessage({ kind: "answer", id: data.id, answer: picked(data) });
        break;
      case "select":
        postMessage({ kind: "answer", id: data.id, answer: selected(data) });
        break;
      case "report":
        report(data);
        break;
    }
  } catch (error) {
    postMessage({ kind: "error", message: error.message });
  }
};
