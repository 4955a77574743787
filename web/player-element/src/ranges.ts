// Spans of time, as HTMLMediaElement.buffered has them.

export interface Ranges {
  readonly length: number;
  start(index: number): number;
  end(index: number): number;
}

/** One span, or none where it is empty. */
export function ranges(start: number, end: number): Ranges {
  const length = end > start ? 1 : 0;
  const at = (value: number) => (index: number) => {
    if (index >= length || index < 0) throw new DOMException(`range ${index} of ${length}`, "IndexSizeError");
    return value;
  };
  return { length, start: at(start), end: at(end) };
}
