// The floor of a headset's empty space, as far as its horizon: without one a viewer does not know where they stand.

import { CircleGeometry, GridHelper, Group, Mesh, MeshBasicMaterial } from "three";

const HORIZON = 300; // m
const GRID = 16; // m across, a line each metre
const GREY = 0x808890; // darker than bright backgrounds, brighter than dark ones
const BELOW = 0.01; // m: so that soles and shadows hide it

export class Floor extends Group {
  readonly #disc = new Mesh(new CircleGeometry(HORIZON, 64).rotateX(-Math.PI / 2), new MeshBasicMaterial({ color: GREY, transparent: true, opacity: 0.18, depthWrite: false }));
  readonly #grid = new GridHelper(GRID, GRID, GREY, GREY);

  constructor() {
    super();
    this.position.y = -BELOW;
    Object.assign(this.#grid.material, { transparent: true, opacity: 0.35, depthWrite: false });
    this.#disc.renderOrder = -3; // of all that is transparent, first
    this.#grid.renderOrder = -2;
    this.add(this.#disc, this.#grid);
  }

  override dispose(): void {
    super.dispose();
    this.removeFromParent();
    this.#disc.geometry.dispose();
    this.#disc.material.dispose();
    this.#grid.dispose();
  }
}
