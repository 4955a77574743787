// CRC-32 (ISO-HDLC), the one of zlib and PNG.

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit++) value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
  return value;
});

export function crc32(data: Uint8Array): number {
  let value = 0xffffffff;
  for (let k = 0; k < data.length; k++) value = (value >>> 8) ^ TABLE[(value ^ data[k]) & 0xff];
  return (value ^ 0xffffffff) >>> 0;
}
