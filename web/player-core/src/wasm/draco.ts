// Counts that Draco meshes claim, checked before Draco decodes them. Declared in core/include/meshreel/draco.h.

import { joined } from "../bytes.ts";
import type { Core } from "./memory.ts";

/** FormatError for Draco meshes of kinds that no encoder writes, or that together claim more than their bytes may. */
export function checkClaims(core: Core, meshes: readonly Uint8Array[]): void {
  const data = joined(meshes);
  core.run((arena) => {
    let place = arena.put(data);
    const structs = meshes.flatMap(({ length }) => [(place += length) - length, length]); // mr_bytes
    const status = core.call("mr_check_draco", arena.put(Int32Array.from(structs)), meshes.length);
    core.check(status, `damaged Draco data (${data.length} bytes): `);
  });
}
