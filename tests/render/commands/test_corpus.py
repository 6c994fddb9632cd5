"""The choice of a variant of Mitsuba: what was begun with the slow one goes on with it."""

import json

import pytest

from lime_keras.render.commands import corpus
from lime_keras.render.mitsuba_setup import variants

FAST = variants.Choice(variants.FAST, "libLLVM.so.19")
SLOW = variants.Choice(variants.SLOW, None)


@pytest.mark.parametrize(
    ("begun", "expected"), [(None, FAST), (variants.FAST, FAST), (variants.SLOW, SLOW)]
)
def test_a_folder_goes_on_with_its_variant(tmp_path, capsys, monkeypatch, begun, expected):
    monkeypatch.setattr(variants, "choose", lambda: FAST)
    description = tmp_path / "description.json"
    if begun:
        description.write_text(json.dumps({"variant": begun}))
    assert corpus.choose_variant(description) == expected
    assert expected.variant in capsys.readouterr().err
