"""The options that render a clone, on their way to the renderer."""

from pathlib import Path

import pytest

from lime_keras.render import cloning
from lime_keras.render.commands import clone
from lime_keras.render.mitsuba_setup import variants


@pytest.mark.parametrize(
    ("words", "up", "shadow"), [([], "y", False), (["--up", "z", "--shadow"], "z", True)]
)
def test_the_mesh_stands_as_the_options_say(words, up, shadow, monkeypatch):
    asked = {}
    monkeypatch.setattr(variants, "choose", lambda: None)
    monkeypatch.setattr(variants, "activate", lambda *_: None)
    monkeypatch.setattr(cloning, "clone", lambda *_, **options: asked.update(options))
    options = clone.parser().parse_args(["cup.jpg", "--clone-onto", "teapot.ply", *words])
    clone._renderer(options)("photo", "mask")
    assert asked == {"mesh_path": Path("teapot.ply"), "up": up, "shadow": shadow}
