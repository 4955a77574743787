// Playing one part over and over.

import type { Direction } from "@meshreel/player-core/types";

const NEAR_END = 1e-3; // s: attributes have three digits

/** The part of a player that it needs. */
export interface Sectioned {
  readonly section: readonly [number, number] | null;
  readonly duration: number;
  readonly paused: boolean;
  readonly ended: boolean;
  readonly seeking: boolean;
  readonly direction: Direction;
  currentTime: number;
  play(): Promise<void>;
}

/** Goes back to the section's start where its end is passed; in reverse, to its end. */
export class SectionKeeper {
  #within = ""; // the section in which the picture before was, without a seek since

  /** Where a seek begins: it may lead out of the section. */
  forget(): void {
    this.#within = "";
  }

  /** After each picture, and at the end. */
  keep(player: Sectioned): void {
    const { section, currentTime: time } = player;
    const [before, own] = [this.#within, String(section)];
    this.#within = section !== null && !player.seeking && time >= section[0] && time <= section[1] ? own : "";
    if (section === null || player.seeking || (player.paused && !player.ended)) return;
    const [from, to] = section;
    const isReverse = player.direction === "reverse";
    const hasLeft = before === own && this.#within === ""; // also by a step so long that it went past the end of the recording
    if (!hasLeft && (isReverse ? time > from : time < to) && !player.ended) return;
    player.currentTime = isReverse ? to : from;
    if (player.paused) player.play().catch(() => undefined); // reported by the error event
  }
}

/** The section with another start or end; null where it would have no length. */
export function cut({ section, duration, currentTime }: Sectioned, end: "from" | "to"): readonly [number, number] | null {
  const [from, to] = section ?? [0, duration];
  const made = end === "from" ? [currentTime, to > currentTime ? to : duration] as const : [from < currentTime ? from : 0, currentTime] as const;
  return made[1] > made[0] ? made : null;
}

/** What comes next of one button that sets where a section begins, then where it ends, then takes it away. */
export function nextCut({ section, duration, currentTime }: Sectioned): "sectionFrom" | "sectionTo" | "sectionOff" {
  if (section === null) return "sectionFrom";
  const [from, to] = section;
  return to >= duration - NEAR_END && currentTime > from && currentTime < duration - NEAR_END ? "sectionTo" : "sectionOff";
}
