"""What cleans SAM3's masks, and that transformers uses it: of doubles one is kept, and areas are counted."""

import numpy as np
import pytest

from meshreel.analysis.scene.sam3_trackers import CleanUp, _libraries


@pytest.fixture(scope="module")
def torch():
    pytest.importorskip("transformers", reason="the extra sam3 is not installed: MESHREEL_SAM3=1 ./scripts/setup")
    return _libraries()[0]


def test_of_masks_that_overlap_the_surest_is_kept(torch):
    overlaps = torch.tensor([[1.0, 0.9, 0.2], [0.9, 1.0, 0.5], [0.2, 0.5, 1.0]])
    assert CleanUp.generic_nms(overlaps, torch.tensor([0.6, 0.8, 0.7]), 0.5).tolist() == [1, 2]


def test_holes_are_filled_and_specks_removed_by_the_model_s_own_rule(torch):
    from transformers.models.sam3_video.modeling_sam3_video import fill_holes_in_mask_scores, nms_masks

    mask = torch.full((1, 1, 20, 20), -1.0)
    mask[..., 4:16, 4:16] = 1.0
    mask[..., 8:10, 8:10] = -1.0
    mask[..., 1, 1] = 1.0
    wanted = np.zeros((20, 20), bool)
    wanted[4:16, 4:16] = True
    assert np.array_equal(fill_holes_in_mask_scores(mask, 16)[0, 0] > 0, wanted)
    kept = nms_masks(torch.tensor([0.9, 0.95, 0.1]), mask[0].repeat(3, 1, 1), 0.5, 0.1)
    assert kept.tolist() == [False, True, False]
