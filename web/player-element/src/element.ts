// <meshreel-player>: an element like <video>, whose picture can be looked at from all sides.

import type { Heard, Info, Packed, Playback } from "@meshreel/player-core/types";
import type { Bench } from "@meshreel/player-three/bench";
import { applyToPlayback, applyToStage } from "./apply.ts";
import { OBSERVED, PROPERTIES } from "./attributes.ts";
import { Controls } from "./controls/controls.ts";
import { PASSED } from "./events.ts";
import { type Ranges, ranges } from "./ranges.ts";
import { SectionKeeper } from "./section.ts";
import type { Engine } from "./stage.ts";
import type { Statistics } from "./stats.ts";
import { View } from "./view.ts";
import { Viewed } from "./viewed.ts";

declare global {
  interface HTMLElementTagNameMap {
    "meshreel-player": MeshreelPlayer;
  }
}

export class MeshreelPlayer extends Viewed {
  static readonly observedAttributes = OBSERVED;
  /** Factory of playbacks and stages; index.ts sets the real one before it defines the element. */
  static engine: Engine;

  #controls: Controls;
  #playback: Playback | null = null;
  #passing = new AbortController();
  #error: Error | null = null;
  #waiting = false;
  #playable = false;
  #sectionKeeper = new SectionKeeper();
  #wished = false; // it plays, or would if it could
  #startAt = 0; // s; where to begin once the head is there
  #left: boolean | null = null; // true if it played when it was taken out of the document; null if it was not open
  #queued = false;
  #early: Event[] = []; // that say there is a picture, and came before it could be drawn

  constructor() {
    super();
    const internals = this.attachInternals();
    internals.role = "region";
    internals.ariaLabel = "Recording"; // an aria-label of the page goes before it
    this.#controls = new Controls(this, this.attachShadow({ mode: "open" }));
  }

  connectedCallback(): void {
    this.upgrade(...PROPERTIES);
    this.#controls.connect();
    if (this.#playback === null) this.#queueLoad();
  }

  disconnectedCallback(): void {
    // A node that is moved is taken out and put in again at once: only one that stays out is closed.
    queueMicrotask(() => {
      if (this.isConnected) return;
      this.#startAt = this.currentTime;
      if (this.#playback !== null) this.#left = this.#wished;
      this.#controls.disconnect();
      this.#close();
      this.view?.dispose();
      this.view = null;
    });
  }

  attributeChangedCallback(name: string, before: string | null, after: string | null): void {
    if (name === "src") {
      this.file = this.#left = null;
      this.#startAt = 0;
      if (this.isConnected) this.#queueLoad();
    } else if (before !== after && !this.restoring) {
      const refusal = this.restore(name, before, after);
      if (refusal === null) this.#apply(name);
      else this.#onPlayback(new CustomEvent("warning", { detail: refusal }));
    }
    this.#controls.refresh();
  }

  /** Opens a file, or without one what was open before, from its start. */
  load(file?: Blob): void {
    if (file) this.file = file;
    this.#startAt = 0;
    this.#open();
  }

  /** Plays. Rejects where there is nothing to play. */
  async play(): Promise<void> {
    if (this.#playback === null && this.isConnected) this.#open();
    if (this.#playback === null) throw this.#error ?? new DOMException("there is nothing to play: set src", "NotSupportedError");
    this.view?.wake();
    await this.#play(this.#playback);
  }

  pause(): void {
    this.#wished = false;
    this.#playback?.pause();
  }

  get currentTime(): number {
    return this.#playback?.info ? this.#playback.currentTime : this.#startAt;
  }
  set currentTime(seconds: number) {
    if (!Number.isFinite(seconds)) throw new TypeError(`currentTime ${seconds}: a finite number of seconds is needed`);
    this.#startAt = Math.max(0, seconds);
    if (this.#playback) this.#playback.currentTime = this.#startAt;
    this.view?.wake();
  }

  get duration(): number {
    return this.#playback?.info ? this.#playback.duration : NaN;
  }
  get paused(): boolean {
    return this.#playback?.paused ?? true;
  }
  get ended(): boolean {
    return this.#playback?.ended ?? false;
  }
  get seeking(): boolean {
    return this.#playback?.seeking ?? false;
  }
  get error(): Error | null {
    return this.#error;
  }
  get currentSrc(): string {
    return this.file ? "" : this.src;
  }
  /** 0 nothing, 1 the head, 2 this frame, 4 the next ones too: as HTMLMediaElement.readyState. */
  get readyState(): 0 | 1 | 2 | 4 {
    if (!this.#playback?.info) return 0;
    if (!this.#playable) return 1;
    return this.#waiting || this.seeking ? 2 : 4;
  }
  get buffered(): Ranges {
    const ahead = this.#playback?.stats.bufferedSeconds ?? 0;
    return ranges(this.currentTime, Math.min(this.duration, this.currentTime + ahead));
  }
  get seekable(): Ranges {
    return ranges(0, this.duration);
  }

  override get info(): Info | null {
    return this.#playback?.info ?? null;
  }
  get currentFrame(): number {
    return this.#playback?.currentFrame ?? 0;
  }
  /** Player of the recording's sound; null if there is none, or not yet. */
  get audio(): Heard["voice"] {
    return this.#playback?.sound.voice ?? null;
  }
  /** True while frames or bytes are waited for. */
  get waiting(): boolean {
    return this.#playback !== null && this.#error === null && (this.#waiting || this.seeking);
  }
  get statistics(): Statistics | null {
    if (!this.#playback || !this.view) return null;
    return { ...this.#playback.stats, ...this.view.stage.stats, fps: this.view.fps, frameMs: this.view.frameMs, drawn: this.view.drawn };
  }
  /** Pauses and moves by a number of frames; a negative one goes back. */
  step(frames: number): void {
    this.#wished = false;
    this.#playback?.step(frames);
    this.view?.wake();
  }
  /** Gives the keyboard to the picture, as the element itself takes no focus. */
  override focus(options?: FocusOptions): void {
    this.#controls.picture.focus(options);
  }
  /** Opens a source that failed again, and continues where it stopped. */
  retry(): void {
    this.#startAt = this.currentTime;
    this.#open(this.#wished);
  }
  /** Shows the scene in the headset; with `passthrough` in the viewer's own room. To be called from a click. */
  async enterVr(passthrough = false): Promise<void> {
    if (!this.view) throw new DOMException("there is no picture yet", "InvalidStateError");
    await this.view.enterVr({
      toggle: () => (this.paused ? void this.play().catch(() => undefined) : this.pause()),
      step: (frames) => this.step(frames),
      seekBy: (seconds) => (this.currentTime += seconds),
      time: () => [this.currentTime, this.duration],
    }, passthrough);
  }
  /** Lets a bench collect from now on what is decoded and drawn; what is given back ends that. Error where nothing is open. */
  measure(bench: Bench): () => void {
    if (!this.view || !this.#playback) throw new DOMException("there is nothing to measure: set src", "InvalidStateError");
    return this.view.measure(this.#playback, bench);
  }

  #queueLoad(): void {
    if (this.#queued) return;
    this.#queued = true;
    queueMicrotask(() => {
      const isAsked = this.#queued && this.isConnected;
      this.#queued = false;
      if (isAsked && this.#left === null && this.preload === "none" && !this.autoplay && !this.file) this.#close();
      else if (isAsked) this.#open(this.#left === true);
      this.#controls.refresh();
    });
  }

  /** `wished`: it is to play though it has no `autoplay`. */
  #open(wished = false): void {
    this.#close();
    this.#left = this.#error = null;
    this.#queued = false; // `play` came first
    this.#controls.refresh();
    const source = this.file ?? this.src;
    if (source === "") return;
    const loading = MeshreelPlayer.engine.load();
    if (loading === null && !this.#hasView()) return;
    const playback = (this.#playback = MeshreelPlayer.engine.open(source, this));
    if (this.#startAt > 0) playback.currentTime = this.#startAt;
    this.#waiting = true;
    this.#listen(playback);
    this.dispatchEvent(new Event("loadstart"));
    if (loading === null) this.view!.show(playback);
    else loading.then(() => this.#showLate(playback), (error: Error) => this.#playback === playback && this.#giveUp(error));
    const plays = wished || (this.autoplay && !matchMedia("(prefers-reduced-motion: reduce)").matches);
    if (plays) this.#play(playback).catch(() => undefined); // reported by the error event
  }

  #play(playback: Playback): Promise<void> {
    this.#wished = true;
    return playback.play();
  }

  #close(): void {
    if (this.#playback === null) return;
    this.view?.show(null);
    this.#playback.dispose(); // reports what to release
    this.#passing.abort();
    this.#playback = null;
    this.#waiting = this.#playable = this.#wished = false;
    this.#early = [];
    this.dispatchEvent(new Event("emptied"));
  }

  /** Shows what was opened before there was anything to show it with. */
  #showLate(playback: Playback): void {
    if (this.#playback !== playback || !this.#hasView()) return;
    this.view!.show(playback);
    if (playback.info) this.#begin();
    for (const event of this.#early.splice(0)) this.#onPlayback(event);
  }

  /** False where there can be none, which is reported. */
  #hasView(): boolean {
    try {
      this.view ??= this.#makeView();
      return true;
    } catch (error) {
      this.#giveUp(error instanceof Error ? error : new Error(String(error)));
      return false;
    }
  }

  #giveUp(error: Error): void {
    this.#close();
    this.#fail(error);
  }

  #makeView(): View {
    const { picture, cover } = this.#controls;
    const view = new View(MeshreelPlayer.engine, picture, cover, (event) => this.#onView(event));
    for (const name of ["mode", "up", "ground", "exposure", "autorotate", "fly"]) applyToStage(name, this, view.stage);
    view.stage.background = this.#controls.background;
    return view;
  }

  #listen(playback: Playback): void {
    this.#passing = new AbortController();
    const { signal } = this.#passing;
    for (const type of PASSED) playback.addEventListener(type, (event) => this.#onPlayback(event), { signal });
    playback.addEventListener("ready", (event) => this.#onReady((event as CustomEvent<Packed>).detail), { signal });
    playback.addEventListener("release", (event) => this.view?.stage.release((event as CustomEvent<Packed>).detail), { signal });
  }

  #onReady(packed: Packed): void {
    if (!this.view) return;
    try {
      this.view.stage.prepare(packed);
    } catch (error) {
      this.#onPlayback(new CustomEvent("warning", { detail: error }));
    }
    this.view.wake(); // it may be what is waited for
  }

  #onPlayback(event: Event): void {
    const detail: unknown = event instanceof CustomEvent ? event.detail : undefined;
    if (!this.view && ["canplay", "playing"].includes(event.type)) return void this.#early.push(event);
    if (event.type === "loadedmetadata") this.#begin();
    if (event.type === "canplay") this.#playable = true;
    if (["canplay", "playing", "seeked"].includes(event.type) || (event.type === "pause" && this.#playable)) this.#waiting = false;
    if (event.type === "waiting") this.#waiting = true;
    if (event.type === "seeking" || event.type === "emptied") this.#sectionKeeper.forget();
    if (event.type === "volumechange" && this.#playback) this.muted = this.#playback.sound.muted;
    if (event.type === "ended") {
      this.#wished = false;
      queueMicrotask(() => this.#sectionKeeper.keep(this));
    }
    if (event.type === "error") {
      this.#fail(detail instanceof Error ? detail : new Error("unknown"));
      return;
    }
    this.dispatchEvent(detail === undefined ? new Event(event.type) : new CustomEvent(event.type, { detail }));
    if (event.type === "warning" && detail instanceof Error) this.#controls.warn(detail.message);
    this.view?.wake();
    this.#controls.refresh();
  }

  #begin(): void {
    const info = this.#playback?.info;
    if (!info || !this.view) return;
    this.view.stage.begin(info);
    applyToStage("mode", this, this.view.stage); // if none is set, the recording decides
    if (this.getAttribute("camera")) applyToStage("camera", this, this.view.stage);
  }

  #fail(error: Error): void {
    this.#error = error;
    this.#waiting = false;
    this.dispatchEvent(new CustomEvent("error", { detail: error }));
    this.#controls.refresh();
  }

  #onView(event: Event): void {
    if (event.type === "drawn") {
      if (this.view?.shows) this.#controls.drawn(this.view.canvas, this.view.frame);
      this.#sectionKeeper.keep(this);
    } else {
      if (event.type !== "change") this.dispatchEvent(new Event(event.type));
      this.#controls.onStage(event.type);
    }
  }

  #apply(name: string): void {
    if (this.#playback) applyToPlayback(name, this, this.#playback);
    if (this.view) applyToStage(name, this, this.view.stage);
    if (name === "background" || name === "theme") this.applyBackground();
    this.view?.refresh();
  }

  /** Takes the background's colour from the styles again. */
  applyBackground(): void {
    const colour = this.#controls.background;
    if (!this.view || this.view.stage.background === colour) return;
    this.view.stage.background = colour;
    this.view.refresh();
  }
}
