// Content time from display time.

import type { Direction } from "../types.ts";

const LONGEST_STEP = 0.5; // s of display time; where nothing was displayed for longer, time stood still
const PULL = 0.15; // s in which two thirds of a difference to what leads are made up for: it may not tell its time evenly
const NEAR = 0.03; // s that it is never off by, but where it stands still until that is so
const ASTRAY = 0.5; // s from which on what leads has to come back: it went on while nothing was displayed
const ROUNDING = 1e-6; // s; a time that is less than this short of a frame's own is that frame's

/** When each frame is shown, s from the first. No table: a head of some kilobytes may announce millions of frames. */
export class Timeline {
  readonly frameCount: number;
  readonly duration: number; // s
  /** When a frame begins; of `frameCount`, the end of the last. */
  readonly startOf: (frame: number) => number;

  constructor(frameCount: number, startOf: (frame: number) => number) {
    this.frameCount = frameCount;
    this.startOf = startOf;
    this.duration = startOf(frameCount);
  }

  /** The frame that is shown at a time; the first or the last one outside. */
  frameAt(time: number): number {
    let [low, high] = [0, this.frameCount - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.startOf(middle) <= time + ROUNDING) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** Position of a time between a frame's start and its end, 0 to 1. */
  blendAt(time: number, frame: number): number {
    const start = this.startOf(frame);
    return Math.min(1, Math.max(0, (time - start) / (this.startOf(frame + 1) - start)));
  }

  /** The nearest time from 0 to the end. */
  clamp(time: number): number {
    return Math.min(Math.max(time, 0), this.duration);
  }
}

/** A leader that a clock may follow. */
export interface Lead {
  /** Its position, s, when the running clock is at `time`; NaN while the clock must wait; null if it does not lead. */
  at(time: number, rate: number): number | null;
  /** The clock stands, or jumps. */
  rest(): void;
}

/** Runs with the display: moves `time` by what has passed between two pictures. Allocates nothing while it runs. */
export class Clock {
  readonly timeline: Timeline;
  time = 0; // s
  rate = 1;
  loop = false;
  lead: Lead | null = null; // forwards; backwards it rests
  #direction: Direction = "normal";
  #isBack = false; // time goes down
  #isRunning = false;
  #last = NaN; // ms, of the picture before
  #before = { time: 0, isBack: false }; // at the picture before

  constructor(timeline: Timeline) {
    this.timeline = timeline;
  }

  get isRunning(): boolean {
    return this.#isRunning;
  }

  /** Runs from the next picture on. */
  start(): void {
    this.#isRunning = true;
    this.#last = NaN;
  }

  stop(): void {
    this.#isRunning = false;
    this.lead?.rest();
  }

  get direction(): Direction {
    return this.#direction;
  }
  set direction(direction: Direction) {
    this.#direction = direction;
    this.#isBack = direction === "reverse";
    this.lead?.rest();
  }

  get isBack(): boolean {
    return this.#isBack;
  }

  get isAtEnd(): boolean {
    if (this.loop) return false;
    return this.#isBack ? this.time <= 0 : this.#direction === "normal" && this.time >= this.timeline.duration;
  }

  /** Where it goes on from its end, s; from there to and fro begins with its way to the end. */
  begin(): number {
    this.#isBack = this.#direction === "reverse";
    return this.#isBack ? this.timeline.duration : 0;
  }

  /** Goes on to the time of a picture that is displayed at `now`, ms of any clock that does not go back. */
  advance(now: number): void {
    const passed = (now - this.#last) / 1000;
    this.#last = now;
    this.#before.time = this.time;
    this.#before.isBack = this.#isBack;
    if (!this.#isRunning || !(passed > 0)) return;
    const step = Math.min(passed, LONGEST_STEP);
    if (this.#isBack) this.time -= step * this.rate;
    else this.#step(step);
    if (this.#isBack ? this.time <= 0 : this.time >= this.timeline.duration) this.#turn(this.#isBack ? -this.time : this.time - this.timeline.duration);
  }

  /** Goes on from an end that was passed by so many seconds, or stays there. */
  #turn(beyond: number): void {
    const { duration } = this.timeline;
    const isAlternate = this.#direction === "alternate";
    this.lead?.rest();
    if (!this.loop && !(isAlternate && !this.#isBack)) this.time = this.#isBack ? 0 : duration;
    else {
      if (isAlternate) this.#isBack = !this.#isBack;
      this.time = this.#isBack ? duration - (beyond % duration) : beyond % duration;
    }
  }

  /** Stops, and takes the last step back: what it led to is not at hand. */
  hold(): void {
    this.time = this.#before.time;
    this.#isBack = this.#before.isBack;
    this.stop();
  }

  #step(passed: number): void {
    const led = this.lead?.at(this.time, this.rate) ?? null;
    if (Number.isNaN(led)) return;
    const expected = this.time + passed * this.rate;
    const error = led === null ? 0 : led - expected;
    if (Math.abs(error) > ASTRAY) this.lead?.rest(); // it begins again where the clock is
    else {
      const pulled = expected + error * (1 - Math.exp(-passed / PULL));
      this.time = Math.max(this.time, led === null ? expected : Math.min(Math.max(pulled, led - NEAR), led + NEAR));
    }
  }
}
