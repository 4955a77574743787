// Where the camera is at each time of a recording, so that all viewers see the same sides of it.

/** Rows of seven: the recording's time, s, then where the camera is and what it looks at, x, y, z each, m, as the attribute `camera` has them. */
export type CameraPath = readonly (readonly number[])[];

/** Checks rows whose times rise; `refuse` is told what is wrong, and throws. */
export function readCameraPath(value: unknown, refuse: (what: unknown, wanted: string) => never): CameraPath {
  if (!Array.isArray(value) || value.length === 0) return refuse(value, "a list of rows is needed, as [[0, 0, 1.6, 4, 0, 1, 0]]");
  value.forEach((row: unknown, k) => {
    const isRow = Array.isArray(row) && row.length === 7 && row.every((number) => typeof number === "number");
    if (!isRow) refuse(row, "a row is seven numbers: seconds, and x, y, z of the camera and of what it looks at");
    if ((row as number[])[0]! < 0 || (k > 0 && (row as number[])[0]! <= (value[k - 1] as number[])[0]!)) refuse(row, "times are from 0 and rise from row to row");
  });
  return value as CameraPath;
}

/** The attribute `camera` at a time, s: on straight lines from row to row, before the first and behind the last as there. */
export function cameraAt(path: CameraPath, seconds: number): string {
  const next = path.findIndex(([time]) => time! > seconds);
  const [before, after] = [path.at(next <= 0 ? next : next - 1)!, path.at(next)!];
  const share = after === before ? 0 : (seconds - before[0]!) / (after[0]! - before[0]!);
  return before.slice(1).map((from, k) => (from + share * (after[k + 1]! - from)).toFixed(4)).join(",");
}
