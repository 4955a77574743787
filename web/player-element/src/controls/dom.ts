// Nodes, made without markup: a strict content security policy lets them pass.

import { icon, type IconName, setIcon } from "../icons.ts";

/** A node with attributes and children; a string is text. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Readonly<Record<string, string>> = {}, ...children: readonly (Node | string)[]
): HTMLElementTagNameMap[K] {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

/** Sets text only where it differs, so that nothing is laid out for nothing. */
export function setText(node: Node, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

/** Icon and name of a button at the moment. */
export interface Look {
  readonly icon: IconName;
  readonly label: string;
  readonly pressed?: boolean; // of a switch
  readonly shown?: boolean; // false takes it away
  readonly enabled?: boolean;
}

/** A button with an icon and a name, drawn again from `look` at each refresh. */
export class Button {
  readonly element: HTMLButtonElement;
  #icon: SVGSVGElement;
  #label = make("span", { class: "label" });
  #look: () => Look;
  #hint: string;

  /** `name` is its part and class; `hint` the key that does the same, "" for none. */
  constructor(name: string, hint: string, look: () => Look, act: () => void) {
    this.#look = look;
    this.#hint = hint;
    this.#icon = icon(look().icon);
    this.element = make("button", { type: "button", part: `button ${name}`, class: `button ${name}` }, this.#icon, this.#label);
    this.element.addEventListener("click", act);
    this.refresh();
  }

  refresh(): void {
    const { icon: name, label, pressed, shown = true, enabled = true } = this.#look();
    if (this.#icon.dataset.icon !== name) setIcon(this.#icon, name);
    if (this.#label.textContent !== label) {
      this.#label.textContent = label;
      this.element.setAttribute("aria-label", label);
      this.element.title = this.#hint ? `${label} (${this.#hint})` : label;
    }
    if (pressed !== undefined) this.element.setAttribute("aria-pressed", String(pressed));
    this.element.hidden = !shown;
    this.element.disabled = !enabled;
  }
}

export interface Choice {
  readonly value: string;
  readonly text: string;
}

/** A native select with a name: it works with keys, touch and readers everywhere. */
export class Menu {
  readonly element: HTMLLabelElement;
  readonly select: HTMLSelectElement;
  #look: () => { choices: readonly Choice[]; value: string; enabled?: boolean };
  #listed = "";

  constructor(
    name: string, label: string, look: () => { choices: readonly Choice[]; value: string; enabled?: boolean },
    choose: (value: string) => void,
  ) {
    this.#look = look;
    this.select = make("select", { part: `select ${name}`, class: name, "aria-label": label });
    this.element = make("label", { class: "choice" }, make("span", { class: "label" }, label), this.select);
    this.select.addEventListener("change", () => choose(this.select.value));
    this.refresh();
  }

  refresh(): void {
    const { choices, value, enabled = true } = this.#look();
    const listed = JSON.stringify(choices);
    if (listed !== this.#listed) {
      this.#listed = listed;
      this.select.replaceChildren(...choices.map((choice) => make("option", { value: choice.value }, choice.text)));
    }
    if (this.select.value !== value) this.select.value = value;
    this.select.disabled = !enabled;
  }
}
