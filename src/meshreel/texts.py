"""Texts of other people's files: JSON, YAML and TOML, of which none costs more than its bytes. In: bytes. Out: values.

All of them raise ValueError and nothing else for what is no such text, or nested too deeply to be read.
"""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any

MOST_TOML = 1 << 16  # bytes: keys of many parts take time by their square, so many 16 s (guess)
MOST_YAML = 1 << 23  # bytes, which take minutes (guess)


def json_of(data: str | bytes) -> Any:
    """Return the value of JSON, which may begin with a byte order mark, as some editors write it."""
    try:
        value = json.loads(data)
        json.dumps(value, ensure_ascii=False).encode()  # half a surrogate can be read, but not written
        return value
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def toml_of(data: bytes) -> dict[str, Any]:
    """Return the tables of TOML."""
    if len(data) > MOST_TOML:
        raise ValueError(f"{len(data)} bytes of TOML, more than {MOST_TOML}")
    try:
        return tomllib.loads(data.decode())
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def yaml_of(data: bytes) -> list[Any]:
    """Return the documents of YAML. Raises ImportError without PyYAML.

    Numbers stay texts, which cost no time. An alias, by which a short text has any size, is refused.
    """
    import yaml

    class Loader(yaml.BaseLoader):
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise yaml.YAMLError(f"has the alias *{self.peek_event().anchor}; write the value in its place")
            return super().compose_node(parent, index)

    if len(data) > MOST_YAML:
        raise ValueError(f"{len(data)} bytes of YAML, more than {MOST_YAML}")
    text = re.sub(r"^%YAML:.*", "", data.decode("utf-8-sig"))  # OpenCV's first line is no YAML
    try:
        return list(yaml.load_all(text, Loader))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())[:80]) from None
