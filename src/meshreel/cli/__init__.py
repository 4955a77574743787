"""The command line `meshreel COMMAND`, with the commands of `COMMANDS`, and those that other distributions add.

Errors are one line on standard error, with exit code 2; `--debug` shows the traceback. The module of a command is
imported when the command is called, so that `decode` and `info` work without the extra `encode`. This module imports
nothing heavy, so that Ctrl-C works from the first moment.
"""

from __future__ import annotations

import io
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from .. import __version__
from ..errors import MeshreelError

if TYPE_CHECKING:
    from cyclopts import App, MissingArgumentError

FAILED = 2
INTERRUPTED = 130  # 128 + SIGINT, as shells report it
TERMINATED = 143  # 128 + SIGTERM
PIPE_CLOSED = 141  # 128 + SIGPIPE
_STOPPED = {False: "interrupted", True: "terminated"}  # True: by SIGTERM

_COMMANDS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")  # also of the direction of text

COMMANDS = {
    "capture": "Fuse the depth of a rig into one mesh per frame, or make a rig of recordings of other programs.",
    "calibrate": "Find the poses of a rig's cameras, from other programs, a board, and their depth.",
    "segment": "Label which faces of a scene move, and with which body.",
    "survey": "Survey a sequence once, for encodes of its parts on many machines.",
    "encode": "Encode a sequence of meshes into one .reel file.",
    "cut": "Write some frames of a .reel file, without encoding them again.",
    "concat": "Join .reel files that are parts of one sequence, without encoding them again.",
    "retime": "Write a .reel file that plays at another frame rate or speed.",
    "transform": "Write a .reel file in another place, size or orientation.",
    "tag": "Write a .reel file with other metadata, such as a title.",
    "decode": "Decode a .reel file into a directory of meshes.",
    "export": "Write a .reel file as one animated file, GLB or USD, or as a film, MP4, WebM or GIF.",
    "info": "Show the rate by content, tracks over time, groups and forms, and what the encoder recorded.",
    "compare": "Compare original meshes with decoded ones by every metric, and print the rate of a .reel file.",
    "play": "Play a .reel file, a folder of meshes or a sample in a browser, on this machine or on a headset.",
    "serve": "Serve a folder of .reel files: a gallery, and a page that plays each.",
    "player": "Copy the player's files for a web server.",
    "demo": "Make a short capture of moving people, encode it, and measure the result.",
    "doctor": "Report installed packages and extras, and what this machine can do with them.",
    "completion": "Print a script that lets a shell complete commands and flags.",
}
GROUPS = {  # of commands in the help, in its order
    "Make": ("encode", "capture", "calibrate", "segment", "survey", "demo"),
    "Look": ("play", "info", "decode", "export"),
    "Edit": ("cut", "concat", "retime", "transform", "tag"),
    "Serve": ("serve", "player"),
    "Check": ("compare", "doctor", "completion"),
}
SHARED = {  # modules with several commands
    **dict.fromkeys(("cut", "concat", "retime", "transform", "tag"), "edits"),
    **dict.fromkeys(("encode", "survey"), "encode"),
    **dict.fromkeys(("decode", "export"), "decode"),
    **dict.fromkeys(("play", "serve"), "serve"),
    **dict.fromkeys(("completion", "doctor", "player"), "tools"),
}
EXAMPLES = {  # two of each command, shown below its help; a test parses each
    "capture": ("rig -o scan --voxel 0.02", "scan.bag -o rig"),
    "calibrate": ("rig --in-place", "rig --board charuco --in-place"),
    "segment": ("room -o labels", "room -o views --views-only"),
    "survey": ("scan -o scan.json", "s3://takes/walk -o s3://takes/walk.json --fps 25"),
    "encode": ("scan -o scan.reel --quality 50 --fps 30", "'takes/walk_*.obj' -o walk.reel --audio walk.opus --jobs 4"),
    "cut": ("walk.reel -o step.reel --frames 30:90", "walk.reel -o step.reel --frames 30:90 --keys"),
    "concat": ("walk-1.reel walk-2.reel -o walk.reel", "s3://takes/walk-1.reel s3://takes/walk-2.reel -o walk.reel"),
    "retime": ("walk.reel -o film.reel --fps 24", "walk.reel -o slow.reel --speed 0.25"),
    "transform": ("walk.reel -o small.reel --scale 0.001", "walk.reel -o turned.reel --rotate 90 0 0 --up z"),
    "tag": ("walk.reel title='A walk' take=3 -o tagged.reel", "walk.reel --audio walk.opus -o heard.reel"),
    "decode": ("scan.reel -o meshes --format ply", "room.reel -o background --only background"),
    "export": ("scan.reel --glb", "scan.reel --mp4 --turntable"),
    "info": ("scan.reel", "scan.reel --groups --json"),
    "compare": ("scan scan.reel --sheet errors.png", "'takes/walk_*.obj' walk.reel --scale 0.001 --no-ssim"),
    "play": ("", "scan.reel --host 0.0.0.0 --https"),
    "serve": ("recordings --port 8000", "recordings --cors https://example.org"),
    "player": ("--copy-to site/player", ""),
    "demo": ("", "-o demo --frames 8 --jobs 2"),
    "doctor": ("", "--json"),
    "completion": ("bash >> ~/.bashrc", "zsh > ~/.zfunc/_meshreel"),
}
BENCH = "Measure codecs against each other."
EXTRAS = {  # extras of packages that are not in `encode`
    **dict.fromkeys(("starlette", "uvicorn", "trustme"), "play"),
    **dict.fromkeys(("matplotlib", "skimage"), "demo"),
    **dict.fromkeys(("cyclopts", "rich"), "cli"),
}


class Terminated(BaseException):
    """Raised on SIGTERM, so that temporary files are removed on the way out."""


PLUGINS = "meshreel.commands"  # entry points with which other distributions add commands: meshreel-bench adds `bench`


def place_of(name: str) -> str:
    """Return module and function of a command, as `module:function`."""
    return f"meshreel.cli.{SHARED.get(name, name)}:{name if name in SHARED else 'command'}"


def make_app(names: Sequence[str] = tuple(COMMANDS)) -> App:
    """Return the parser of the command line, with the commands that other distributions add."""
    from importlib.metadata import entry_points

    from cyclopts import App, Group

    help = "Compression of time-varying meshes."
    app = App(name="meshreel", help=help, version=__version__, suppress_keyboard_interrupt=False)
    titles = [Group(title, sort_key=at) for at, title in enumerate(GROUPS)]
    groups = {name: title for title, some in zip(titles, GROUPS.values(), strict=True) for name in some}
    for name in names:
        examples = (f"    meshreel {name} {line}".rstrip() for line in EXAMPLES[name])
        epilogue = "\n".join(["Examples:", "", *examples])  # Markdown
        app.command(place_of(name), name=name, help=COMMANDS[name], help_epilogue=epilogue, group=groups[name])
    added = {entry.name: entry.value for entry in entry_points(group=PLUGINS) if entry.name not in COMMANDS}
    for name, where in added.items():
        app.command(where, name=name, help=BENCH, group=groups["compare"])
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program `meshreel`; return its exit code as `run_app` does."""
    return run_app(make_app, arguments)


def run_app(make: Callable[[], App], arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0, 2, or 128 plus a signal; without `arguments`, exit with it."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    signals = _Signals(raises=arguments is not None)
    with signals.heeded(lasting=arguments is None):
        code = _run(make, tokens, signals)
    if arguments is None:
        sys.exit(code)
    return code


def _run(make: Callable[[], App], tokens: list[str], signals: _Signals) -> int:
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # for file names that the terminal cannot show
    try:
        app = make()
        if tokens and not tokens[0].startswith("-") and tokens[0] not in [*app]:  # the parser would import them all
            return _report(f"error: {_unknown(tokens[0], app)}", FAILED)
        command, bound, _ = app.parse_args(tokens, exit_on_error=False, print_error=False)
        with signals.raised():
            command(*bound.args, **bound.kwargs)
        return 0
    except (KeyboardInterrupt, Terminated) as error:
        return _stopped(signal.SIGTERM if isinstance(error, Terminated) else signal.SIGINT, error)
    except BrokenPipeError:  # the reader of our output is gone
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115  (else the interpreter complains when it exits)
        return PIPE_CLOSED
    except Exception as error:
        if signals.heard:  # a signal during the import of a compiled module becomes an ImportError
            return _stopped(signals.heard[-1], error)
        if "--debug" in tokens:
            raise
        return _report(f"error: {one_line(error)}", FAILED)


def shown(text: str) -> str:
    """Return a text, which may be of a stranger's file, without characters that would command a terminal."""
    return _COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def one_line(error: Exception) -> str:
    """Return the message of an error, with its remedy, without line breaks."""
    return _noted(_text_of(error), error)


def _noted(text: str, error: BaseException) -> str:
    return "; ".join([text, *getattr(error, "__notes__", ())])


def _text_of(error: Exception) -> str:
    from concurrent.futures.process import BrokenProcessPool

    if isinstance(error, ImportError) and isinstance(error.__cause__, ModuleNotFoundError):
        error = error.__cause__  # raised by the import of the command's module
    text = " ".join(str(error).split()) or type(error).__name__
    if isinstance(error, ModuleNotFoundError) and not (error.name or "").startswith("meshreel"):
        extra = EXTRAS.get((error.name or "").split(".")[0], "encode")
        return f"{error.name} is missing; install it with: pip install 'meshreel[{extra}]'"
    from cyclopts import CycloptsError, MissingArgumentError

    if isinstance(error, MissingArgumentError) and error.argument is not None:
        return _missing(error, " ".join([program(), *(error.command_chain or ())]))
    if isinstance(error, CycloptsError):
        return f"{text} (see {program()} --help)"
    if isinstance(error, BrokenProcessPool):
        return "a worker process died, out of memory perhaps; give fewer --jobs"
    if type(error).__module__.startswith("distributed."):
        return f"the cluster failed: {text}"
    if isinstance(error, MemoryError):
        return "out of memory; give fewer --jobs or smaller meshes"
    if isinstance(error, (MeshreelError, OSError)):
        return text
    return f"{type(error).__name__}: {text}; this is a fault of meshreel: please report it with the output of --debug"


def _unknown(name: str, app: App) -> str:
    """Return the message for an unknown command, with commands that it begins or resembles."""
    program, names = app.name[0], [command for command in app if not command.startswith("-")]
    if (program, name) == ("meshreel", "bench"):
        return "the bench is a distribution of its own; install it with: pip install meshreel-bench"
    near = [command for command in names if command.startswith(name)] or get_close_matches(name, names)
    suggestion = f" Did you mean {' or '.join(near)}?" if near else ""
    return f'Unknown command "{name}".{suggestion} Commands: {", ".join(names)} (see {program} --help)'


def _missing(error: MissingArgumentError, command: str) -> str:
    """Return the message for a missing argument of a command, with the first sentence of its help."""
    assert error.argument is not None
    arguments = [] if error.app is None else error.app.assemble_argument_collection(parse_docstring=True)
    helps = {argument.name: argument.parameter.help or "" for argument in arguments}
    meaning = " ".join(helps.get(error.argument.name, "").split()).split(". ")[0].rstrip(".")
    sentence = f": {meaning}" if meaning else ""
    return f"{command}: {error.keyword or error.argument.name} is missing{sentence} (see {command} --help)"


def _report(text: str, code: int) -> int:
    print(f"{program()}: {shown(text)}", file=sys.stderr)
    return code


def program() -> str:
    """Return the program's name for messages: `meshreel`, or one that begins with `meshreel-`, as the bench's."""
    name = os.path.basename(sys.argv[0]).removesuffix(".exe") if sys.argv else ""  # noqa: PTH119  (see the module)
    return name if name.startswith("meshreel-") else "meshreel"


def _stopped(number: int, error: BaseException) -> int:
    terminated = number == signal.SIGTERM
    return _report(_noted(_STOPPED[terminated], error), TERMINATED if terminated else INTERRUPTED)


class _Signals:
    """Handlers of signals: they raise while a command runs, and end the process in imports, which lose exceptions."""

    def __init__(self, raises: bool) -> None:
        self.heard: list[int] = []
        self.raises = raises

    @contextmanager
    def heeded(self, lasting: bool) -> Iterator[None]:
        """Heed signals in the block and, if `lasting`, to the end of the process."""
        if threading.current_thread() is not threading.main_thread():
            yield  # only the main thread may set handlers
            return
        both = (signal.SIGINT, signal.SIGTERM)
        signals = [number for number in both if signal.getsignal(number) is not signal.SIG_IGN]
        before = {number: signal.signal(number, self._stop) for number in signals}
        try:
            yield
        finally:
            for number, handler in {} if lasting else before.items():
                signal.signal(number, handler)

    @contextmanager
    def raised(self) -> Iterator[None]:
        """Turn signals into exceptions in the block."""
        before, self.raises = self.raises, True
        try:
            yield
        finally:
            self.raises = before

    def _stop(self, number: int, _frame: FrameType | None) -> NoReturn:
        self.heard.append(number)
        terminated = number == signal.SIGTERM
        if not self.raises:
            os.write(2, f"{program()}: {_STOPPED[terminated]}\n".encode())
            os._exit(TERMINATED if terminated else INTERRUPTED)
        raise Terminated if terminated else KeyboardInterrupt
