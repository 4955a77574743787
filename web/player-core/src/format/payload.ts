// Payloads as they were written: of the form and with the checksums that the index tells.

import { FormatError } from "../errors.ts";
import { crc32 } from "./crc.ts";

/** FormatError where the checksum of a layer does not fit, or the payload is of another form than the index says. */
export function checkPayload(name: string, form: number, payload: Uint8Array, layers: readonly { size: number; crc: number }[]): void {
  let offset = 0;
  layers.forEach((layer, number) => {
    const part = payload.subarray(offset, offset + layer.size);
    if (part.length !== layer.size) throw new FormatError(`${name}: truncated, ${payload.length} bytes`);
    if (crc32(part) !== layer.crc) throw new FormatError(`${name}: layer ${number} is damaged, its checksum does not match`);
    offset += layer.size;
  });
  if (payload[0] !== form) throw new FormatError(`${name}: its form is ${payload[0]}, the index says ${form}`);
}
