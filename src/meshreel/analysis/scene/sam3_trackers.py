"""SAM3's models as trackers of objects through a video, prompted by words, or by points and masks.

In: a folder of weights, and pictures. Out: the object at each pixel. The one module that imports torch and
transformers, of the extra `sam3`. Pictures are prepared here, since SAM3's own processor needs torchvision.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Int32, UInt8
from scipy.ndimage import label

from ...errors import InputError
from .hypotheses import Prompt, Tracked, motion_prompts

_WORDS = 32  # tokens of a prompt, fixed by the model
_TOKENIZER = "tokenizer.json, or vocab.json with merges.txt"
_NEEDED = f"config.json, model.safetensors (or its shards) and {_TOKENIZER}: the files of facebook/sam3"
_KIND = "moving"  # of the objects that are found by their motion

Pictures = Sequence[UInt8[np.ndarray, "H W 3"]]


class WordTracker:
    """SAM3's video model: finds the prompted objects in every picture of a video and tracks them through it."""

    def __init__(self, path: Path, prompts: tuple[str, ...], device: str) -> None:
        self._model = _Model(path, "Sam3VideoModel", device)
        self._prompts = prompts

    def over_time(self, pictures: Pictures, depths: Sequence[Float32[np.ndarray, "h w"]]) -> Tracked:
        """Track objects through the pictures of one view at consecutive moments; `depths` are for `PointTracker`."""
        del depths
        return self._follow(pictures, self._model.network.config.hotstart_delay)

    def through_views(self, pictures: Pictures, first: Int32[np.ndarray, "H W"]) -> Tracked:
        """Track objects through the pictures of all views at one moment.

        Most views do not see a given object. In a video SAM3 would discard it as a false detection; here it is kept.
        """
        del first
        return self._follow(pictures, 0)

    def _follow(self, pictures: Pictures, confirmation: int) -> Tracked:
        """Track objects through a video; one that is not found again within `confirmation` pictures is discarded."""
        from transformers.models.sam3_video.modeling_sam3_video import Sam3VideoInferenceSession

        self._model.network.hotstart_delay = confirmation
        session = self._model.session(Sam3VideoInferenceSession, pictures)
        for prompt in self._prompts:
            number = session.add_prompt(prompt)
            words = self._model.tokens(prompt)
            session.prompt_input_ids[number] = words.input_ids
            session.prompt_attention_masks[number] = words.attention_mask
        objects = np.zeros((len(pictures), *pictures[0].shape[:2]), np.int32)
        kinds: dict[int, str] = {}
        for output in self._model.network.propagate_in_video_iterator(session):
            hidden = set(output.suppressed_obj_ids or ()) | set(session.hotstart_removed_obj_ids)
            numbers = [number for number in sorted(output.obj_id_to_mask) if number not in hidden]
            # Read now: the session forgets the prompt of an object that it removes.
            kinds |= {number + 1: session.prompts[session.obj_id_to_prompt_id[number]] for number in numbers}
            scores = [output.obj_id_to_tracker_score.get(number, 0.0) for number in numbers]
            masks = [output.obj_id_to_mask[number] for number in numbers]
            self._model.paint(objects[output.frame_idx], zip(scores, numbers, masks, strict=True))
        return Tracked(objects, {number: kinds[number] for number in np.unique(objects[objects > 0]).tolist()})


class PointTracker:
    """SAM3's tracker, prompted by points where there is motion, and in other views by masks."""

    def __init__(self, path: Path, device: str) -> None:
        self._model = _Model(path, "Sam3TrackerVideoModel", device)

    def over_time(self, pictures: Pictures, depths: Sequence[Float32[np.ndarray, "h w"]]) -> Tracked:
        """Track moving objects through the pictures of one view at consecutive moments."""
        prompts = motion_prompts(depths)
        return self._follow(pictures, {number: (prompt.frame, prompt) for number, prompt in enumerate(prompts, 1)})

    def through_views(self, pictures: Pictures, first: Int32[np.ndarray, "H W"]) -> Tracked:
        """Track the objects of the first picture through the pictures of all views at one moment."""
        return self._follow(pictures, {number: (0, first == number) for number in np.unique(first[first > 0]).tolist()})

    def _follow(self, pictures: Pictures, prompts: dict[int, tuple[int, Any]]) -> Tracked:
        """Track objects through a video, each prompted in one picture by points or by a mask."""
        from transformers.models.sam3_tracker_video.modeling_sam3_tracker_video import Sam3TrackerVideoInferenceSession

        objects = np.zeros((len(pictures), *pictures[0].shape[:2]), np.int32)
        if not prompts:
            return Tracked(objects, {})
        session = self._model.session(Sam3TrackerVideoInferenceSession, pictures)
        for number, (frame, prompt) in sorted(prompts.items(), key=lambda item: item[1][0]):
            index = session.obj_id_to_idx(number - 1)
            if isinstance(prompt, Prompt):
                session.add_point_inputs(index, frame, self._model.points(prompt))
            else:
                session.add_mask_inputs(index, frame, self._model.mask(prompt))
            session.obj_with_new_inputs = [number - 1]
            self._model.run(session, frame)  # with its input first, so that it is tracked before that picture, too
        for frame in range(len(pictures)):
            output = self._model.run(session, frame)
            scores = output.object_score_logits.reshape(-1).tolist()
            self._model.paint(objects[frame], zip(scores, output.object_ids, output.pred_masks, strict=True))
        return Tracked(objects, dict.fromkeys(np.unique(objects[objects > 0]).tolist(), _KIND))


class _Model:
    """A model of transformers on a device, with conversions of its inputs and outputs."""

    def __init__(self, path: Path, name: str, device: str) -> None:
        names = {child.name for child in path.iterdir()} if path.is_dir() else set()
        weights = any(name.endswith(".safetensors") for name in names)
        words = "tokenizer.json" in names or {"vocab.json", "merges.txt"} <= names
        if not ("config.json" in names and weights and words):
            raise InputError(f"{path}: holds no weights of SAM3; the folder must hold {_NEEDED}")
        torch, transformers = _libraries()
        try:
            self._device = torch.device(device)
            network, loaded = getattr(transformers, name).from_pretrained(
                path, local_files_only=True, output_loading_info=True, dtype=torch.float32
            )
            self.network = network.to(self._device).eval()
            self._tokenizer = transformers.AutoTokenizer.from_pretrained(path, local_files_only=True)
        except Exception as error:  # the library raises exceptions of many types for invalid files
            raise InputError(f"{path}: SAM3 cannot be loaded ({error}); the folder must hold {_NEEDED}") from error
        if loaded["missing_keys"]:
            first = sorted(loaded["missing_keys"])[0]
            text = f"{path}: the weights lack {len(loaded['missing_keys'])} of SAM3's tensors, as {first}"
            raise InputError(f"{text}; the folder must hold {_NEEDED}")
        self._torch, self._size = torch, int(self.network.config.image_size)

    def session(self, kind: Any, pictures: Pictures) -> Any:
        height, width, _ = pictures[0].shape
        places = dict.fromkeys(("inference_device", "inference_state_device", "video_storage_device"), self._device)
        session = kind(video_height=height, video_width=width, dtype=self._torch.float32, **places)
        session.processed_frames = _Video(pictures, self._size, self._torch)
        return session

    def run(self, session: Any, frame: int) -> Any:
        with self._torch.inference_mode():
            return self.network(session, frame_idx=frame)

    def tokens(self, words: str) -> Any:
        text = self._tokenizer(words, return_tensors="pt", padding="max_length", max_length=_WORDS, truncation=True)
        return text.to(self._device)

    def points(self, prompt: Prompt) -> dict[str, Any]:
        """Return points as the model's input: in pixels of its square picture, label 1 on the object."""
        places = self._torch.from_numpy((prompt.points * self._size).astype(np.float32))
        labels = self._torch.from_numpy(prompt.inside.astype(np.int32))
        return {"point_coords": places[None, None], "point_labels": labels[None, None]}

    def mask(self, mask: np.ndarray) -> Any:
        """Return a mask as the model's input, of its square picture."""
        picture = self._torch.from_numpy(mask.astype(np.float32))[None, None]
        return self._torch.nn.functional.interpolate(picture, size=(self._size, self._size), mode="nearest")

    def paint(self, objects: Int32[np.ndarray, "H W"], scored: Iterable[tuple[float, int, Any]]) -> None:
        """Write objects, each with score, number and logits, into a picture: number + 1 where logits are positive.

        The surest object is written last and keeps its pixels.
        """
        for _, number, logits in sorted(scored, key=lambda item: item[0]):
            logits = logits.float().reshape(1, 1, *logits.shape[-2:])
            scaled = self._torch.nn.functional.interpolate(logits, size=objects.shape, mode="bilinear")
            objects[np.asarray((scaled[0, 0] > 0).cpu())] = number + 1


class _Video:
    """Pictures in the model's input format, converted on access: a whole converted video would take gigabytes."""

    def __init__(self, pictures: Pictures, size: int, torch: Any) -> None:
        self._pictures, self._size, self._torch = pictures, size, torch

    def __len__(self) -> int:
        return len(self._pictures)

    def __getitem__(self, number: int) -> Any:
        """Return a picture as 3 x size x size, -1 to 1, like SAM3's own processor."""
        picture = self._torch.from_numpy(np.ascontiguousarray(self._pictures[number])).permute(2, 0, 1)[None].float()
        square = self._torch.nn.functional.interpolate(
            picture, size=(self._size, self._size), mode="bilinear", antialias=True
        )
        return square[0] / 127.5 - 1


class CleanUp:
    """Suppression of duplicate masks, and areas of connected pixels, with which SAM3 cleans its masks.

    transformers takes both from a package that it downloads at run time and that needs CUDA; without that package it
    skips them with a warning.
    """

    @staticmethod
    def generic_nms(overlaps: Any, scores: Any, most: float, use_iou_matrix: bool = True) -> Any:
        """Return the masks, surest first, that overlap none of the surer returned ones by more than `most`."""
        del use_iou_matrix
        doubles, surest = (overlaps > most).cpu().numpy(), list[int]()
        for number in np.argsort(-scores.float().cpu().numpy(), kind="stable").tolist():
            if not doubles[number, surest].any():
                surest.append(number)
        return scores.new_tensor(surest).long()

    @staticmethod
    def cc_2d(masks: Any, get_counts: bool = True) -> tuple[Any, Any]:
        """Return a label and the area, pixels, of the connected component of each pixel of N x 1 x H x W masks."""
        del get_counts
        labels, areas = np.zeros((2, *masks.shape), np.int32)
        for number, mask in enumerate(masks[:, 0].cpu().numpy()):
            labels[number, 0], _ = label(mask, np.ones((3, 3)))
            counts = np.bincount(labels[number].reshape(-1))
            areas[number, 0] = np.where(mask, counts[labels[number, 0]], 0)
        return tuple(masks.new_tensor(array).int() for array in (labels, areas))


def _libraries() -> tuple[Any, Any]:
    try:
        import torch
        import transformers
        from transformers import Sam3TrackerVideoModel, Sam3VideoModel  # noqa: F401
        from transformers.models.sam3_video import modeling_sam3_video
    except ImportError as error:
        raise InputError(f"SAM3 needs the extra sam3 ({error}): pip install 'meshreel[sam3]'") from None
    transformers.utils.logging.disable_progress_bar()
    modeling: Any = modeling_sam3_video  # its own type for this name is the kernel that is not installed
    modeling.cv_utils_kernel = CleanUp
    return torch, transformers
