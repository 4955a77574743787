"""Masks by SAM3 in the paper's two stages (section 3.2): one view over time, then all views of each frame.

In: pictures of the views. Out: masks, and the object that each pixel sees. Stage 1 tracks the prompted objects through
a reference view and keeps those that move; stage 2 tracks them through the views of a frame, taken as a video, and
keeps those found in stage 1. Needs the extra `sam3`; the user supplies a folder with the weights.

Differs from the paper: it does not state its prompts; ours are words, by default `AUTOMATIC`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Int32, UInt8

from ...errors import InputError
from ...geometry.cameras import PinholeCamera
from ...geometry.raycast import Seen
from .hypotheses import Hypotheses, HypothesisOptions, Tracked, hypotheses, moving_in_views, reference_view, tour
from .masks import Masker
from .pictures import normal_picture

AUTOMATIC = ("person", "animal", "vehicle", "object")  # default prompts, whatever may move: a guess
_WORDS = 32  # tokens of a prompt, fixed by the model
_TOKENIZER = "tokenizer.json, or vocab.json with merges.txt"
_NEEDED = f"config.json, model.safetensors (or its shards) and {_TOKENIZER}: the files of facebook/sam3"


@dataclass(frozen=True, slots=True)
class Sam3Options:
    """Options of masks by SAM3."""

    reference: int | None = None  # number of the view that is tracked over time; None: the one with most changes
    device: str = "cpu"  # torch's name of a device: cpu, cuda, cuda:1 ...
    hypotheses: HypothesisOptions = field(default_factory=HypothesisOptions)


class Sam3Masks(Masker):
    """Masker that observes the reference view in every frame before it makes masks: two passes over the frames.

    Masks are kept, one bit per pixel, so that further encodes of the same sequence do not run the model again.
    """

    observes = True

    def __init__(self, path: Path, prompts: Sequence[str] | None = None, options: Sam3Options = Sam3Options()) -> None:
        """Load the weights in the folder `path`. Raises InputError if they or the extra `sam3` are missing."""
        self._tracker = _Tracker(path, tuple(prompts or AUTOMATIC), options.device)
        self._options = options
        self._chosen = options.reference
        self._pictures: list[UInt8[np.ndarray, "H W 3"]] = []
        self._moving: Hypotheses | None = None
        self._known: dict[int, UInt8[np.ndarray, " B"]] = {}

    @property
    def reference(self) -> int:
        """Number of the view that is tracked over time."""
        return self._chosen or 0

    def foresee(self, moments: Sequence[Sequence[Seen]]) -> None:
        """Choose the reference view by what all views see at a few moments; without this call it is the first view."""
        if self._chosen is None:
            self._chosen = reference_view(moments)

    def observe(self, frame: int, seen: Sequence[Seen], views: Sequence[PinholeCamera]) -> None:
        """Keep the reference view's picture of a frame; frames must come in order from 0 on, before the first masks."""
        if self._moving is not None or frame < len(self._pictures):
            return
        assert frame == len(self._pictures), "frames are observed in order, before masks"
        number = self._reference(views)
        self._pictures.append(normal_picture(seen[number], views[number]))

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[PinholeCamera]) -> Bool[np.ndarray, "X H W"]:
        """Return the masks of an observed frame; True: moving."""
        shape = (len(views), views[0].height, views[0].width)
        if frame not in self._known:
            self._known[frame] = np.packbits(self.objects(frame, seen, views) > 0)
        return np.unpackbits(self._known[frame], count=math.prod(shape)).astype(bool).reshape(shape)

    def objects(self, frame: int, seen: Sequence[Seen], views: Sequence[PinholeCamera]) -> Int32[np.ndarray, "X H W"]:
        """Return the number, the same in all frames, of the moving object that each pixel sees; 0: none."""
        moving = self._hypotheses()
        if not moving.objects.any():
            return np.zeros((len(views), views[0].height, views[0].width), np.int32)
        order = tour(views, self._reference(views))
        tracked = self._tracker.through_views([normal_picture(seen[number], views[number]) for number in order])
        found = moving_in_views(tracked, moving, frame, self._options.hypotheses)
        return found[np.argsort(order)]

    def _hypotheses(self) -> Hypotheses:
        """Run stage 1 at the first call and return its moving objects."""
        if self._moving is None:
            assert self._pictures, "observe the frames first"
            self._moving = hypotheses(self._tracker.over_time(self._pictures), self._options.hypotheses)
            self._pictures = []
        return self._moving

    def _reference(self, views: Sequence[PinholeCamera]) -> int:
        number = self.reference
        if not 0 <= number < len(views):
            raise InputError(f"reference view {number} of {len(views)}: give 0 to {len(views) - 1}")
        return number


class _Tracker:
    """SAM3's video model: finds the prompted objects in every picture of a video and tracks them through it."""

    def __init__(self, path: Path, prompts: tuple[str, ...], device: str) -> None:
        _check_files(path)
        torch, transformers = _libraries()
        try:
            self._device = torch.device(device)
            model, loaded = transformers.Sam3VideoModel.from_pretrained(
                path, local_files_only=True, output_loading_info=True, dtype=torch.float32
            )
            self._model = model.to(self._device).eval()
            self._tokenizer = transformers.AutoTokenizer.from_pretrained(path, local_files_only=True)
        except Exception as error:  # the library raises exceptions of many types for invalid files
            raise InputError(f"{path}: SAM3 cannot be loaded ({error}); the folder must hold {_NEEDED}") from error
        if loaded["missing_keys"]:
            some = sorted(loaded["missing_keys"])[0]
            text = f"{path}: the weights lack {len(loaded['missing_keys'])} of SAM3's tensors, as {some}"
            raise InputError(f"{text}; the folder must hold {_NEEDED}")
        self._torch, self._prompts = torch, prompts
        self._size = int(self._model.config.image_size)

    def over_time(self, pictures: list[UInt8[np.ndarray, "H W 3"]]) -> Tracked:
        """Track objects through the pictures of one view at consecutive moments."""
        return self._follow(pictures, self._model.config.hotstart_delay)

    def through_views(self, pictures: list[UInt8[np.ndarray, "H W 3"]]) -> Tracked:
        """Track objects through the pictures of all views at one moment.

        Most views do not see a given object. In a video SAM3 would discard it as a false detection; not here.
        """
        return self._follow(pictures, 0)

    def _follow(self, pictures: list[UInt8[np.ndarray, "H W 3"]], confirmation: int) -> Tracked:
        """Track objects through a video; one that is not found again within `confirmation` pictures is discarded."""
        self._model.hotstart_delay = confirmation
        height, width, _ = pictures[0].shape
        session = self._session(pictures)
        objects = np.zeros((len(pictures), height, width), np.int32)
        for output in self._model.propagate_in_video_iterator(session):
            hidden = set(output.suppressed_obj_ids or ()) | set(session.hotstart_removed_obj_ids)
            numbers = [number for number in sorted(output.obj_id_to_mask) if number not in hidden]
            scores = np.array([output.obj_id_to_tracker_score.get(number, 0.0) for number in numbers])
            for place in np.argsort(scores, kind="stable"):  # the surest object comes last and keeps its pixels
                mask = self._whole(output.obj_id_to_mask[numbers[place]], height, width)
                objects[output.frame_idx][mask] = numbers[place] + 1
        found = np.unique(objects[objects > 0]).tolist()
        return Tracked(objects, {k: session.prompts[session.obj_id_to_prompt_id[k - 1]] for k in found})

    def _session(self, pictures: list[UInt8[np.ndarray, "H W 3"]]) -> Any:
        from transformers.models.sam3_video.modeling_sam3_video import Sam3VideoInferenceSession

        height, width, _ = pictures[0].shape
        session: Any = Sam3VideoInferenceSession(
            video_height=height,
            video_width=width,
            inference_device=self._device,
            inference_state_device=self._device,
            video_storage_device=self._device,
            dtype=self._torch.float32,
        )
        session.processed_frames = _Video(pictures, self._size, self._torch)
        for prompt in self._prompts:
            number = session.add_prompt(prompt)
            words = self._tokenizer(
                prompt, return_tensors="pt", padding="max_length", max_length=_WORDS, truncation=True
            ).to(self._device)
            session.prompt_input_ids[number] = words.input_ids
            session.prompt_attention_masks[number] = words.attention_mask
        return session

    def _whole(self, logits: Any, height: int, width: int) -> Bool[np.ndarray, "H W"]:
        """Resize the model's logits to the picture's size and return the mask where they are positive."""
        logits = logits.float().reshape(1, 1, *logits.shape[-2:])
        whole = self._torch.nn.functional.interpolate(logits, size=(height, width), mode="bilinear")
        return np.asarray((whole[0, 0] > 0).cpu())


class _Video:
    """Pictures in the model's input format, converted on access: a whole converted video would take gigabytes."""

    def __init__(self, pictures: list[UInt8[np.ndarray, "H W 3"]], size: int, torch: Any) -> None:
        self._pictures, self._size, self._torch = pictures, size, torch

    def __len__(self) -> int:
        return len(self._pictures)

    def __getitem__(self, number: int) -> Any:
        """Return a picture as 3 x size x size, -1 to 1, like SAM3's own processor, which would need torchvision."""
        picture = self._torch.from_numpy(np.ascontiguousarray(self._pictures[number])).permute(2, 0, 1)[None].float()
        square = self._torch.nn.functional.interpolate(
            picture, size=(self._size, self._size), mode="bilinear", antialias=True
        )
        return square[0] / 127.5 - 1


def _libraries() -> tuple[Any, Any]:
    try:
        import torch
        import transformers
        from transformers import Sam3VideoModel  # noqa: F401
    except ImportError as error:
        raise InputError(f"SAM3 needs the extra sam3 ({error}): pip install 'meshreel[sam3]'") from None
    transformers.utils.logging.disable_progress_bar()
    return torch, transformers


def _check_files(path: Path) -> None:
    there = {child.name for child in path.iterdir()} if path.is_dir() else set()
    weights = any(name.endswith(".safetensors") for name in there)
    words = "tokenizer.json" in there or {"vocab.json", "merges.txt"} <= there
    if not ("config.json" in there and weights and words):
        raise InputError(f"{path}: holds no weights of SAM3; the folder must hold {_NEEDED}")
