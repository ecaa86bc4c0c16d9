// Colours over those of the splats: a property of each splat, or a selection.

/** Colour and share of selected splats, RGB and share, 0 to 255. */
const SELECTED = [255, 140, 0, 190];
/** Share of an overlay's colours at first. */
const FIRST_OPACITY = 0.75;

class Overlays {
  constructor(renderer, scenes, changed) {
    Object.assign(this, { renderer, scenes, changed });
    this.sources = [];
    this.name = "none";
    this.opacity = FIRST_OPACITY;
    byId("overlay").addEventListener("change", (event) => this.choose(event.target.value));
    byId("overlay-opacity").addEventListener("input", (event) => this.setOpacity(Number(event.target.value)));
  }

  /** Adds a payload or replaces one: descriptions of its overlays, and their entries by name. */
  load(index, described, entries) {
    this.sources[index] = { described, entries, marks: null };
    const names = new Map(this.sources.flatMap((source) => source.described.map(({ name, title }) => [name, title])));
    byId("overlay").replaceChildren(new Option("No overlay", "none"), ...[...names.keys()].map((name) => new Option(name, name)));
    byId("overlays").hidden = names.size === 0;
    if (!names.has(this.name)) this.name = "none";
    byId("overlay").value = this.name;
    this.names = ["none", ...names.keys()];
    this.paint(index);
    this.explain();
  }

  choose(name) {
    if (!this.names.includes(name)) return;
    this.name = name;
    byId("overlay").value = name;
    this.sources.forEach((_, index) => this.paint(index));
    this.explain();
    this.changed();
  }

  next() {
    if (this.names?.length > 1) this.choose(this.names[(this.names.indexOf(this.name) + 1) % this.names.length]);
  }

  /** Share of the overlay's colours, 0 to 1. */
  setOpacity(opacity) {
    this.opacity = Math.max(0, Math.min(1, opacity));
    byId("overlay-opacity").value = this.opacity;
    this.sources.forEach((_, index) => this.paint(index));
    this.changed();
  }

  /** Marks the selected splats of one payload and of no other; `null` for none. */
  mark(index, marks) {
    this.sources.forEach((source, other) => {
      if (!source.marks && other !== index) return;
      source.marks = other === index ? marks : null;
      this.paint(other);
    });
    this.changed();
  }

  described(index) {
    return this.sources[index].described.find(({ name }) => name === this.name);
  }

  paint(index) {
    const { entries, marks } = this.sources[index];
    const shown = this.described(index), chosen = shown ? entries[this.name] : null;
    const length = chosen?.length ?? marks?.length;
    if (length === undefined) {
      this.renderer.paint(index, null);
      return;
    }
    const colors = new Uint8Array(length * 4), share = Math.round(this.opacity * 255);
    for (let appearance = 0, at = 0; appearance < length; appearance++, at += 4) {
      if (marks?.[appearance]) {
        colors.set(SELECTED, at);
      } else if (chosen) {
        colors.set(shown.palette[chosen[appearance]], at);
        colors[at + 3] = share;
      }
    }
    this.renderer.paint(index, colors);
  }

  /** Fills in the legend. */
  explain() {
    const legend = byId("legend"), lines = [], seen = new Set();
    byId("overlay-opacity").hidden = this.name === "none";
    const add = (key, ...parts) => {
      if (seen.has(key)) return;
      seen.add(key);
      const line = document.createElement("li");
      line.append(...parts);
      lines.push(line);
    };
    const swatch = (background) => {
      const box = document.createElement("span");
      box.className = "swatch";
      box.style.background = background;
      return box;
    };
    const color = (rgb) => `rgb(${rgb.join(" ")})`;
    this.sources.forEach((_, index) => {
      const shown = this.described(index);
      if (!shown) return;
      const { title, palette, legend: { classes, scale } } = shown;
      add(`title ${title}`, title);
      if (scale) {
        const [from, low, to, high] = scale, stops = 8;
        const at = (k) => color(palette[Math.round(from + ((to - from) * k) / stops)]);
        const ramp = swatch(`linear-gradient(to right, ${Array.from({ length: stops + 1 }, (_, k) => at(k)).join(", ")})`);
        ramp.classList.add("ramp");
        add(`scale ${low} ${high}`, low, ramp, high);
      }
      for (const [entry, label] of classes) add(`${color(palette[entry])} ${label}`, swatch(color(palette[entry])), label);
    });
    legend.replaceChildren(...lines);
  }
}
