"""Summary of an encode: the size, the groups and the warnings of a written file."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...format.layout import Form
from ...geometry.work import Work
from ..group.target import Fidelity


@dataclass(frozen=True, slots=True)
class GroupSummary:
    """Form, size and fidelity of a written group; distances in metres."""

    form: Form
    frame_count: int
    size: int  # bytes
    fidelity: Fidelity
    predicted: bool = False  # from the group before
    key: int | None = None  # the frame of the sequence whose surface the others follow
    track: int = 0  # the body
    share: float = 1.0  # of the vertices of its frames that the track has, where there is no background
    colors: int = 0  # bytes of its colours and pictures, beyond `size`
    lost_colors: bool = False  # its frames have colours that a reader would refuse
    canonical: bool = False  # its reference lies in the pose of eq. 5


@dataclass(frozen=True, slots=True)
class SceneSummary:
    """Sizes and measurements of the parts of a scene."""

    background: int  # bytes, of all its states
    faces: int  # of the first of them, as decoded
    noise: float  # m, RMS distance of a frame's still surface from the background
    psnr: float  # d2_psnr_paper of some frames, the scene's diagonal as peak, dB
    measured: tuple[int, ...]  # these frames
    tracks: int


@dataclass(frozen=True, slots=True)
class Summary:
    """Size, groups and warnings of a written file."""

    size: int  # bytes of the file
    groups: tuple[GroupSummary, ...]
    warnings: tuple[str, ...] = ()  # about surface that was not kept, a line each
    scene: SceneSummary | None = None  # of a scene with a background
    continued: int = 0  # intervals that an earlier run, which was stopped, had done
    audio: int = 0  # bytes of what is heard
    work: Work = field(default_factory=dict)  # that this run did

    @property
    def frame_count(self) -> int:
        """Number of frames of the sequence."""
        return sum(group.frame_count for group in self.groups if group.track == 0)

    @property
    def psnr(self) -> float:
        """Mean d2_psnr_paper over the frames, dB; of a scene, over the measured frames."""
        if self.scene is not None:
            return self.scene.psnr
        return sum(group.share * group.frame_count * group.fidelity.psnr for group in self.groups) / self.frame_count
