// A camera that orbits a point: orbit, pan, zoom. World units, radians;
// the camera frame is x right, y down, z forward.

const sub = (a, b) => a.map((value, k) => value - b[k]);
const add = (a, b, scale = 1) => a.map((value, k) => value + scale * b[k]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));

/** The near plane is at most this share of the way to the target, so that zooming in does not clip the target. */
const NEAR_SHARE = 0.1;

/** Smallest angle between the view direction and the up axis. */
const POLE = 0.02;

class OrbitCamera {
  /**
   * `camera`: position, focal lengths, image size and near plane of the first view; `limits`: largest angles to it, around and up, degrees,
   * or null.
   */
  constructor(camera, target, up, limits = null) {
    this.camera = camera;
    this.limits = limits?.map((degrees) => (degrees * Math.PI) / 180) ?? null;
    this.limited = limits !== null;
    this.up = unit(up);
    // Two horizontal directions from which the azimuth is measured.
    const other = Math.abs(this.up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    this.east = unit(cross(other, this.up));
    this.north = cross(this.up, this.east);
    const arm = sub(camera.position, target);
    this.home = {
      target,
      distance: Math.hypot(...arm),
      turn: Math.atan2(dot(arm, this.north), dot(arm, this.east)),
      rise: Math.asin(Math.max(-1, Math.min(1, dot(unit(arm), this.up)))),
    };
    this.reset();
  }

  reset() {
    this.now = { ...this.home, target: [...this.home.target] };
  }

  /** Orbits by angles, radians; within the limits while they hold. */
  orbit(right, up) {
    const within = (value, center, reach) => Math.max(center - reach, Math.min(center + reach, value));
    this.now.turn += right;
    this.now.rise = within(this.now.rise + up, 0, Math.PI / 2 - POLE);
    if (!this.limited) return;
    this.now.turn = within(this.now.turn, this.home.turn, this.limits[0]);
    this.now.rise = within(this.now.rise, this.home.rise, this.limits[1]);
  }

  /** Lifts the limits, or makes them hold again. Returns whether they hold. */
  toggleLimits() {
    this.limited = this.limits !== null && !this.limited;
    this.orbit(0, 0);
    return this.limited;
  }

  /** Pans so that the image at the target moves by that many pixels. */
  pan(x, y, size) {
    const { rows } = this.view(size);
    const perPixel = this.now.distance / this.focal(size);
    this.now.target = add(add(this.now.target, rows[0].slice(0, 3), -x * perPixel), rows[1].slice(0, 3), -y * perPixel);
  }

  /** Multiplies the distance to the target: below 1 moves nearer. */
  zoom(factor) {
    const { distance } = this.home;
    this.now.distance = Math.max(distance * 0.02, Math.min(distance * 20, this.now.distance * factor));
  }

  /** Focal length in pixels when the first view's image just fits into `size`. */
  focal([width, height]) {
    const [w, h] = this.camera.size;
    return this.camera.focal[0] * Math.min(width / w, height / h);
  }

  /** Camera parameters for an image of `size` pixels. */
  view(size) {
    const { target, distance, turn, rise } = this.now;
    const level = add(this.east.map((value) => value * Math.cos(turn)), this.north, Math.sin(turn));
    const arm = add(level.map((value) => value * Math.cos(rise)), this.up, Math.sin(rise));
    // Computed as in the shader, so that points relative to the eye
    // keep their precision far from the origin.
    const eye = add(target, arm, distance).map(Math.fround);
    const forward = arm.map((value) => -value);
    const right = unit(cross(forward, this.up));
    const down = cross(forward, right);
    const rows = [right, down, forward].map((axis) => [...axis, -dot(axis, eye)]);
    const scale = Math.min(size[0] / this.camera.size[0], size[1] / this.camera.size[1]);
    return {
      rows,
      eye,
      focal: this.camera.focal.map((focal) => focal * scale),
      principal: [size[0] / 2, size[1] / 2],
      near: Math.min(this.camera.near, NEAR_SHARE * distance),
      size,
    };
  }
}

/** Distance that a pointer may move during a click, CSS pixels. */
const CLICK_REACH = 4;

/** Lets pointers, wheel and touch move the camera; calls `changed` after every change, and `clicked` with the place of a click. */
function attachControls(canvas, camera, changed, clicked) {
  const pointers = new Map();
  let pressed = null;
  const size = () => [canvas.clientWidth, canvas.clientHeight];
  const middle = () => {
    const points = [...pointers.values()];
    const mean = (axis) => points.reduce((sum, point) => sum + point[axis], 0) / points.length;
    const center = [mean(0), mean(1)];
    const spread = points.reduce((sum, point) => sum + Math.hypot(point[0] - center[0], point[1] - center[1]), 0);
    return { center, spread };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("dragging");
    pressed = event.button === 0 && pointers.size === 0 ? [event.clientX, event.clientY] : null;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!pointers.has(event.pointerId)) return;
    const before = middle();
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    const after = middle();
    const [x, y] = sub(after.center, before.center);
    if (pointers.size > 1) {
      camera.pan(x, y, size());
      if (after.spread > 0) camera.zoom(before.spread / after.spread);
    } else if (event.buttons & 6 || event.shiftKey || event.ctrlKey || event.metaKey) {
      camera.pan(x, y, size());
    } else {
      const perPixel = Math.PI / Math.min(...size());
      camera.orbit(-x * perPixel, y * perPixel);
    }
    changed();
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => {
      const place = [event.clientX, event.clientY];
      if (name === "pointerup" && pressed && Math.hypot(...sub(place, pressed)) < CLICK_REACH) clicked(place);
      pressed = null;
      pointers.delete(event.pointerId);
      if (pointers.size === 0) canvas.classList.remove("dragging");
    });
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  // On the whole stage, because the divider covers part of the image.
  canvas.parentElement.addEventListener("wheel", (event) => {
    event.preventDefault();
    // Some browsers report lines or pages instead of pixels.
    const unitPixels = [1, 16, 400][event.deltaMode] ?? 1;
    camera.zoom(Math.exp(Math.max(-240, Math.min(240, event.deltaY * unitPixels)) * 0.0012));
    changed();
  }, { passive: false });
  canvas.addEventListener("dblclick", () => {
    camera.reset();
    changed();
  });
}
