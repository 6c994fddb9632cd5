"""The page says of a gloss what Python says."""

import javascript
import numpy as np

from lime_keras.material import srgb_hex
from lime_keras.optics import gloss


def test_words_and_intervals_are_those_of_python():
    rng = np.random.default_rng(0)
    probabilities = [*rng.dirichlet(np.full(8, 0.3), 40), *rng.dirichlet(np.full(8, 20), 20)]
    probabilities += [np.eye(8)[at] for at in (0, 3, 7)]
    materials = [
        (s, m)
        for s in (0.0, 9.0, 20.0, 31.0, 32.0, 65.0, 177.0, 178.0, 2e3)
        for m in (0.0, 0.01, 0.05, 0.6)
    ]
    calibration = gloss.Calibration(1.6, 3.2)
    found = javascript.run(
        """
        const { describe, interval, inNumbers, probability, word } =
          await import(page + "gloss.js");
        const { hex } = await import(page + "colour.js");
        const ends = lists.map((one) => interval(one));
        const told = ends.map((one) => inNumbers(20, one));
        const likely = materials.map((one) => probability(calibration, ...one));
        const said = materials.map((one, at) => describe(likely[at], ...one));
        const words = materials.map((one) => word(...one));
        return { ends, told, likely, said, words, hex: hex([1.2, 0.214, 0.001]) };
        """,
        lists=[list(map(float, one)) for one in probabilities],
        materials=materials,
        calibration=calibration._asdict(),
    )
    ends = [gloss.interval(one) for one in probabilities]
    np.testing.assert_allclose(found["ends"], ends, rtol=1e-9)
    for one, numbers in zip(ends, found["told"], strict=True):
        assert gloss.numbers(20.0, one) == f"s {numbers}"
    likely = [calibration.probability(*one) for one in materials]
    np.testing.assert_allclose(found["likely"], likely, rtol=1e-9)
    said = [gloss.describe(p, *one) for p, one in zip(likely, materials, strict=True)]
    assert found["said"] == said and len(set(said)) > 5
    assert found["words"] == [gloss.word(*one) for one in materials]
    assert found["hex"] == srgb_hex([1.2, 0.214, 0.001])


def test_without_probabilities_there_is_no_interval():
    found = javascript.run(
        'return (await import(page + "gloss.js")).interval(null) ?? "none";', nothing=[]
    )
    assert found == "none"
