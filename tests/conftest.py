"""Settings of all tests: shapes and types of annotated arrays are checked.

`MESHREEL_SHAPES=0` leaves the checks out, which cost each worker seconds to load, and each call that is checked .1 ms.
"""

import os
import sys

import hypothesis
import jaxtyping
from jaxtyping import install_import_hook

from tests.typecheck import modules_with_shapes

SHAPES = os.environ.get("MESHREEL_SHAPES") != "0"

if SHAPES:
    sys.modules["meshreel.shapes"] = jaxtyping  # whose names check what ours only say
    install_import_hook(modules_with_shapes("meshreel"), "tests.typecheck.check")
hypothesis.settings.register_profile("shared", deadline=None)  # a machine that does other work, too, misses any
hypothesis.settings.load_profile("shared")
