// To be run before the element's own module, which looks there for its files.

import { files } from "./files.js";

globalThis.meshreelFiles ??= {
  "worker.js": files.worker.href,
  "core.wasm": files.core.href,
  "order.js": files.order.href,
  "three.js": new URL("./three.js", import.meta.url).href,
};
