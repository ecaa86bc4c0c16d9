// A payload and its worker, which decodes, moves, sorts, picks and selects; the page's thread only draws.

class Source {
  /** `handlers`: progress(share), frame(answer, loaded), report(report), fail(error). */
  constructor(handlers) {
    this.handlers = handlers;
    this.ready = false;
    this.waiting = false;
    this.question = "";
    this.spare = [];
    this.calls = new Map();
    this.loaded = null;
    const text = byId("engine").textContent;
    this.worker = new Worker(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
    this.worker.addEventListener("error", (event) => handlers.fail(new Error(`The scene's worker stopped: ${event.message ?? "it could not start"}`)));
    this.worker.addEventListener("message", ({ data }) => this.receive(data));
  }

  /** Opens a payload from the blocks of text in the page, which are removed from it. */
  openBlocks(elements, rawBytes) {
    for (const block of elements) {
      this.worker.postMessage({ kind: "block", text: block.textContent, bytes: Number(block.dataset.bytes) });
      block.remove();
    }
    this.worker.postMessage({ kind: "open", rawBytes });
  }

  /** Opens a payload from its bytes. */
  openBytes(bytes, rawBytes) {
    this.worker.postMessage({ kind: "bytes", bytes }, [bytes.buffer]);
    this.worker.postMessage({ kind: "open", rawBytes });
  }

  /** Requests a frame. One request at a time; its answer is drawn with the newest view. */
  ask(time, row, near) {
    const question = `${time} ${row} ${near}`;
    if (!this.ready || this.waiting || question === this.question) return;
    this.question = question;
    this.waiting = true;
    this.worker.postMessage({ kind: "frame", id: 0, time, view: row, near, returned: this.spare }, this.spare);
    this.spare = [];
  }

  /** The worker's answer to a different request. */
  call(kind, request) {
    return new Promise((resolve) => {
      const id = this.calls.size === 0 ? 1 : Math.max(...this.calls.keys()) + 1;
      this.calls.set(id, resolve);
      this.worker.postMessage({ ...request, kind, id });
    });
  }

  receive(data) {
    switch (data.kind) {
      case "progress":
        this.handlers.progress(data.share);
        break;
      case "ready":
        this.ready = true;
        this.loaded = data;
        this.handlers.ready();
        break;
      case "frame": {
        this.waiting = false;
        const loaded = this.loaded;
        this.loaded = null;
        this.handlers.frame(data, loaded);
        for (const name of ["geometry", "appearance", "first", "second"]) if (data[name]) this.spare.push(data[name].buffer);
        break;
      }
      case "answer":
        this.calls.get(data.id)?.(data.answer);
        this.calls.delete(data.id);
        break;
      case "report":
        this.handlers.report(data.report);
        break;
      case "error":
        this.handlers.fail(new Error(`The scene's data is damaged: ${data.message}`));
        break;
    }
  }

  close() {
    this.worker.terminate();
  }
}
