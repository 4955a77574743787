"""`meshreel player`: the folder of the built player, or a copy of it for a web server."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from ..io.write import make_folder, replacing
from .console import Common

EMBED = """\
<script type="module" src="{folder}/meshreel-player.js"></script>
<meshreel-player src="walk.reel" controls loop style="width: 640px; aspect-ratio: 16 / 9"></meshreel-player>"""


def command(*, copy_to: Annotated[Path | None, Parameter()] = None, common: Common = Common()) -> None:
    """Copy the player's files for a web server, or print the folder where they are.

    Parameters
    ----------
    copy_to
        The folder to copy them to, made if needed; files of the same names are replaced. The files stay together.
    """
    with as_file(files("meshreel") / "player") as folder:
        built = sorted(path for path in folder.iterdir() if path.is_file())
        if not any(path.name == "meshreel-player.js" for path in built):
            raise InputError(f"{folder}: the player is not built; run scripts/build-web, or install a wheel")
        if copy_to is None:
            common.result({"folder": str(folder), "files": [path.name for path in built]}, str(folder))
            return
        make_folder(copy_to)
        for path in built:
            with replacing(copy_to / path.name) as file:
                file.write(path.read_bytes())
    embed = EMBED.format(folder=copy_to.resolve().name)  # "." has no name
    text = f"{copy_to}: {len(built)} files; in a page beside that folder:\n{embed}"
    common.result({"folder": str(copy_to), "files": [path.name for path in built]}, text)
