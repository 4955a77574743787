"""The command line: `meshreel encode|decode|info|compare|bench|demo`.

Errors take one line on standard error and exit code 2; `--debug` shows the traceback.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from .. import __version__
from ..errors import MeshreelError
from . import bench, compare, decode, demo, encode, info

app = App(name="meshreel", help="Compression of time-varying meshes.", version=__version__)
for module in (encode, decode, info, compare, bench, demo):
    app.command(module.command, name=module.__name__.rsplit(".", 1)[-1])


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; exits with 0, 2 after an error, 130 after an interrupt."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        code = 0
    except (MeshreelError, OSError, CycloptsError) as error:
        if "--debug" in tokens:
            raise
        text = " ".join(str(error).split()) or type(error).__name__
        print(f"meshreel: error: {text}", file=sys.stderr)
        code = 2
    except KeyboardInterrupt:
        print("meshreel: interrupted", file=sys.stderr)
        code = 130
    if arguments is None:
        sys.exit(code)
    return code
