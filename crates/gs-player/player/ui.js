// Buttons, keys and labels.

/** Seconds without input after which the controls are hidden during playback. */
const QUIET_AFTER = 3;

const byId = (id) => document.getElementById(id);

class Interface {
  constructor(config, clock, layout, overlays, camera, changed) {
    Object.assign(this, { config, clock, layout, overlays, camera, changed });
    const body = document.body;
    body.classList.toggle("still", clock.frames < 2);
    body.classList.toggle("alone", !layout.several);
    const compare = byId("compare");
    compare.hidden = !layout.several;
    const button = (text, data, chosen) => {
      const element = document.createElement("button");
      element.type = "button";
      element.textContent = text;
      Object.assign(element.dataset, data);
      element.addEventListener("click", chosen);
      compare.append(element);
    };
    layout.scenes.forEach(({ name }, index) => button(name, { show: index }, () => layout.show(index)));
    for (const mode of ["wipe", "grid", "blink"]) {
      button(mode[0].toUpperCase() + mode.slice(1), { mode }, () => layout.choose(mode));
    }
    this.scrub = byId("scrub");
    this.scrub.max = clock.last;
    this.scrub.addEventListener("input", () => {
      this.play(false);
      clock.seek(Number(this.scrub.value));
      changed();
    });
    byId("play").addEventListener("click", () => this.play(!clock.playing));
    byId("loop").addEventListener("click", () => this.nextRepeat());
    byId("home").addEventListener("click", () => this.home());
    byId("full").addEventListener("click", () => this.fullScreen());
    byId("full").hidden = !document.fullscreenEnabled;
    byId("ask").addEventListener("click", () => this.help());
    const speed = byId("speed");
    for (const value of SPEEDS) speed.add(new Option(`${value}×`, value, value === 1, value === 1));
    speed.addEventListener("change", () => this.setSpeed(Number(speed.value)));
    addEventListener("keydown", (event) => this.key(event));
    byId("help").addEventListener("click", (event) => {
      if (event.target === byId("help")) byId("help").close();
    });
    for (const name of ["pointermove", "pointerdown", "keydown", "focusin"]) addEventListener(name, () => this.wake());
    this.wake();
  }

  /** Shows the numbers of splats of the scenes, in the order of the scenes. */
  count(splats) {
    const numbers = splats.map((n) => n.toLocaleString("en")).join(this.layout.several ? " → " : "");
    const { frames, fps } = this.config;
    byId("facts").textContent = `${numbers} splats${frames > 1 ? ` · ${frames} frames · ${+fps.toFixed(3)} fps` : ""}`;
  }

  announce(text) {
    byId("announcement").textContent = text;
  }

  wake() {
    document.body.classList.remove("quiet");
    clearTimeout(this.quietTimer);
    this.quietTimer = setTimeout(() => {
      const busy = byId("help").open || document.activeElement?.closest(".bar") || document.querySelector(".bar:hover, .dragging");
      if (this.clock.playing && !busy) document.body.classList.add("quiet");
    }, QUIET_AFTER * 1000);
  }

  play(playing) {
    this.clock.play(playing);
    this.changed();
  }

  nextRepeat() {
    this.clock.nextRepeat();
    const { repeat } = this.clock;
    byId("loop").firstElementChild.firstElementChild.setAttribute("href", `#icon-${repeat}`);
    byId("loop").setAttribute("aria-label", `Repeat: ${REPEAT_NAMES[repeat]}`);
    byId("loop").title = `Repeat: ${REPEAT_NAMES[repeat]}`;
    this.announce(`Repeat: ${REPEAT_NAMES[repeat]}`);
  }

  setSpeed(speed) {
    this.clock.speed = speed;
    byId("speed").value = String(speed);
    this.announce(`Speed ${speed}×`);
  }

  step(frames) {
    this.play(false);
    this.clock.seek(Math.round(this.clock.time) + frames);
    this.changed();
  }

  home() {
    this.camera.reset();
    this.changed();
  }

  toggleLimits() {
    if (this.camera.limits === null) return;
    this.announce(this.camera.toggleLimits() ? "The view stays where the scene was captured" : "The view is free");
    this.changed();
  }

  help() {
    const dialog = byId("help");
    if (dialog.open) dialog.close();
    else dialog.showModal();
  }

  fullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.documentElement.requestFullscreen?.().catch(() => this.announce("Full screen was refused"));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { key, shiftKey, target } = event;
    if (key === "?") return this.help();
    // Form controls handle their own keys.
    if (byId("help").open || target.closest("select, input:not([type=range]), textarea")) return;
    const slides = target.matches("input[type=range]") && (/^(Arrow|Page)/.test(key) || key === "Home" || key === "End");
    if (slides || (key === " " && target.closest("button"))) return;
    const turn = 0.06, reach = 30, size = [innerWidth, innerHeight];
    const move = (x, y) => {
      if (shiftKey) this.camera.pan(x * reach, y * reach, size);
      else this.camera.orbit(-x * turn, y * turn);
      this.changed();
    };
    const zoom = (factor) => {
      this.camera.zoom(factor);
      this.changed();
    };
    const faster = (by) => this.setSpeed(SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(this.clock.speed) + by))]);
    const actions = {
      ...this.tools,
      " ": () => this.play(!this.clock.playing),
      ",": () => this.step(-1),
      ".": () => this.step(1),
      Home: () => this.step(-Infinity),
      End: () => this.step(Infinity),
      "[": () => faster(-1),
      "]": () => faster(1),
      l: () => this.nextRepeat(),
      ArrowLeft: () => move(-1, 0),
      ArrowRight: () => move(1, 0),
      ArrowUp: () => move(0, -1),
      ArrowDown: () => move(0, 1),
      "+": () => zoom(0.92),
      "=": () => zoom(0.92),
      "-": () => zoom(1 / 0.92),
      "−": () => zoom(1 / 0.92),
      r: () => this.home(),
      1: () => this.layout.show(0),
      2: () => this.layout.show(1),
      3: () => this.layout.show(2),
      4: () => this.layout.show(3),
      w: () => this.layout.choose("wipe"),
      g: () => this.layout.choose("grid"),
      b: () => this.layout.choose("blink"),
      "<": () => this.layout.move(this.layout.at - 0.02),
      ">": () => this.layout.move(this.layout.at + 0.02),
      o: () => this.overlays.next(),
      9: () => this.overlays.setOpacity(this.overlays.opacity - 0.05),
      0: () => this.overlays.setOpacity(this.overlays.opacity + 0.05),
      c: () => this.toggleLimits(),
      f: () => this.fullScreen(),
      h: () => document.body.classList.toggle("hushed"),
    };
    const action = actions[key.length === 1 ? key.toLowerCase() : key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  /** Shows the state of the playhead. */
  refresh() {
    const { clock, scrub } = this;
    const shown = `${Math.round(clock.time) + 1} / ${clock.frames}`;
    if (byId("clock").textContent !== shown) {
      byId("clock").textContent = shown;
      scrub.setAttribute("aria-valuetext", `Frame ${shown.replace("/", "of")}`);
    }
    scrub.value = clock.time;
    scrub.style.setProperty("--at", `${(100 * clock.time) / Math.max(1, clock.last)}%`);
    if (this.shownPlaying !== clock.playing) {
      this.shownPlaying = clock.playing;
      byId("play").setAttribute("aria-label", clock.playing ? "Pause" : "Play");
      byId("play").querySelector("use").setAttribute("href", clock.playing ? "#icon-pause" : "#icon-play");
      this.wake();
    }
  }
}
