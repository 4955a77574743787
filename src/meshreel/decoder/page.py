"""Self-contained page that plays one recording: the built player and the file's bytes in one HTML text.

In: the bytes of a .reel file. Out: a page, and for notebooks a frame that holds it. Browsers unpack its contents.
"""

from __future__ import annotations

import gzip
import json
from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files

_NAMES = ("meshreel-player.js", "three.js", "worker.js", "order.js", "core.wasm")

# The element, its files in memory (`meshreelFiles`, where the player looks them up), and the recording.
_PAGE = """\
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<style>
html, body {{ height: 100%; margin: 0 }}
meshreel-player {{ width: 100%; height: 100%; aspect-ratio: auto }}
</style>
<meshreel-player controls loop></meshreel-player>
<script>
(async (packed, recording) => {{
  const bytes = (text) => new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))]);
  const opened = (text) => new Response(bytes(text).stream().pipeThrough(new DecompressionStream("gzip"))).blob();
  const letters = (buffer) => Array.from(new Uint8Array(buffer), (byte) => String.fromCharCode(byte)).join("");
  const address = async ([name, text]) => {{
    const file = await (await opened(text)).arrayBuffer();
    if (name.endsWith(".js")) return [name, URL.createObjectURL(new Blob([file], {{ type: "text/javascript" }}))];
    return [name, `data:application/wasm;base64,${{btoa(letters(file))}}`]; // workers of a page on disk fetch no blobs
  }};
  globalThis.meshreelFiles = Object.fromEntries(await Promise.all(Object.entries(packed).map(address)));
  await import(meshreelFiles["meshreel-player.js"]);
  document.querySelector("meshreel-player").load(new File([bytes(recording)], {name}));
}})({packed}, "{recording}");
</script>
</html>
"""


def player_page(data: bytes, name: str) -> str:
    """Return the page that plays a file, entitled `name`. Raises FileNotFoundError if no player is built."""
    built = files("meshreel") / "player"
    packed = {file: _text(gzip.compress((built / file).read_bytes(), mtime=0)) for file in _NAMES}
    text = json.dumps(name).replace("<", "\\u003c")  # no name ends the script
    return _PAGE.format(title=escape(name), name=text, packed=json.dumps(packed), recording=_text(data))


def in_frame(page: str, facts: Sequence[str]) -> str:
    """Return the HTML of a notebook's output: facts, and the page in a frame."""
    style = "width: 100%; height: 400px; border: 0"
    allow = 'allow="fullscreen; xr-spatial-tracking" allowfullscreen'
    return f'<p>{escape(", ".join(facts))}</p><iframe style="{style}" {allow} srcdoc="{escape(page)}"></iframe>'


def table(facts: Iterable[tuple[str, str]], note: str) -> str:
    """Return the HTML for a file that is too large for a notebook: its facts, and a note on how to play it."""
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in facts)
    return f"<table>{rows}</table><p>{escape(note)}</p>"


def _text(data: bytes) -> str:
    return b64encode(data).decode()
