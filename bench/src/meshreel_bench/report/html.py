"""Markdown to one HTML page that needs no other file: styles, plots and pictures are in it, links stay within it.

In -> out: lines of Markdown, and the pictures that they name as bytes -> HTML. Markup in the text is shown, not obeyed.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from markdown_it.token import Token

_KINDS = {"png": "image/png", "svg": "image/svg+xml"}
_LEVELS = ("h1", "h2")  # that the table of contents has

_STYLE = """
:root { color-scheme: light dark; --text: #1b1b1b; --page: #fff; --line: #d0d0d0; --faint: #f4f4f4; --quiet: #595959; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e4e4e4; --page: #161616; --line: #444; --faint: #222; --quiet: #a8a8a8; }
}
body { margin: 0 auto; padding: 1.5rem; max-width: 72rem; color: var(--text); background: var(--page);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1, h2, h3 { line-height: 1.25; margin: 2em 0 .6em; }
h1 { border-bottom: 2px solid var(--line); padding-bottom: .2em; }
code { font: .92em ui-monospace, Menlo, Consolas, monospace; background: var(--faint); padding: .1em .3em; }
pre { background: var(--faint); padding: .8em 1em; overflow-x: auto; }
pre code { padding: 0; background: none; }
img { display: block; margin: 1em auto; max-width: 100%; background: #fff; }
img.plot { width: 56rem; }
nav { border: 1px solid var(--line); padding: .6em 1em; }
nav ul { margin: .2em 0; padding-left: 1.2em; }
a { color: inherit; }
.wide { overflow-x: auto; margin: 1em 0; }
table { border-collapse: collapse; font-size: .82rem; font-variant-numeric: tabular-nums; }
th, td { padding: .3em .6em; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
th { border-bottom-width: 2px; background: var(--faint); }
@media print {
  :root { color-scheme: light; --text: #000; --page: #fff; --line: #999; --faint: #fff; --quiet: #333; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  nav { display: none; }
  h1, h2, h3 { break-after: avoid; }
  img, tr { break-inside: avoid; }
  img.plot { width: 17cm; }
  .wide { overflow: visible; }
  table { font-size: 6pt; line-height: 1.25; }
  th, td { padding: 1.5pt 2pt; overflow-wrap: break-word; }
}
@page { margin: 1.5cm; }
"""


def html_page(title: str, lines: Sequence[str], pictures: Mapping[str, bytes]) -> str:
    """The page; `pictures` are PNG and SVG files by the paths that the Markdown has for them, or their SVG twins'.

    A picture that is not among them is its text alone, and so is a link to anywhere else.
    """
    from markdown_it import MarkdownIt

    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = reader.parse("\n".join(lines))
    heads = _name_heads(tokens)
    for token in tokens:
        if token.children:
            token.children = _within(token.children, pictures)
    reader.add_render_rule("text", _breakable)
    body = reader.renderer.render(tokens, reader.options, {})
    body = body.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<nav>\n{_contents(heads)}</nav>\n{body}</body>\n</html>\n"
    )


def _breakable(_renderer: object, tokens: Sequence[Token], place: int, _options: object, _env: object) -> str:
    """Text that may go on in the next line behind an underscore: names of codecs are long and columns narrow."""
    return escape(tokens[place].content).replace("_", "_<wbr>")


def _name_heads(tokens: Sequence[Token]) -> list[tuple[str, str, str]]:
    """Gives every head an id of its own; (level, id, text) of those of the table of contents."""
    found, taken = list[tuple[str, str, str]](), set[str]()
    for token, inline in pairwise(tokens):
        if token.type == "heading_open":
            told = "".join(child.content for child in inline.children or ())
            name = base = re.sub(r"[^a-z0-9]+", "-", told.lower()).strip("-") or "part"
            for number in range(2, len(tokens)):
                if name not in taken:
                    break
                name = f"{base}-{number}"
            taken.add(name)
            token.attrSet("id", name)
            found.append((token.tag, name, told))
    return [head for head in found if head[0] in _LEVELS]


def _contents(heads: Sequence[tuple[str, str, str]]) -> str:
    """The table of contents: a list with a list in it for what is below each first head."""
    html, depth = "", 0
    for level, name, told in heads:
        wanted = _LEVELS.index(level) + 1
        html += "<ul>\n" * (wanted - depth) + "</ul>\n" * (depth - wanted)
        html += f'<li><a href="#{name}">{escape(told)}</a></li>\n'
        depth = wanted
    return html + "</ul>\n" * depth


def _within(tokens: Sequence[Token], pictures: Mapping[str, bytes]) -> list[Token]:
    """The same with pictures in the page, and without links that leave it."""
    from markdown_it.token import Token

    kept, opened = list[Token](), list[bool]()
    for token in tokens:
        if token.type == "link_open":
            opened.append(str(token.attrGet("href")).startswith("#"))
        stays = opened[-1] if token.type in ("link_open", "link_close") else True
        if token.type == "link_close":
            opened.pop()
        if token.type == "image":
            source = str(token.attrGet("src"))
            if source not in pictures:
                kept.append(Token("text", "", 0, content=token.content))
                continue
            is_plot = pictures[source].lstrip().startswith(b"<")
            token.attrSet("src", _data_uri(pictures[source], "svg" if is_plot else "png"))
            token.attrSet("class", "plot" if is_plot else "sheet")
        if stays:
            kept.append(token)
    return kept


def _data_uri(data: bytes, kind: str) -> str:
    return f"data:{_KINDS[kind]};base64,{base64.b64encode(data).decode()}"
