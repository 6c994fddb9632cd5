"""The options that render a clone, on their way to the results and to the renderer."""

import pytest

from lime_keras.commands import estimate
from lime_keras.render import cloning
from lime_keras.render.commands import clone
from lime_keras.render.mitsuba_setup import variants


@pytest.mark.parametrize(
    ("words", "up", "shadow"),
    [([], "y", False), (["--up", "y"], "y", False), (["--up", "z", "--shadow"], "z", True)],
)
def test_the_mesh_stands_as_the_options_say(words, up, shadow, monkeypatch, tmp_path):
    """A result remembers the options, so that other ones make it anew."""
    rendered, passed = {}, []
    monkeypatch.setattr(variants, "choose", lambda: None)
    monkeypatch.setattr(variants, "activate", lambda *_: None)
    monkeypatch.setattr(cloning, "clone", lambda *_, **options: rendered.update(options))
    monkeypatch.setattr(estimate, "run", lambda *arguments: passed.extend(arguments) or 0)
    mesh = tmp_path / "teapot.ply"
    mesh.write_bytes(b"ply\n")
    assert clone.main(["cup.jpg", "--clone-onto", str(mesh), *words]) == 0
    options, changing, make_clone = passed
    assert options.clone_onto == mesh and len(changing["clone-onto"]) == 16
    assert (changing["up"], changing["shadow"]) == (None if up == "y" else up, shadow)
    make_clone()("photo", "mask")
    assert rendered == {"mesh_path": mesh, "up": up, "shadow": shadow}


def test_a_mesh_that_is_none_is_told(tmp_path, capsys):
    for mesh in (tmp_path, tmp_path / "none.ply"):
        assert clone.main(["cup.jpg", "--clone-onto", str(mesh)]) == 1
        assert f"{mesh} is no file: pass a mesh to --clone-onto" in capsys.readouterr().err
