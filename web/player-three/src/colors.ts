// Colours: of tracks, of the background, of edges. All are as the screen shows them (sRGB), none is linear.

/** Three numbers: a colour, or a place. */
export type Vector = readonly [number, number, number];

/** Okabe and Ito's palette, which are distinct for people with any colour vision, without its black. */
const PALETTE = [0xe69f00, 0x56b4e9, 0x009e73, 0xf0e442, 0x0072b2, 0xd55e00, 0xcc79a7] as const;
const CLAY = rgb(0xdcd8d0);
const HUE_SHARE = 0.3; // of a track's own colour in its clay
const DARKER = 0.68; // from one round through the palette to the next

export const BACKGROUND_CLAY = rgb(0xb9bdc6);
export const BACKGROUND_COLOR = rgb(0x8a8a8a);
export const EDGE_COLOR = rgb(0x1d2733);

/** The unlit colour of a track. From the eighth on the palette's colours come again, darker each time. */
export function trackColor(track: number): Vector {
  const [r, g, b] = rgb(PALETTE[track % PALETTE.length]);
  const share = DARKER ** Math.floor(track / PALETTE.length);
  return [r * share, g * share, b * share];
}

/** The colour of a track's lit surface: clay, but for the first with a hue of the track's own. */
export function trackClay(track: number): Vector {
  if (track === 0) return CLAY;
  const hue = trackColor(track);
  return [mix(CLAY[0], hue[0]), mix(CLAY[1], hue[1]), mix(CLAY[2], hue[2])];
}

function mix(clay: number, hue: number): number {
  return clay + (hue - clay) * HUE_SHARE;
}

function rgb(hex: number): Vector {
  return [(hex >> 16) / 255, ((hex >> 8) & 255) / 255, (hex & 255) / 255];
}
