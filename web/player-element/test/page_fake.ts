// A page whose players run on fakes.

import { MeshreelPlayer } from "../src/element.ts";
import { FakeEngine } from "./fake.ts";

const engine = new FakeEngine();
MeshreelPlayer.engine = engine;
customElements.define("meshreel-player", MeshreelPlayer);
Object.assign(globalThis, { engine });
