// Detects whether the player is in use, and taps on the picture, which are no drags of the camera.

const IDLE_AFTER = 2500; // ms
const TAP_TIME = 350; // ms
const TAP_WAY = 6; // px

export interface Tap {
  readonly touch: boolean;
  readonly double: boolean;
}

/** Calls `idle(true)` after a while without input, `idle(false)` at the next input. */
export class Activity {
  #timer = 0;
  #idle: (idle: boolean) => void;

  constructor(idle: (idle: boolean) => void) {
    this.#idle = idle;
  }

  connect(target: HTMLElement, signal: AbortSignal): void {
    for (const type of ["pointermove", "pointerdown", "keydown", "focusin"]) {
      target.addEventListener(type, () => this.touch(), { signal });
    }
    // A finger leaves with each tap: what a tap has shown stays for its time.
    target.addEventListener("pointerleave", ({ pointerType }) => { if (pointerType !== "touch") this.#sleep(); }, { signal });
    signal.addEventListener("abort", () => clearTimeout(this.#timer));
  }

  touch(): void {
    this.#idle(false);
    clearTimeout(this.#timer);
    this.#timer = window.setTimeout(() => this.#sleep(), IDLE_AFTER);
  }

  #sleep(): void {
    clearTimeout(this.#timer);
    this.#idle(true);
  }
}

/** Calls `tap` where the picture is clicked or touched without dragging. */
export function acceptTaps(target: HTMLElement, tap: (tap: Tap) => void, signal: AbortSignal): void {
  let down: PointerEvent | null = null;
  let last = -Infinity;
  target.addEventListener("pointerdown", (event) => {
    down = event.isPrimary && event.button === 0 ? event : null;
  }, { signal });
  target.addEventListener("pointerup", (event) => {
    if (down === null || event.pointerId !== down.pointerId) return;
    const way = Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY);
    const quick = event.timeStamp - down.timeStamp < TAP_TIME;
    down = null;
    if (way > TAP_WAY || !quick) return;
    const double = event.timeStamp - last < TAP_TIME;
    last = double ? -Infinity : event.timeStamp;
    tap({ touch: event.pointerType === "touch", double });
  }, { signal });
}
