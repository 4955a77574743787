// The look of a study's page: the same for all viewers, whatever their system prefers.

export const STYLES = `
html, body { height: 100%; background: #1b1d21; color: #f1f3f5; color-scheme: dark; }
body { margin: 0; font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
.study, .study * { box-sizing: border-box; }
.study [hidden] { display: none !important; }
.study { height: 100%; display: grid; }
.study h1 { margin: 0 0 16px; font-size: 28px; line-height: 1.25; font-weight: 650; }
.study p { margin: 0 0 16px; max-width: 62ch; }
.study .quiet { color: #a9b1bb; font-size: 14px; }

.card { place-self: center; width: min(640px, calc(100% - 32px)); margin: 32px 0; padding: 40px; border: 1px solid #ffffff1f; border-radius: 16px; background: #25282d; }
.card :last-child { margin-bottom: 0; }
.card form { display: flex; flex-wrap: wrap; align-items: end; gap: 16px; margin: 24px 0; }
.card label { flex: 1 1 240px; display: grid; gap: 4px; font-size: 14px; color: #c9d0d8; }
.card input { font: inherit; font-size: 16px; padding: 9px 14px; border: 1px solid #ffffff40; border-radius: 8px; background: #1b1d21; color: inherit; }
.card pre { margin: 0 0 16px; padding: 16px; border-radius: 8px; background: #1b1d21; white-space: pre-wrap; overflow-wrap: anywhere; font: 14px/1.5 ui-monospace, Consolas, monospace; }

.study button { min-height: 44px; padding: 9px 22px; border: 1px solid #ffffff38; border-radius: 8px; background: #363a41; color: inherit; font: inherit; font-weight: 550; cursor: pointer; }
.study button:hover:enabled { background: #434850; }
.study button.main { border-color: transparent; background: #5ab0ff; color: #06121f; }
.study button.main:hover:enabled { background: #7cc0ff; }
.study button:disabled { opacity: .38; cursor: default; }
.study :is(button, input):focus-visible { outline: 3px solid #5ab0ff; outline-offset: 2px; }

.trial { grid-template-rows: auto 1fr auto; gap: 16px; padding: 20px; min-height: 420px; }
.trial header { display: flex; align-items: baseline; justify-content: space-between; gap: 24px; }
.trial h1 { margin: 0; font-size: 22px; }
.trial progress { display: block; width: 160px; height: 6px; margin-top: 6px; appearance: none; border: 0; border-radius: 3px; overflow: hidden; background: #ffffff24; }
.trial progress::-webkit-progress-bar { background: #ffffff24; }
.trial progress::-webkit-progress-value { background: #5ab0ff; }
.trial progress::-moz-progress-bar { background: #5ab0ff; }
.panes { display: grid; grid-auto-flow: column; grid-auto-columns: 1fr; gap: 16px; min-height: 0; }
.pane { position: relative; border-radius: 12px; overflow: hidden; background: #3b3d41; }
.pane meshreel-player { display: block; width: 100%; height: 100%; aspect-ratio: auto; pointer-events: none; }
.pane b { position: absolute; left: 14px; top: 14px; width: 36px; height: 36px; border-radius: 50%; display: grid; place-items: center; background: #000000a6; font-size: 18px; }
.cover { position: absolute; inset: 0; display: grid; place-items: center; background: #3b3d41; color: #c9d0d8; font-size: 18px; }
.trial footer { display: grid; gap: 12px; justify-items: center; }
.trial footer p { margin: 0; text-align: center; color: #c9d0d8; }
.choices { display: flex; flex-wrap: wrap; justify-content: center; gap: 12px; }
.choices .again { margin-left: 28px; background: none; }
`;
