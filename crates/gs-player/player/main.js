// Connects the page, the workers and the renderer.
//
// Start options in the address, after `#`, joined by `&`:
//   t=0.5      time, 0 first to 1 last frame        paused     do not play
//   wipe=0.3   share left of the divider            ui=0       only the image
//   mode=grid  or blink                             show=2     one scene alone, from 1
//   overlay=parts, opacity=0.5                      free       views beyond those captured
//   turn=30    degrees around, rise= up, zoom= factor, from the initial view
//   help       open the help                        report     write a decoding report to #report (for tests)
//   pick=X,Y;… write the splats at places, shares of the canvas, to #picked (for tests)
//   hold       delay the page's load event until the first image is shown (for screenshots)

const config = JSON.parse(byId("config").textContent);
const startOptions = new URLSearchParams(location.hash.slice(1));
const number = (name, otherwise) => (startOptions.has(name) && Number.isFinite(Number(startOptions.get(name))) ? Number(startOptions.get(name)) : otherwise);

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
if (startOptions.has("hold")) release = holdLoading();

/** Writes a value into the page, for tests. */
function note(id, value) {
  const text = document.createElement("pre");
  text.id = id;
  text.hidden = true;
  text.textContent = JSON.stringify(value);
  document.body.append(text);
}

function start() {
  const canvas = byId("view");
  document.body.style.background = `rgb(${config.background.map((value) => Math.round(value * 255)).join(" ")})`;
  document.body.classList.toggle("bare", startOptions.get("ui") === "0");
  if (typeof DecompressionStream === "undefined") throw new Error("This browser cannot decompress (DecompressionStream is missing)");
  const renderer = new Renderer(canvas, config.background);
  canvas.addEventListener("webglcontextlost", () => fail(new Error("The graphics device was lost; reload the page")));

  let dirty = true;
  const changed = () => { dirty = true; };
  const clock = new Clock(config.frames, config.fps);
  const camera = new OrbitCamera(config.camera, config.target, config.up, config.limits);
  const layout = new Layout(config.scenes, changed);
  const overlays = new Overlays(renderer, config.scenes, changed);
  const ui = new Interface(config, clock, layout, overlays, camera, changed);
  clock.seek(number("t", 0) * clock.last);
  if (startOptions.has("free") && camera.limited) camera.toggleLimits();
  camera.orbit((number("turn", 0) * Math.PI) / 180, (number("rise", 0) * Math.PI) / 180);
  camera.zoom(1 / Math.max(0.01, number("zoom", 1)));
  layout.at = Math.max(0, Math.min(1, number("wipe", 0.5)));
  if (startOptions.has("mode")) layout.set(startOptions.get("mode"));
  if (startOptions.has("show")) layout.show(number("show", 1) - 1);
  if (startOptions.has("opacity")) overlays.opacity = number("opacity", 1);
  if (startOptions.has("help")) ui.help();

  const size = () => [canvas.width, canvas.height];
  const resize = () => {
    const density = Math.min(MAX_DENSITY, devicePixelRatio || 1);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * density));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * density));
    layout.place();
    changed();
  };
  new ResizeObserver(resize).observe(canvas);
  resize();

  const sources = [], metas = [];
  let shown = false, scale = 1, slowness = 30, lastTick = 0, lastActive = 0;
  /** Cells with their views, as the renderer draws them. */
  const cells = () => layout.cells(size()).map((cell) => ({ ...cell, ...config.scenes[cell.scene], view: camera.view([cell.width, cell.height]) }));
  const draw = (at) => renderer.draw(cells(), at);
  const ask = () => {
    const { rows, near } = camera.view(size());
    for (const source of sources) source?.ask(clock.time, rows[2], near);
  };
  const started = config.scenes.reduce((most, { source }) => Math.max(most, source), 0) + 1;
  const drawn = new Set(), shares = [];

  /** Opens a payload, described by `meta`, in place of the one with this index; `open` hands over its data. */
  function openSource(index, meta, open) {
    const source = new Source({
      fail,
      progress: (share) => {
        shares[index] = share;
        byId("progress").value = shares.reduce((sum, share) => sum + share, 0) / started;
      },
      ready: () => {
        if (startOptions.has("report")) source.worker.postMessage({ kind: "report", time: clock.time });
        const { rows, near } = camera.view(size());
        source.ask(clock.time, rows[2], near);
      },
      report: (report) => note("report", report),
      frame: (answer, loaded) => {
        try {
          if (loaded) {
            renderer.load(index, loaded);
            if (sources[index] !== source) sources[index]?.close();
            [sources[index], metas[index]] = [source, meta];
            overlays.load(index, meta.overlays, loaded.overlays);
            document.body.dataset.decodeMs = Math.round(loaded.decodeTime);
          }
          renderer.update(index, answer);
        } catch (error) {
          fail(error);
          return;
        }
        drawn.add(index);
        document.body.dataset.seekMs = answer.times.seek.toFixed(1);
        document.body.dataset.sortMs = answer.times.sort.toFixed(1);
        if (loaded && drawn.size === started) {
          ui.count(config.scenes.map((scene) => metas[scene.source].splats[scene.second]));
          if (!shown && startOptions.has("overlay")) overlays.choose(startOptions.get("overlay"));
          shown ||= reveal();
        }
        changed();
      },
    });
    open(source);
  }

  /** The splat at a place, CSS pixels: {scene, row, center, depth, weight, view, place, cell}; null where none is. */
  async function pick(places, at = cells()) {
    const density = canvas.width / canvas.clientWidth;
    const found = [];
    for (const place of places) {
      const point = place.map((value) => value * density);
      const cell = at.find((cell) => point[0] >= cell.clip[0] && point[0] < cell.clip[1] && point[1] >= cell.y && point[1] < cell.y + cell.height);
      found.push(cell ? { cell, pixel: [point[0] - cell.x, point[1] - cell.y] } : null);
    }
    const answers = new Array(places.length).fill(null);
    for (const cell of at) {
      const here = found.map((one, i) => (one?.cell === cell ? i : -1)).filter((i) => i >= 0);
      if (here.length === 0) continue;
      const request = { time: clock.time, view: cell.view, second: cell.second, pixels: here.map((i) => found[i].pixel) };
      const picked = await sources[cell.source].call("pick", request);
      here.forEach((i, k) => { answers[i] = picked[k] && { ...picked[k], scene: cell.scene, cell, pixel: found[i].pixel }; });
    }
    return answers;
  }

  /** Called with the first image: removes the poster and starts the clip. */
  function reveal() {
    document.body.classList.remove("loading");
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (!startOptions.has("paused") && !calm) clock.play(true);
    draw(1);
    const poster = byId("poster");
    if (startOptions.has("hold")) {
      poster?.remove();
      // After two frames the image is on the screen.
      const finish = () => requestAnimationFrame(() => requestAnimationFrame(release));
      Promise.resolve(answerTests()).then(finish, fail);
    } else if (poster) {
      poster.classList.add("gone");
      setTimeout(() => poster.remove(), 600);
    }
    return true;
  }

  async function answerTests() {
    if (startOptions.has("pick")) {
      const sides = [canvas.clientWidth, canvas.clientHeight];
      const places = startOptions.get("pick").split(";").map((place) => place.split(",").map((share, k) => Math.floor(share * sides[k]) + 0.5));
      const answers = await pick(places);
      note("picked", { sides, answers: answers.map((answer, i) => ({ place: places[i], row: answer?.row ?? null, weight: answer?.weight ?? 0 })) });
    }
    await tools?.answerTests();
  }

  function tick(now) {
    requestAnimationFrame(tick);
    const elapsed = lastTick ? now - lastTick : 16;
    lastTick = now;
    if (shown) {
      clock.advance(Math.min(elapsed, 250) / 1000);
      layout.advance(Math.min(elapsed, 250) / 1000);
    }
    if (clock.playing) changed();
    if (!dirty) {
      // At rest the image is drawn once more at full resolution.
      if (scale < 1 && now - lastActive > 200 && shown) {
        scale = 1;
        draw(1);
      }
      return;
    }
    dirty = false;
    // Slow devices render fewer pixels while the scene moves.
    const active = now - lastActive < 100;
    lastActive = now;
    if (active && !startOptions.has("hold")) {
      slowness += (elapsed - slowness) * 0.1;
      if (slowness > SLOW) [scale, slowness] = [Math.max(0.4, scale * 0.85), 30];
      else if (slowness < FAST) [scale, slowness] = [Math.min(1, scale * 1.1), 30];
    }
    ask();
    ui.refresh();
    if (shown) draw(scale);
  }

  const parts = { canvas, clock, camera, layout, overlays, ui, sources, cells, changed, pick, openSource, fail, note };
  const tools = typeof Tools === "undefined" ? null : new Tools(parts);
  attachControls(canvas, camera, changed, (place) => tools?.clicked(place));
  config.sources.forEach((meta, index) => {
    const blocks = document.querySelectorAll(`script[data-source="${index}"]`);
    openSource(index, meta, (source) => source.openBlocks(blocks, meta.raw_bytes));
  });
  requestAnimationFrame(tick);
}

try {
  start();
} catch (error) {
  fail(error);
}
