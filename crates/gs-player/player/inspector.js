// What a splat is, where its motion comes from and why, as the server describes it.

class Inspector {
  constructor(parts, get) {
    Object.assign(this, { parts, get });
    byId("inspector-close").addEventListener("click", () => { byId("inspector").hidden = true; });
  }

  /** Describes the splat at a place, CSS pixels. */
  async show(place) {
    const [found] = await this.parts.pick([place]);
    const panel = byId("inspector");
    if (!found || found.row === null || found.row < 0) {
      panel.hidden = true;
      return;
    }
    const { title, facts } = await this.get(`splat?scene=${found.scene}&row=${found.row}`);
    byId("inspector-title").textContent = title;
    const share = ["Share of this pixel", `${Math.round(100 * found.weight)} %`];
    byId("inspector-facts").replaceChildren(...[...facts, share].map(([name, value]) => {
      const line = document.createElement("div"), term = document.createElement("dt"), text = document.createElement("dd");
      term.textContent = name;
      text.textContent = value;
      line.append(term, text);
      return line;
    }));
    panel.hidden = false;
  }
}
