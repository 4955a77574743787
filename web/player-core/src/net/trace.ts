// Traces of a network: how many bits a second it gives at which time.

/** Rates by time; behind its end it begins again. */
export interface Trace {
  readonly times: readonly number[]; // s, from 0 on
  readonly rates: readonly number[]; // bytes a second, from each time until the next
  readonly duration: number; // s; the last rate lasts as long as the one before it, alone 1 s
}

const HEAD = "seconds,mbps";

/** Reads a CSV with the head "seconds,mbps"; lines that begin with # are comments. `name` is for errors, which say the line. */
export function readTrace(text: string, name: string): Trace {
  const lines = text.split(/\r?\n/).map((line, k) => ({ line: line.trim(), number: k + 1 })).filter(({ line }) => line !== "" && !line.startsWith("#"));
  const head = lines.shift();
  if (head?.line.replaceAll(" ", "") !== HEAD) throw new Error(`${name}, line ${head?.number ?? 1}: "${head?.line ?? ""}", but a network trace begins with ${HEAD}`);
  const times: number[] = [];
  const rates: number[] = [];
  for (const { line, number } of lines) {
    const [time, mbps, ...rest] = line.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));
    const what = `${name}, line ${number}: "${line}"`;
    if (!Number.isFinite(time) || !Number.isFinite(mbps) || rest.length > 0 || mbps! < 0) throw new Error(`${what}, but a row is seconds and Mbit/s, two numbers from 0 with a comma`);
    if (times.length === 0 ? time !== 0 : !(time! > times.at(-1)!)) throw new Error(`${what}, but times begin with 0 and rise`);
    times.push(time!);
    rates.push(mbps! * 125_000);
  }
  if (!rates.some((rate) => rate > 0)) throw new Error(`${name} gives no byte at any time: give a rate above 0 somewhere`);
  return { times, rates, duration: times.length > 1 ? 2 * times.at(-1)! - times.at(-2)! : 1 };
}

/** Bytes a second at a time, s. */
export function rateAt({ times, rates, duration }: Trace, seconds: number): number {
  const time = seconds % duration;
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle]! <= time) low = middle;
    else high = middle - 1;
  }
  return rates[low]!;
}
