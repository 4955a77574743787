"""Checks every annotated array's shape and dtype while the tests run."""

from jaxtyping import install_import_hook

install_import_hook("meshreel", "beartype.beartype")
