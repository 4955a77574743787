// Colours, the box, the picture, and what lies in its middle.

const DARK = `
  --_background: var(--meshreel-background, #14171c);
  --_text: var(--meshreel-text, #f4f6f8);
  --_quiet: var(--meshreel-quiet, #b4bcc6);
  --_panel: var(--meshreel-panel, #1d2127);
  --_line: var(--meshreel-line, #ffffff2e);
  --_hover: var(--meshreel-hover, #ffffff26);
  --_accent: var(--meshreel-accent, #5ab0ff);
  --_on-accent: var(--meshreel-on-accent, #06121f);
  --_warning: var(--meshreel-warning, #ffc24b);
  color-scheme: dark;
`;

const LIGHT = `
  --_background: var(--meshreel-background, #e9ecf0);
  --_text: var(--meshreel-text, #14181d);
  --_quiet: var(--meshreel-quiet, #4d5661);
  --_panel: var(--meshreel-panel, #ffffff);
  --_line: var(--meshreel-line, #00000029);
  --_hover: var(--meshreel-hover, #00000014);
  --_accent: var(--meshreel-accent, #0a63c9);
  --_on-accent: var(--meshreel-on-accent, #ffffff);
  --_warning: var(--meshreel-warning, #8a5200);
  color-scheme: light;
`;

export const BASE = `
:host {
  ${LIGHT}
  display: block;
  position: relative;
  aspect-ratio: 16 / 9;
  min-width: 0;
  overflow: hidden;
  background: var(--_background);
  color: var(--_text);
  font: 400 14px/1.35 var(--meshreel-font, system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif);
  font-variant-numeric: tabular-nums;
  -webkit-text-size-adjust: none;
}
@media (prefers-color-scheme: dark) { :host { ${DARK} } }
:host([theme="light"]) { ${LIGHT} }
:host([theme="dark"]) { ${DARK} }
:host([background]) { background: none; }
:host([hidden]) { display: none; }
:host(:fullscreen) { width: 100%; height: 100%; aspect-ratio: auto; border-radius: 0; }

*, ::before, ::after { box-sizing: border-box; }
[hidden] { display: none !important; }
.root { position: absolute; inset: 0; container: player / size; --_button: 40px; }
@media (pointer: coarse) { .root { --_button: 48px; } }
.picture { position: absolute; inset: 0; outline: none; touch-action: none; background-color: var(--_background); cursor: grab; }
.picture:active { cursor: grabbing; }
.picture:focus-visible::after {
  content: ""; position: absolute; inset: 0; border: 3px solid var(--_accent); pointer-events: none;
}
canvas { display: block; width: 100%; height: 100%; }
.root[data-idle][data-playing][data-controls] .picture { cursor: none; }

.poster { position: absolute; inset: 0; width: 100%; height: 100%; object-fit: contain; pointer-events: none; }
.poster:not([src]), .root[data-drawn] .poster, .root[data-error] .poster { display: none; }

.icon { width: 24px; height: 24px; fill: currentColor; flex: none; }
.icon.line { fill: none; stroke: currentColor; stroke-width: 1.8; stroke-linecap: round; stroke-linejoin: round; }
.file { position: absolute; width: 0; height: 0; opacity: 0; pointer-events: none; }

button, select { font: inherit; color: inherit; }
button { cursor: pointer; -webkit-tap-highlight-color: transparent; }
button:disabled, select:disabled { cursor: default; opacity: .45; }
:is(button, select, input):focus-visible { outline: 3px solid var(--_accent); outline-offset: -3px; }

.big {
  position: absolute; left: 50%; top: 50%; width: 72px; height: 72px; margin: -36px; padding: 0; display: none;
  place-items: center; border: 0; border-radius: 50%; background: var(--_accent); color: var(--_on-accent);
  box-shadow: 0 4px 20px #0006; transition: transform .15s;
}
.big .icon { width: 36px; height: 36px; transform: translateX(2px); }
.big:hover { transform: scale(1.06); }
.big:focus-visible { outline-offset: 3px; }
.root[data-controls]:not([data-started], [data-waiting], [data-error], [data-empty]) .big { display: grid; }
@container player (max-width: 360px) or (max-height: 220px) {
  .big { width: 52px; height: 52px; margin: -26px; }
  .big .icon { width: 28px; height: 28px; }
}

.spinner { position: absolute; left: 50%; top: 50%; width: 48px; height: 48px; margin: -24px; display: none; pointer-events: none; }
.spinner::before {
  content: ""; position: absolute; inset: 0; border: 4px solid var(--_line); border-top-color: var(--_accent); border-radius: 50%;
  animation: turn 1s linear infinite, come .2s .3s both;
}
.root[data-waiting] .spinner { display: block; }
@keyframes turn { to { rotate: 1turn; } }
@keyframes come { from { opacity: 0; } }

.veil, .empty { position: absolute; display: none; place-content: center; justify-items: center; gap: 12px; text-align: center; }
.veil {
  inset: 8px; border: 2px dashed var(--_accent); border-radius: 10px; background: color-mix(in srgb, var(--_panel) 85%, transparent);
  pointer-events: none;
}
.empty { inset: 0; padding: 0 12px calc(var(--_button) + 12px); }
.veil .icon, .empty .icon { width: 40px; height: 40px; color: var(--_quiet); }
@container player (max-height: 220px) { .empty .icon { display: none; } }
.root[data-over] .veil, .root[data-controls][data-empty] .empty { display: grid; }

@media (prefers-reduced-motion: reduce) {
  *, ::before, ::after { transition: none !important; }
  .spinner::before { animation-duration: 3s, .01s; }
}
@media (forced-colors: active) {
  .icon { forced-color-adjust: auto; }
  .button, .big, .text { border: 1px solid ButtonText; }
}
`;
