// Importing this defines <meshreel-player>.

import "./addresses.js";

export { MeshreelPlayer } from "./meshreel-player.js";
