"""Checks annotated arrays while the bench's tests run; fixtures are those of the commands of the product."""

from jaxtyping import install_import_hook

import tests.typecheck  # noqa: F401  (the hook finds it by name)
from tests.cli.conftest import balls, quick_presets, run, scan  # noqa: F401
from tests.conftest import SHAPES  # and its settings

if SHAPES:
    install_import_hook("meshreel_bench", "tests.typecheck.check")
