"""Pictures of coloured meshes, as bytes."""

import numpy as np

from meshreel.metrics.color import Colored
from meshreel.metrics.viewpoints import Camera
from meshreel.types import Mesh


def render_colors(mesh: Mesh, camera: Camera) -> np.ndarray:
    """The mesh with its colours on white, H x W x 3; one without is grey."""
    view = Colored(mesh).look(camera)
    return np.rint(255 * view.colors).astype(np.uint8)
