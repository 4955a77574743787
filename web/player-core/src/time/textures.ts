// The textures of what is shown: which video they come from, which pictures are wanted now and next, and why there are none.

import type { Decoding } from "./decoding.ts";
import { FormatError } from "../errors.ts";
import type { Fetcher } from "../net/fetcher.ts";
import { Form, Pictures, VideoCodec } from "../format/layout.gen.ts";
import { checkPictures } from "../format/budget.ts";
import { checkPayload } from "../format/payload.ts";
import { RENDITIONS, describe, isVideo } from "../format/reader.ts";
import type { Chunk, CompanionChunk, Head } from "../format/reader.ts";
import { unpackAll } from "../format/records.ts";
import type { Rendition, Shown, TextureImage, TextureState, TextureStats } from "../types.ts";
import { CODECS, configFor, texelsOf } from "../format/renditions.ts";
import { SlowVideo } from "./slow_video.ts";
import { VideoLane, countOf } from "./video_lane.ts";
import type { LaneHost, Place } from "./video_lane.ts";

/** Wishes of the viewer and abilities of the browser concerning textures. */
export interface TextureSettings {
  readonly on: boolean;
  readonly decodable: readonly Rendition[] | null; // as `decodable` says
}

export interface TextureEvents {
  warn(error: Error): void;
  changed(): void; // there is a picture more, or no more will come
}

const AHEAD = 6; // pictures of a track that are decoded, the shown one included: decoders have few to give (guess)
const BACK = 4; // pictures of a group that are decoded where time goes down: for each group a video is decoded from its key on (guess)
const NO_WEBCODECS = "this browser has no WebCodecs, or the page is not served securely";
const MOST_LANES = 8; // tracks with textures: each has a decoder of its own (guess)
const LATE = 3; // times within LATE_MS that playback had to wait for a picture, until another video or none is tried (guess)
const LATE_MS = 10_000;
const RETRY_MS = [15_000, 120_000] as const; // until they are tried again that were too slow, first and at most, doubled each time (guess)

export class Textures implements LaneHost {
  /** Counts what changes in what can be shown. */
  version = 0;
  loop = false;
  isBack = false; // time goes down
  turns = false; // at the ends
  readonly #head: Head;
  readonly #fetcher: Fetcher;
  readonly #decoding: Decoding;
  readonly #events: TextureEvents;
  readonly #lanes = new Map<number, VideoLane>(); // by track; -1: of the background
  readonly #chains = new Map<number, readonly CompanionChunk[]>(); // the chunks of each video, by each of them
  readonly #slow = new Map<number, SlowVideo>(); // by the chunk with a background's pictures
  readonly #texels = new Map<number, number>(); // of a picture of each video, by the offset of its first chunk
  readonly #late: number[] = []; // ms
  readonly #far = new Set<number>(); // tracks that are seen too small for textures
  readonly #early = new Set<number>(); // tracks that are shown without until their first picture is there
  #on: boolean;
  #choices: readonly Rendition[]; // that the file has and the browser decodes, the best first
  #choice = 0; // index of the choice; behind the last if none is in time
  #reason = ""; // why it is not the best that there could be
  #retryAt = Infinity; // ms
  #retryIn: number = RETRY_MS[0];

  constructor(head: Head, fetcher: Fetcher, decoding: Decoding, events: TextureEvents, { on, decodable }: TextureSettings) {
    this.#head = head;
    this.#fetcher = fetcher;
    this.#decoding = decoding;
    this.#events = events;
    this.#on = on;
    for (const chunk of head.chunks) if (isVideo(chunk)) this.#link(chunk);
    const inFile = RENDITIONS.filter((kind) => head.chunks.some((chunk) => chunk.kind === kind));
    this.#choices = inFile.filter((kind) => decodable?.includes(kind));
    const better = inFile.slice(0, this.#choices.length > 0 ? inFile.indexOf(this.#choices[0]) : undefined).map((kind) => CODECS[kind]);
    if (better.length > 0) this.#reason = decodable === null ? NO_WEBCODECS : `this browser decodes no ${better.join(" and no ")}`;
    decoding.want({ textures: this.rendition });
    if (better.length > 0 && this.#choices.length === 0) this.#warn();
  }

  /** The video that is fetched and shown; null where textures are not wanted, or none is possible. */
  get rendition(): Rendition | null {
    return this.#on ? (this.#choices[this.#choice] ?? null) : null;
  }

  set on(on: boolean) {
    if (on && !this.#on) this.#choice = 0;
    this.#on = on;
    this.#switch();
  }

  /** Tracks that are seen so small that their textures make no difference: these are neither fetched nor decoded. */
  set far(far: ReadonlySet<number>) {
    for (let track = 0; track < this.#head.tracks.length; track++) {
      if (far.has(track) === this.#far.has(track)) continue;
      this.version++;
      if (!this.#far.delete(track)) this.#far.add(track);
      this.#early.add(track);
    }
  }

  /** Shows a track without textures until its first picture is there. */
  begin(track: number): void {
    this.#early.add(track);
  }

  /** True if the pictures of a chunk are left out because its track is far. */
  isFar({ kind, track }: Chunk): boolean {
    return kind === "group" && this.#far.has(track);
  }

  statsOf(shown: Shown | null): TextureStats {
    const codec = this.rendition && CODECS[this.rendition];
    return { textures: this.#stateOf(shown), textureCodec: codec, textureReason: this.#reason, backgroundLate: shown !== null && this.#isLate(shown) };
  }

  /** Decodes the pictures of a frame and of those behind it. */
  aim(frame: number, isShown: (image: TextureImage) => boolean): void {
    if (performance.now() >= this.#retryAt) this.#retry();
    if (this.rendition === null) return;
    const { frameCount, tracks } = this.#head;
    for (let track = 0; track < Math.min(tracks.length, MOST_LANES); track++) {
      const places = (this.isBack ? this.#behind(frame, track) : this.#ahead(frame, track)).map((other) => this.#placeOf(other, track)).filter((place) => place !== null);
      if (places.length > 0 || this.#lanes.has(track)) this.#lane(track).want(places, isShown);
      if (places.length > 0 && this.#lane(track).imageOf(places[0]) !== null) this.#early.delete(track);
    }
    const slow = this.#slowOf(frame);
    const next = frame + (slow?.interval ?? 0) * (this.isBack ? -1 : 1);
    const places = slow === null ? [] : [frame, ...(next >= 0 && next < frameCount && this.#slowOf(next) === slow ? [next] : [])].map((shown) => slow.placeOf(shown));
    if (places.length > 0 || this.#lanes.has(-1)) this.#lane(-1).want(places, isShown);
  }

  /** Frames from one on, as many as are decoded; then those whose pictures are shown on the way back. */
  #ahead(frame: number, track: number): number[] {
    const { frameCount } = this.#head;
    const frames = Array.from({ length: Math.min(AHEAD, frameCount) }, (_, k) => frame + k);
    const inTime = frames.filter((other) => other < frameCount);
    if (this.turns && inTime.length < frames.length) return [...inTime, ...this.#downTo(frameCount - 1, track)];
    return this.loop ? frames.map((other) => other % frameCount) : inTime;
  }

  /** Frames whose pictures are shown from one down; then those of the group before, or what comes where there is none. */
  #behind(frame: number, track: number): number[] {
    const { shownFirst } = this.#head.chunkOfFrame(frame, track);
    const frames = this.#downTo(frame, track);
    if (shownFirst > 0) return [...frames, ...this.#downTo(shownFirst - 1, track)];
    if (this.turns) return [...frames, ...Array.from({ length: Math.min(AHEAD, this.#head.frameCount) }, (_, k) => k)];
    return this.loop ? [...frames, ...this.#downTo(this.#head.frameCount - 1, track)] : frames;
  }

  /** Frames of a group whose pictures serve for all of it up to one, in the order of their video. */
  #downTo(last: number, track: number): number[] {
    const { shownFirst } = this.#head.chunkOfFrame(last, track);
    return [...new Set(Array.from({ length: last - shownFirst + 1 }, (_, k) => this.#serving(shownFirst + k, track)))];
  }

  #pictured(frame: number, track: number): number {
    return this.isBack ? this.#serving(frame, track) : frame;
  }

  /** The frame whose picture serves for one where time goes down: there are a few in each group. */
  #serving(frame: number, track: number): number {
    const { shownFirst, shownEnd } = this.#head.chunkOfFrame(frame, track);
    const stride = Math.ceil((shownEnd - shownFirst) / BACK);
    return shownFirst + stride * Math.floor((frame - shownFirst) / stride);
  }

  /** True if the bodies' pictures of a frame whose groups are at hand are there, except for those that can never be. */
  isReady(frame: number): boolean {
    for (let track = 0; track < this.#head.tracks.length; track++) {
      const place = this.#placeOf(this.#pictured(frame, track), track);
      if (place !== null && !this.#early.has(track) && this.#lane(track).imageOf(place) === null) return false;
    }
    return true;
  }

  /** The texture of a track in a frame; null where it has none. */
  imageOf(frame: number, track: number): TextureImage | null {
    const place = this.#placeOf(this.#pictured(frame, track), track);
    return place && this.#sized(this.#lane(track).imageOf(place), place, this.#head.chunkOfFrame(frame, track));
  }

  /** The picture of the background in a frame; where it is late, the one that was shown `before` if there was one. */
  imageOfBackground(frame: number, before: TextureImage | null): TextureImage | null {
    const place = this.#slowOf(frame)?.placeOf(frame);
    if (place === undefined) return null;
    return this.#sized(this.#lane(-1).imageOf(place), place, this.#head.staticOfFrame(frame)!) ?? (this.#slowOf(frame) && before);
  }

  /** The layers of a background's video that frames from one to another are shown with. */
  layersOf(state: Chunk, first: number, last: number): readonly CompanionChunk[] {
    const from = Math.max(first, this.#head.shownFrom(state));
    const slow = this.#slowOf(from);
    if (slow === null || this.#head.staticOfFrame(from) !== state) return [];
    return [...new Set([from, Math.max(from, last)].map((frame) => slow.placeOf(frame).pictures))];
  }

  /** True if the bytes of a chunk's pictures are at hand, or it does not wait for them. */
  hasBytes(chunk: Chunk): boolean {
    if (chunk.kind === "static" || this.#early.has(chunk.track)) return true;
    const pictures = this.#picturesOf(chunk);
    return pictures === null || this.#fetcher.layersOf(pictures) > 0;
  }

  /** The chunks that the pictures of one are decoded from, as far as they were not; null where it is shown without. */
  leadTo(pictures: CompanionChunk): readonly CompanionChunk[] {
    const chain = this.chainOf(pictures);
    return this.#lanes.get(pictures.track)?.leadTo(pictures) ?? chain.slice(0, chain.indexOf(pictures) + 1);
  }

  /** Playback had to wait for a picture whose bytes were there. */
  late(now: number): void {
    this.#late.push(now);
    if (this.#late.length > LATE) this.#late.shift();
    if (this.#late.length < LATE || now - this.#late[0] > LATE_MS) return;
    this.#late.length = 0;
    const { rendition } = this;
    if (rendition === null) return;
    this.#choice++;
    this.#reason = `this machine decodes ${CODECS[rendition]} too slowly`;
    if (this.rendition === null) this.#retryAt = now + this.#retryIn;
    this.#switch();
    if (this.rendition === null && this.#retryIn === RETRY_MS[0]) this.#warn();
  }

  refused(): void {
    const { rendition } = this;
    this.#choices = this.#choices.filter((kind) => kind !== rendition);
    if (rendition !== null) this.#reason = `this browser decodes no ${CODECS[rendition]} of that size`;
    this.#switch();
    if (this.rendition === null) this.#warn();
  }

  close(): void {
    for (const lane of this.#lanes.values()) lane.close();
    this.#lanes.clear();
  }

  chainOf(pictures: CompanionChunk): readonly CompanionChunk[] {
    return this.#chains.get(pictures.number) ?? [pictures];
  }

  configFor({ kind }: CompanionChunk, first: Uint8Array): VideoDecoderConfig {
    return configFor(kind as Rendition, first);
  }

  packetsOf(pictures: CompanionChunk): readonly Uint8Array[] | null {
    if (this.#fetcher.layersOf(pictures) === 0) return null;
    const data = this.#fetcher.payload(pictures, 1);
    checkPayload(describe(pictures), pictures.form, data, pictures.layers);
    const { form, codec, interval, packets } = unpackAll(Pictures, data);
    const kind = codec === VideoCodec.AV1 ? "pictures" : "compatible";
    const isRight = this.#slow.get(pictures.number)?.read(pictures, interval, packets.length) ?? (interval === 1 && packets.length === countOf(pictures));
    const isWhole = form === Form.VIDEO && kind === pictures.kind && packets.every((packet) => packet.length > 0);
    if (!isRight || !isWhole) throw new FormatError(`${packets.length} pictures of codec ${codec}, one each ${interval} frames, for ${countOf(pictures)}`);
    const video = this.chainOf(pictures)[0].offset;
    const texels = packets.reduce((most, packet) => Math.max(most, texelsOf(kind, packet)), this.#texels.get(video) ?? 0);
    this.#texels.set(video, texels);
    checkPictures(texels * packets.length, data.length);
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

  #link(chunk: CompanionChunk): void {
    if (chunk.frameCount === 0) return this.#linkSlow(chunk);
    const chain = (chunk.dependsOn.length > 2 ? this.#chains.get(chunk.dependsOn[2]) : undefined) ?? [];
    (chain as CompanionChunk[]).push(chunk);
    this.#chains.set(chunk.number, chain);
  }

  #linkSlow(chunk: CompanionChunk): void {
    const state = this.#head.chunks[chunk.dependsOn[0]];
    const first = this.#head.shownFrom(state);
    const others = this.#head.chunks.filter(({ kind }) => kind === "static").map((other) => this.#head.shownFrom(other));
    const end = Math.min(this.#head.frameCount, ...others.filter((other) => other > first));
    this.#slow.set(chunk.number, new SlowVideo(this.#head.piecesOf(chunk), (frame) => this.#head.framesWith(state, frame), Math.max(1, end - first)));
  }

  /** Appearance shown in place of textures, or that textures are shown. */
  #stateOf(shown: Shown | null): TextureState {
    if (!this.#head.info.hasTextures) return "none";
    if (!this.#on) return "off";
    if (this.rendition === null) return this.#choices.length > 0 ? "slow" : "unsupported";
    if (shown === null || shown.backgroundImage !== null || shown.images.some((image) => image !== null)) return "shown";
    if (this.#isLate(shown)) return "late";
    if (shown.groups.some((group) => group !== null && this.#far.has(group.track))) return "far";
    const chunks = [...shown.groups, shown.background].map((packed) => packed && this.#head.chunks[packed.chunk]);
    const failed = chunks.some((chunk) => chunk && this.#head.companionsOf(chunk).some((other) => isVideo(other) && this.#decoding.isFailed(other)));
    return failed ? "damaged" : "left out";
  }

  #isLate({ frame }: Shown): boolean {
    const place = this.#slowOf(frame)?.placeOf(frame);
    return place !== undefined && this.#lane(-1).imageOf(place) === null;
  }

  #warn(): void {
    this.#events.warn(new Error(`textures are not shown, colours of vertices are: ${this.#reason}`));
  }

  /** Tries again what was too slow, the last of all: others may have been at work. */
  #retry(): void {
    this.#retryAt = Infinity;
    this.#retryIn = Math.min(2 * this.#retryIn, RETRY_MS[1]);
    this.#choice = Math.min(this.#choice, this.#choices.length - 1);
    for (const track of this.#head.tracks.keys()) this.#early.add(track);
    this.#switch();
  }

  #switch(): void {
    this.#decoding.want({ textures: this.rendition });
    if (this.rendition === null) for (const lane of this.#lanes.values()) lane.want([], () => true);
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
    if (packed === null || packed.places === null || (chunk.kind === "group" && chunk.track >= MOST_LANES) || this.isFar(chunk)) return null;
    return this.#decoding.picturesOf(chunk, packed.kind === "group" ? packed.layers : chunk.layers.length - 1);
  }

  #placeOf(frame: number, track: number): Place | null {
    const chunk = this.#head.chunkOfFrame(frame, track);
    const pictures = this.#picturesOf(chunk);
    return pictures && { pictures, index: frame - chunk.firstFrame };
  }

  /** The video that the background of a frame is shown with. */
  #slowOf(frame: number): SlowVideo | null {
    const state = this.#head.staticOfFrame(frame);
    const pictures = state && this.#picturesOf(state);
    return pictures && this.#slow.get(pictures.number)!;
  }

  /** A picture of another size than the atlas is no texture, nor are those behind it. */
  #sized(image: TextureImage | null, { pictures }: Place, chunk: Chunk): TextureImage | null {
    const places = this.#decoding.packedOf(chunk)?.places;
    if (image === null || !places || (image.displayWidth === places.width && image.displayHeight === places.height)) return image;
    this.damaged(pictures, `a picture of ${image.displayWidth} x ${image.displayHeight}: not the atlas' ${places.width} x ${places.height}`);
    return null;
  }
}
