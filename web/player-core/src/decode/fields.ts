// Fields over a causal graph: the basis and the symbols of a CodedField. Beside coding/fields.py.

import { FormatError } from "../errors.ts";
import type { CodedField } from "../format/layout.gen.ts";
import { decodeField } from "../wasm/entropy.ts";
import { orthonormalInverse } from "../wasm/layers.ts";
import type { FieldValues, Graph } from "../wasm/layers.ts";
import type { Core } from "../wasm/memory.ts";
import { checkPlausible, decodeIntegers } from "./entropy.ts";
import { LEVELS, stepOf } from "./steps.ts";

const MOST_BITS = 30;

/** The field of a record, `width` numbers a value, as coded. FormatError where it holds none of this width. */
export function readField(core: Core, record: CodedField, graph: Graph, width: number, hasMean: boolean): FieldValues {
  const count = graph.starts.length - 1;
  const { columns, stepLevel } = record;
  if (columns > width || stepLevel >= LEVELS) throw new FormatError(`${columns} columns of ${width} numbers at step level ${stepLevel}`);
  const [means, vectors] = readBasis(core, record, width, hasMean);
  checkPlausible(count * columns, record.symbols.length, "symbols");
  const symbols = decodeField(core, record.symbols, columns, graph);
  if (symbols === null) throw new FormatError(`${record.symbols.length} bytes of symbols are truncated or damaged`);
  return { symbols, graph, step: stepOf(stepLevel), columns, vectors, means, before: null };
}

function readBasis(core: Core, record: CodedField, width: number, hasMean: boolean): [Float64Array, Float64Array] {
  const { columns } = record;
  const head = hasMean ? 1 + width : 0;
  const values = decodeIntegers(core, record.basis, head + columns * width - (columns * (columns - 1)) / 2);
  const means = new Float64Array(width);
  if (hasMean) {
    const bits = values[0];
    if (!(bits >= 0 && bits <= MOST_BITS)) throw new FormatError(`a mean of ${bits} bits`);
    for (let k = 0; k < width; k++) means[k] = values[1 + k] * 2 ** -bits;
  }
  return [means, orthonormalInverse(core, values.slice(head), columns, width)];
}
