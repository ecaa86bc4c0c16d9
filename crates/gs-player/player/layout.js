// Where each scene is drawn: one alone, two on either side of a divider, all in a grid, or one after the other.

/** Time for which each scene is shown when they blink, seconds. */
const BLINK_SECONDS = 0.7;
/** Space between the cells of a grid, pixels. */
const GRID_GAP = 2;

class Layout {
  /** `scenes`: {name, source, second}. */
  constructor(scenes, changed) {
    this.scenes = scenes;
    this.changed = changed;
    this.mode = this.several ? "wipe" : "single";
    this.shown = 0;
    this.right = 1;
    this.at = 0.5;
    this.elapsed = 0;
    this.divider = byId("divider");
    this.names = scenes.map(({ name }) => {
      const label = document.createElement("div");
      label.className = "name";
      label.textContent = name;
      label.hidden = true;
      byId("stage").append(label);
      return label;
    });
    if (this.several) this.attachDivider();
  }

  get several() {
    return this.scenes.length > 1;
  }

  attachDivider() {
    const { divider } = this;
    divider.addEventListener("pointerdown", (event) => {
      divider.setPointerCapture(event.pointerId);
      divider.classList.add("dragging");
    });
    divider.addEventListener("pointermove", (event) => {
      if (divider.hasPointerCapture(event.pointerId)) this.move(event.clientX / innerWidth);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      divider.addEventListener(name, () => divider.classList.remove("dragging"));
    }
    divider.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowDown: -0.02, ArrowRight: 0.02, ArrowUp: 0.02, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      this.move(this.at + step);
    });
  }

  /** Moves the divider; `at` is the share of the width left of it. */
  move(at) {
    this.at = Math.max(0, Math.min(1, at));
    this.set("wipe");
  }

  /** Chooses "single", "wipe", "grid" or "blink"; the divider chosen again compares the first scene with the next. */
  choose(mode) {
    if (mode === "wipe" && this.mode === "wipe" && this.several) this.right = 1 + (this.right % (this.scenes.length - 1));
    this.set(mode);
  }

  set(mode) {
    if (!this.several) return;
    this.mode = mode;
    this.elapsed = 0;
    this.place();
    this.changed();
  }

  /** Shows one scene alone. */
  show(index) {
    if (!this.several || index >= this.scenes.length) return;
    this.shown = index;
    this.set("single");
  }

  /** Lets time pass for scenes that blink. */
  advance(seconds) {
    if (this.mode !== "blink") return;
    this.elapsed += seconds;
    if (this.elapsed < BLINK_SECONDS) return;
    this.elapsed %= BLINK_SECONDS;
    this.shown = (this.shown + 1) % this.scenes.length;
    this.place();
    this.changed();
  }

  /** Cells of a canvas of this size: {scene, x, y, width, height, clip}, pixels; `clip` is the first and last column that are drawn. */
  cells([width, height]) {
    const whole = (scene, from, to) => ({ scene, x: 0, y: 0, width, height, clip: [from, to] });
    if (this.mode === "wipe") {
      const split = Math.round(this.at * width);
      return [whole(0, 0, split), whole(this.right, split, width)];
    }
    if (this.mode !== "grid") return [whole(this.shown, 0, width)];
    const count = this.scenes.length;
    const columns = count > 2 || width > height ? 2 : 1, lines = Math.ceil(count / columns);
    return this.scenes.map((_, scene) => {
      const column = scene % columns, line = Math.floor(scene / columns);
      const edge = (side, parts, part) => Math.round((side * part) / parts);
      const x = edge(width, columns, column) + (column > 0 ? GRID_GAP : 0), y = edge(height, lines, line) + (line > 0 ? GRID_GAP : 0);
      const right = edge(width, columns, column + 1), below = edge(height, lines, line + 1);
      return { scene, x, y, width: Math.max(1, right - x), height: Math.max(1, below - y), clip: [x, right] };
    });
  }

  /** Positions the divider and the names. */
  place() {
    if (!this.several) return;
    const percent = `${this.at * 100}%`;
    this.divider.hidden = this.mode !== "wipe";
    this.divider.style.left = percent;
    this.divider.setAttribute("aria-valuenow", Math.round(this.at * 100));
    const cells = this.cells([innerWidth, innerHeight]);
    this.names.forEach((label, scene) => {
      const cell = cells.find((cell) => cell.scene === scene);
      label.hidden = this.mode === "single" || !cell;
      if (label.hidden) return;
      const left = this.mode === "wipe" ? percent : `calc(${cell.x}px + var(--edge))`;
      label.style.left = left;
      label.style.top = cell.y > 0 ? `calc(${cell.y}px + 12px)` : "";
      label.classList.toggle("ends", this.mode === "wipe" && scene === 0);
      label.classList.toggle("starts", this.mode === "wipe" && scene !== 0);
    });
    for (const button of document.querySelectorAll("#compare button")) {
      const { show, mode } = button.dataset;
      const pressed = show === undefined ? mode === this.mode : this.mode === "single" && Number(show) === this.shown;
      button.setAttribute("aria-pressed", String(pressed));
    }
  }
}
