// Panels over the picture.

export const PANELS = `
.panel { position: absolute; background: var(--_panel); border: 1px solid var(--_line); border-radius: 10px; }
.panel dl, .panel p { margin: 0; }

.statistics {
  left: 8px; top: 8px; margin: 0; padding: 8px 12px; font-size: 12px; line-height: 1.5; pointer-events: none; max-width: calc(100% - 16px);
  max-height: calc(100% - 16px); overflow: hidden; background: color-mix(in srgb, var(--_panel) 88%, transparent);
}
.statistics div { display: grid; grid-template-columns: 116px auto; gap: 8px; }
.statistics dt { color: var(--_quiet); }
.statistics dd { margin: 0; }
@container player (max-width: 360px) or (max-height: 300px) {
  .statistics { padding: 4px 8px; font-size: 10px; line-height: 1.35; }
  .root[data-controls] .statistics { max-height: calc(100% - var(--_button) - 42px); overflow: auto; pointer-events: auto; }
  .statistics div { grid-template-columns: 92px auto; }
}

.help-panel {
  left: 50%; top: 50%; translate: -50% -50%; width: max-content; max-width: calc(100% - 16px); max-height: calc(100% - 16px); padding: 12px 16px;
  overflow: auto; box-shadow: 0 6px 30px #0006;
}
.help-panel .title { display: flex; align-items: center; justify-content: space-between; font-size: 16px; margin: -6px -8px 4px 0; }
.help-panel dl { columns: 2; column-gap: 28px; }
.help-panel dl div { display: grid; grid-template-columns: 116px 1fr; align-items: baseline; padding: 3px 0; break-inside: avoid; }
.help-panel dd { margin: 0; }
.help-panel p { margin-top: 12px; color: var(--_quiet); max-width: 46ch; }
kbd { padding: 1px 7px; border: 1px solid var(--_line); border-radius: 5px; background: var(--_hover); font: inherit; font-size: 12px; }
@container player (max-width: 480px) { .help-panel dl { columns: 1; } }

.error {
  left: 50%; top: 50%; translate: -50% -50%; display: grid; justify-items: center; gap: 6px; width: max-content; max-width: min(420px, calc(100% - 16px));
  max-height: calc(100% - 16px); padding: 18px 22px; overflow: auto; text-align: center; box-shadow: 0 6px 30px #0006;
}
.error > .icon { width: 32px; height: 32px; color: var(--_warning); }
.error strong { font-size: 16px; }
.error code { color: var(--_quiet); font: 12px/1.4 ui-monospace, "SF Mono", Consolas, monospace; overflow-wrap: anywhere; }
.error .ways { display: flex; flex-wrap: wrap; justify-content: center; gap: 8px; margin-top: 8px; }
.root:not([data-controls]) .another { display: none; }
.text { min-height: 40px; padding: 0 16px; border: 1px solid var(--_line); border-radius: 8px; background: none; }
.text:hover { background: var(--_hover); }
.text.primary { border-color: transparent; background: var(--_accent); color: var(--_on-accent); font-weight: 600; }
.text.primary:hover { filter: brightness(1.08); }
.text:focus-visible { outline-offset: 2px; }
@container player (max-width: 360px) or (max-height: 240px) {
  .error { padding: 8px 12px; gap: 3px; font-size: 13px; }
  .error > .icon, .error code { display: none; }
  .error strong { font-size: 14px; }
  .error .ways { flex-wrap: nowrap; gap: 6px; }
  .text { min-height: 32px; padding: 0 10px; font-size: 13px; white-space: nowrap; }
}

.toasts {
  position: absolute; left: 50%; bottom: calc(var(--_button) + 58px); translate: -50%; display: grid; justify-items: center; gap: 6px; width: max-content;
  max-width: calc(100% - 16px); pointer-events: none;
}
.toast {
  display: flex; align-items: center; gap: 8px; padding: 7px 14px; border: 1px solid var(--_line); border-radius: 8px; background: var(--_panel);
  overflow-wrap: anywhere; animation: come .15s;
}
.toast .others { color: var(--_quiet); white-space: nowrap; }
.toast.warning .icon { width: 20px; height: 20px; color: var(--_warning); }
`;
