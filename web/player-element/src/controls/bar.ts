// The bar below the picture: seek bar, buttons, and the settings that open above it.

import type { MeshreelPlayer } from "../element.ts";
import { formatTime, timeDigits } from "../format.ts";
import type { Action } from "../keyboard.ts";
import { phoneLink } from "../phone_ar.ts";
import type { Direction } from "@meshreel/player-core/types";
import type { Mode } from "@meshreel/player-three/modes";
import { parseLayers } from "../attributes.ts";
import { canRecord } from "../record.ts";
import { nextCut } from "../section.ts";
import { DIRECTION_CHOICES, layersChoices, layersValue, modeChoices, speedChoices } from "./choices.ts";
import { Button, type Look, make, Menu, setText } from "./dom.ts";
import { SeekBar } from "./seek.ts";
import { Volume } from "./volume.ts";

/** Interface of the surrounding controls for the bar. */
export interface BarActs {
  act(action: Action): void;
  screenshot(): void;
  openFile(): void;
  copyLink(): void;
  copyView(): void;
  enterAr(): void;
  recordLoop(): void;
}

export class Bar {
  readonly element: HTMLElement;
  readonly settings: HTMLElement;
  readonly seek: SeekBar;
  /** True if this browser has a headset; determined when the player enters a document. */
  headset = false;
  passthrough = false; // and whether it shows the viewer's own room
  recording = false; // a video of a loop
  #player: MeshreelPlayer;
  #acts: BarActs;
  #more: Button;
  #parts: { refresh(): void }[] = [];
  #time = make("span", { class: "time", part: "time" });
  #now = make("span", { class: "now" });
  #all = make("span", { class: "all" });

  constructor(player: MeshreelPlayer, acts: BarActs) {
    this.#player = player;
    this.#acts = acts;
    this.seek = new SeekBar(player);
    this.settings = make("div", { class: "settings", part: "settings", role: "group", "aria-label": "Settings", id: "settings" });
    this.settings.hidden = true;
    this.settings.append(...this.#menus(), ...this.#tools().map((button) => button.element), ...this.#rows().map((button) => button.element));
    this.#more = this.#button("more", "", () => ({ icon: "more", label: "Settings" }), () => this.toggleSettings());
    this.#more.element.setAttribute("aria-expanded", "false");
    this.#more.element.setAttribute("aria-controls", "settings");
    this.#time.append(this.#now, this.#all);
    const row = make("div", { class: "row" }, ...this.#transport(), this.#time, make("span", { class: "space" }));
    const volume = new Volume(player, () => acts.act("mute"));
    this.#parts.push(volume);
    row.append(volume.element, ...this.#tools().map((button) => button.element), this.#more.element, ...this.#screens());
    this.element = make("div", { class: "bar", part: "controls", role: "group", "aria-label": "Player controls" }, this.seek.element, row);
  }

  get settingsOpen(): boolean {
    return !this.settings.hidden;
  }

  toggleSettings(open = this.settings.hidden): void {
    if (open === this.settingsOpen) return;
    const inside = this.settings.matches(":focus-within");
    this.settings.hidden = !open;
    this.#more.element.setAttribute("aria-expanded", String(open));
    if (open) this.settings.querySelector<HTMLElement>("select:enabled, button:enabled")?.focus({ preventScroll: true });
    else if (inside) this.#more.element.focus({ preventScroll: true });
  }

  refresh(): void {
    this.seek.refresh();
    for (const part of this.#parts) part.refresh();
    this.refreshTime();
  }

  /** The part of `refresh` that changes with each frame. */
  refreshTime(): void {
    this.seek.refresh();
    const { duration, currentTime, currentFrame, info } = this.#player;
    const digits = timeDigits(duration, info?.frameRate ?? 0);
    const [now, all] = this.#player.frames && info ? [currentFrame + 1, info.frameCount] : [formatTime(currentTime, digits), duration > 0 ? formatTime(duration, digits) : "–"];
    setText(this.#now, String(now));
    setText(this.#all, ` / ${all}`);
    this.#time.title = info ? `Frame ${currentFrame + 1} of ${info.frameCount}` : "";
  }

  #button(name: string, hint: string, look: () => Look, act: () => void): Button {
    const button = new Button(name, hint, look, act);
    this.#parts.push(button);
    return button;
  }

  #transport(): HTMLElement[] {
    const player = this.#player;
    const known = () => player.duration > 0;
    const play = (): Look => {
      if (player.ended) return { icon: "replay", label: "Replay" };
      return player.paused ? { icon: "play", label: "Play" } : { icon: "pause", label: "Pause" };
    };
    return [
      this.#button("play", "K", play, () => this.#acts.act("toggle")),
      this.#button("step-back step", ",", () => ({ icon: "stepBack", label: "Previous frame", enabled: known() }), () => this.#acts.act("previousFrame")),
      this.#button("step-forward step", ".", () => ({ icon: "stepForward", label: "Next frame", enabled: known() }), () => this.#acts.act("nextFrame")),
    ].map((button) => button.element);
  }

  /** Made twice: in the bar, and as rows of the settings where the bar is too narrow for them. */
  #tools(): Button[] {
    const player = this.#player;
    const { act, screenshot } = this.#acts;
    const known = () => player.info !== null;
    return [
      this.#button("loop tool", "L", () => ({ icon: "loop", label: "Loop", pressed: player.loop }), () => act("loop")),
      this.#button("stats tool", "S", () => ({ icon: "stats", label: "Statistics", pressed: player.stats }), () => act("stats")),
      this.#button("screenshot tool", "", () => ({ icon: "camera", label: "Save screenshot", enabled: known() }), () => screenshot()),
      this.#button("fit tool", "0", () => ({ icon: "fit", label: "Reset view", enabled: known() }), () => act("fit")),
    ];
  }

  #rows(): Button[] {
    const player = this.#player;
    const { act } = this.#acts;
    const section = (): Look => {
      const label = { sectionFrom: "Set loop start", sectionTo: "Set loop end", sectionOff: "Clear loop" }[nextCut(player)];
      return { icon: "section", label, pressed: player.section !== null, enabled: player.duration > 0 };
    };
    const record = (): Look => ({
      icon: "record", label: this.recording ? "Stop recording" : "Record loop", pressed: this.recording, shown: canRecord(), enabled: player.duration > 0,
    });
    return [
      this.#button("repeat", "", section, () => act(nextCut(player))),
      this.#button("frames", "N", () => ({ icon: "frames", label: "Frame numbers", pressed: player.frames }), () => act("frames")),
      this.#button("autorotate", "R", () => ({ icon: "replay", label: "Auto-rotate", pressed: player.autoRotate }), () => act("autoRotate")),
      this.#button("fly", "G", () => ({ icon: "fly", label: "Fly mode", pressed: player.fly }), () => act("fly")),
      this.#button("record", "", record, () => this.#acts.recordLoop()),
      this.#button("share", "", () => ({ icon: "link", label: "Copy link", shown: player.share, enabled: player.info !== null }), () => this.#acts.copyLink()),
      this.#button("view", "", () => ({ icon: "camera", label: "Use this view", enabled: player.info !== null }), () => this.#acts.copyView()),
      this.#button("open", "", () => ({ icon: "open", label: "Open file" }), () => this.#acts.openFile()),
      this.#button("help", "?", () => ({ icon: "help", label: "Keyboard shortcuts" }), () => this.#acts.act("help")),
    ];
  }

  #screens(): HTMLElement[] {
    const player = this.#player;
    const vr = (): Look => ({
      icon: "vr", label: player.presenting ? "Exit VR" : "Enter VR", shown: this.headset, enabled: player.info !== null,
    });
    const ar = (): Look => {
      const onPhone = !this.passthrough && phoneLink(player) !== null;
      return { icon: "ar", label: "View in your space", shown: (this.passthrough || onPhone) && !player.presenting, enabled: onPhone || player.info !== null };
    };
    const screen = (): Look => {
      const full = document.fullscreenElement !== null;
      return { icon: full ? "exitFullscreen" : "fullscreen", label: full ? "Exit full screen" : "Full screen", shown: document.fullscreenEnabled };
    };
    return [
      this.#button("vr", "V", vr, () => this.#acts.act("vr")).element,
      this.#button("ar", "", ar, () => this.#acts.enterAr()).element,
      this.#button("fullscreen", "F", screen, () => this.#acts.act("fullscreen")).element,
    ];
  }

  #menus(): HTMLElement[] {
    const player = this.#player;
    const most = () => player.info?.mostLayers ?? 0;
    const menus = [
      new Menu("speed", "Playback speed", () => ({ choices: speedChoices(player.playbackRate), value: String(player.playbackRate) }),
        (value) => void (player.playbackRate = Number(value))),
      new Menu("direction", "Direction", () => ({ choices: DIRECTION_CHOICES, value: player.direction }),
        (value) => void (player.direction = value as Direction)),
      new Menu("layers", "Quality",
        () => ({ choices: layersChoices(most(), player.layers), value: layersValue(most(), player.layers), enabled: most() > 0 }),
        (value) => void (player.layers = parseLayers(value))),
      new Menu("mode", "Shading", () => ({ choices: modeChoices(player.info), value: player.mode }),
        (value) => void (player.mode = value as Mode)),
    ];
    this.#parts.push(...menus);
    return menus.map((menu) => menu.element);
  }
}
