// Properties that are attributes: the attribute is the one place where a setting is kept, so HTML, scripts and controls agree.

import type { Direction, Info, Layers } from "@meshreel/player-core/types";
import type { Mode } from "@meshreel/player-three/modes";
import * as parse from "./attributes.ts";
import type { Up } from "@meshreel/player-three/upright";

// Pages that are made on a server import this where there are no elements.
const Element = globalThis.HTMLElement ?? (class {} as typeof HTMLElement);

/** The base class of the element, with nothing but its reflected properties. */
export class Reflected extends Element {
  /** Properties set on the node before the element was defined hide the accessors; this sets them again. */
  protected upgrade(...names: string[]): void {
    for (const name of names) {
      if (!Object.hasOwn(this, name)) continue;
      const value = Reflect.get(this, name);
      Reflect.deleteProperty(this, name);
      Reflect.set(this, name, value);
    }
  }

  /** Facts about the recording; null before its head is there. */
  get info(): Info | null {
    return null;
  }

  /** True while an attribute is put back. */
  protected restoring = false;

  /** Puts an attribute back as it was where its new value is none, and says what is wrong with that; null where it stays. */
  protected restore(name: string, before: string | null, after: string | null): Error | null {
    const wrong = after === null ? null : parse.complaint(name, after);
    if (wrong === null) return null;
    this.restoring = true;
    if (before === null) this.removeAttribute(name);
    else this.setAttribute(name, before);
    this.restoring = false;
    return new Error(wrong);
  }

  /** A whole address; as it was written where it is none, which opening it then reports. */
  get src(): string {
    const text = this.getAttribute("src");
    return text !== null && URL.canParse(text, document.baseURI) ? new URL(text, document.baseURI).href : (text ?? "");
  }
  set src(value: string) {
    this.setAttribute("src", value);
  }

  get poster(): string {
    return this.getAttribute("poster") ?? "";
  }
  set poster(value: string) {
    this.setAttribute("poster", value);
  }

  /** "none" fetches nothing before playback is asked for. */
  get preload(): "auto" | "none" {
    return this.getAttribute("preload") === "none" ? "none" : "auto";
  }
  set preload(value: "auto" | "none") {
    this.setAttribute("preload", value);
  }

  get controls(): boolean {
    return parse.parseFlag(this.getAttribute("controls"));
  }
  set controls(value: boolean) {
    this.toggleAttribute("controls", value);
  }

  get autoplay(): boolean {
    return parse.parseFlag(this.getAttribute("autoplay"));
  }
  set autoplay(value: boolean) {
    this.toggleAttribute("autoplay", value);
  }

  get loop(): boolean {
    return parse.parseFlag(this.getAttribute("loop"));
  }
  set loop(value: boolean) {
    this.toggleAttribute("loop", value);
  }

  /** To the end, to the start, or there and back. */
  get direction(): Direction {
    return parse.parseDirection(this.getAttribute("direction"));
  }
  set direction(value: Direction) {
    this.setAttribute("direction", value);
  }

  /** True while the statistics are shown. */
  get stats(): boolean {
    return parse.parseFlag(this.getAttribute("stats"));
  }
  set stats(value: boolean) {
    this.toggleAttribute("stats", value);
  }

  /** Layers beyond the first, or "auto". */
  get layers(): Layers {
    return parse.parseLayers(this.getAttribute("layers"));
  }
  set layers(value: Layers) {
    this.setAttribute("layers", String(value));
  }

  /** 0.1 to 4; the attribute is `speed`, and `playbackrate` is taken too. */
  get playbackRate(): number {
    return parse.parseSpeed(this.getAttribute("speed") ?? this.getAttribute("playbackrate"));
  }
  set playbackRate(value: number) {
    this.setAttribute("speed", String(value));
  }

  /** True if motion is blended between frames. */
  get interpolate(): boolean {
    return parse.parseSwitch(this.getAttribute("interpolate"));
  }
  set interpolate(value: boolean) {
    this.setAttribute("interpolate", value ? "on" : "off");
  }

  /** True if textures are fetched and shown; without them surfaces have the colours of their vertices. */
  get textures(): boolean {
    return parse.parseSwitch(this.getAttribute("textures"));
  }
  set textures(value: boolean) {
    this.setAttribute("textures", value ? "on" : "off");
  }

  /** True if a recording without a floor gets a ground, with its shadow. */
  get ground(): boolean {
    return parse.parseSwitch(this.getAttribute("ground"));
  }
  set ground(value: boolean) {
    this.setAttribute("ground", value ? "on" : "off");
  }

  /** Brightness of the light on surfaces that are lit, 1 as usual; as `<model-viewer>` has it. */
  get exposure(): number {
    return parse.parseExposure(this.getAttribute("exposure"));
  }
  set exposure(value: number) {
    this.setAttribute("exposure", String(value));
  }

  /** True if the camera orbits by itself; not for viewers who prefer reduced motion. */
  get autoRotate(): boolean {
    return parse.parseFlag(this.getAttribute("autorotate"));
  }
  set autoRotate(value: boolean) {
    this.toggleAttribute("autorotate", value);
  }

  /** True if the camera flies instead of orbiting: for rooms. */
  get fly(): boolean {
    return parse.parseFlag(this.getAttribute("fly"));
  }
  set fly(value: boolean) {
    this.toggleAttribute("fly", value);
  }

  /** The part that is played over and over, from and to, s; null for all. */
  get section(): readonly [number, number] | null {
    return parse.readSection(this.getAttribute("section") ?? "");
  }
  set section(value: readonly [number, number] | null) {
    if (value === null) this.removeAttribute("section");
    else this.setAttribute("section", value.map((time) => Number(time.toFixed(3))).join(","));
  }

  /** True if the bar counts frames instead of seconds. */
  get frames(): boolean {
    return parse.parseFlag(this.getAttribute("frames"));
  }
  set frames(value: boolean) {
    this.toggleAttribute("frames", value);
  }

  /** True if the settings offer a link to the current view: for pages that read it from their address, as player/index.html. */
  get share(): boolean {
    return parse.parseFlag(this.getAttribute("share"));
  }
  set share(value: boolean) {
    this.toggleAttribute("share", value);
  }

  /** True if the sound is off and not fetched; set automatically if the browser allows no sound before the viewer acts. */
  get muted(): boolean {
    return parse.parseFlag(this.getAttribute("muted"));
  }
  set muted(value: boolean) {
    this.toggleAttribute("muted", value);
  }

  /** Volume, 0 to 1. */
  get volume(): number {
    return parse.parseVolume(this.getAttribute("volume"));
  }
  set volume(value: number) {
    this.setAttribute("volume", String(Number(value.toFixed(3))));
  }

  /** As a video has it: it always plays in its place. */
  get playsInline(): boolean {
    return parse.parseFlag(this.getAttribute("playsinline"));
  }
  set playsInline(value: boolean) {
    this.toggleAttribute("playsinline", value);
  }

  /** "use-credentials" sends cookies to another origin, too; as a video has it. */
  get crossOrigin(): "anonymous" | "use-credentials" | null {
    const text = this.getAttribute("crossorigin");
    return text === null ? null : text.trim().toLowerCase() === "use-credentials" ? "use-credentials" : "anonymous";
  }
  set crossOrigin(value: string | null) {
    if (value === null) this.removeAttribute("crossorigin");
    else this.setAttribute("crossorigin", value);
  }

  /** Address of the recording as USDZ, which iPhones show in AR. */
  get usdz(): string {
    return this.getAttribute("usdz") ?? "";
  }
  set usdz(value: string) {
    this.setAttribute("usdz", value);
  }

  /** Address of the recording as GLB, which Android phones show in AR. */
  get glb(): string {
    return this.getAttribute("glb") ?? "";
  }
  set glb(value: string) {
    this.setAttribute("glb", value);
  }

  /** Appearance of surfaces; if none is set, or one that the recording lacks, the first of `splats`, `color` and `shaded` that it has. */
  get mode(): Mode {
    return parse.parseMode(this.getAttribute("mode"), this.info);
  }
  set mode(value: Mode) {
    this.setAttribute("mode", value);
  }

  /** True if the recording's splats are fetched: `mode` decides. */
  get splats(): boolean {
    return parse.wantsSplats(this.getAttribute("mode"));
  }

  /** The recording's axis that points up; null for the one that the file names. */
  get up(): Up | null {
    return parse.parseUp(this.getAttribute("up"));
  }
  set up(value: Up | null) {
    if (value === null) this.removeAttribute("up");
    else this.setAttribute("up", value);
  }

  get theme(): parse.Theme {
    return parse.parseTheme(this.getAttribute("theme"));
  }
  set theme(value: parse.Theme) {
    this.setAttribute("theme", value);
  }

  /** A CSS colour behind the scene; "" for the theme's. */
  get background(): string {
    return this.getAttribute("background") ?? "";
  }
  set background(value: string) {
    this.setAttribute("background", value);
  }
}
