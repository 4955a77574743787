"""Poses of colour cameras: means over frames of those of a board of markers, which OpenCV finds in their pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from jaxtyping import UInt8

from ...errors import InputError, needed
from ...geometry import strict
from ...geometry.cameras import Matrix
from ..rig.cameras import ColorCamera
from .poses import mean_pose, pose_of

LEAST_CORNERS = 6  # of a board in a picture: four and one to check them, and one more (guess)
WORST = 2.0  # pixels between corners and where the board's pose puts them, root mean square (guess)
LOOKED_AT = 200  # frames, at most (guess)


@dataclass(frozen=True, slots=True)
class BoardOptions:
    """A printed board: ChArUco (a chessboard with markers on its white squares), or a grid of AprilTags."""

    kind: Annotated[Literal["charuco", "apriltag"] | None, Parameter(name="--board")] = None
    """Kind of a board that was moved through the colour pictures (extra `calibrate`)."""
    columns: int = 7
    """Squares (of a ChArUco board) or tags in a row of the board."""
    rows: int = 5
    """Rows of the board."""
    square: float = 0.04
    """Side of a square, or from one tag to the next, m."""
    marker: float = 0.03
    """Side of a marker or tag, its black border included, m."""
    dictionary: str = ""
    """OpenCV's name of the markers; 5X5_100, and APRILTAG_36h11 for tags, where none is given."""

    def __post_init__(self) -> None:
        if not (1 <= self.columns <= 100 and 1 <= self.rows <= 100 and 0 < self.marker < self.square < 10):
            text = f"{self.columns} x {self.rows} of {self.square:g} m with markers of {self.marker:g} m"
            raise InputError(f"board of {text}: give counts from 1 to 100, and metres, markers smaller than squares")

    def made(self) -> Any:
        """Return OpenCV's board. Raises InputError where OpenCV is missing, or has no such markers."""
        aruco = opencv().aruco
        name = f"DICT_{self.dictionary or ('APRILTAG_36h11' if self.kind == 'apriltag' else '5X5_100')}"
        if not hasattr(aruco, name):
            known = ", ".join(one[5:] for one in dir(aruco) if one.startswith("DICT_"))
            raise InputError(f"dictionary {name[5:]!r:.40} is not known to OpenCV; give one of {known}")
        markers, size = aruco.getPredefinedDictionary(getattr(aruco, name)), (self.columns, self.rows)
        try:
            if self.kind == "apriltag":
                board = aruco.GridBoard(size, self.marker, self.square - self.marker, markers)
            else:
                board = aruco.CharucoBoard(size, self.square, self.marker, markers)
            if int(np.max(board.getIds())) >= len(markers.bytesList):
                raise ValueError("too few markers")
            return board
        except Exception as error:  # OpenCV's, or Python's where it returns nothing
            text = f"a board of {self.columns} x {self.rows} with {name[5:]} is none to OpenCV"
            remedy = "give its numbers of columns and rows, and a dictionary with enough markers"
            raise InputError(f"{text}; {remedy}") from error


def opencv() -> Any:
    """Return OpenCV. Raises InputError where it is missing."""
    with needed("boards need the extra `calibrate`: pip install 'meshreel[calibrate]'"):
        import cv2
    return cv2


def poses_by_board(cameras: Sequence[ColorCamera], options: BoardOptions) -> tuple[dict[str, Matrix], list[str]]:
    """Return the cameras' poses, of which the first stays, and a warning for unseen ones. Raises InputError."""
    board = options.made()
    seen = [_seen(camera, board) for camera in cameras]
    across = {  # poses of j in i
        (i, j): [strict.products(pose, strict.inverse(seen[j][n])) for n, pose in seen[i].items() if n in seen[j]]
        for i, j in permutations(range(len(cameras)), 2)
    }
    together = sorted((pair for pair in across if across[pair]), key=lambda pair: -len(across[pair]))
    if not together:
        counts = ", ".join(f"{camera.name} in {len(found)} frames" for camera, found in zip(cameras, seen, strict=True))
        text = f"no two cameras see the board in one frame ({counts or 'there are no colour cameras'})"
        raise InputError(f"{text}; check its numbers and dictionary, or move it where several see it")
    first = min(min(pair) for pair in together)
    placed = {first: cameras[first].view.pose.to_world}
    while steps := [(i, j) for i, j in together if i in placed and j not in placed]:
        i, j = steps[0]  # of those, the pair with the most frames
        placed[j] = strict.products(placed[i], mean_pose(across[i, j]))
    lost = [camera.name for number, camera in enumerate(cameras) if number not in placed]
    text = f"{', '.join(lost)} did not see the board together with {cameras[first].name}, also not through others"
    return {cameras[n].name: pose for n, pose in placed.items()}, [f"{text}; poses stay as given"] if lost else []


def _seen(camera: ColorCamera, board: Any) -> dict[int, Matrix]:
    """Return the board's pose in the camera, by frame."""
    frames = sorted(camera.files)
    chosen = sorted({frames[int(k)] for k in np.linspace(0, len(frames) - 1, LOOKED_AT)})
    found = dict[int, Matrix]()
    for frame in chosen:
        picture = camera.picture(frame)
        if picture is not None and (pose := _board_pose(picture.pixels, camera, board)) is not None:
            found[frame] = pose
    return found


def _board_pose(pixels: UInt8[np.ndarray, "H W 3"], camera: ColorCamera, board: Any) -> Matrix | None:
    """Return the pose of a board in the camera's coordinates, None where it is not seen well."""
    cv2 = opencv()
    grey = cv2.cvtColor(np.ascontiguousarray(pixels), cv2.COLOR_RGB2GRAY)
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    if isinstance(board, cv2.aruco.CharucoBoard):
        corners, ids, *_ = cv2.aruco.CharucoDetector(board, detectorParams=settings).detectBoard(grey)
    else:
        corners, ids, _ = cv2.aruco.ArucoDetector(board.getDictionary(), settings).detectMarkers(grey)
    if ids is None or len(ids) == 0:
        return None
    places, points = board.matchImagePoints(corners, ids)
    least = 4 if len(ids) == 1 and board.getIds().size == 1 else LEAST_CORNERS
    if places is None or len(places) < least:
        return None
    places = places.reshape(-1, 3)
    if np.linalg.matrix_rank(places - places[:1], tol=1e-6) < 2:  # on a line, about which the board is free to turn
        return None
    to_middle = np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])  # to OpenCV the middles of pixels are whole numbers
    lens = camera.view.intrinsic - to_middle, np.array(camera.view.distortion)
    good, turn, shift = cv2.solvePnP(places, points, *lens, flags=cv2.SOLVEPNP_IPPE)
    if not good:
        return None
    turn, shift = cv2.solvePnPRefineLM(places, points, *lens, turn, shift)
    apart = cv2.projectPoints(places, turn, shift, *lens)[0].reshape(-1, 2) - points.reshape(-1, 2)
    if float(np.sqrt((apart**2).sum(axis=1).mean())) > WORST:
        return None
    return pose_of(turn.reshape(3), shift.reshape(3))
