// Numbers as people read them. All functions take numbers from streams, so none may throw.

const SHORT = 60; // s; a longer recording's time is shown in whole seconds

/** Digits behind the point of a recording's times: two of a short one whose frames come faster than tenths, so that each has its own. */
export function timeDigits(duration: number, frameRate: number): number {
  if (!(duration < SHORT)) return 0;
  return frameRate > 10 ? 2 : 1;
}

/** "1:05", or "0:03.25" with digits behind the point; hours where there are any. */
export function formatTime(seconds: number, digits = 0): string {
  const safe = Number.isFinite(seconds) ? Math.max(0, seconds) : 0;
  const units = Math.floor(safe * 10 ** digits + 1e-6) / 10 ** digits;
  const hours = Math.floor(units / 3600);
  const minutes = Math.floor(units / 60) % 60;
  const rest = units - hours * 3600 - minutes * 60;
  const text = rest.toFixed(digits).padStart(digits > 0 ? digits + 3 : 2, "0");
  return hours > 0 ? `${hours}:${String(minutes).padStart(2, "0")}:${text}` : `${minutes}:${text}`;
}

/** "1 minute 5 seconds", for screen readers. */
export function speakTime(seconds: number): string {
  const safe = Number.isFinite(seconds) ? Math.max(0, seconds) : 0;
  const minutes = Math.floor((safe + 0.05) / 60);
  const rest = Math.max(0, Math.round((safe - minutes * 60) * 10) / 10);
  const second = `${rest} ${rest === 1 ? "second" : "seconds"}`;
  return minutes > 0 ? `${minutes} ${minutes === 1 ? "minute" : "minutes"} ${second}` : second;
}

const PREFIXES = ["", "k", "M", "G", "T"];

/** "1.25 MB": three digits and a power of 1000. */
export function formatAmount(value: number, unit: string): string {
  if (!Number.isFinite(value) || value <= 0) return `0 ${unit}`;
  let scaled = value;
  let prefix = 0;
  while (scaled >= 999.5 && prefix < PREFIXES.length - 1) {
    scaled /= 1000;
    prefix++;
  }
  const digits = prefix === 0 || scaled >= 99.95 ? 0 : scaled >= 9.995 ? 1 : 2;
  return `${scaled.toFixed(digits)} ${PREFIXES[prefix]}${unit}`;
}

/** "2.41 Mbit/s" of a number of megabits a second. */
export function formatRate(mbps: number): string {
  return formatAmount(mbps * 1e6, "bit/s");
}

/** "12,480". */
export function formatCount(value: number): string {
  return Math.round(Number.isFinite(value) ? value : 0).toLocaleString("en");
}

/** "0.5x", "1x". */
export function formatSpeed(speed: number): string {
  return `${Number(speed.toFixed(2))}×`;
}

/** A file's name without its ending, of an address; "meshreel" where it has none. */
export function recordingName(address: string): string {
  const last = address.split(/[?#]/)[0]!.split("/").at(-1)!;
  let name = last;
  try {
    name = decodeURIComponent(last);
  } catch {
    // a stray percent sign stays as it is
  }
  return name.replace(/\.reel$/, "") || "meshreel";
}
