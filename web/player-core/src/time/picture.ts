// The pictures to show, in two objects that are used in turn, so that `update` allocates nothing.

import type { Decoding } from "./decoding.ts";
import { mostLayers } from "../format/links.ts";
import type { Chunk, Head } from "../format/reader.ts";
import type { Textures } from "./textures.ts";
import type { Packed, PackedGroup, PackedStatic, Shown, TextureImage } from "../types.ts";

interface Mutable {
  frame: number;
  blend: number;
  frames: number[];
  groups: (PackedGroup | null)[];
  background: PackedStatic | null;
  images: (TextureImage | null)[];
  backgroundImage: TextureImage | null;
}

export class Picture {
  readonly #head: Head;
  readonly #decoding: Decoding;
  readonly #textures: Textures;
  #shown: Mutable;
  #spare: Mutable;
  #version = -1; // of what was at hand when it was made

  constructor(head: Head, decoding: Decoding, textures: Textures) {
    this.#head = head;
    this.#decoding = decoding;
    this.#textures = textures;
    const none = (): null[] => head.tracks.map(() => null);
    const empty = (): Mutable => ({ frame: -1, blend: 0, frames: head.tracks.map(() => -1), groups: none(), background: null, images: none(), backgroundImage: null });
    [this.#shown, this.#spare] = [empty(), empty()];
  }

  /** The last picture; null before the first. The one before it stays as it is until the next is asked for. */
  get shown(): Shown | null {
    return this.#shown.frame < 0 ? null : this.#shown;
  }

  /** Layers beyond the first that the richest of the groups shown has in the file. */
  get wholeLayers(): number {
    const { chunks } = this.#head;
    return this.#shown.groups.reduce((most, group) => (group === null ? most : Math.max(most, mostLayers(chunks[group.chunk]))), 0);
  }

  /** True if everything that a frame shows is at hand, except for chunks that can never be; of textures, their bytes. */
  isReady(frame: number): boolean {
    const { tracks } = this.#head;
    for (let track = 0; track < tracks.length; track++) {
      if (!this.#isAtHand(this.#head.chunkOfFrame(frame, track))) return false;
    }
    const background = this.#head.staticOfFrame(frame);
    return background === null || this.#isAtHand(background);
  }

  /** True if a frame is ready and its textures are decoded; the background's textures are not waited for. */
  canShow(frame: number): boolean {
    return this.isReady(frame) && this.#textures.isReady(frame);
  }

  /** Makes it the picture of a frame, `blend` of the way to the next. False, and the frame before, where the frame is not ready. */
  show(frame: number, blend: number): boolean {
    this.#textures.aim(frame, this.#isInUse);
    const isSame = frame === this.#shown.frame && this.#currentVersion === this.#version;
    if (!isSame && !this.canShow(frame)) {
      this.#renew();
      return false;
    }
    const next = this.#spare;
    if (isSame) this.#copy(next);
    else this.#fill(next, frame);
    next.blend = this.#goesOn(next) ? blend : 0;
    if (!this.#differs(next)) return true;
    this.#spare = this.#shown;
    this.#shown = next;
    return true;
  }

  /** Adds the numbers of the chunks that are shown. */
  addTo(keep: Set<number>): void {
    const { groups, background } = this.#shown;
    for (const group of groups) if (group !== null) keep.add(group.chunk);
    if (background !== null) keep.add(background.chunk);
  }

  /** Counts what changes in what can be shown. */
  get #currentVersion(): number {
    return this.#decoding.version + this.#textures.version;
  }

  /** True if a picture is shown, or was shown last. */
  #isInUse = (image: TextureImage): boolean => {
    for (const { images, backgroundImage } of [this.#shown, this.#spare]) if (image === backgroundImage || images.includes(image)) return true;
    return false;
  };

  #isAtHand(chunk: Chunk): boolean {
    return this.#decoding.isSettled(chunk) && this.#textures.hasBytes(chunk);
  }

  /** Takes what came in the place of what is shown, as with other layers: the old is released. */
  #renew(): void {
    const { frame, blend } = this.#shown;
    if (frame < 0 || this.#currentVersion === this.#version) return;
    const next = this.#spare;
    this.#fill(next, frame);
    next.blend = blend;
    if (!this.#differs(next)) return;
    this.#spare = this.#shown;
    this.#shown = next;
  }

  #copy(next: Mutable): void {
    const { frame, frames, groups, background, images, backgroundImage } = this.#shown;
    next.frame = frame;
    next.background = background;
    next.backgroundImage = backgroundImage;
    for (let track = 0; track < groups.length; track++) {
      next.frames[track] = frames[track];
      next.groups[track] = groups[track];
      next.images[track] = images[track];
    }
  }

  #fill(next: Mutable, frame: number): void {
    next.frame = frame;
    for (let track = 0; track < next.groups.length; track++) {
      const chunk = this.#head.chunkOfFrame(frame, track);
      const own = this.#decoding.packedOf(chunk);
      const held = own === null ? this.#held(chunk, this.#shown.groups[track]) : null;
      next.groups[track] = (own ?? held) as PackedGroup | null;
      next.frames[track] = held === null ? frame : this.#shown.frames[track];
      next.images[track] = held === null ? this.#textures.imageOf(frame, track) : this.#shown.images[track];
    }
    const background = this.#head.staticOfFrame(frame);
    const own = background && this.#decoding.packedOf(background);
    next.background = (own ?? (background && this.#held(background, this.#shown.background))) as PackedStatic | null;
    const isSame = next.background !== null && next.background.chunk === this.#shown.background?.chunk;
    next.backgroundImage = next.background && this.#textures.imageOfBackground(frame, isSame ? this.#shown.backgroundImage : null);
    this.#version = this.#currentVersion;
  }

  /** Replacement for a damaged chunk: the chunk shown before, with the layers that it has now. */
  #held(chunk: Chunk, before: Packed | null): Packed | null {
    return before !== null && this.#decoding.isFailed(chunk) ? this.#decoding.packedOf(this.#head.chunks[before.chunk]) : null;
  }

  #differs({ frame, blend, frames, groups, background, images, backgroundImage }: Mutable): boolean {
    const shown = this.#shown;
    if (frame !== shown.frame || blend !== shown.blend || background !== shown.background || backgroundImage !== shown.backgroundImage) return true;
    for (let track = 0; track < groups.length; track++) {
      if (groups[track] !== shown.groups[track] || frames[track] !== shown.frames[track] || images[track] !== shown.images[track]) return true;
    }
    return false;
  }

  /** True if a shown group has the next frame, too. */
  #goesOn({ frame, frames, groups }: Mutable): boolean {
    for (let track = 0; track < groups.length; track++) {
      const group = groups[track];
      if (group !== null && frames[track] === frame && frame + 1 < this.#head.chunks[group.chunk].shownEnd) return true; // later ones are hidden
    }
    return false;
  }
}
