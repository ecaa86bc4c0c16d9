// Requests of a served page to the server that it comes from; addresses are relative to the page's own.

/** Time between questions whether files have changed, milliseconds. */
const POLL_MS = 1000;

class Tools {
  constructor(parts) {
    this.parts = parts;
    this.versions = [];
    const show = (text, command = "") => {
      byId("tools-message").textContent = text;
      byId("tools-command").textContent = command;
      byId("tools-command").hidden = command === "";
    };
    this.show = show;
    this.inspector = new Inspector(parts, (address) => this.get(address));
    this.selection = new Selection(parts, (address, body) => this.post(address, body), show);
    byId("tool-camera").addEventListener("click", () => this.saveCamera());
    parts.ui.tools = {
      s: () => this.saveCamera(),
      x: () => this.selection.use("box"),
      v: () => this.selection.use("brush"),
      Escape: () => this.selection.use(this.selection.tool),
    };
    this.update(true).catch(parts.fail);
    if (!startOptions.has("hold")) setInterval(() => this.update(false).catch(() => show("The server does not answer: c4d view has ended")), POLL_MS);
  }

  async request(address, options) {
    const response = await fetch(address, { cache: "no-store", ...options });
    if (!response.ok) throw new Error(`The server refused ${address}: ${await response.text()}`);
    return response;
  }

  async get(address) {
    return (await this.request(address)).json();
  }

  async post(address, body) {
    const headers = { "Content-Type": "application/json" };
    return (await this.request(address, { method: "POST", headers, body: JSON.stringify(body) })).json();
  }

  /** Loads the payloads that are new. */
  async update(first) {
    if (this.updating) return;
    this.updating = true;
    try {
      const { versions, problem } = await this.get("state");
      for (const [index, version] of versions.entries()) {
        if (this.versions[index] === version) continue;
        const file = new Uint8Array(await (await this.request(`source/${index}`)).arrayBuffer());
        const length = new DataView(file.buffer).getUint32(0, true);
        const meta = JSON.parse(new TextDecoder().decode(file.subarray(4, 4 + length)));
        this.parts.openSource(index, meta, (source) => source.openBytes(file.slice(4 + length), meta.raw_bytes));
        this.versions[index] = version;
        if (!first) this.show("Reloaded: its files have changed");
      }
      if (problem && problem !== this.problem) this.show(problem);
      this.problem = problem;
    } finally {
      this.updating = false;
    }
  }

  clicked(place) {
    this.inspector.show(place).catch((error) => this.show(error.message));
  }

  /** Sends the view to the server, which writes it for `c4d render --cameras`. */
  async saveCamera() {
    const { canvas, cells } = this.parts;
    const [{ view }] = cells();
    const density = canvas.width / canvas.clientWidth;
    const size = view.size.map((side) => Math.max(1, Math.round(side / density)));
    const body = { rows: view.rows, focal: view.focal.map((focal) => focal / density), size, near: view.near };
    try {
      const { message, command } = await this.post("camera", body);
      this.show(message, command);
    } catch (error) {
      this.show(error.message);
    }
  }

  /** Start options of tests: inspect=X,Y, save, box=X,Y,X,Y, brush=X,Y;…, shares of the canvas; results go to #answered. */
  async answerTests() {
    const { clientWidth, clientHeight } = this.parts.canvas;
    const numbers = (text) => text.split(",").map((share, k) => Math.floor(share * [clientWidth, clientHeight][k % 2]) + 0.5);
    if (startOptions.has("inspect")) await this.inspector.show(numbers(startOptions.get("inspect")));
    if (startOptions.has("save")) await this.saveCamera();
    if (startOptions.has("box")) this.parts.note("answered", await this.selection.box(numbers(startOptions.get("box"))));
    if (startOptions.has("brush")) this.parts.note("answered", await this.selection.brush(startOptions.get("brush").split(";").map(numbers)));
  }
}
