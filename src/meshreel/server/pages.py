"""HTML pages: the player of one file, and the gallery. In: names and entries. Out: HTML, with names escaped.

Scripts are separate files, so that the content security policy can refuse inline ones. A player's page has its styles
within it, whose sum the policy names: on a slow line something is seen as soon as the page is there.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from html import escape
from math import ceil
from urllib.parse import quote

from .library import Entry

_HEAD = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="dark light">
<title>{title}</title>
<link rel="icon" href="data:,">
"""
# Until the script is there.
_LOADING = '<svg class="loading" viewBox="0 0 48 48"><circle cx="24" cy="24" r="22"/></svg>'

_TOOLS = """\
<div class="tools">
<input type="search" placeholder="Search" aria-label="Search">
<select aria-label="Sort by">
<option value="name">Name<option value="duration">Duration<option value="size">Size
</select>
</div>
"""

# A play mark, shown until a poster is drawn.
_PLAIN = "data:image/svg+xml," + quote(
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 480 360"><path d="M210 140v80l70-40z" fill="#8a92a0"/></svg>'
)


def policy(styles: str = "") -> str:
    """Return the content security policy of a page with these styles: own files only; any site may embed the page."""
    known = f" 'sha256-{b64encode(sha256(styles.encode()).digest()).decode()}'" if styles else ""
    return (
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; "
        "connect-src 'self' blob: data:; img-src 'self' blob: data:; media-src blob:; "
        f"style-src 'self'{known}; base-uri 'none'; form-action 'none'"
    )


def player_page(name: str, player: str, styles: str) -> str:
    """Return the page that plays one file; `player` is the address of the player's folder, `styles` its page.css."""
    source = escape(f"/files/{quote(name)}")
    modules = ("load.js", "meshreel-player.js", "three.js")
    preloads = "".join(f'<link rel="modulepreload" href="{player}/{file}">\n' for file in modules)
    preloads += f'<link rel="preload" as="fetch" crossorigin href="{player}/core.wasm">\n'
    return (
        f"{_HEAD.format(title=escape(f'{name} · meshreel'))}<style>{styles}</style>\n{preloads}"
        f'<script type="module" src="{player}/page.js"></script>\n</head>\n<body>\n'
        f'<meshreel-player src="{source}" controls autoplay loop>{_LOADING}</meshreel-player>\n'
        "<noscript>The player needs JavaScript.</noscript>\n</body>\n</html>\n"
    )


def gallery_page(title: str, entries: Sequence[Entry], player: str) -> str:
    """Return the gallery, with a tile for each file, whose posters the player at the address `player` draws."""
    head = _HEAD.format(title=escape(f"{title} · meshreel")) + '<link rel="stylesheet" href="/gallery.css">\n'
    for script in (f"{player}/meshreel-player.js", "/gallery.js") if entries else ():
        head += f'<script type="module" src="{script}"></script>\n'
    tiles = f"{_TOOLS}<ul>\n{''.join(map(_tile, entries))}</ul>"
    body = tiles if entries else "<p>This folder has no .reel files.</p>"
    return f"{head}</head>\n<body>\n<main>\n<h1>{escape(title)}</h1>\n{body}\n</main>\n</body>\n</html>\n"


def _tile(entry: Entry) -> str:
    name = escape(entry.name.removesuffix(".reel"))
    address = quote(entry.name)
    size = f"{entry.size / 1e6:.3g} MB" if entry.size >= 1e6 else f"{entry.size / 1e3:.3g} kB"
    facts = f"{entry.mbps:.3g} Mbps, {entry.frames} frames, {size}"
    facts = facts if entry.frames else size
    lines = f'<div class="facts">{facts}</div>' if not entry.error or entry.frames else ""
    lines += f'<div class="error">{escape(entry.error)}</div>' if entry.error else ""
    picture = f'<img src="{_PLAIN}" data-file="/files/{address}" alt="">'
    plays = entry.frames > 0 or not entry.error
    poster = picture if plays else '<div class="blank"></div>'
    poster += f'<span class="time">{_minutes(entry.duration)}</span>' if entry.frames else ""
    inside = f'{poster}<div class="facts-box"><div class="name">{name}</div>{lines}</div>'
    order = f'data-duration="{entry.duration:.3f}" data-size="{entry.size}"'
    return f"<li {order}>" + (f'<a href="/watch/{address}">{inside}</a>' if plays else inside) + "</li>\n"


def _minutes(seconds: float) -> str:
    """Return a duration as "1:05", rounded up; in hours, too, where there are any."""
    minutes, rest = divmod(ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
