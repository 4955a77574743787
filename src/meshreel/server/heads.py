"""Process that reads the heads of files for the gallery: bytes of strangers cost the server neither time nor memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from threading import Timer
from typing import Any

from ..container.reader import LargeHeadError, ReelReader
from ..container.sources import FileSource
from ..errors import FormatError, InputError

MOST_HEAD = 1 << 20  # bytes, which take a second to read: an hour of a scene has fewer (guess)
MOST_MEMORY = 2 << 30  # bytes of addresses of the process, the interpreter's included (guess)
PATIENCE = 10.0  # s for one file, the start of the process included (guess)
SHARE = 10.0  # s for the files of one gallery; the next one reads the others (guess)


class HeadReader:
    """The process, for one gallery: it begins with the first file, and again after a file that ended it."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.until = time.monotonic() + SHARE  # when the time of the gallery ends

    def __enter__(self) -> HeadReader:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def read(self, path: Path) -> dict[str, Any]:
        """Return size, frames, duration and error of a file, as far as it has them. Raises InputError."""
        if self._process is None:
            command, variables = [sys.executable, "-P", "-m", __name__], os.environ | {"OPENBLAS_NUM_THREADS": "1"}
            pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
            self._process = subprocess.Popen(command, env=variables, start_new_session=True, **pipes)
        process, patience = self._process, Timer(PATIENCE, self._process.kill)
        assert process.stdin is not None and process.stdout is not None
        patience.start()
        with suppress(OSError):  # it has ended
            process.stdin.write(json.dumps(str(path)).encode() + b"\n")
            process.stdin.flush()
        answer = process.stdout.readline()
        patience.cancel()
        if not answer.endswith(b"\n"):
            self.__exit__()
            return {"error": f"its head takes more than {PATIENCE:g} s or {MOST_MEMORY >> 30} GiB to read"}
        if isinstance(facts := json.loads(answer), str):
            raise InputError(facts)
        return dict(facts)


def _facts(path: Path) -> dict[str, Any] | str:
    try:
        with FileSource(path) as source:
            reader = ReelReader(source, MOST_HEAD)
    except LargeHeadError:
        return {"size": path.stat().st_size}
    except FormatError as error:
        return {"error": str(error)}
    except (InputError, OSError) as error:
        return str(error)
    lost, whole = len(reader.missing), len(reader.chunks)
    cut = f"{lost} of {whole} chunks are missing: the file is truncated" if lost else ""
    return {"size": reader.size, "frames": reader.frame_count, "duration": reader.duration, "error": cut}


if __name__ == "__main__":
    with suppress(ImportError, ValueError):  # Windows has no such limits
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY,) * 2)
    for line in sys.stdin.buffer:
        sys.stdout.write(json.dumps(_facts(Path(json.loads(line)))) + "\n")
        sys.stdout.flush()
