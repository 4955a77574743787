export { MeshreelPlayer } from "./types/player-element/src/element.js";
