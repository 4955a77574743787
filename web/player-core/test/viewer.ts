// A display for tests: asks the player for a picture sixty times a second and finds out what no picture may be.

import { Form } from "../src/format/layout.gen.ts";
import type { Player } from "../src/player.ts";
import { Head } from "../src/format/reader.ts";
import type { Packed, Shown } from "../src/types.ts";

const EVENTS = [
  "loadedmetadata", "canplay", "play", "playing", "pause", "waiting", "seeking", "seeked", "ended", "ratechange", "layerschange", "error",
] as const;

export class Viewer {
  readonly player: Player;
  /** Frames in the order in which they were shown, each once. */
  readonly frames: number[] = [];
  /** Layers beyond the first of what track 0 showed, one number a picture. */
  readonly layersShown: number[] = [];
  readonly events: string[] = [];
  readonly warnings: string[] = [];
  readonly errors: Error[] = [];
  readonly offences: string[] = [];
  readonly alive = new Set<Packed>();
  /** Chunks that were ready, in their order. */
  readonly readied: number[] = [];
  mostAlive = 0;
  pictures = 0;
  shown: Shown | null = null;
  far = new Set<number>();
  readonly #head: Head | null;
  readonly #timer: ReturnType<typeof setInterval>;

  constructor(player: Player, file?: Uint8Array, rate = 60) {
    this.player = player;
    this.#head = file ? Head.parse(file) : null;
    for (const type of EVENTS) player.addEventListener(type, () => this.events.push(type));
    player.addEventListener("warning", ({ detail }) => this.warnings.push(detail.message));
    player.addEventListener("error", ({ detail }) => this.errors.push(detail));
    player.addEventListener("ready", ({ detail }) => this.#ready(detail));
    player.addEventListener("release", ({ detail }) => {
      if (!this.alive.delete(detail)) this.offences.push(`chunk ${detail.chunk} released, though it is not alive`);
    });
    this.#timer = setInterval(() => this.look(), 1000 / rate);
  }

  stop(): void {
    clearInterval(this.#timer);
  }

  look(): void {
    const shown = this.player.update(performance.now(), this.far);
    this.pictures++;
    if (shown === null) return;
    this.shown = shown;
    if (this.frames.at(-1) !== shown.frame) this.frames.push(shown.frame);
    this.layersShown.push(shown.groups[0]?.layers ?? -1);
    this.#check(shown);
  }

  count(event: string): number {
    return this.events.filter((other) => other === event).length;
  }

  #ready(packed: Packed): void {
    if (this.alive.has(packed)) this.offences.push(`chunk ${packed.chunk} is ready twice`);
    this.alive.add(packed);
    this.readied.push(packed.chunk);
    this.mostAlive = Math.max(this.mostAlive, this.alive.size);
  }

  #check(shown: Shown): void {
    shown.groups.forEach((group, track) => {
      const wanted = this.#head?.chunkOfFrame(shown.frames[track], track);
      if (shown.frames[track] !== shown.frame && this.warnings.length === 0) this.offences.push(`frame ${shown.frame} shows frame ${shown.frames[track]}`);
      if (group !== null && !this.alive.has(group)) this.offences.push(`frame ${shown.frame} shows chunk ${group.chunk}, which is not alive`);
      if (group !== null && wanted && group.chunk !== wanted.number) this.offences.push(`frame ${shown.frame} shows chunk ${group.chunk}`);
      const isWhole = this.warnings.length === 0;
      if (group === null && isWhole && wanted && wanted.form !== Form.EMPTY) this.offences.push(`frame ${shown.frame} lacks track ${track}`);
    });
    const background = this.#head?.staticOfFrame(shown.frame)?.number;
    if (shown.background !== null && !this.alive.has(shown.background)) this.offences.push(`frame ${shown.frame}: background not alive`);
    if (this.#head && shown.background?.chunk !== background && this.warnings.length === 0) this.offences.push(`frame ${shown.frame}: background`);
    if (!(shown.blend >= 0 && shown.blend <= 1)) this.offences.push(`frame ${shown.frame}: blend ${shown.blend}`);
  }
}
