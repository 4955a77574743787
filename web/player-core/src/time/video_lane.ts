// The video of one track's textures: packets in, pictures out, a few ahead of the play head. WebCodecs decodes it.

import { FormatError } from "../errors.ts";
import type { CompanionChunk } from "../format/reader.ts";
import { LAYER_PICTURES } from "./slow_video.ts";
import type { TextureImage } from "../types.ts";

/** One picture: which it is of those of a chunk, or of a layer of a background's. */
export interface Place {
  readonly pictures: CompanionChunk;
  readonly index: number;
}

/** Source of packets, and receiver of the results. */
export interface LaneHost {
  /** The chunks of one video, from its key picture on. */
  chainOf(pictures: CompanionChunk): readonly CompanionChunk[];
  /** The packets of a chunk; null where its bytes are not at hand. FormatError where they are damaged. */
  packetsOf(pictures: CompanionChunk): readonly Uint8Array[] | null;
  configFor(pictures: CompanionChunk, first: Uint8Array): VideoDecoderConfig;
  damaged(pictures: CompanionChunk, message: string): void;
  refused(): void; // the browser has no decoder for such a video after all
  changed(): void; // there is a picture more
}

const MOST_PENDING = 8; // packets that the decoder has and has not answered (guess)
const SILENCE = 3000; // ms without a picture though packets wait: none will come (guess)

export class VideoLane {
  readonly #host: LaneHost;
  readonly #held = new Map<number, TextureImage>(); // by keyOf
  readonly #pending = new Map<number, Place>(); // by the number that the packet has as its time, in their order
  #wanted: readonly Place[] = [];
  #cursor: Place | null = null; // of the last packet that was given to the decoder
  #decoder: VideoDecoder | null = null;
  #codec = ""; // that the decoder is set up for
  #unpacked: { readonly pictures: CompanionChunk; readonly packets: readonly Uint8Array[] } | null = null;
  #serial = 0;
  #silence: ReturnType<typeof setTimeout> | undefined;

  constructor(host: LaneHost) {
    this.#host = host;
  }

  /** Decodes these, in their order; of all others it keeps those only that are still shown. */
  want(wanted: readonly Place[], isShown: (image: TextureImage) => boolean): void {
    this.#wanted = wanted;
    for (const [key, image] of this.#held) {
      if (isShown(image) || this.#isWanted(key)) continue;
      image.close();
      this.#held.delete(key);
    }
    this.#feed();
  }

  imageOf({ pictures, index }: Place): TextureImage | null {
    return this.#held.get(keyOf(pictures, index)) ?? null;
  }

  /** The chunks whose packets are needed before a picture of one can be decoded, and that one. */
  leadTo(pictures: CompanionChunk): readonly CompanionChunk[] {
    const chain = this.#host.chainOf(pictures);
    const from = this.#cursor === null ? -1 : chain.indexOf(this.#cursor.pictures);
    const to = chain.indexOf(pictures);
    return chain.slice(from >= 0 && from <= to ? from : 0, to + 1);
  }

  close(): void {
    this.#stop();
    for (const image of this.#held.values()) image.close();
    this.#held.clear();
    this.#wanted = [];
  }

  #isWanted(key: number): boolean {
    return this.#wanted.some(({ pictures, index }) => keyOf(pictures, index) === key);
  }

  #feed(): void {
    while (this.#pending.size < MOST_PENDING) {
      const target = this.#wanted.find((place) => this.imageOf(place) === null && !this.#isPending(place));
      const next = target && this.#before(target);
      if (!next || !this.#submit(next)) return;
    }
  }

  #isPending({ pictures, index }: Place): boolean {
    for (const place of this.#pending.values()) if (place.pictures === pictures && place.index === index) return true;
    return false;
  }

  /** The packet that is next on the way to a picture: that behind the last one, or the key. */
  #before(target: Place): Place {
    const chain = this.#host.chainOf(target.pictures);
    const at = this.#cursor;
    const link = at === null ? -1 : chain.indexOf(at.pictures);
    const last = chain.indexOf(target.pictures);
    const isOnTheWay = at !== null && link >= 0 && (link < last || (link === last && at.index < target.index));
    if (!isOnTheWay) return { pictures: chain[0], index: 0 };
    return at.index + 1 < countOf(at.pictures) ? { pictures: at.pictures, index: at.index + 1 } : { pictures: chain[link + 1], index: 0 };
  }

  /** False where the packet is not at hand, or no good. */
  #submit(place: Place): boolean {
    const { pictures, index } = place;
    try {
      const packets = this.#packetsOf(pictures);
      if (packets === null || index >= packets.length) return false;
      const isKey = index === 0 && this.#host.chainOf(pictures)[0] === pictures;
      if (isKey) this.#forgetStale();
      this.#decoder ??= this.#open();
      if (isKey) this.#configure(this.#decoder, this.#host.configFor(pictures, packets[0]));
      const timestamp = ++this.#serial;
      this.#pending.set(timestamp, place);
      this.#cursor = place;
      this.#decoder.decode(new EncodedVideoChunk({ type: isKey ? "key" : "delta", timestamp, data: packets[index] }));
    } catch (error) {
      this.#fail(pictures, error instanceof FormatError ? error.message : `a damaged picture (${String(error)})`);
      return false;
    }
    this.#watch();
    return true;
  }

  #packetsOf(pictures: CompanionChunk): readonly Uint8Array[] | null {
    if (this.#unpacked?.pictures === pictures) return this.#unpacked.packets;
    const packets = this.#host.packetsOf(pictures);
    this.#unpacked = packets && { pictures, packets };
    return packets;
  }

  /** A video is begun again or another one: nothing of what the decoder still has may be wanted. */
  #forgetStale(): void {
    if (this.#pending.size === 0) return;
    for (const { pictures, index } of this.#pending.values()) if (this.#isWanted(keyOf(pictures, index))) return;
    this.#stop();
  }

  #open(): VideoDecoder {
    const decoder: VideoDecoder = new VideoDecoder({
      output: (image) => (this.#decoder === decoder ? this.#take(image) : image.close()),
      error: (error) => {
        if (this.#decoder !== decoder) return;
        if (error.name === "NotSupportedError") return this.#host.refused();
        const [first] = this.#pending.values();
        this.#fail((first ?? this.#cursor)!.pictures, `a damaged picture (${error.message})`);
      },
    });
    return decoder;
  }

  #configure(decoder: VideoDecoder, config: VideoDecoderConfig): void {
    if (config.codec !== this.#codec) decoder.configure(config);
    this.#codec = config.codec;
  }

  #take(image: TextureImage): void {
    const place = this.#pending.get(image.timestamp);
    const [[first, skipped]] = this.#pending.size > 0 ? this.#pending : [[NaN, null]];
    if (place === undefined || first !== image.timestamp) {
      image.close();
      return this.#fail((skipped ?? this.#cursor)!.pictures, "a packet that does not have one picture");
    }
    this.#pending.delete(image.timestamp);
    this.#watch();
    const key = keyOf(place.pictures, place.index);
    if (this.#isWanted(key) && !this.#held.has(key)) this.#held.set(key, image);
    else image.close();
    this.#host.changed();
    this.#feed();
  }

  #watch(): void {
    clearTimeout(this.#silence);
    const [first] = this.#pending.values();
    if (first !== undefined) this.#silence = setTimeout(() => this.#fail(first.pictures, `no picture for ${SILENCE / 1000} s`), SILENCE);
  }

  #fail(pictures: CompanionChunk, message: string): void {
    this.#stop();
    this.#host.damaged(pictures, message);
  }

  /** Lets go of the decoder; what it has decoded stays. */
  #stop(): void {
    clearTimeout(this.#silence);
    const decoder = this.#decoder;
    this.#decoder = this.#cursor = null;
    this.#codec = "";
    this.#pending.clear();
    if (decoder !== null && decoder.state !== "closed") decoder.close();
  }
}

/** Number of pictures of a chunk, or the largest number in a layer of a background's. */
export function countOf(pictures: CompanionChunk): number {
  return pictures.frameCount || LAYER_PICTURES;
}

function keyOf(pictures: CompanionChunk, index: number): number {
  return 65536 * pictures.offset + index;
}
