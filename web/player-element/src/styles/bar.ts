// The bar, the seek bar, and the settings above it.

const TRACK = "height: 20px; margin: 0; width: 100%; background: none; appearance: none; cursor: pointer;";
const THUMB = `
  appearance: none; width: 14px; height: 14px; border: 0; border-radius: 50%; background: var(--_accent);
  box-shadow: 0 0 0 2px var(--_panel); transition: scale .12s;
`;

export const BAR = `
.bar {
  position: absolute; inset: auto 0 0; display: none; padding: 0 6px 4px; background: color-mix(in srgb, var(--_panel) 90%, transparent);
  border-top: 1px solid var(--_line); transition: opacity .2s, translate .2s;
}
.root[data-controls] .bar { display: block; }
.root[data-idle][data-playing] .bar:not(:hover, :has(:focus-visible)) { opacity: 0; translate: 0 6px; pointer-events: none; }
.root:has(.settings:not([hidden])) .bar { opacity: 1 !important; translate: none !important; pointer-events: auto !important; }
.row { display: flex; align-items: center; gap: 2px; min-width: 0; }
.space { flex: 1; min-width: 0; }
.volume { display: flex; align-items: center; flex: none; }
.volume .range { position: static; flex: none; width: 64px; margin: 0 6px 0 0; background: linear-gradient(var(--_line) 0 0) center / 100% 4px no-repeat; }
.time { padding: 0 6px; white-space: nowrap; }
.time .all { color: var(--_quiet); }

.button {
  display: grid; place-items: center; flex: none; width: var(--_button); height: var(--_button); padding: 0; border: 0;
  border-radius: 8px; background: none;
}
.button:hover:enabled { background: var(--_hover); }
.button .label { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
.button[aria-pressed="true"] { color: var(--_accent); }
.button[aria-pressed="true"]::after {
  content: ""; grid-area: 1 / 1; align-self: end; width: 16px; height: 3px; margin-bottom: 4px; border-radius: 2px; background: currentColor;
}
.button .icon { grid-area: 1 / 1; }
.button.more[aria-expanded="true"] { background: var(--_hover); }

.seek { position: relative; height: 20px; margin: 0 4px; touch-action: none; --played: 0; --buffered: 0; --hover: 0; --from: 0; --to: 0; }
.track { position: absolute; left: 7px; right: 7px; top: 8px; height: 4px; border-radius: 2px; overflow: hidden; background: var(--_line); }
.track::before, .track::after { content: ""; position: absolute; inset: 0; transform-origin: 0 50%; }
.track::before { background: var(--_quiet); opacity: .7; transform: scaleX(var(--buffered)); }
.track::after { background: var(--_accent); transform: scaleX(var(--played)); }
.section { position: absolute; z-index: 1; inset: 0 calc(100% * (1 - var(--to))) 0 calc(100% * var(--from)); border: solid var(--_warning); border-width: 0 2px; }
.section::before { content: ""; position: absolute; inset: 0; background: var(--_warning); opacity: .35; }
.range { position: absolute; inset: 0; ${TRACK} }
.range:disabled { cursor: default; }
.range::-webkit-slider-runnable-track { ${TRACK} }
.range::-webkit-slider-thumb { ${THUMB} margin-top: 3px; }
.range::-moz-range-thumb { ${THUMB} }
.range:is(:hover, :focus-visible):enabled::-webkit-slider-thumb { scale: 1.2; }
.range:disabled::-webkit-slider-thumb { visibility: hidden; }
.range:disabled::-moz-range-thumb { visibility: hidden; }
.range:focus-visible { outline-offset: 0; border-radius: 6px; }
.tip {
  position: absolute; bottom: 22px; left: calc(7px + var(--hover) * (100% - 14px)); translate: -50%; padding: 2px 6px; border-radius: 5px;
  background: var(--_panel); border: 1px solid var(--_line); font-size: 12px; opacity: 0; pointer-events: none; white-space: nowrap;
}
.tip:not(:has(.at:not(:empty))) { display: none; }
.tip:has(.thumbnail:not([hidden])) { left: clamp(72px, calc(7px + var(--hover) * (100% - 14px)), calc(100% - 72px)); }
.thumbnail { display: block; height: 72px; margin: 2px auto 3px; border-radius: 3px; }
.thumbnail[hidden] { display: none; }
.at { display: block; text-align: center; }
.seek[data-scrubbing] .tip { opacity: 1; }
@media (hover: hover) { .seek:hover .tip { opacity: 1; } }

.settings {
  position: absolute; right: 6px; bottom: calc(var(--_button) + 34px); width: 250px; max-width: calc(100% - 12px);
  max-height: calc(100cqh - var(--_button) - 42px); padding: 6px; overflow: auto; border: 1px solid var(--_line); border-radius: 10px;
  background: var(--_panel); box-shadow: 0 6px 24px #0005;
}
.root:not([data-controls]) .settings { display: none; }
.choice { display: flex; align-items: center; justify-content: space-between; gap: 10px; min-height: var(--_button); padding: 0 8px; }
.choice select {
  min-width: 0; height: 32px; padding: 0 6px; border: 1px solid var(--_line); border-radius: 7px; background: var(--_background); cursor: pointer;
}
@media (pointer: coarse) { .choice select { height: 40px; } }
.settings .button {
  display: flex; align-items: center; gap: 10px; width: 100%; padding: 0 8px; text-align: start;
}
.settings .button .label { position: static; width: auto; height: auto; clip-path: none; }
.settings .button[aria-pressed="true"]::after { align-self: center; margin: 0 0 0 auto; width: 8px; height: 8px; border-radius: 50%; }
.settings .tool { display: none; }
@container player (max-height: 280px) { .settings :is(.choice, .button) { min-height: 34px; height: 34px; } .choice select { height: 28px; } }
@container player (max-width: 620px) { .row .tool { display: none; } .settings .tool { display: flex; } }
@container player (max-width: 400px) { .row .step, .volume .range { display: none; } }
@container player (max-width: 300px) { .time .all { display: none; } }
@container player (max-width: 400px) { .bar { padding: 0 2px 2px; } .row { gap: 0; } }
`;
