"""Names of anything as names of files. In -> out: a name -> one that every file system takes."""

from __future__ import annotations

import hashlib
import re

_LONGEST = 100  # letters that are kept: most file systems take 255, with what is put around them


def file_name(name: str) -> str:
    """A name as that of a file anywhere, without folders; two names never make one."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "_", name)[:_LONGEST]
    if plain == name:
        return plain
    return f"{plain}-{hashlib.sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}"
