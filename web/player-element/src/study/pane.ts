// A player on a study's page, which viewers cannot touch: it plays a file as a trace and a camera path have it.

import type { Source } from "@meshreel/player-core/net/source";
import { TracedSource } from "@meshreel/player-core/net/traced_source";
import type { Trace } from "@meshreel/player-core/net/trace";
import type { Playback } from "@meshreel/player-core/types";
import { make, setText } from "../controls/dom.ts";
import type { MeshreelPlayer } from "../element.ts";
import type { Engine, Settings, Stage } from "../stage.ts";
import { cameraAt } from "./camera_path.ts";
import type { Pair } from "./description.ts";
import { type Result, Showing } from "./showing.ts";

const BACKGROUND = "#3b3d41"; // grey: neither side of a picture stands out from it

/** What a pane plays. */
export interface Film {
  readonly address: string; // for messages
  readonly bytes: Uint8Array<ArrayBuffer>; // the whole file
  readonly trace: Trace | null;
  readonly pair: Pair;
}

/** Opens the films of panes in the place of the addresses of their players; all others as the engine of the page does. */
export class StudyEngine implements Engine {
  readonly films = new Map<Settings, { readonly film: Film; readonly showing: Showing | null }>(); // by player
  readonly #engine: Engine;

  constructor(engine: Engine) {
    this.#engine = engine;
  }

  open(source: string | Blob | Source, settings: Settings): Playback {
    const played = this.films.get(settings);
    if (played === undefined) return this.#engine.open(source, settings);
    const { film, showing } = played;
    const isTraced = film.trace !== null && showing !== null;
    const playback = this.#engine.open(isTraced ? new TracedSource(film.bytes, film.trace) : new Blob([film.bytes]), settings);
    showing?.watch(playback);
    return playback;
  }

  load(): Promise<void> | null {
    return this.#engine.load();
  }

  stage(canvas: HTMLCanvasElement): Stage {
    return this.#engine.stage(canvas);
  }
}

export class Pane {
  readonly element: HTMLElement;
  readonly player: MeshreelPlayer = make("meshreel-player", { muted: "", inert: "", theme: "dark", background: BACKGROUND, preload: "none" });
  readonly #engine: StudyEngine;
  readonly #cover = make("div", { class: "cover" });

  constructor(name: string, engine: StudyEngine) {
    this.#engine = engine;
    this.element = make("section", { class: "pane", "aria-label": `Recording ${name}` }, this.player, this.#cover, make("b", {}, name));
  }

  /** Hides the picture behind a text, so that nobody studies a frame that stands and gets better. */
  cover(text: string): void {
    setText(this.#cover, text);
    this.#cover.hidden = false;
  }

  /** Has a film decoded and drawn without its trace, behind the cover, so that the first trial does not wait for workers and shaders. */
  async warm(film: Film): Promise<void> {
    this.#open(film, null);
    void this.player.play().catch(() => undefined);
    await this.#until(film, () => this.player.currentFrame > 0 || this.player.ended);
    this.player.pause();
  }

  /** Plays a film once, from the start of its trace. Rejects with the file's address where it cannot be played. */
  async play(film: Film, signal: AbortSignal): Promise<Result> {
    const showing = new Showing();
    this.#open(film, showing);
    this.#cover.hidden = true;
    void this.player.play().catch(() => undefined); // reported by its error
    await this.#until(film, () => this.player.ended || signal.aborted);
    const result = showing.result();
    const damaged = this.player.statistics?.skippedGroups ?? 0;
    if (damaged > 0) throw new Error(`${film.address}: ${damaged} of its groups are damaged, copy the file again`);
    this.player.pause();
    this.cover("The end");
    return result;
  }

  #open(film: Film, showing: Showing | null): void {
    const { camera, layers } = film.pair;
    this.#engine.films.set(this.player, { film, showing });
    this.player.layers = layers;
    if (camera === null) this.player.removeAttribute("camera");
    else this.player.camera = cameraAt(camera, 0);
    this.player.src = film.address;
    this.player.load();
  }

  /** Asks before each picture, and has the camera follow its path. */
  async #until(film: Film, holds: () => boolean): Promise<void> {
    const { camera } = film.pair;
    while (!holds()) {
      if (this.player.error) throw new Error(`${film.address}: ${this.player.error.message}`, { cause: this.player.error });
      if (camera !== null) this.player.camera = cameraAt(camera, this.player.currentTime);
      await new Promise(requestAnimationFrame);
    }
  }
}
