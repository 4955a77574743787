// Colours of the vertices of a group of any form, or of a background. Beside coding/{colored,appearance/colors}.py.

import { joined } from "../bytes.ts";
import { FormatError } from "../errors.ts";
import { checkColors } from "../format/budget.ts";
import { CodedField, ColorsLevel, Form, Origin, VertexColors } from "../format/layout.gen.ts";
import { unpack } from "../format/records.ts";
import type { Mesh } from "../mesh.ts";
import { decodeMeshColors } from "../wasm/colors.ts";
import type { ColoredMesh } from "../wasm/colors.ts";
import type { Core } from "../wasm/memory.ts";

/** The meshes of a payload whose vertices have colours, in the order in which these are coded. */
export type Canvas = readonly ColoredMesh[];

export interface DecodedColors {
  readonly colors: Uint8Array; // red, green and blue of all meshes' vertices, frame after frame, mesh after mesh
  readonly last: Float64Array | null; // of the first mesh, from which the next group may be predicted
}

/**
 * The colours of the vertices of meshes, whose records `data` has and no more. FormatError where it is damaged, costs too much, or needs a group
 * that is not at hand.
 */
export function decodeColors(core: Core, data: Uint8Array, canvas: Canvas, before: Float64Array | null): DecodedColors {
  checkColors(canvas, data.length);
  let [head, offset] = unpack(VertexColors, data);
  if (head.form !== Form.VERTEX_COLORS || head.chroma === 0) throw new FormatError(`colours of form ${head.form} and chroma ${head.chroma}`);
  const isPredicted = head.origin === Origin.PREVIOUS;
  if (isPredicted && before === null) throw new FormatError("colours that are predicted from those of a group which is not at hand");
  const found: Uint8Array[] = [];
  let last: Float64Array | null = null;
  canvas.forEach((mesh, number) => {
    const start = offset;
    [, offset] = unpack(CodedField, data, start);
    for (let level = 0; level < mesh.levels; level++) [, offset] = unpack(ColorsLevel, data, offset);
    const known = number === 0 && isPredicted ? before : null;
    if (known !== null && known.length !== 3 * mesh.vertices) throw new FormatError(`colours of ${mesh.vertices} vertices, predicted from those of ${known.length / 3}`);
    const [colors, values] = decodeMeshColors(core, data.subarray(start, offset), mesh, { chroma: head.chroma / 64, before: known });
    found.push(colors);
    if (number === 0) last = values;
  });
  if (offset !== data.length) throw new FormatError(`colours: ${data.length - offset} bytes too many`);
  return { colors: joined(found), last };
}

/** A decoded state of the background, and what of it has colours of its own: all of it, or what a change adds behind what it keeps. */
export interface StaticCanvas {
  readonly mesh: Mesh;
  readonly added: ColoredMesh;
  readonly isChange: boolean;
}

/** The state with the colours of a payload. FormatError where they are damaged, or of other vertices. */
export function paintStatic(core: Core, { mesh, added, isChange }: StaticCanvas, data: Uint8Array): Mesh {
  const { colors } = decodeColors(core, data, [added], null);
  if (!isChange && colors.length === mesh.vertices.length) return { ...mesh, colors };
  if (mesh.colors === undefined || colors.length > mesh.vertices.length) {
    throw new FormatError(`colours of ${colors.length / 3} of ${mesh.vertices.length / 3} vertices of a background`);
  }
  const painted = mesh.colors.slice();
  painted.set(colors, painted.length - colors.length);
  return { ...mesh, colors: painted };
}
