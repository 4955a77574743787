"""A tiny SAM3 video model for tests, with random weights and single letters as tokens."""

import json
from pathlib import Path

SIZE, PATCH = 112, 14
SIDE = SIZE // PATCH


def write_tiny_sam3(folder: Path) -> None:
    """Writes configuration, weights and tokenizer, as they lie in a folder of real weights."""
    import torch
    from transformers import Sam3Config, Sam3TrackerVideoConfig, Sam3VideoConfig, Sam3VideoModel

    backbone = {
        "model_type": "sam3_vit_model",
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_hidden_layers": 2,
        "num_attention_heads": 4,
        "image_size": SIZE,
        "patch_size": PATCH,
        "window_size": 4,
        "global_attn_indexes": [1],
        "pretrain_image_size": SIZE,
    }
    vision = {
        "model_type": "sam3_vision_model",
        "backbone_config": backbone,
        "backbone_feature_sizes": [[4 * SIDE, 4 * SIDE], [2 * SIDE, 2 * SIDE], [SIDE, SIDE]],
    }
    text = {"hidden_size": 32, "intermediate_size": 64, "num_hidden_layers": 1, "num_attention_heads": 4}
    text |= {"vocab_size": 60, "max_position_embeddings": 32, "projection_dim": 32, "model_type": "clip_text_model"}
    text |= {"bos_token_id": 52, "eos_token_id": 53, "pad_token_id": 53}
    small = {"num_layers": 1, "intermediate_size": 64}
    detector = Sam3Config(
        vision_config=vision,
        text_config=text,
        geometry_encoder_config=small,
        detr_encoder_config=small,
        detr_decoder_config=small | {"num_queries": 4},
    )
    tracker = Sam3TrackerVideoConfig(
        vision_config=vision,
        prompt_encoder_config={"image_size": SIZE, "patch_size": PATCH},
        memory_attention_num_layers=1,
        memory_attention_feed_forward_hidden_size=64,
        memory_attention_rope_feat_sizes=[SIDE, SIDE],
        num_maskmem=2,
    )
    config = Sam3VideoConfig(
        detector_config=detector,
        tracker_config=tracker,
        low_res_mask_size=4 * SIDE,
        score_threshold_detection=0.01,  # random weights are sure of nothing
        new_det_thresh=0.01,
        max_num_objects=3,
        hotstart_delay=0,
    )
    config.image_size = SIZE  # the parts come with their own
    torch.manual_seed(0)
    Sam3VideoModel(config).save_pretrained(folder)
    write_tokenizer(folder)


def write_tokenizer(folder: Path) -> None:
    """A tokenizer of letters, in the files of CLIP's."""
    letters = "abcdefghijklmnopqrstuvwxyz"
    words = [*letters, *(letter + "</w>" for letter in letters), "<|startoftext|>", "<|endoftext|>"]
    vocabulary = {word: number for number, word in enumerate(words)}
    (folder / "vocab.json").write_text(json.dumps(vocabulary))
    (folder / "merges.txt").write_text("#version: 0.2\n")
    (folder / "tokenizer_config.json").write_text(json.dumps({"tokenizer_class": "CLIPTokenizer"}))
