"""Checks every annotated array's shape and dtype while the tests run."""

import sys

import jaxtyping
from jaxtyping import install_import_hook

import tests.typecheck  # noqa: F401  (the hook finds it by name)

sys.modules["meshreel.shapes"] = jaxtyping  # whose names check what ours only say
install_import_hook("meshreel", "tests.typecheck.check")
