// Where the player's files lie. Written so that bundlers see each as a file to take along.

export const files = {
  worker: new URL("./worker.js", import.meta.url),
  core: new URL("./core.wasm", import.meta.url),
  order: new URL("./order.js", import.meta.url),
};
