"""What a run's record says, and models of another unit."""

import json

import pytest

from lime_keras.data.corpus import Split
from lime_keras.eval.accuracy import training_record


def _write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content), encoding="utf-8")


def test_the_record_of_a_run_or_of_its_model_is_read(tmp_path):
    assert training_record.read(tmp_path) == {}
    _write(tmp_path / "model" / "training.json", {"config": {"seed": 3}})
    assert training_record.read(tmp_path) == {"seed": 3}
    assert training_record.read(tmp_path / "model") == {"seed": 3}
    _write(tmp_path / "model" / "training.json", {})
    with pytest.raises(ValueError, match=r"training\.json is no record of a run"):
        training_record.read(tmp_path)


@pytest.mark.parametrize("learnt", [None, "furnace", "printed"])
@pytest.mark.parametrize("shown", ["furnace", "printed"])
def test_a_model_is_measured_in_its_own_unit_alone(tmp_path, learnt, shown):
    _write(tmp_path / "run" / "config.json", {"config": {} if learnt is None else {"lobe": learnt}})
    _write(tmp_path / "corpus" / "test" / "manifest.json", {"description": {"shading": shown}})
    split = Split(tmp_path / "corpus", "test")
    if (learnt or "furnace") == shown:
        training_record.check_lobe(tmp_path / "run", split)
    else:
        with pytest.raises(ValueError, match=f"test split with --lobe {learnt or 'furnace'}"):
            training_record.check_lobe(tmp_path / "run", split)
