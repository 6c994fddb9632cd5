"""Models are measured in their own unit of m_s alone."""

import json

import pytest

from lime_keras.data.corpus import Split
from lime_keras.eval.accuracy import units


def _write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content), encoding="utf-8")


@pytest.mark.parametrize("learnt", [None, "furnace", "printed"])
@pytest.mark.parametrize("shown", ["furnace", "printed"])
def test_a_model_is_measured_in_its_own_unit_alone(tmp_path, learnt, shown):
    _write(tmp_path / "run" / "config.json", {"config": {} if learnt is None else {"lobe": learnt}})
    _write(tmp_path / "corpus" / "test" / "manifest.json", {"description": {"shading": shown}})
    split = Split(tmp_path / "corpus", "test")
    if (learnt or "furnace") == shown:
        units.check_lobe(tmp_path / "run", split)
    else:
        with pytest.raises(ValueError, match=f"test split with --lobe {learnt or 'furnace'}"):
            units.check_lobe(tmp_path / "run", split)
