"""The README's first command in its smallest form: every command, one after another."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest
from in_process import InProcess
from render_scenes import write_inputs

from lime_keras.commands import estimate as estimate_cli
from lime_keras.commands import export as export_cli
from lime_keras.data.corpus import Split
from lime_keras.eval import cli as eval_cli
from lime_keras.io import photo
from lime_keras.networks import PRESETS, Architecture
from lime_keras.render import cli as render_cli
from lime_keras.render.corpus import split as rendering
from lime_keras.render.jobs import processes
from lime_keras.train import cli as train_cli
from lime_keras.train import stages

BRIEF = stages.Schedule(
    batch_size=2,
    single_steps=2,
    encoder_steps=2,
    single_learning_rate=1e-3,
    joint_steps=2,
    joint_learning_rate=1e-4,
    validation_examples=2,
)
SMALL = Architecture(size=64, unet_width=2, unet_depth=1, encoder_width=2, dense_width=4)
STAGES = {
    # These train every subnetwork, and the last one learns from all that a record holds.
    "two stages": ["--stages", "segmentation", "specular+mirror+exponent+albedo"],
    "every stage": [],
}


@pytest.fixture(
    scope="module",
    params=[STAGES["two stages"], pytest.param(STAGES["every stage"], marks=pytest.mark.slow)],
    ids=STAGES,
)
def run(request, tmp_path_factory):
    """A folder in which every command has succeeded."""
    with pytest.MonkeyPatch.context() as patch:
        for name in processes.THREAD_VARIABLES:
            patch.setenv(name, "1")
        # Processes are tested in tests/render/corpus.
        patch.setattr(rendering, "Pool", InProcess)
        patch.setitem(stages.SCHEDULES, "smoke", BRIEF)
        patch.setitem(PRESETS, "smoke", SMALL)
        run = tmp_path_factory.mktemp("quickstart")
        inputs = write_inputs(tmp_path_factory.mktemp("inputs"))
        corpus = str(run / "corpus")
        render = [corpus, "--size", "64", "--shard-size", "3", "--workers", "1"]
        render += ["--shapes", str(inputs / "shapes")]
        render += ["--environments", str(inputs / "environments")]
        assert render_cli.main([*render, "--split", "train", "--count", "6"]) == 0
        assert render_cli.main([*render, "--split", "test", "--count", "3"]) == 0
        train = [corpus, "--out", str(run), "--preset", "smoke", *request.param]
        assert train_cli.main(train) == 0
        assert eval_cli.main([corpus, "--weights", str(run), "--out", str(run)]) == 0
        # A SavedModel takes long to write, and is tried in tests/lime_keras/export.
        for model_format in ("onnx",) if request.param else ("savedmodel", "onnx"):
            export = [str(run / "exported"), "--format", model_format, "--weights", str(run)]
            assert export_cli.main(export) == 0
        photos = sorted((run / "examples").glob("*.png"))
        # After so few batches, SegmentationNet may find no object.
        (run / "masks").mkdir()
        for path in photos:
            mask = np.zeros((64, 64, 1), np.float32)
            mask[16:48, 16:48] = 1
            photo.write(run / "masks" / path.name, mask)
        estimate = [*map(str, photos), "--weights", str(run), "--mask", str(run / "masks")]
        estimate += ["--out", str(run / "materials")]
        assert estimate_cli.main(estimate) == 0
    return run


def test_everything_promised_is_there(run):
    for name in (
        "report.html",
        "metrics.json",
        "table1.md",
        "confusion.png",
        "config.json",
        "model/architecture.json",
        "exported/lime.onnx",
    ):
        assert (run / name).exists(), name
    assert not list(run.rglob("partial-*"))


def test_training_and_test_share_no_shape_and_no_light(run):
    train, test = (Split(run / "corpus", split).manifest for split in ("train", "test"))
    assert not set(train["shapes"]) & set(test["shapes"])
    assert not set(train["lights"]) & set(test["lights"])


def test_a_picture_goes_in_and_a_material_comes_out(run):
    picture = sorted((run / "examples").glob("*.png"))[0]
    material = json.loads((run / "materials" / f"{picture.stem}.json").read_text(encoding="utf-8"))
    assert len(material["diffuse_albedo"]) == 3
    assert all(0 <= value <= 1 for value in material["diffuse_albedo"])
    assert 0 <= material["specular_albedo"] <= 1
    assert 1 <= material["exponent"] <= 1000
    assert sum(material["exponent_bin_probabilities"]) == pytest.approx(1, abs=1e-5)
    for layer in ("mask.png", "diffuse.png", "specular_shading.exr", "mirror.exr", "mirror.png"):
        image = oiio.ImageBuf(str(run / "materials" / f"{picture.stem}-{layer}"))
        assert not image.has_error
        assert (image.spec().width, image.spec().height) == (64, 64)


def test_the_report_counts_the_test_split(run):
    metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["count"] == 3
