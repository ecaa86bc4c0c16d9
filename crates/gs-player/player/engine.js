// Message handling of the worker: receives blocks of text, then answers requests for a time and a
// view with texels and draw orders.

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
  const geometry = describe(stage.geometry), look = describe(stage.look);
  postMessage(
    { kind: "ready", header: payload.header, geometry, look, moving: stage.moving, decodeTime: performance.now() - begun },
    [geometry.data.buffer, look.data.buffer],
  );
}

function frame({ id, time, view, near, returned }) {
  spare.push(...returned);
  const begun = performance.now();
  const answer = { kind: "frame", id, time, geometry: null, look: null };
  const transfer = [];
  if (time !== shownTime) {
    stage.seek(time);
    shownTime = time;
    for (const name of ["geometry", "look"]) {
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

/** Report of the decoded payload for tests: fingerprints of the integers, sums of the scene at a time. */
function report({ time }) {
  stage.seek(time);
  const attributes = Object.values(stage.attributes).map((attribute) => ({
    name: attribute.name,
    base: fingerprint(attribute.base),
    frames: fingerprint(attribute.knotFrames),
    values: fingerprint(attribute.values),
  }));
  // The screen still shows another time.
  shownTime = NaN;
  const sum = (data) => data.reduce((total, value) => total + value, 0);
  postMessage({
    kind: "report",
    report: { header: stage.header, time, attributes, sums: { geometry: sum(stage.geometry.data), look: sum(stage.look.data) } },
  });
}

onmessage = async ({ data }) => {
  try {
    switch (data.kind) {
      case "block":
        blocks.push(decodeBase91(data.text, data.bytes));
        break;
      case "open":
        await open(data);
        break;
      case "frame":
        frame(data);
        break;
      case "report":
        report(data);
        break;
    }
  } catch (error) {
    postMessage({ kind: "error", message: error.message });
  }
};
