"""The choice of a device: what was begun with one variant of Mitsuba goes on with it."""

import json

import pytest

from lime_keras.render.commands import corpus
from lime_keras.render.mitsuba_setup import variants

ON_GPU = variants.Choice(variants.GPU, None)
ON_CPU = variants.Choice(variants.FAST, "libLLVM.so.19")


@pytest.fixture(autouse=True)
def machine_with_both(monkeypatch):
    monkeypatch.setattr(
        variants, "choose", lambda device=None: ON_CPU if device == "cpu" else ON_GPU
    )


def choose(tmp_path, begun, device=None):
    description = tmp_path / "description.json"
    if begun:
        description.write_text(json.dumps({"variant": begun}))
    return corpus.choose_variant(description, device)


@pytest.mark.parametrize(
    ("begun", "device", "expected"),
    [
        (None, None, ON_GPU),
        (None, "cpu", ON_CPU),
        (None, "cuda", ON_GPU),
        (variants.FAST, None, ON_CPU),
        (variants.GPU, None, ON_GPU),
        (variants.SLOW, None, variants.Choice(variants.SLOW, None)),
        (variants.SLOW, "cpu", variants.Choice(variants.SLOW, None)),
        (variants.SLOW, "cuda", ON_GPU),  # refused later, as any other description
    ],
)
def test_a_folder_goes_on_with_its_variant_unless_a_device_is_asked_for(
    tmp_path, capsys, begun, device, expected
):
    assert choose(tmp_path, begun, device) == expected
    assert expected.variant in capsys.readouterr().err


def test_a_corpus_begun_on_a_gpu_is_not_finished_without_one(tmp_path, monkeypatch):
    def refuse(device=None):
        assert device == "cuda"
        raise RuntimeError("no GPU can render here")

    monkeypatch.setattr(variants, "choose", refuse)
    with pytest.raises(RuntimeError, match="no GPU can render here"):
        choose(tmp_path, variants.GPU)
