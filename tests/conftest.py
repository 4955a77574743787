"""Checks every annotated array's shape and dtype while the tests run."""

import sys

import hypothesis
import jaxtyping
from jaxtyping import install_import_hook

import tests.typecheck  # noqa: F401  (the hook finds it by name)

sys.modules["meshreel.shapes"] = jaxtyping  # whose names check what ours only say
install_import_hook("meshreel", "tests.typecheck.check")
hypothesis.settings.register_profile("shared", deadline=None)  # a machine that does other work, too, misses any
hypothesis.settings.load_profile("shared")
