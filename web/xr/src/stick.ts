// A thumbstick: a tap to a side, a side that is held, a click.

export interface StickActions {
  /** Pushed to a side (-1 left, 1 right) and soon let go. */
  tap(side: number): void;
  /** Held to a side: once every `REPEAT`. */
  hold(side: number): void;
  click(): void;
}

const PUSHED = 0.6; // of the way to the edge
const LET_GO = 0.3;
const HELD = 350; // ms until a push is no tap
const REPEAT = 250; // ms between two calls of `hold`

export class Stick {
  readonly #actions: StickActions;
  #side = 0;
  #since = 0; // ms, of the push
  #next = 0; // ms, of the next call of `hold`
  #pressed = false;

  constructor(actions: StickActions) {
    this.#actions = actions;
  }

  /** Once a picture. `x` is -1 to 1, `now` milliseconds. */
  update(x: number, pressed: boolean, now: number): void {
    if (pressed && !this.#pressed) this.#actions.click();
    this.#pressed = pressed;
    if (this.#side === 0) {
      if (Math.abs(x) > PUSHED) this.#push(Math.sign(x), now);
    } else if (this.#side * x < LET_GO) {
      const side = this.#side;
      this.#side = 0;
      if (now - this.#since < HELD) this.#actions.tap(side); // only now: a held one must not step, which pauses
    } else if (now >= this.#next) {
      this.#next = now + REPEAT;
      this.#actions.hold(this.#side);
    }
  }

  /** Forgets a push, as when the controller is gone. */
  reset(): void {
    this.#side = 0;
    this.#pressed = false;
  }

  #push(side: number, now: number): void {
    this.#side = side;
    this.#since = now;
    this.#next = now + HELD;
  }
}
