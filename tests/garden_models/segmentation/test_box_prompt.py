"""SAM-3's tracker and SAM-2, small and random, through their real classes and files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from garden_models.foundation import ADAPTERS, card
from garden_models.scene import BadInput
from garden_models.segmentation import sam2, sam3_tracker
from garden_models.segmentation.box_prompt import squeezed, squeezed_boxes, stretched
from garden_models.segmentation.mask_model import MaskRequest

transformers = pytest.importorskip("transformers")

SIDE = {"sam3": 112, "sam2": 128}
MODULES = {"sam3": sam3_tracker, "sam2": sam2}


def tiny_sam3() -> torch.nn.Module:
    vit = transformers.Sam3ViTConfig(
        hidden_size=32, intermediate_size=64, num_hidden_layers=2, num_attention_heads=2,
        image_size=112, patch_size=14, window_size=4, global_attn_indexes=[1],
        pretrain_image_size=56,
    )  # fmt: skip
    config = transformers.Sam3TrackerConfig(
        vision_config=transformers.Sam3VisionConfig(
            backbone_config=vit,
            fpn_hidden_size=32,
            backbone_feature_sizes=[[32, 32], [16, 16], [8, 8]],
        ),
        prompt_encoder_config={"hidden_size": 32, "image_size": 112, "patch_size": 14},
        mask_decoder_config={
            "hidden_size": 32, "mlp_dim": 64, "num_attention_heads": 4, "iou_head_hidden_dim": 32,
        },
    )  # fmt: skip
    return transformers.Sam3TrackerModel(config)


def tiny_sam2() -> torch.nn.Module:
    backbone = transformers.Sam2HieraDetConfig(
        hidden_size=8, image_size=[128, 128], blocks_per_stage=[1, 1, 2, 1],
        embed_dim_per_stage=[8, 16, 32, 64], num_attention_heads_per_stage=[1, 1, 2, 2],
        window_size_per_stage=[8, 4, 4, 2], global_attention_blocks=[3],
    )  # fmt: skip
    vision = transformers.Sam2VisionConfig(
        backbone_config=backbone, backbone_channel_list=[64, 32, 16, 8],
        backbone_feature_sizes=[[32, 32], [16, 16], [8, 8]], fpn_hidden_size=32,
    )  # fmt: skip
    config = transformers.Sam2Config(
        vision_config=vision,
        prompt_encoder_config={"hidden_size": 32, "image_size": 128, "patch_size": 16},
        mask_decoder_config={
            "hidden_size": 32, "mlp_dim": 64, "num_attention_heads": 4, "iou_head_hidden_dim": 32,
        },
    )  # fmt: skip
    return transformers.Sam2Model(config)


@pytest.fixture(scope="module", params=["sam3", "sam2"])
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def network(name: str) -> torch.nn.Module:
    torch.manual_seed(3)
    return {"sam3": tiny_sam3, "sam2": tiny_sam2}[name]().eval()


@pytest.fixture(scope="module")
def folder(name: str, network: torch.nn.Module, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp(name)
    network.save_pretrained(path)
    return path


def photo(width: int = 80, height: int = 60) -> np.ndarray:
    return np.random.default_rng(5).integers(0, 256, (height, width, 3), np.uint8)


BOXES = np.array([[10.0, 12.0, 40.0, 50.0], [50.0, 5.0, 75.0, 30.0]])


def test_the_reloaded_network_answers_one_mask_and_score_a_box(name: str, folder: Path) -> None:
    answer = MODULES[name].load(folder, "cpu")(MaskRequest(photo(), BOXES))
    assert answer.masks.shape == (2, 60, 80) and answer.masks.dtype == bool
    assert answer.scores.shape == (2,)
    assert ((answer.scores >= 0) & (answer.scores <= 1)).all()


def test_it_answers_what_the_saved_network_says(
    name: str, network: torch.nn.Module, folder: Path
) -> None:
    """The very weights were loaded, and the photo and the boxes went in as they should."""
    module, side = MODULES[name], SIDE[name]
    answer = module.load(folder, "cpu")(MaskRequest(photo(), BOXES))
    with torch.inference_mode():
        out = network(
            pixel_values=squeezed(photo(), side, module.MEAN, module.STD),
            input_boxes=torch.tensor(
                [[[x0 * side / 80, y0 * side / 60, x1 * side / 80, y1 * side / 60]
                  for x0, y0, x1, y1 in BOXES]]
            ).float(),
            multimask_output=False,
        )  # fmt: skip
    expected = stretched(out.pred_masks[0, :, 0], (80, 60)).numpy()
    assert 0 < expected.mean() < 1
    np.testing.assert_array_equal(answer.masks, expected)


def test_each_box_has_a_mask_of_its_own(name: str, folder: Path) -> None:
    predict = MODULES[name].load(folder, "cpu")
    both = predict(MaskRequest(photo(), BOXES))
    for i in range(2):
        alone = predict(MaskRequest(photo(), BOXES[i : i + 1]))
        np.testing.assert_array_equal(both.masks[i], alone.masks[0])


def test_no_box_has_no_mask_and_a_box_without_area_is_refused(name: str, folder: Path) -> None:
    predict = MODULES[name].load(folder, "cpu")
    assert predict(MaskRequest(photo(), np.zeros((0, 4)))).masks.shape == (0, 60, 80)
    with pytest.raises(BadInput, match="x0 < x1"):
        predict(MaskRequest(photo(), BOXES[:, [2, 1, 0, 3]]))


def test_a_folder_without_weights_is_refused_by_the_names_of_the_files(
    name: str, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match=r"config\.json.*model\.safetensors"):
        MODULES[name].load(tmp_path, "cpu")


def test_weights_that_lack_a_parameter_are_refused(name: str, folder: Path, tmp_path: Path) -> None:
    """The loader would fill it with random numbers, and say so in a log at most."""
    weights = load_file(folder / "model.safetensors")
    gone = next(key for key in weights if "mask_decoder" in key)
    save_file(
        {k: w for k, w in weights.items() if k != gone},
        tmp_path / "model.safetensors",
        {"format": "pt"},
    )
    (tmp_path / "config.json").write_text((folder / "config.json").read_text())
    with pytest.raises(BadInput, match="1 of its parameters are missing"):
        MODULES[name].load(tmp_path, "cpu")


def test_weights_of_another_size_are_refused(name: str, folder: Path, tmp_path: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    config["mask_decoder_config"]["mlp_dim"] = 96
    (tmp_path / "config.json").write_text(json.dumps(config))
    (tmp_path / "model.safetensors").write_bytes((folder / "model.safetensors").read_bytes())
    with pytest.raises(BadInput):
        MODULES[name].load(tmp_path, "cpu")


def place_in_video_checkpoint(name: str) -> str:
    """Where the published checkpoint keeps a part of the tracker: it shares the detector's eyes."""
    if name.startswith("vision_encoder.backbone."):
        return f"detector_model.{name}"
    if name.startswith("vision_encoder.neck."):
        return name.replace("vision_encoder.neck.", "tracker_neck.")
    return f"tracker_model.{name}"


def test_the_tracker_loads_from_the_video_checkpoint(tmp_path: Path) -> None:
    """The published file holds the tracker among a detector and a memory."""
    torch.manual_seed(4)
    tiny = tiny_sam3().eval()
    weights = {
        place_in_video_checkpoint(name): value.clone().contiguous()
        for name, value in tiny.state_dict().items()
    }
    weights["detector_model.text_projection.weight"] = torch.zeros(2, 2)
    weights["tracker_model.memory_attention.layers.0.norm1.weight"] = torch.zeros(2)
    save_file(weights, tmp_path / "model.safetensors", {"format": "pt"})
    config = {"model_type": "sam3_video", "tracker_config": tiny.config.to_dict()}
    (tmp_path / "config.json").write_text(json.dumps(config))
    answer = sam3_tracker.load(tmp_path, "cpu")(MaskRequest(photo(), BOXES))
    with torch.inference_mode():
        out = tiny(
            pixel_values=squeezed(photo(), 112, sam3_tracker.MEAN, sam3_tracker.STD),
            input_boxes=squeezed_boxes(BOXES, (80, 60), 112),
            multimask_output=False,
        )
    np.testing.assert_array_equal(
        answer.masks, stretched(out.pred_masks[0, :, 0], (80, 60)).numpy()
    )


def test_sam2_loads_from_its_video_checkpoint(tmp_path: Path) -> None:
    """The published files are of the video model: the same network with a memory."""
    torch.manual_seed(5)
    tiny = tiny_sam2().eval()
    video = transformers.Sam2VideoModel(
        transformers.Sam2VideoConfig(
            vision_config=tiny.config.vision_config,
            prompt_encoder_config=tiny.config.prompt_encoder_config.to_dict(),
            mask_decoder_config=tiny.config.mask_decoder_config.to_dict(),
            image_size=128,
            memory_attention_hidden_size=32,
            memory_attention_num_layers=1,
            memory_attention_feed_forward_hidden_size=32,
            memory_encoder_hidden_size=32,
            memory_encoder_output_channels=16,
            mask_downsampler_embed_dim=32,
            memory_fuser_embed_dim=32,
            memory_fuser_intermediate_dim=32,
        )
    ).eval()
    video.save_pretrained(tmp_path)
    answer = sam2.load(tmp_path, "cpu")(MaskRequest(photo(), BOXES))
    same = sam2.load(tmp_path, "cpu")
    for name, value in same._model.state_dict().items():
        torch.testing.assert_close(value, video.state_dict()[name])
    assert answer.masks.shape == (2, 60, 80)


def test_weights_at_half_precision_are_read_at_full(
    name: str, folder: Path, tmp_path: Path
) -> None:
    weights = load_file(folder / "model.safetensors")
    half = {k: w.half() if w.is_floating_point() else w for k, w in weights.items()}
    save_file(half, tmp_path / "model.safetensors", {"format": "pt"})
    config = json.loads((folder / "config.json").read_text()) | {"dtype": "float16"}
    (tmp_path / "config.json").write_text(json.dumps(config))
    assert MODULES[name].load(tmp_path, "cpu")(MaskRequest(photo(), BOXES)).masks.any()


def test_boxes_are_squeezed_as_the_published_processor_does() -> None:
    """(10, 12, 40, 50) on 80 x 60 for a square of 112: recorded from the processor."""
    found = squeezed_boxes(BOXES[:1], (80, 60), 112).numpy()[0, 0]
    np.testing.assert_allclose(found, [14, 22.4, 56, 93.3333], atol=1e-3)


def test_a_mask_comes_back_where_it_was_in_the_photo() -> None:
    """Squeeze a box's own picture and stretch it again: the half-pixel grids agree."""
    width, height, side = 200, 120, 96
    mask = np.zeros((height, width, 3), np.uint8)
    mask[30:90, 50:150] = 255
    small = squeezed(mask, side, (0.5,) * 3, (0.5,) * 3)[0, :1]
    back = stretched(small, (width, height)).numpy()[0]
    wrong = back != (mask[..., 0] > 0)
    assert wrong.mean() < 0.02
    rows, columns = np.nonzero(back)
    assert abs(rows.mean() - 59.5) < 0.6 and abs(columns.mean() - 99.5) < 0.6


def test_colours_are_normalised_as_each_model_was_trained() -> None:
    white = np.full((8, 8, 3), 255, np.uint8)
    np.testing.assert_allclose(squeezed(white, 4, sam3_tracker.MEAN, sam3_tracker.STD), 1.0)
    imagenet = squeezed(white, 4, sam2.MEAN, sam2.STD).numpy()[0, :, 0, 0]
    np.testing.assert_allclose(imagenet, [2.2489, 2.4286, 2.64], atol=1e-3)


def test_both_are_known_by_name() -> None:
    for key, module in MODULES.items():
        assert ADAPTERS[key] == module.__name__
        assert card(key) is module.CARD and module.CARD.stage == "segment"
