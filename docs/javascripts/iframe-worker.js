// The search runs in a web worker. Browsers start no worker for a page that is read from disk (file://). There, this file runs the
// worker's script in a hidden frame instead, so that the search works without a server and without the network.
if (location.protocol === "file:") {
  const load = (frame, url) =>
    new Promise((loaded, failed) => {
      const script = frame.contentDocument.createElement("script");
      script.src = url;
      script.onload = loaded;
      script.onerror = failed;
      frame.contentDocument.head.appendChild(script);
    });

  class FrameWorker extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      this.ready = new Promise((started) => {
        frame.addEventListener("load", () => started(this.start(frame, String(url))), { once: true });
      });
      document.body.appendChild(frame);
    }

    async start(frame, url) {
      const inner = frame.contentWindow;
      inner.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      inner.importScripts = async (...urls) => {
        for (const each of urls) await load(frame, each);
      };
      await load(frame, url);
      return inner;
    }

    async postMessage(data) {
      const inner = await this.ready;
      inner.dispatchEvent(new inner.MessageEvent("message", { data }));
    }
  }

  window.Worker = window.IFrameWorker = FrameWorker;
}
