"""Cuts and fusion are Python's, in JavaScript."""

import javascript
import numpy as np

from lime_keras.material import Material
from lime_keras.video.cuts import histogram
from lime_keras.video.fusion import Fusion
from lime_keras.video.tracking import Tracker


def test_the_fusion_is_that_of_python():
    """Over estimates of which some were not seen, one never, and after a restart."""
    estimates = np.random.default_rng(0).normal(size=(40, 6))
    estimates[np.random.default_rng(1).uniform(size=(40, 6)) < 0.3] = np.nan
    estimates[:, 5] = np.nan
    found = javascript.run(
        """
        const { Fusion } = await import(page + "browser/tracking.js");
        const fusion = new Fusion();
        return Array.from({ length: 40 }, (_, frame) => {
          if (frame === 25) fusion.restart();
          return fusion.update(estimates.subarray(6 * frame, 6 * frame + 6));
        });
        """,
        estimates=estimates,
    )
    fusion = Fusion()
    for frame, (estimate, fused) in enumerate(zip(estimates, found, strict=True)):
        if frame == 25:
            fusion = Fusion()
        np.testing.assert_allclose(fused, fusion.update(estimate), rtol=1e-12, atol=1e-12)


def test_the_histogram_is_that_of_python():
    for shape in ((1, 1), (63, 70), (130, 200)):
        levels = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
        found = javascript.run(
            """
            const { histogram } = await import(page + "browser/tracking.js");
            return histogram({ data, width, height });
            """,
            data=javascript.image(levels),
            width=shape[1],
            height=shape[0],
        )
        np.testing.assert_allclose(found.reshape(3, 16), histogram(levels), atol=1e-12)


def test_a_tracked_object_is_that_of_python():
    """Through a cut, a short gap, and one after which the object is forgotten."""
    rng = np.random.default_rng(0)
    count = 60
    frames = np.full((count, 8, 8, 3), 90, np.uint8) + rng.integers(
        0, 9, (count, 8, 8, 3), np.uint8
    )
    frames[10:] += 120
    found = np.ones(count, bool)
    found[[5, 6, *range(20, 55)]] = False
    values = np.where(found[:, None], rng.uniform(0.1, 1, (count, 5)), np.nan)
    answers = javascript.run(
        """
        const { Tracker } = await import(page + "browser/tracking.js");
        const tracker = new Tracker();
        return found.map((seen, frame) => {
          const [levels, start] = [data.subarray(256 * frame, 256 * (frame + 1)), 5 * frame];
          const image = { data: levels, width: 8, height: 8 };
          const { cut, fused } = tracker.step(image, seen, values.subarray(start, start + 5));
          return [cut, fused];
        });
        """,
        data=np.stack([javascript.image(frame) for frame in frames]),
        found=found.tolist(),
        values=values,
    )
    tracker, cuts = Tracker(), []
    for frame, seen, value, (cut, fused) in zip(frames, found, values, answers, strict=True):
        material = Material(mask_coverage=0.0)
        if seen:
            material = Material(
                diffuse_albedo=value[:3],
                specular_albedo=value[3],
                exponent=10 ** value[4],
                mask_coverage=0.2,
            )
        step = tracker.step(frame, material)
        cuts.append(step.cut)
        assert cut == step.cut
        np.testing.assert_allclose(fused, step.fused, rtol=1e-9)
    assert np.flatnonzero(cuts).tolist() == [10]
    assert np.isnan(answers[54][1]).all() and not np.isnan(answers[6][1]).any()
