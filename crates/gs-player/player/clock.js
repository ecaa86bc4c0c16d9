// The playhead. Time is in frames, including fractions; the
// last frame is shown as long as any other.

const REPEATS = ["loop", "pingpong", "once"];
const REPEAT_NAMES = { loop: "loop", pingpong: "back and forth", once: "once" };
const SPEEDS = [0.1, 0.25, 0.5, 1, 1.5, 2, 4];

class Clock {
  constructor(frames, fps) {
    this.frames = frames;
    this.fps = fps;
    this.position = 0;
    this.playing = false;
    this.repeat = "loop";
    this.speed = 1;
    this.direction = 1;
  }

  get last() {
    return this.frames - 1;
  }

  /** Time to show, 0 to `frames - 1`. */
  get time() {
    return Math.max(0, Math.min(this.last, this.position));
  }

  seek(time) {
    this.position = Math.max(0, Math.min(this.last, time));
  }

  play(playing) {
    this.playing = playing && this.frames > 1;
    // Playing from the end restarts.
    if (this.playing && this.repeat === "once" && this.position >= this.last) this.position = 0;
    if (this.repeat !== "pingpong") this.direction = 1;
  }

  nextRepeat() {
    this.repeat = REPEATS[(REPEATS.indexOf(this.repeat) + 1) % REPEATS.length];
    this.direction = 1;
  }

  /** Advances by `seconds`. */
  advance(seconds) {
    if (!this.playing) return;
    this.position += this.direction * seconds * this.fps * this.speed;
    switch (this.repeat) {
      case "loop":
        this.position = ((this.position % this.frames) + this.frames) % this.frames;
        break;
      case "pingpong":
        // In slow browsers a step can be longer than the clip; the position must stay inside.
        if (this.position > this.last) [this.position, this.direction] = [Math.max(0, 2 * this.last - this.position), -1];
        if (this.position < 0) [this.position, this.direction] = [Math.min(this.last, -this.position), 1];
        break;
      case "once":
        if (this.position >= this.last) {
          this.position = this.last;
          this.playing = false;
        }
        break;
    }
  }
}
