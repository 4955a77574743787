"""Checks every annotated array's shape and dtype while the tests run."""

from jaxtyping import install_import_hook

import tests.typecheck  # noqa: F401  (the hook finds it by name)

install_import_hook("meshreel", "tests.typecheck.check")
