// Search where the site is opened from disk: browsers allow no workers there, so that the search runs in a hidden frame.
if (location.protocol === "file:") {
  const load = (inner, url) =>
    new Promise((done) => {
      const script = inner.document.createElement("script");
      Object.assign(script, { src: url, onload: done });
      inner.document.body.append(script);
    });

  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      this.ready = new Promise((done) => {
        frame.onload = async () => {
          const inner = frame.contentWindow;
          inner.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
          inner.importScripts = async (...urls) => {
            for (const each of urls) await load(inner, each);
          };
          await load(inner, url);
          done(inner);
        };
      });
      frame.srcdoc = "<!doctype html><title>search</title>";
      document.body.append(frame);
    }

    postMessage(data) {
      this.ready.then((inner) => inner.dispatchEvent(new MessageEvent("message", { data })));
    }

    terminate() {}
  };
}
