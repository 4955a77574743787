"""Scenes are looked at by few, small views."""

from collections.abc import Iterator

import pytest

from tests.small_options import look_quickly


@pytest.fixture(scope="module")
def small_views() -> Iterator[None]:
    """Scenes are looked at in few frames, by few, small views."""
    with pytest.MonkeyPatch.context() as patch:
        look_quickly(patch.setattr)
        yield
