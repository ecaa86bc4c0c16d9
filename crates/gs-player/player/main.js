// Connects the page, the worker and the renderer.
//
// Start options in the address, after `#`, joined by `&`:
//   t=0.5      time, 0 first to 1 last frame        paused     do not play
//   wipe=0.3   share that shows the original        ui=0       only the image
//   turn=30    degrees around, rise= up, zoom= factor, from the initial view
//   help       open the help                        report     write a decoding report to #report (for tests)
//   hold       delay the page's load event until the first image is shown (for screenshots)

const config = JSON.parse(byId("config").textContent);
const asked = new URLSearchParams(location.hash.slice(1));
const number = (name, otherwise) => (asked.has(name) && Number.isFinite(Number(asked.get(name))) ? Number(asked.get(name)) : otherwise);

/** Highest resolution, device pixels per CSS pixel. */
const MAX_DENSITY = 2;
/** Frame times above which the resolution is reduced, and below which it is raised, milliseconds. */
const SLOW = 45, FAST = 22;

function fail(error) {
  document.body.classList.remove("loading");
  document.body.classList.add("broken");
  byId("problem").hidden = false;
  byId("problem-text").textContent = `${error.message ?? error}.`.replace("..", ".");
  release();
}

/** Delays the page's load event with a frame that does not finish loading. */
function holdLoading() {
  const frame = document.createElement("iframe");
  frame.hidden = true;
  document.body.append(frame);
  frame.contentDocument.open();
  return () => {
    frame.contentDocument.close();
    frame.remove();
  };
}
let release = () => {};
if (asked.has("hold")) release = holdLoading();

function start() {
  const canvas = byId("view");
  document.body.style.background = `rgb(${config.background.map((value) => Math.round(value * 255)).join(" ")})`;
  document.body.classList.toggle("bare", asked.get("ui") === "0");
  if (typeof DecompressionStream === "undefined") throw new Error("This browser cannot decompress (DecompressionStream is missing)");
  const renderer = new Renderer(canvas, config.background);
  canvas.addEventListener("webglcontextlost", () => fail(new Error("The graphics device was lost; reload the page")));

  // Slow work runs in the worker; this thread only draws.
  const engine = new Worker(URL.createObjectURL(new Blob([byId("engine").textContent], { type: "text/javascript" })));
  engine.addEventListener("error", (event) => fail(new Error(`The scene's worker stopped: ${event.message ?? "it could not start"}`)));
  for (const block of document.querySelectorAll("script[data-bytes]")) {
    engine.postMessage({ kind: "block", text: block.textContent, bytes: Number(block.dataset.bytes) });
    block.remove();
  }
  engine.postMessage({ kind: "open", rawBytes: config.raw_bytes });

  let dirty = true;
  const changed = () => { dirty = true; };
  const clock = new Clock(config.frames, config.fps);
  const camera = new OrbitCamera(config.camera, config.target, config.up);
  const wipe = new Wipe(config.splats[1] > 0, changed);
  const ui = new Interface(config, clock, wipe, camera, changed);
  attachControls(canvas, camera, changed);
  clock.seek(number("t", 0) * clock.last);
  wipe.at = Math.max(0, Math.min(1, number("wipe", 0.5)));
  camera.orbit((number("turn", 0) * Math.PI) / 180, (number("rise", 0) * Math.PI) / 180);
  camera.zoom(1 / Math.max(0.01, number("zoom", 1)));
  if (asked.has("help")) ui.help();
  if (wipe.both) wipe.place();

  const resize = () => {
    const density = Math.min(MAX_DENSITY, devicePixelRatio || 1);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * density));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * density));
    changed();
  };
  new ResizeObserver(resize).observe(canvas);
  resize();

  // One request to the worker at a time; its answer is drawn with the newest view.
  let ready = false, waiting = false, shown = false, question = "", spare = [];
  let scale = 1, slowness = 30, lastTick = 0, lastActive = 0;
  const currentView = () => camera.view([canvas.width, canvas.height]);
  const ask = () => {
    const { rows, near } = currentView();
    const next = `${clock.time} ${rows[2]} ${near}`;
    if (!ready || waiting || next === question) return;
    question = next;
    waiting = true;
    engine.postMessage({ kind: "frame", id: 0, time: clock.time, view: rows[2], near, returned: spare }, spare);
    spare = [];
  };

  engine.addEventListener("message", ({ data }) => {
    switch (data.kind) {
      case "progress":
        byId("progress").value = data.share;
        break;
      case "ready":
        try {
          renderer.load(data);
        } catch (error) {
          fail(error);
          return;
        }
        ready = true;
        document.body.dataset.decodeMs = Math.round(data.decodeTime);
        if (asked.has("report")) engine.postMessage({ kind: "report", time: clock.time });
        ask();
        break;
      case "frame":
        waiting = false;
        renderer.update(data);
        for (const name of ["geometry", "look", "first", "second"]) if (data[name]) spare.push(data[name].buffer);
        document.body.dataset.seekMs = data.times.seek.toFixed(1);
        document.body.dataset.sortMs = data.times.sort.toFixed(1);
        shown ||= reveal();
        changed();
        break;
      case "report": {
        const text = document.createElement("pre");
        text.id = "report";
        text.hidden = true;
        text.textContent = JSON.stringify(data.report);
        document.body.append(text);
        break;
      }
      case "error":
        fail(new Error(`The scene's data is damaged: ${data.message}`));
        break;
    }
  });

  /** Called with the first image: removes the poster and starts the clip. */
  function reveal() {
    document.body.classList.remove("loading");
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (!asked.has("paused") && !calm) clock.play(true);
    renderer.draw(currentView(), wipe.value, 1);
    const poster = byId("poster");
    if (asked.has("hold")) {
      poster?.remove();
      // After two frames the image is on the screen.
      requestAnimationFrame(() => requestAnimationFrame(release));
    } else if (poster) {
      poster.classList.add("gone");
      setTimeout(() => poster.remove(), 600);
    }
    return true;
  }

  function tick(now) {
    requestAnimationFrame(tick);
    const elapsed = lastTick ? now - lastTick : 16;
    lastTick = now;
    if (shown) clock.advance(Math.min(elapsed, 250) / 1000);
    if (clock.playing) changed();
    if (!dirty) {
      // At rest the image is drawn once more at full resolution.
      if (scale < 1 && now - lastActive > 200 && shown) {
        scale = 1;
        renderer.draw(currentView(), wipe.value, 1);
      }
      return;
    }
    dirty = false;
    // Slow devices render fewer pixels while the scene moves.
    const active = now - lastActive < 100;
    lastActive = now;
    if (active && !asked.has("hold")) {
      slowness += (elapsed - slowness) * 0.1;
      if (slowness > SLOW) [scale, slowness] = [Math.max(0.4, scale * 0.85), 30];
      else if (slowness < FAST) [scale, slowness] = [Math.min(1, scale * 1.1), 30];
    }
    ask();
    ui.refresh();
    if (shown) renderer.draw(currentView(), wipe.value, scale);
  }
  requestAnimationFrame(tick);
}

try {
  start();
} catch (error) {
  fail(error);
}
