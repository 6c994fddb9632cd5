"""What is read back of a folder that was begun."""

import json

import pytest

from lime_keras.render.jobs import resuming

SIDECAR = {"failures": [], "packages": {}, "sha256": "0", "examples": 2}


def test_a_sidecar_is_read_back(tmp_path):
    path = tmp_path / "00000.json"
    path.write_text(json.dumps(SIDECAR), encoding="utf-8")
    assert resuming.sidecar(path) == SIDECAR


@pytest.mark.parametrize(
    "change",
    [{"failures": {}}, {"packages": []}, *({name: None} for name in SIDECAR if name != "examples")],
)
def test_what_is_no_sidecar_is_named_with_the_mend(change, tmp_path):
    content = {name: value for name, value in (SIDECAR | change).items() if value is not None}
    path = tmp_path / "00000.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(
        ValueError,
        match=r"00000\.json cannot be read as the record of a finished shard: .*; delete it",
    ):
        resuming.sidecar(path)


def test_of_two_that_claim_a_folder_the_first_is_believed(tmp_path):
    path = tmp_path / "description.json"
    resuming.claim(path, {"seed": 1})
    resuming.claim(path, {"seed": 2})
    assert resuming.read_description(path) == {"seed": 1}
    assert list(tmp_path.iterdir()) == [path]
