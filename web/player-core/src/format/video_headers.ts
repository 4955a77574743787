// Headers in a video's packets: its codec and size, read before a decoder allocates memory.

import { FormatError } from "../errors.ts";
import type { Rendition } from "../types.ts";

export interface VideoHeader {
  readonly codec: string; // with profile and level, as WebCodecs names it
  readonly width: number; // pixels, at most
  readonly height: number;
}

const [SEQUENCE_HEADER, PARAMETER_SET] = [1, 7]; // types of an OBU of AV1, of a NAL unit of H.264
const WITH_CHROMA = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135]; // profiles of H.264 that tell how colours are stored

/** The headers in a packet: the first of a video has one, and others may. FormatError where one breaks off, or is of no kind that textures have. */
export function headersOf(kind: Rendition, packet: Uint8Array): VideoHeader[] {
  return kind === "pictures" ? sequenceHeaders(packet).map(readSequence) : parameterSets(packet).map(readParameters);
}

/** Payloads of the OBUs that are sequence headers (AV1, 5.3). */
function sequenceHeaders(packet: Uint8Array): Uint8Array[] {
  const found: Uint8Array[] = [];
  for (let at = 0; at < packet.length; ) {
    const first = packet[at];
    at += first & 4 ? 2 : 1;
    let size = first & 2 ? 0 : packet.length - at;
    for (let scale = 1, more = (first & 2) !== 0; more; scale *= 128) {
      more = packet[at] > 127;
      size += (packet[at++] & 127) * scale;
    }
    if (((first >> 3) & 15) === SEQUENCE_HEADER) found.push(packet.subarray(at, at + size));
    at += size;
  }
  return found;
}

/** Names as in AV1, 5.5.1. */
function readSequence(payload: Uint8Array): VideoHeader {
  const bits = new Bits(payload);
  const profile = bits.take(3);
  bits.take(1); // still_picture
  const level = bits.take(1) ? bits.take(5) : readOperatingPoints(bits);
  const [wide, high] = [bits.take(4) + 1, bits.take(4) + 1];
  return { codec: `av01.${profile}.${String(level).padStart(2, "0")}M.08`, width: bits.take(wide) + 1, height: bits.take(high) + 1 };
}

/** The level of the first operating point. */
function readOperatingPoints(bits: Bits): number {
  let modelBits = 0; // of what each point says of a decoder's buffers
  if (bits.take(1)) {
    bits.take(64); // num_units_in_display_tick, time_scale
    if (bits.take(1)) bits.golomb();
    if (bits.take(1)) {
      modelBits = 2 * (bits.take(5) + 1) + 1;
      bits.take(42); // the rest of decoder_model_info
    }
  }
  const hasDelays = bits.take(1);
  const count = bits.take(5) + 1;
  const levels = Array.from({ length: count }, () => {
    bits.take(12); // operating_point_idc
    const level = bits.take(5);
    if (level > 7) bits.take(1); // seq_tier
    if (modelBits > 0 && bits.take(1)) bits.take(modelBits);
    if (hasDelays && bits.take(1)) bits.take(4);
    return level;
  });
  return levels[0];
}

/** Payloads of the NAL units that are sequence parameter sets, without the bytes that keep start codes out of them (H.264, 7.3.1). */
function parameterSets(packet: Uint8Array): Uint8Array[] {
  const found: Uint8Array[] = [];
  for (let at = 0; at + 3 < packet.length; at++) {
    if (packet[at] !== 0 || packet[at + 1] !== 0 || packet[at + 2] !== 1 || (packet[at + 3] & 31) !== PARAMETER_SET) continue;
    const raw = packet.subarray(at + 4);
    found.push(raw.filter((byte, k) => byte !== 3 || k < 2 || raw[k - 1] !== 0 || raw[k - 2] !== 0));
  }
  return found;
}

/** Names as in H.264, 7.3.2.1.1. */
function readParameters(payload: Uint8Array): VideoHeader {
  const bits = new Bits(payload);
  const [profile, flags, level] = [bits.take(8), bits.take(8), bits.take(8)];
  bits.golomb(); // seq_parameter_set_id
  if (WITH_CHROMA.includes(profile)) {
    const [chroma, luma, depth, , isScaled] = [bits.golomb(), bits.golomb(), bits.golomb(), bits.take(1), bits.take(1)];
    if (chroma !== 1 || luma !== 0 || depth !== 0 || isScaled) throw new FormatError("a video that is not of 8 bits and 4:2:0");
  }
  bits.golomb(); // log2_max_frame_num_minus4
  const order = bits.golomb();
  if (order === 0) bits.golomb();
  if (order === 1) throw new FormatError("a video in another order than it is shown in");
  bits.golomb(); // max_num_ref_frames
  bits.take(1);
  const [wide, high, isProgressive] = [bits.golomb() + 1, bits.golomb() + 1, bits.take(1)];
  const codec = `avc1.${[profile, flags, level].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  return { codec, width: 16 * wide, height: 16 * high * (2 - isProgressive) };
}

/** Reads bits, the highest of a byte first. FormatError behind the end. */
class Bits {
  private at = 0;

  constructor(private readonly bytes: Uint8Array) {}

  take(count: number): number {
    let value = 0;
    for (let k = 0; k < count; k++, this.at++) {
      const byte = this.bytes[this.at >> 3];
      if (byte === undefined) throw new FormatError("the header of a video breaks off");
      value = 2 * value + ((byte >> (7 - (this.at & 7))) & 1);
    }
    return value;
  }

  /** A number as H.264 writes it: as many zeros as it has bits behind its first. */
  golomb(): number {
    let zeros = 0;
    while (this.take(1) === 0) if (++zeros > 31) throw new FormatError("the header of a video is damaged");
    return 2 ** zeros + this.take(zeros) - 1;
  }
}
