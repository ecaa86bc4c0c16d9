// Selections drawn on the image, as expressions of `c4d edit --select`.

/** Columns and lines of places at which a box looks for splats. */
const BOX_PLACES = 14;
/** Depth beyond the deepest splat that a box sees, as a share of its depth. */
const BOX_MARGIN = 0.02;
/** Radius of the brush, CSS pixels. */
const BRUSH_RADIUS = 24;
/** Most spheres of a stroke, so that the expression stays readable. */
const MOST_SPHERES = 60;

/** As written in an expression; the page selects by the written numbers. */
const written = (value) => Number(value.toPrecision(7));

/** The planes of the part of space that a box on a cell's image shows, up to `depth`: [nx, ny, nz, d] with n·x ≥ d inside. */
function boxPlanes({ rows, eye, focal, principal }, [left, top, right, bottom], depth) {
  const [x, y, z] = rows.map((row) => row.slice(0, 3));
  const plane = (direction, offset) => {
    const normal = unit(direction).map(written);
    return [...normal, written(dot(unit(direction), eye) + offset)];
  };
  const side = (axis, k, pixel, sign) => plane(add(axis.map((value) => sign * focal[k] * value), z, -sign * (pixel - principal[k])), 0);
  return [side(x, 0, left, 1), side(x, 0, right, -1), side(y, 1, top, 1), side(y, 1, bottom, -1), plane(z.map((value) => -value), -depth)];
}

/** `shape` in the language of `c4d edit --select`. */
function expressionOf({ planes = [], spheres = [] }) {
  const list = (kind, all) => all.map((numbers) => `${kind} ${numbers.join(",")}`);
  return [...list("plane", planes), list("sphere", spheres).join(" | ")].filter((part) => part !== "").join(" & ");
}

class Selection {
  /** `show(text, command)` shows a message; `post` sends a selection to the server. */
  constructor(parts, post, show) {
    Object.assign(this, { parts, post, show });
    this.tool = null;
    this.lasso = byId("lasso");
    byId("tool-box").addEventListener("click", () => this.use("box"));
    byId("tool-brush").addEventListener("click", () => this.use("brush"));
    this.lasso.addEventListener("pointerdown", (event) => {
      this.lasso.setPointerCapture(event.pointerId);
      this.trail = [[event.clientX, event.clientY]];
      // The spheres of a stroke lie on the splats of one frame.
      this.parts.clock.play(false);
      this.parts.clock.seek(Math.round(this.parts.clock.time));
      this.outline();
    });
    this.lasso.addEventListener("pointermove", (event) => {
      if (!this.lasso.hasPointerCapture(event.pointerId)) return;
      this.trail.push([event.clientX, event.clientY]);
      this.outline();
    });
    this.lasso.addEventListener("pointerup", () => {
      byId("lasso-box").hidden = true;
      const trail = this.trail;
      const done = this.tool === "box" ? this.box([...trail[0], ...trail.at(-1)]) : this.brush(trail);
      done.catch((error) => this.show(error.message));
    });
  }

  /** Takes up a tool, "box" or "brush", or puts it down. */
  use(tool) {
    this.tool = this.tool === tool ? null : tool;
    this.lasso.hidden = this.tool === null;
    for (const name of ["box", "brush"]) byId(`tool-${name}`).setAttribute("aria-pressed", String(this.tool === name));
    if (this.tool === null) this.clear();
    else this.show(this.tool === "box" ? "Drag a box over what to select" : "Draw over what to select");
  }

  clear() {
    this.parts.overlays.mark(-1, null);
    this.show("");
  }

  outline() {
    const box = byId("lasso-box"), [first, last] = [this.trail[0], this.trail.at(-1)];
    const brush = this.tool === "brush";
    const low = [0, 1].map((k) => (brush ? last[k] - BRUSH_RADIUS : Math.min(first[k], last[k])));
    const high = [0, 1].map((k) => (brush ? last[k] + BRUSH_RADIUS : Math.max(first[k], last[k])));
    Object.assign(box.style, { left: `${low[0]}px`, top: `${low[1]}px`, width: `${high[0] - low[0]}px`, height: `${high[1] - low[1]}px`, borderRadius: brush ? "50%" : "0" });
    box.hidden = false;
  }

  /** Selects what a box shows, up to the deepest splat that it shows; corners in CSS pixels. */
  async box([x0, y0, x1, y1]) {
    const [left, right, top, bottom] = [Math.min(x0, x1), Math.max(x0, x1), Math.min(y0, y1), Math.max(y0, y1)];
    const at = (from, to, k) => from + ((to - from) * (k + 0.5)) / BOX_PLACES;
    const places = Array.from({ length: BOX_PLACES ** 2 }, (_, i) => [at(left, right, i % BOX_PLACES), at(top, bottom, Math.floor(i / BOX_PLACES))]);
    const found = (await this.parts.pick(places)).filter((one) => one !== null);
    if (found.length === 0) return this.show("Nothing is shown there");
    // A box across cells selects in the one where it begins.
    const { cell } = found[0];
    const depth = Math.max(...found.filter((one) => one.cell === cell).map((one) => one.depth)) * (1 + BOX_MARGIN);
    const density = this.parts.canvas.width / this.parts.canvas.clientWidth;
    const corner = (x, y) => [x * density - cell.x, y * density - cell.y];
    return this.finish(cell, { planes: boxPlanes(cell.view, [...corner(left, top), ...corner(right, bottom)], depth) });
  }

  /** Selects around the splats that a stroke passes over; places in CSS pixels. */
  async brush(trail) {
    const found = (await this.parts.pick(trail)).filter((one) => one !== null);
    if (found.length === 0) return this.show("Nothing is shown there");
    const { cell } = found[0];
    const density = this.parts.canvas.width / this.parts.canvas.clientWidth;
    const spheres = [];
    for (const one of found.filter((one) => one.cell === cell)) {
      const radius = (BRUSH_RADIUS * density * one.depth) / cell.view.focal[0];
      const near = spheres.some((sphere) => Math.hypot(...sub(one.center, sphere)) < sphere[3] / 2);
      if (!near && spheres.length < MOST_SPHERES) spheres.push([...one.center, radius].map(written));
    }
    return this.finish(cell, { spheres });
  }

  /** Marks the selected splats and sends the expression to the server, which prints the command. */
  async finish(cell, shape) {
    const { clock, overlays, sources } = this.parts;
    const { marks, count } = await sources[cell.source].call("select", { time: clock.time, second: cell.second, shape });
    overlays.mark(cell.source, marks);
    const expression = expressionOf(shape);
    const { command } = await this.post("selection", { scene: cell.scene, frame: Math.round(clock.time), expression });
    this.show(`${count.toLocaleString("en")} splats selected. The command is also in the terminal:`, command);
    return { count, expression, command };
  }
}
