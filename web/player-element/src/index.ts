// The package: importing it defines <meshreel-player>.

export { MeshreelPlayer } from "./element.ts";
