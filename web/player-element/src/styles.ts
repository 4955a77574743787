// The look. Colours and sizes are custom properties that a page may set on the element; every part can be reached with ::part.

import { BAR } from "./styles/bar.ts";
import { PANELS } from "./styles/panels.ts";
import { BASE } from "./styles/base.ts";

let sheet: CSSStyleSheet | null = null;

/** One sheet for all players of a page. */
export function styleSheet(): CSSStyleSheet {
  if (sheet === null) {
    sheet = new CSSStyleSheet();
    sheet.replaceSync(BASE + BAR + PANELS);
  }
  return sheet;
}
