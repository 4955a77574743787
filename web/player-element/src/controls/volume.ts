// Sound on and off, and how loud it is; absent where the recording has none.

import type { MeshreelPlayer } from "../element.ts";
import { Button, make } from "./dom.ts";

export class Volume {
  readonly element: HTMLElement;
  #player: MeshreelPlayer;
  #button: Button;
  #slider = make("input", { type: "range", min: "0", max: "1", step: "0.05", part: "volume", class: "range", "aria-label": "Volume" });

  constructor(player: MeshreelPlayer, mute: () => void) {
    this.#player = player;
    const look = () => (this.#isSilent ? { icon: "silent", label: "Unmute" } as const : { icon: "sound", label: "Mute" } as const);
    this.#button = new Button("mute", "U", look, () => (this.#isSilent && player.volume === 0 ? this.#set(1) : mute()));
    this.#slider.addEventListener("input", () => this.#set(this.#slider.valueAsNumber));
    this.element = make("div", { class: "volume" }, this.#button.element, this.#slider);
    this.refresh();
  }

  refresh(): void {
    const { info, volume } = this.#player;
    this.element.hidden = !info?.hasAudio;
    this.#button.refresh();
    const shown = this.#isSilent ? 0 : volume;
    if (this.#slider.valueAsNumber !== shown) this.#slider.value = String(shown);
    this.#slider.setAttribute("aria-valuetext", `${Math.round(100 * shown)} %`);
  }

  get #isSilent(): boolean {
    return this.#player.muted || this.#player.volume === 0;
  }

  #set(volume: number): void {
    this.#player.volume = volume;
    this.#player.muted = false;
  }
}
