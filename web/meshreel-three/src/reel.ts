// A recording as an object of a scene that a page has already.

import { Players, openWorker, type Player } from "@meshreel/player-core";
import { ReelScene, Sorter, shownMode, standing, type Mode, type OrderWorker, type Up } from "@meshreel/player-three";
import { files } from "meshreel-player/files";
import { Box3, Group, type WebGLRenderer } from "three";

export interface ReelOptions {
  /** Puts what was decoded on the GPU before it is shown; if not given, the first picture that shows it waits for that. */
  readonly renderer?: WebGLRenderer;
  /** The recording's axis that points up; as its file says if not given. */
  readonly up?: Up;
  /** As the element's attribute: what the recording has of `splats`, `color` and `shaded`, in this order, if not given. */
  readonly mode?: Mode;
  /** As a video has it: `use-credentials` sends cookies to another origin, too. */
  readonly crossOrigin?: string;
}

const players = new Players(files); // shares its workers

/**
 * A recording in metres, upright, about the place that its file calls the origin. Call `update` once a picture. Its surfaces have shaders of their own: lights and fog
 * of the scene do not change them.
 */
export class Reel extends Group {
  /** Plays, pauses, seeks, and tells what happens; as an HTMLMediaElement does. */
  readonly player: Player;
  /** Around all frames, in the object's own space; empty until `loadedmetadata`. */
  readonly box = new Box3();
  readonly #scene: ReelScene;
  readonly #sorter = new Sorter(() => openWorker(files.order) as OrderWorker);
  readonly #far = new Set<number>(); // tracks that are drawn as splats need no textures
  #mode: Mode;

  /** Begins to fetch; what fails is told by the player's event `error`. */
  constructor(source: string | Blob, { renderer, up, mode = "splats", crossOrigin }: ReelOptions = {}) {
    super();
    this.#mode = mode;
    this.#scene = new ReelScene(this.#sorter);
    this.add(this.#scene);
    this.player = players.open(source, crossOrigin ?? null);
    this.player.addEventListener("loadedmetadata", () => this.#stand(up ?? null));
    if (renderer) this.player.addEventListener("ready", ({ detail }) => void this.#scene.prepare(detail, renderer));
    this.player.addEventListener("release", ({ detail }) => this.#scene.release(detail));
    this.mode = mode;
    this.player.load().catch(() => undefined);
  }

  /** Appearance of surfaces; if the recording lacks it, the nearest one that it has. */
  get mode(): Mode {
    return shownMode(this.#mode, this.player.info);
  }

  set mode(mode: Mode) {
    this.#mode = mode;
    this.player.splats = mode === "splats";
    this.#scene.mode = this.mode;
  }

  /** Shows the frame of this moment; `time`: seconds of any clock that does not go back, such as `THREE.Clock`'s. */
  update(time: number): void {
    const shown = this.player.update(1000 * time, this.#far);
    this.#scene.visible = shown !== null;
    if (shown === null) return;
    this.#scene.show(shown);
    this.#far.clear();
    this.#scene.splats.forEach((count, track) => void (count > 0 && this.#far.add(track)));
  }

  /** Frees memory, GPU and workers. */
  override dispose(): void {
    super.dispose();
    this.removeFromParent();
    this.player.dispose();
    this.#scene.dispose();
    this.#sorter.dispose();
  }

  #stand(up: Up | null): void {
    const { turned, box } = standing(this.player.info!, up);
    this.#scene.stand(turned, box.minimum[1], box.size[1]);
    this.box.min.set(...box.minimum);
    this.box.max.set(...box.size).add(this.box.min);
    this.mode = this.#mode;
  }
}
