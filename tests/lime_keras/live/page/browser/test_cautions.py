"""The reasons to distrust an estimate are Python's, in JavaScript."""

import javascript
import numpy as np
import pytest

from lime_keras.estimate import cautions

PHOTOS = 120


def drawn(rng):
    """Return a photo, its mask and what is known of the mask, of a kind that may be doubted."""
    height, width = rng.integers(3, 160, 2)
    y, x = np.mgrid[:height, :width]
    mask = np.zeros((height, width), bool)
    for _ in range(rng.integers(0, 4)):
        centre = rng.uniform(0, 1, 2) * (height, width)
        mask |= np.hypot(y - centre[0], x - centre[1]) < rng.uniform(0, 0.7) * min(height, width)
    level = rng.choice([30, 60, 160, 300])
    noise = rng.normal(level, 30, (height, width, rng.choice([1, 3])))
    photo = np.repeat(np.clip(noise, 0, 255).astype(np.uint8), 3 // noise.shape[-1], axis=-1)
    return photo, mask, float(rng.uniform(0.7, 1)) if rng.uniform() < 0.7 else None


def test_what_is_told_of_a_photo_is_what_python_tells():
    rng = np.random.default_rng(0)
    good = np.zeros((120, 100), bool)
    good[20:90, 30:70] = True
    plain = np.broadcast_to(np.uint8([190, 180, 170]), (120, 100, 3)).copy()
    burnt = plain.copy()
    burnt[40:50, 40:50] = 255
    photos = [(plain, good, 0.95), (burnt, good, None)]
    photos += [drawn(rng) for _ in range(PHOTOS)]
    found = javascript.run(
        """
        const { codes } = await import(page + "browser/cautions.js");
        let first = 0;
        return known.map(([height, width, confidence]) => {
          const last = first + height * width;
          const data = levels.subarray(4 * first, 4 * last);
          const inside = masks.subarray(first, last);
          first = last;
          return codes({ data, width, height }, inside, confidence);
        });
        """,
        levels=np.concatenate([javascript.image(photo).ravel() for photo, _, _ in photos]),
        masks=np.concatenate([255 * mask.ravel().astype(np.uint8) for _, mask, _ in photos]),
        known=[(*mask.shape, confidence) for _, mask, confidence in photos],
    )
    expected = [
        [c.code for c in cautions.of(photo / np.float32(255), mask[..., None] * 1.0, confidence)]
        for photo, mask, confidence in photos
    ]
    assert found == expected
    told = {code for codes in found for code in codes}
    assert told == {
        *("no-object", "uncertain-mask", "small-object", "few-pixels"),
        *("touches-frame", "many-parts", "too-dark", "underexposed", "clipped"),
        *("burnt-highlight", "grey", "second-colour"),
    }
    assert found[:2] == [[], ["burnt-highlight"]]


def test_the_confidence_is_that_of_python():
    mask = np.random.default_rng(0).uniform(size=(40, 40, 1)).astype(np.float32)
    found, none = javascript.run(
        """
        const { confidence } = await import(page + "browser/cautions.js");
        return [confidence(mask), confidence(mask.map((value) => 0.49 * value))];
        """,
        mask=mask,
    )
    assert found == pytest.approx(cautions.confidence(mask), rel=1e-9)
    assert none is None
