// The seek bar: a range input over a drawn track that shows what was played and what is buffered.

import { formatTime, speakTime, timeDigits } from "../format.ts";
import type { MeshreelPlayer } from "../element.ts";
import { make, setText } from "./dom.ts";
import { Thumbnails } from "./thumbnails.ts";

const THUMB = 14; // px; as in styles/bar.ts

export class SeekBar {
  readonly element: HTMLElement;
  readonly input: HTMLInputElement;
  #player: MeshreelPlayer;
  readonly #label = make("span", { class: "at" });
  readonly #section = make("div", { class: "section" });
  readonly #thumbnails = new Thumbnails();
  #scrubbing = false;
  #resume = false; // it played before it was dragged
  #wanted: number | null = null;
  #part = 0; // of the recording, that was pointed at last

  constructor(player: MeshreelPlayer) {
    this.#player = player;
    this.input = make("input", {
      type: "range", min: "0", max: "0", step: "any", value: "0", part: "seek", class: "range", "aria-label": "Seek",
    });
    this.element = make("div", { class: "seek" }, make("div", { class: "track", part: "track" }, this.#section), this.input,
      make("span", { class: "tip", part: "tip", "aria-hidden": "true" }, this.#thumbnails.element, this.#label));
    this.input.addEventListener("input", () => this.#drag());
    this.input.addEventListener("change", () => this.#drop());
    this.element.addEventListener("pointermove", (event) => this.#hover(event));
    player.addEventListener("seeked", () => this.#follow());
    this.element.addEventListener("pointerleave", () => player.endGlimpses());
    player.addEventListener("emptied", () => {
      player.endGlimpses();
      this.#thumbnails.clear();
    });
  }

  refresh(): void {
    const { duration, currentTime, buffered } = this.#player;
    const known = duration > 0;
    this.input.disabled = !known;
    this.input.max = String(known ? duration : 0);
    if (!this.#scrubbing) this.input.value = String(currentTime);
    const time = this.#scrubbing ? Number(this.input.value) : currentTime;
    const end = buffered.length > 0 ? buffered.end(0) : currentTime;
    this.element.style.setProperty("--played", String(known ? time / duration : 0));
    const [from, to] = this.#player.section ?? [0, 0];
    this.#section.hidden = to === 0;
    this.element.style.setProperty("--from", String(known ? from / duration : 0));
    this.element.style.setProperty("--to", String(known ? Math.min(1, to / duration) : 0));
    this.element.style.setProperty("--buffered", String(known ? end / duration : 0));
    this.input.setAttribute("aria-valuetext", known ? `${speakTime(time)} of ${speakTime(duration)}` : "nothing is open");
  }

  /** After a picture of a frame was drawn into a canvas, in the same task. */
  drawn(canvas: HTMLCanvasElement, frame: number): void {
    const { info, presenting } = this.#player;
    if (info && !presenting) this.#thumbnails.take(canvas, frame, info.frameCount);
  }

  #drag(): void {
    if (!this.#scrubbing) {
      this.#scrubbing = true;
      this.element.toggleAttribute("data-scrubbing", true); // without a mouse the tip is seen while it lasts
      this.#resume = !this.#player.paused && !this.#player.ended;
      if (this.#resume) this.#player.pause();
    }
    this.#wanted = Number(this.input.value);
    // While one seek is under way the latest position waits, so that dragging never asks for more than can be shown.
    if (!this.#player.seeking) this.#follow();
    this.refresh();
  }

  #follow(): void {
    if (this.#wanted === null) return;
    const wanted = this.#wanted;
    this.#wanted = null;
    this.#player.currentTime = wanted;
  }

  #drop(): void {
    this.#follow();
    this.#scrubbing = false;
    this.element.toggleAttribute("data-scrubbing", false);
    if (this.#resume) this.#player.play().catch(() => undefined); // reported by the error event
    this.#resume = false;
    this.refresh();
  }

  #hover(event: PointerEvent): void {
    const { duration } = this.#player;
    const { left, width } = this.element.getBoundingClientRect();
    if (!(duration > 0) || width <= THUMB) return;
    const part = Math.min(1, Math.max(0, (event.clientX - left - THUMB / 2) / (width - THUMB)));
    this.element.style.setProperty("--hover", String(part));
    const { frameRate, frameCount } = this.#player.info ?? { frameRate: 0, frameCount: 0 };
    const frame = Math.min(frameCount, Math.floor(part * duration * frameRate + 1e-6) + 1);
    setText(this.#label, `${formatTime(part * duration, timeDigits(duration, frameRate))} · ${frame}`);
    this.#look(part, frameCount);
  }

  /** Shows the picture of a share of the recording, as soon as there is one. */
  #look(part: number, frameCount: number): void {
    this.#part = part;
    const missing = this.#thumbnails.show(part, frameCount);
    if (missing === null || this.#scrubbing || this.#player.waiting) return;
    this.#player.glimpse(missing * this.#player.duration, (canvas, frame) => {
      this.#thumbnails.take(canvas, frame, frameCount);
      this.#thumbnails.show(this.#part, frameCount);
    });
  }
}
