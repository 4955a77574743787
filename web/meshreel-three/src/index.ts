// The package: recordings as objects of a three.js scene.

export { Reel, type ReelOptions } from "./reel.ts";
