// Panels over the picture: statistics, help, errors, warnings, and the welcome before a file is open.

import type { MeshreelPlayer } from "../element.ts";
import { KEYS } from "../keyboard.ts";
import { explain } from "../messages.ts";
import { statisticsLines } from "../stats.ts";
import { icon } from "../icons.ts";
import { Button, make, setText } from "./dom.ts";

const STATISTICS_EVERY = 250; // ms

/** The statistics; they are counted only while they are shown. */
export class StatisticsPanel {
  readonly element = make("dl", { class: "panel statistics", part: "statistics", "aria-label": "Statistics", role: "group" });
  #player: MeshreelPlayer;
  #timer = 0;

  constructor(player: MeshreelPlayer) {
    this.#player = player;
    this.element.hidden = true;
  }

  refresh(): void {
    const wanted = this.#player.stats && this.#player.isConnected;
    this.element.hidden = !wanted;
    if (wanted && this.#timer === 0) {
      this.#timer = window.setInterval(() => this.#write(), STATISTICS_EVERY);
      this.#write();
    } else if (!wanted) {
      clearInterval(this.#timer);
      this.#timer = 0;
    }
  }

  #write(): void {
    const numbers = this.#player.statistics;
    const lines = numbers ? statisticsLines(numbers, this.#player.info, this.#player.currentFrame) : [["State", "nothing is open"] as const];
    if (this.element.children.length !== lines.length) {
      this.element.replaceChildren(...lines.map(() => make("div", {}, make("dt"), make("dd"))));
    }
    lines.forEach(([name, value], i) => {
      const row = this.element.children[i]!;
      setText(row.firstChild!, name);
      setText(row.lastChild!, value);
    });
  }
}

/** The keys, opened with "?". */
export class HelpPanel {
  readonly element: HTMLElement;

  constructor(close: () => void) {
    const rows = KEYS.map(({ shown, says }) => make("div", {}, make("dt", {}, make("kbd", {}, shown)), make("dd", {}, says)));
    const button = new Button("close", "", () => ({ icon: "close", label: "Close" }), close);
    this.element = make(
      "div", { class: "panel help-panel", part: "help-panel", role: "dialog", "aria-label": "Keyboard shortcuts" },
      make("div", { class: "title" }, make("strong", {}, "Keyboard shortcuts"), button.element),
      make("dl", {}, ...rows),
      make("p", {}, "Drag to rotate, right-drag or two fingers to pan, scroll or pinch to zoom."),
    );
    this.element.hidden = true;
  }

  get open(): boolean {
    return !this.element.hidden;
  }

  toggle(open: boolean): void {
    this.element.hidden = !open;
    if (open) this.element.querySelector("button")?.focus({ preventScroll: true });
  }
}

/** An error in plain words, and a way on. */
export class ErrorPanel {
  readonly element: HTMLElement;
  #title = make("strong");
  #advice = make("p");
  #detail = make("code", { part: "error-detail" });
  #retry: HTMLButtonElement;

  constructor(retry: () => void, open: () => void) {
    this.#retry = make("button", { type: "button", class: "text primary", part: "button retry" }, "Try again");
    const another = make("button", { type: "button", class: "text another", part: "button another" }, "Open file");
    this.#retry.addEventListener("click", retry);
    another.addEventListener("click", open);
    this.element = make(
      "div", { class: "panel error", part: "error", role: "alert" },
      icon("warning"), this.#title, this.#advice, this.#detail, make("div", { class: "ways" }, this.#retry, another),
    );
    this.element.hidden = true;
  }

  show(error: Error | null): void {
    this.element.hidden = error === null;
    if (error === null) return;
    const { title, advice, detail, retry } = explain(error);
    setText(this.#title, title);
    setText(this.#advice, advice);
    setText(this.#detail, detail);
    this.#retry.hidden = !retry;
  }
}

const WARNING_TIME = 8000; // ms
const TELLING_TIME = 1600; // ms

/** Short messages that disappear after a while; screen readers announce them. One of what was done and one warning at a time. */
export class Toasts {
  readonly element = make("div", { class: "toasts", part: "toasts", role: "status", "aria-live": "polite" });
  #warnings = new Set<string>(); // since none was shown

  /** A warning stays longer. It takes the place of the one before, and counts that. */
  warn(text: string): void {
    if (this.element.querySelector(".warning") === null) this.#warnings.clear();
    this.#warnings.add(text);
    const others = this.#warnings.size > 1 ? [make("span", { class: "others" }, `and ${this.#warnings.size - 1} more`)] : [];
    this.#show("warning", WARNING_TIME, icon("warning"), make("span", {}, text), ...others);
  }

  /** Notice of the last action. */
  tell(text: string): void {
    this.#show("told", TELLING_TIME, make("span", {}, text));
  }

  clear(): void {
    this.element.replaceChildren();
  }

  #show(kind: string, time: number, ...content: readonly Node[]): void {
    this.element.querySelector(`.${kind}`)?.remove();
    const toast = make("div", { class: `toast ${kind}`, part: "toast" }, ...content);
    this.element.append(toast);
    setTimeout(() => toast.remove(), time);
  }
}

/** Welcome of an empty player. */
export function emptyPanel(open: () => void): HTMLElement {
  const button = make("button", { type: "button", class: "text primary", part: "button open" }, "Open file");
  button.addEventListener("click", open);
  return make("div", { class: "empty", part: "empty" }, icon("open"), make("strong", {}, "Drop a .reel file here"), button);
}
