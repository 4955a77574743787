"""Dependencies: their licences are known and bind no user, and their lower bounds are checked."""

from __future__ import annotations

import sys
from email.message import Message
from pathlib import PurePosixPath

import igl  # noqa: F401  (looked for in sys.modules)
import pytest

from scripts import check_bounds, licences

ROOT = licences.PLAYER.parents[3]


class Wheel:
    """A distribution as importlib.metadata shows it: metadata, and files with texts."""

    def __init__(self, name: str, texts: dict[str, str] | None = None, **about: str) -> None:
        self.name, self.version, self.metadata = name, "1.0", Message()
        for field, value in about.items():
            self.metadata[field.replace("_", "-")] = value
        self.files = [Text(f"{name}-1.0.dist-info/{path}", text) for path, text in (texts or {}).items()]


class Text(PurePosixPath):
    """A file of a wheel that has this text."""

    def __new__(cls, path: str, _: str) -> Text:
        return super().__new__(cls, path)

    def __init__(self, path: str, text: str) -> None:
        if sys.version_info >= (3, 12):
            super().__init__(path)
        self.text = text

    def locate(self) -> Text:
        return self

    def read_text(self, **_: str) -> str:
        return self.text


@pytest.mark.parametrize(
    ("wheel", "fault"),
    [
        (Wheel("a", License_Expression="MIT"), False),
        (Wheel("a", License_Expression="GPL-3.0-only"), True),
        (Wheel("a", License_Expression="GPL-3.0-only OR MIT"), False),
        (Wheel("a", License="LGPL v3"), True),
        (Wheel("a", Classifier="License :: OSI Approved :: GNU Lesser General Public License v3 (LGPLv3)"), True),
        (Wheel("a"), True),
        (Wheel("a", {"LICENSE": "Apache License\n\n2.0"}), False),
        (Wheel("a", {"licenses/LICENSE.GPL": "..."}, License="MPL-2.0"), True),
        (Wheel("libigl", {"licenses/LICENSE.GPL": "..."}, License="MPL-2.0"), False),
        (Wheel("a", {"LICENSE.txt": "Name: library\nLicense: LGPL-2.1-or-later\n"}, License="BSD"), True),
    ],
)
def test_copyleft_and_unknown_licences_are_faults(wheel, fault):
    assert licences.verdict(wheel, free=False)[1] is fault


def test_what_a_user_asks_for_by_name_may_have_any_known_licence():
    assert not licences.verdict(Wheel("a", License="GPL"), free=True)[1]
    assert licences.verdict(Wheel("a"), free=True)[1]


def test_what_is_installed_is_free_of_copyleft_and_every_extra_is_listed(capsys):
    assert licences.main() == 0
    said = capsys.readouterr().out
    assert all(f"\n{name} " in said for name in ("numpy", "open3d", "starlette", "usd-core", "three.js"))


def test_the_parts_of_libigl_that_are_not_free_are_never_imported():
    assert [name for name in sys.modules if name.startswith(("igl.copyleft", "igl.triangle"))] == []
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    assert "igl.copyleft" not in code and "igl.triangle" not in code and "from igl" not in code


def test_a_lower_bound_that_nothing_was_installed_at_is_reported(monkeypatch):
    monkeypatch.setattr(check_bounds, "version", lambda name: "9.9" if name == "rich" else "0")
    monkeypatch.setattr(check_bounds, "requirements", lambda: ["rich>=9.9.0", "numpy>=2", "scipy"])
    assert [sentence.split(":")[0] for sentence in check_bounds.untrue()] == ["numpy>=2", "scipy"]


def test_every_dependency_has_a_lower_bound():
    assert [one for one in check_bounds.requirements() if not check_bounds.FORM.match(one)] == []
