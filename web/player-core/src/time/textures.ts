// The textures of what is shown: which pictures are wanted now and next, and why there are none.

import type { Decoding } from "./decoding.ts";
import { FormatError } from "../errors.ts";
import type { Fetcher } from "../net/fetcher.ts";
import { Form, Pictures, VideoCodec } from "../format/layout.gen.ts";
import { checkPayload } from "../format/payload.ts";
import { describe, isCompanion } from "../format/reader.ts";
import type { Chunk, CompanionChunk, Head } from "../format/reader.ts";
import { unpackAll } from "../format/records.ts";
import type { Shown, TextureImage, TextureState } from "../types.ts";
import { CONFIG, VideoLane, countOf } from "./video_lane.ts";
import type { LaneHost, Place } from "./video_lane.ts";

export interface TextureEvents {
  warn(error: Error): void;
  changed(): void; // there is a picture more, or no more will come
}

const AHEAD = 6; // pictures of a track that are decoded, the shown one included: decoders have few to give (guess)
const MOST_LANES = 8; // tracks with textures: each has a decoder of its own (guess)
const LATE = 3; // times within LATE_MS that playback had to wait for a picture, until textures are given up (guess)
const LATE_MS = 10_000;

export class Textures implements LaneHost {
  /** Counts what changes in what can be shown. */
  version = 0;
  loop = false;
  readonly #head: Head;
  readonly #fetcher: Fetcher;
  readonly #decoding: Decoding;
  readonly #events: TextureEvents;
  readonly #lanes = new Map<number, VideoLane>(); // by track; -1: of the background
  readonly #chains = new Map<number, CompanionChunk[]>(); // the chunks of each video, by each of them
  readonly #late: number[] = []; // ms
  #on: boolean;
  #lack: "unsupported" | "slow" | null = null;
  #isSupported = false; // as far as is known
  #isClosed = false;

  constructor(head: Head, fetcher: Fetcher, decoding: Decoding, events: TextureEvents, on: boolean) {
    this.#head = head;
    this.#fetcher = fetcher;
    this.#decoding = decoding;
    this.#events = events;
    this.#on = on;
    for (const chunk of head.chunks) if (isCompanion(chunk) && chunk.kind === "pictures") this.#link(chunk);
    decoding.textures = on;
    if (head.info.hasTextures) void this.#ask();
  }

  /** Whether textures are wanted, and nothing is known that speaks against them. */
  get isOn(): boolean {
    return this.#on && this.#lack === null;
  }

  set on(on: boolean) {
    if (on && !this.#on && this.#lack === "slow") this.#lack = null;
    this.#on = on;
    this.#switch();
  }

  /** What is shown in place of textures, or that they are. */
  stateOf(shown: Shown | null): TextureState {
    if (!this.#head.info.hasTextures) return "none";
    if (!this.#on) return "off";
    if (this.#lack !== null) return this.#lack;
    if (shown === null || shown.backgroundImage !== null || shown.images.some((image) => image !== null)) return "shown";
    const chunks = shown.groups.map((group) => group && this.#head.chunks[group.chunk]);
    const failed = chunks.some((chunk) => chunk && this.#head.companionsOf(chunk).some((other) => other.kind === "pictures" && this.#decoding.isFailed(other)));
    return failed ? "damaged" : "left out";
  }

  /** Decodes the pictures of a frame and of those behind it. */
  aim(frame: number, isShown: (image: TextureImage) => boolean): void {
    if (!this.isOn || !this.#isSupported || !this.#head.info.hasTextures) return;
    const { frameCount, tracks } = this.#head;
    for (let track = 0; track < Math.min(tracks.length, MOST_LANES); track++) {
      const places: Place[] = [];
      for (let k = 0; k < Math.min(AHEAD, frameCount); k++) {
        if (frame + k >= frameCount && !this.loop) break;
        const place = this.#placeOf((frame + k) % frameCount, track);
        if (place !== null) places.push(place);
      }
      if (places.length > 0 || this.#lanes.has(track)) this.#lane(track).want(places, isShown);
    }
    const place = this.#placeOfBackground(this.#head.staticOfFrame(frame));
    if (place !== null || this.#lanes.has(-1)) this.#lane(-1).want(place === null ? [] : [place], isShown);
  }

  /** Whether all pictures of a frame whose groups are at hand are there, but for what can never be. */
  isReady(frame: number): boolean {
    for (let track = 0; track < this.#head.tracks.length; track++) {
      const place = this.#placeOf(frame, track);
      if (place !== null && this.#lane(track).imageOf(place) === null) return false;
    }
    const place = this.#placeOfBackground(this.#head.staticOfFrame(frame));
    return place === null || this.#lane(-1).imageOf(place) !== null;
  }

  /** The texture of a track in a frame; null where it has none. */
  imageOf(frame: number, track: number): TextureImage | null {
    const place = this.#placeOf(frame, track);
    return place && this.#sized(this.#lane(track).imageOf(place), place, this.#head.chunkOfFrame(frame, track));
  }

  imageOfBackground(state: Chunk | null): TextureImage | null {
    const place = this.#placeOfBackground(state);
    return place && this.#sized(this.#lane(-1).imageOf(place), place, state!);
  }

  /** Whether the bytes of a chunk's pictures are at hand, where they are wanted. */
  hasBytes(chunk: Chunk): boolean {
    const pictures = this.#picturesOf(chunk);
    return pictures === null || this.#fetcher.layersOf(pictures) > 0;
  }

  /** The chunks that the pictures of one are decoded from, as far as they were not; null where it is shown without. */
  leadTo(pictures: CompanionChunk): readonly CompanionChunk[] {
    return this.#lanes.get(pictures.frameCount === 0 ? -1 : pictures.track)?.leadTo(pictures) ?? this.chainTo(pictures);
  }

  /** Playback had to wait for a picture whose bytes were there. */
  late(now: number): void {
    this.#late.push(now);
    if (this.#late.length > LATE) this.#late.shift();
    if (this.#late.length < LATE || now - this.#late[0] > LATE_MS) return;
    this.#late.length = 0;
    this.#giveUp("slow", "this machine decodes them too slowly");
  }

  close(): void {
    this.#isClosed = true;
    for (const lane of this.#lanes.values()) lane.close();
    this.#lanes.clear();
  }

  chainOf(pictures: CompanionChunk): readonly CompanionChunk[] {
    return this.#chains.get(pictures.number)!;
  }

  packetsOf(pictures: CompanionChunk): readonly Uint8Array[] | null {
    if (this.#fetcher.layersOf(pictures) === 0) return null;
    const data = this.#fetcher.payload(pictures, 1);
    checkPayload(describe(pictures), pictures.form, data, pictures.layers);
    const { form, codec, packets } = unpackAll(Pictures, data);
    const isWhole = packets.length === countOf(pictures) && packets.every((packet) => packet.length > 0);
    if (form !== Form.VIDEO || codec !== VideoCodec.AV1 || !isWhole) throw new FormatError(`${packets.length} pictures for ${countOf(pictures)} frames`);
    return packets;
  }

  damaged(pictures: CompanionChunk, message: string): void {
    this.version++;
    if (!this.#decoding.isFailed(pictures)) this.#decoding.failPictures(pictures, message);
    this.#events.changed();
  }

  changed(): void {
    this.version++;
    this.#events.changed();
  }

  private chainTo(pictures: CompanionChunk): readonly CompanionChunk[] {
    const chain = this.chainOf(pictures);
    return chain.slice(0, chain.indexOf(pictures) + 1);
  }

  #link(chunk: CompanionChunk): void {
    const before = chunk.dependsOn.length > 2 ? this.#chains.get(chunk.dependsOn[2]) : undefined;
    const chain = before ?? [];
    chain.push(chunk);
    this.#chains.set(chunk.number, chain);
  }

  async #ask(): Promise<void> {
    if (typeof VideoDecoder === "undefined") return this.#giveUp("unsupported", "this browser has no WebCodecs, or the page is not served securely");
    const supported = await VideoDecoder.isConfigSupported(CONFIG).then((answer) => answer.supported === true, () => false);
    if (this.#isClosed) return;
    if (!supported) return this.#giveUp("unsupported", "this browser decodes no AV1");
    this.#isSupported = true;
    this.changed();
  }

  #giveUp(lack: "unsupported" | "slow", reason: string): void {
    this.#lack = lack;
    this.#switch();
    this.#events.warn(new Error(`textures are not shown, colours of vertices are: ${reason}`));
  }

  #switch(): void {
    this.#decoding.textures = this.isOn;
    if (!this.isOn) for (const lane of this.#lanes.values()) lane.want([], () => true);
    this.changed();
  }

  #lane(track: number): VideoLane {
    let lane = this.#lanes.get(track);
    if (lane === undefined) this.#lanes.set(track, (lane = new VideoLane(this)));
    return lane;
  }

  /** The pictures that a chunk is shown with; null where it is not at hand, or is shown without. */
  #picturesOf(chunk: Chunk): CompanionChunk | null {
    const packed = this.#decoding.packedOf(chunk);
    if (packed === null || packed.places === null || (chunk.kind === "group" && chunk.track >= MOST_LANES)) return null;
    return this.#decoding.picturesOf(chunk, packed.kind === "group" ? packed.layers : chunk.layers.length - 1);
  }

  #placeOf(frame: number, track: number): Place | null {
    const chunk = this.#head.chunkOfFrame(frame, track);
    const pictures = this.#picturesOf(chunk);
    return pictures && { pictures, index: frame - chunk.firstFrame };
  }

  #placeOfBackground(state: Chunk | null): Place | null {
    const pictures = state && this.#picturesOf(state);
    return pictures && { pictures, index: 0 };
  }

  /** A picture of another size than the atlas is no texture, nor are those behind it. */
  #sized(image: TextureImage | null, { pictures }: Place, chunk: Chunk): TextureImage | null {
    const places = this.#decoding.packedOf(chunk)?.places;
    if (image === null || !places || (image.displayWidth === places.width && image.displayHeight === places.height)) return image;
    this.damaged(pictures, `a picture of ${image.displayWidth} x ${image.displayHeight}: not the atlas' ${places.width} x ${places.height}`);
    return null;
  }
}
