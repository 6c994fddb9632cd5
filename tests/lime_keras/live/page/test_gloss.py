"""The page says of a gloss what Python says."""

import javascript
import numpy as np

from lime_keras.material import srgb_hex
from lime_keras.optics import gloss


def test_words_and_intervals_are_those_of_python():
    rng = np.random.default_rng(0)
    probabilities = [*rng.dirichlet(np.full(8, 0.3), 40), *rng.dirichlet(np.full(8, 20), 20)]
    probabilities += [np.eye(8)[at] for at in (0, 3, 7)]
    exponents = [0.0, 1.0, 5.6, 5.7, 177.0, 178.0, 2000.0]
    found = javascript.run(
        """
        const { interval, inWords, inNumbers, word } = await import(page + "gloss.js");
        const { hex } = await import(page + "colour.js");
        const ends = lists.map((one) => interval(one));
        const told = ends.map((one) => [inWords(20, one), inNumbers(20, one)]);
        const words = exponents.map((one) => word(one));
        return { ends, told, words, bare: inNumbers(20.4, null), hex: hex([1.2, 0.214, 0.001]) };
        """,
        lists=[list(map(float, one)) for one in probabilities],
        exponents=exponents,
    )
    ends = [gloss.interval(one) for one in probabilities]
    np.testing.assert_allclose(found["ends"], ends, rtol=1e-9)
    assert [words for words, _ in found["told"]] == [gloss.in_words(20.0, one) for one in ends]
    for one, (_, numbers) in zip(ends, found["told"], strict=True):
        assert gloss.sentence(20.0, one).endswith(f"s {numbers}")
    assert {gloss.is_flat(one) for one in ends} == {True, False}
    assert found["words"] == [gloss.word(one) for one in exponents]
    assert found["bare"] == "20" and found["hex"] == srgb_hex([1.2, 0.214, 0.001])
    assert gloss.sentence(20.4, None) == "satin, s 20"


def test_without_probabilities_there_is_no_interval():
    found = javascript.run(
        'return (await import(page + "gloss.js")).interval(null) ?? "none";', nothing=[]
    )
    assert found == "none"
