// The divider between the first scene (left) and the second (right).

class Wipe {
  /** `both`: whether there are two scenes. */
  constructor(both, changed) {
    this.both = both;
    this.show = both ? "both" : "first";
    this.at = 0.5;
    this.changed = changed;
    this.divider = document.getElementById("divider");
    if (!both) return;
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

  /** Share of the width that shows the first scene. */
  get value() {
    return { first: 1, both: this.at, second: 0 }[this.show];
  }

  move(at) {
    this.at = Math.max(0, Math.min(1, at));
    this.choose("both");
  }

  /** "first", "both" or "second". */
  choose(show) {
    if (!this.both) return;
    this.show = show;
    this.place();
    this.changed();
  }

  /** Positions the line and the names. */
  place() {
    const visible = this.show === "both";
    const percent = `${this.at * 100}%`;
    this.divider.hidden = !visible;
    this.divider.style.left = percent;
    this.divider.setAttribute("aria-valuenow", Math.round(this.at * 100));
    for (const name of ["name-first", "name-second"]) {
      const label = document.getElementById(name);
      label.hidden = !visible;
      label.style.left = percent;
    }
    for (const button of document.querySelectorAll("#compare button")) {
      button.setAttribute("aria-pressed", String(button.dataset.show === this.show));
    }
  }
}
