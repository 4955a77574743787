// The player's shadow tree: picture, bar and panels. It uses what the element offers to everyone, and keeps no state of playback.

import { acceptDrops } from "../drop.ts";
import type { MeshreelPlayer } from "../element.ts";
import { icon } from "../icons.ts";
import { type Action, actionOf, isOfSound, takesKey, type Target } from "../keyboard.ts";
import { phoneLink } from "../phone_ar.ts";
import { styleSheet } from "../styles.ts";
import { copyLink, copyView, perform, saveLoop, saveScreenshot, type Surface, toggleVr } from "./actions.ts";
import { acceptTaps, Activity, type Tap } from "./activity.ts";
import { Bar } from "./bar.ts";
import { make } from "./dom.ts";
import { emptyPanel, ErrorPanel, HelpPanel, StatisticsPanel, Toasts } from "./panels.ts";

const TIME_EVERY = 100; // ms between two moves of the seek bar while it plays

export class Controls implements Surface {
  /** The box that holds the canvas. */
  readonly picture: HTMLElement;
  #player: MeshreelPlayer;
  #root = make("div", { class: "root", part: "root" });
  #poster = make("img", { class: "poster", part: "poster", alt: "", decoding: "async" });
  #file = make("input", { type: "file", accept: ".reel", class: "file", tabindex: "-1", "aria-hidden": "true" });
  #big: HTMLButtonElement;
  #bar: Bar;
  #error: ErrorPanel;
  #help: HelpPanel;
  #statistics: StatisticsPanel;
  #toasts = new Toasts();
  #activity: Activity;
  #stop = new AbortController();
  #queued = false;
  #timed = 0;

  constructor(player: MeshreelPlayer, shadow: ShadowRoot) {
    this.#player = player;
    shadow.adoptedStyleSheets = [styleSheet()];
    this.picture = make("div", {
      class: "picture", part: "picture", tabindex: "0", role: "application", "aria-roledescription": "3D view",
      "aria-label": "Recording. Drag to rotate; press question mark for keyboard shortcuts",
    });
    const open = () => this.#file.click();
    const act = (action: Action) => this.#act(action);
    this.#bar = new Bar(player, { act, openFile: open, screenshot: () => void saveScreenshot(player, this), copyLink: () => void copyLink(player, this), copyView: () => void copyView(player, this), enterAr: () => this.#enterAr(), recordLoop: () => void this.#record() });
    this.#error = new ErrorPanel(() => player.retry(), open);
    this.#help = new HelpPanel(() => this.toggleHelp());
    this.#statistics = new StatisticsPanel(player);
    this.#big = make("button", { type: "button", class: "big", part: "button big-play", "aria-label": "Play" }, icon("play"));
    this.#big.addEventListener("click", () => act("toggle"));
    this.#activity = new Activity((idle) => this.#root.toggleAttribute("data-idle", idle));
    this.#root.append(
      this.picture, this.#poster, this.#statistics.element, this.#big, make("div", { class: "spinner", part: "spinner" }), emptyPanel(open),
      this.#bar.element, this.#bar.settings, this.#toasts.element, this.#error.element, this.#help.element, this.#file,
      make("div", { class: "veil", "aria-hidden": "true" }, icon("open"), make("strong", {}, "Drop to play")),
    );
    shadow.append(this.#root);
    this.#file.addEventListener("change", () => this.#chosen());
  }

  /** Controls over the lower end of the picture. */
  get cover(): HTMLElement {
    return this.#bar.element;
  }

  /** The background's colour as the styles have it now. */
  get background(): string {
    this.picture.style.backgroundColor = this.#player.background;
    return getComputedStyle(this.picture).backgroundColor;
  }

  /** Without WebXR, by the phone's own app. */
  #enterAr(): void {
    const link = this.#bar.passthrough ? null : phoneLink(this.#player);
    if (link === null) void toggleVr(this.#player, this, true);
    else link.click();
  }

  /** Records one loop; asked again, ends it early. */
  async #record(): Promise<void> {
    const canvas = this.picture.querySelector("canvas");
    if (this.#bar.recording || !canvas) return this.#player.pause();
    this.#bar.recording = true;
    this.refresh();
    await saveLoop(this.#player, this, canvas);
    this.#bar.recording = false;
    this.refresh();
  }

  connect(): void {
    this.#stop.abort();
    this.#stop = new AbortController();
    const { signal } = this.#stop;
    const player = this.#player;
    this.#activity.connect(this.#root, signal);
    player.addEventListener("keydown", (event) => this.#key(event), { signal });
    acceptTaps(this.picture, (tap) => this.#tap(tap), signal);
    acceptDrops(this.#root, {
      welcome: () => player.controls,
      open: (file) => this.#openFile(file),
      over: (inside) => this.#root.toggleAttribute("data-over", inside),
    }, signal);
    document.addEventListener("fullscreenchange", () => this.refresh(), { signal });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => player.applyBackground(), { signal });
    this.#root.addEventListener("pointerdown", (event) => this.#outside(event), { signal });
    void this.#findHeadset(signal);
    this.refresh();
  }

  disconnect(): void {
    this.#stop.abort();
    this.#toasts.clear();
    this.#statistics.refresh();
  }

  /** Brings all that is shown up to date, once for all changes of this moment. */
  refresh(): void {
    if (this.#queued) return;
    this.#queued = true;
    queueMicrotask(() => {
      this.#queued = false;
      this.#write();
    });
  }

  /** After each picture: moves the seek bar, not more often than the eye needs. */
  drawn(canvas: HTMLCanvasElement, frame: number): void {
    this.#root.setAttribute("data-drawn", "");
    if (this.#player.controls) this.#bar.seek.drawn(canvas, frame);
    const now = performance.now();
    if (now - this.#timed < TIME_EVERY || !this.#player.controls) return;
    this.#timed = now;
    this.#bar.refreshTime();
  }

  onStage(type: string): void {
    if (type === "lost") this.warn("The graphics driver was reset; waiting for it");
    if (type !== "change" && type !== "camerachange") this.refresh();
  }

  warn(text: string): void {
    if (this.#player.controls) this.#toasts.warn(text);
  }

  tell(text: string): void {
    this.#toasts.tell(text);
  }

  toggleHelp(): void {
    this.#bar.toggleSettings(false);
    this.#help.toggle(!this.#help.open);
    if (!this.#help.open) this.picture.focus({ preventScroll: true });
  }

  close(): void {
    if (this.#help.open) this.toggleHelp();
    this.#bar.toggleSettings(false);
  }

  #write(): void {
    const player = this.#player;
    const closed = player.info === null && player.error === null && !player.waiting;
    const states: Record<string, boolean> = {
      "data-controls": player.controls,
      "data-empty": closed && player.src === "",
      "data-error": player.error !== null,
      "data-playing": !player.paused && !player.ended,
      "data-started": !player.paused || player.currentTime > 0 || (player.readyState > 0 && this.#root.hasAttribute("data-started")),
      "data-waiting": player.waiting,
    };
    for (const [name, holds] of Object.entries(states)) this.#root.toggleAttribute(name, holds);
    if (closed || player.readyState === 0) this.#root.removeAttribute("data-drawn");
    if (this.#poster.getAttribute("src") !== player.poster) this.#showPoster(player.poster);
    this.#error.show(player.error);
    this.#statistics.refresh();
    if (player.controls) this.#bar.refresh();
  }

  #showPoster(address: string): void {
    if (address === "") this.#poster.removeAttribute("src");
    else this.#poster.src = address;
  }

  #act(action: Action): void {
    perform(action, this.#player, this);
    this.refresh();
  }

  #key(event: KeyboardEvent): void {
    const player = this.#player;
    if (!player.controls || event.defaultPrevented) return;
    const target = event.composedPath()[0];
    if (target instanceof Element && takesKey(target as Target, event.key)) {
      if (event.key === "Escape") this.close();
      return;
    }
    const action = actionOf(event);
    if (action === null || (isOfSound(action) && !player.info?.hasAudio)) return;
    if (action !== "close") event.preventDefault();
    this.#act(action);
  }

  #tap({ touch, double }: Tap): void {
    if (!this.#player.controls || this.#player.info === null) return;
    if (!touch) {
      this.#act("toggle");
      if (double) this.#act("fullscreen");
    } else if (this.#player.paused) this.#act("toggle");
  }

  #outside(event: PointerEvent): void {
    const path = event.composedPath();
    if (!path.includes(this.#bar.settings) && !path.some((node) => node instanceof Element && node.classList.contains("more"))) {
      this.#bar.toggleSettings(false);
    }
    if (path.includes(this.picture)) this.picture.focus({ preventScroll: true });
  }

  #chosen(): void {
    const file = this.#file.files?.[0];
    if (file) this.#openFile(file);
    this.#file.value = "";
  }

  #openFile(file: File): void {
    this.#bar.toggleSettings(false);
    this.#player.load(file);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.#player.play().catch(() => undefined);
  }

  async #findHeadset(signal: AbortSignal): Promise<void> {
    [this.#bar.headset, this.#bar.passthrough] = await Promise.all([this.#player.vrSupported(), this.#player.arSupported()]);
    if (!signal.aborted) this.refresh();
  }
}
