// Icons: paths on a grid of 24, drawn for this player. Made as nodes, not as markup, so that a strict policy lets them pass.

const PATHS = {
  play: "M7 4.5v15a1 1 0 0 0 1.53.85l12-7.5a1 1 0 0 0 0-1.7l-12-7.5A1 1 0 0 0 7 4.5z",
  pause: "M7 4h3a1 1 0 0 1 1 1v14a1 1 0 0 1-1 1H7a1 1 0 0 1-1-1V5a1 1 0 0 1 1-1zm7 0h3a1 1 0 0 1 1 1v14a1 1 0 0 1-1 1h-3a1 1 0 0 1-1-1V5a1 1 0 0 1 1-1z",
  replay: "~M5 5v5h5M5.6 10A7.5 7.5 0 1 1 4.5 14",
  stepBack: "M18 6.2v11.6a.8.8 0 0 1-1.24.67L8.2 12.67a.8.8 0 0 1 0-1.34l8.56-5.8A.8.8 0 0 1 18 6.2zM5 5.5h1.6v13H5z",
  stepForward: "M6 6.2v11.6a.8.8 0 0 0 1.24.67l8.56-5.8a.8.8 0 0 0 0-1.34l-8.56-5.8A.8.8 0 0 0 6 6.2zM17.4 5.5H19v13h-1.6z",
  loop: "~M17 3l3 3-3 3M4 11.5V9a3 3 0 0 1 3-3h13M7 21l-3-3 3-3M20 12.5V15a3 3 0 0 1-3 3H4",
  section: "~M8 5H5v14h3M16 5h3v14h-3M9 12h6M12.5 9.5L15 12l-2.5 2.5",
  stats: "~M4 20h16M7 16v-4M12 16V5M17 16V9",
  camera: "~M4 8h3.2l1.6-2.5h6.4L16.8 8H20a1 1 0 0 1 1 1v9a1 1 0 0 1-1 1H4a1 1 0 0 1-1-1V9a1 1 0 0 1 1-1zM15.5 13.2a3.5 3.5 0 1 1-7 0 3.5 3.5 0 0 1 7 0z",
  record: "~M20.5 12a8.5 8.5 0 1 1-17 0 8.5 8.5 0 0 1 17 0zM15 12a3 3 0 1 1-6 0 3 3 0 0 1 6 0z",
  fit: "~M12 3.5l7.5 4.2v8.6L12 20.5l-7.5-4.2V7.7zM4.5 7.7L12 12m0 0l7.5-4.3M12 12v8.5",
  sound: "~M4 9.5v5h3.5L12 18.5v-13L7.5 9.5zM15.5 9a4 4 0 0 1 0 6M18 6.5a7.5 7.5 0 0 1 0 11",
  silent: "~M4 9.5v5h3.5L12 18.5v-13L7.5 9.5zM16 9.5l5 5M21 9.5l-5 5",
  open: "~M3.5 18.5v-12a1 1 0 0 1 1-1h4.6l2 2.5h8.4a1 1 0 0 1 1 1v9.5a1 1 0 0 1-1 1h-15a1 1 0 0 1-1-1z",
  vr: "~M4.5 7h15A1.5 1.5 0 0 1 21 8.5v7a1.5 1.5 0 0 1-1.5 1.5h-3.7a1.5 1.5 0 0 1-1.2-.6l-1.4-1.9a1.5 1.5 0 0 0-2.4 0l-1.4 1.9a1.5 1.5 0 0 1-1.2.6H4.5A1.5 1.5 0 0 1 3 15.5v-7A1.5 1.5 0 0 1 4.5 7zM7.5 11.5h1.5M15 11.5h1.5",
  fullscreen: "~M4 9V5a1 1 0 0 1 1-1h4M15 4h4a1 1 0 0 1 1 1v4M20 15v4a1 1 0 0 1-1 1h-4M9 20H5a1 1 0 0 1-1-1v-4",
  exitFullscreen: "~M9 4v4a1 1 0 0 1-1 1H4M20 9h-4a1 1 0 0 1-1-1V4M15 20v-4a1 1 0 0 1 1-1h4M4 15h4a1 1 0 0 1 1 1v4",
  more: "~M4 7h9M17 7h3M15 5v4M4 17h3M11 17h9M9 15v4M4 12h12M20 12h0M18 10v4",
  help: "~M9 9.2A3 3 0 1 1 13.3 12c-.9.4-1.3 1-1.3 2v.3M12 17.5v.1",
  frames: "~M4 5.5h16v13H4zM9.3 5.5v13M14.7 5.5v13",
  fly: "~M12 3v18M3 12h18M9 6l3-3 3 3M9 18l3 3 3-3M6 9l-3 3 3 3M18 9l3 3-3 3",
  link: "~M9.5 14.5l5-5M11 6.5l1.8-1.8a4 4 0 0 1 5.6 5.6L16.5 12.2M13 17.5l-1.8 1.8a4 4 0 0 1-5.6-5.6L7.5 11.8",
  ar: "~M4 8V5a1 1 0 0 1 1-1h3M16 4h3a1 1 0 0 1 1 1v3M20 16v3a1 1 0 0 1-1 1h-3M8 20H5a1 1 0 0 1-1-1v-3M12 8l3.5 2v4L12 16l-3.5-2v-4z",
  close: "~M6 6l12 12M18 6L6 18",
  warning: "~M12 4l9 15.5H3zM12 10v4.5M12 17v.1",
} as const;

export type IconName = keyof typeof PATHS;

const SVG = "http://www.w3.org/2000/svg";

/** An icon in the colour of the text around it; hidden from screen readers, its button has a name. */
export function icon(name: IconName): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  svg.setAttribute("focusable", "false");
  svg.append(document.createElementNS(SVG, "path"));
  setIcon(svg, name);
  return svg;
}

/** Changes what an icon shows. A path that begins with ~ is a line, any other an area. */
export function setIcon(svg: SVGSVGElement, name: IconName): void {
  const data: string = PATHS[name];
  const line = data.startsWith("~");
  svg.setAttribute("class", line ? "icon line" : "icon");
  svg.firstElementChild?.setAttribute("d", line ? data.slice(1) : data);
  svg.dataset.icon = name;
}
