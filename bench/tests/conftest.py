"""Checks annotated arrays while the bench's tests run; fixtures are those of the commands of the product."""

from jaxtyping import install_import_hook

from tests.cli.conftest import balls, quick_presets, run, scan  # noqa: F401
from tests.conftest import SHAPES  # and its settings
from tests.typecheck import modules_with_shapes

if SHAPES:
    install_import_hook(modules_with_shapes("meshreel_bench"), "tests.typecheck.check")
