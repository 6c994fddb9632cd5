"""The measures on photos whose materials nobody measured: NumPy alone, a function for each.

An answer that is NaN (the model gave none, or found no object) neither stops a measure nor helps a
model: it orders no two photos (a tie with each), and lies outside every tolerance. Means over
photos, of ratios and angles, are taken over the answers that there are; their number stands beside.
"""

from collections.abc import Callable, Sequence

import numpy as np

from lime_keras.optics import colour, shading

DIELECTRIC_INDEX = 1.5
"""Refractive index of plastics, glazes and varnishes; they have 1.45 to 1.6."""
LEAST_SPECULAR = 1e-3
"""Specular albedo that a smaller one counts as in a ratio: its lobe is below 8 bits of a photo."""
_RESAMPLES = 1000
_SEED = 2018


def dielectric_specular_albedo(index: float = DIELECTRIC_INDEX) -> float:
    """Return the m_s that a dielectric has in Eq. 4: its normal reflectance ((n − 1)/(n + 1))².

    S is 1 in a white furnace at n = o for every s, so m_s is the share of light that the surface
    returns there by reflection: Fresnel's reflectance at normal incidence, 0.04 for n = 1.5, on a
    smooth surface as on a rough one. Towards the rim the model's lobe fades where Fresnel's
    reflectance grows: the m_s that fits a whole smooth sphere best, by least squares, is 0.084. The
    plastics of MERL, fitted with this lobe, have 0.03 (geometric mean of 30), which is too low for
    the sharp ones, as such fits lose a part of a sharp lobe (its metals get 0.1). All this is about
    within a factor of 2 of 0.04.

    Args:
        index: refractive index n, above 0.
    """
    return float(((index - 1) / (index + 1)) ** 2)


def lobe_peak(specular_albedo: np.ndarray | float, exponent: np.ndarray | float) -> np.ndarray:
    """Return m_s · c(s), the height of the specular lobe per steradian, of the same shape.

    The height is the radiance of a small light's mirror image for each unit of its irradiance, and
    what a gloss meter (ISO 2813) reads: its receptor, 1.8° to 4.4° wide, lies inside the lobe for
    every s up to 1000, where the lobe is 8.5° wide at half its height. It joins the two numbers
    that gloss is made of: s alone calls a sharp lobe of no strength glossy, m_s alone a blunt one.

    Args:
        specular_albedo: m_s, at least 0, or NaN.
        exponent: s, at least 0, or NaN.
    """
    exponent = np.asarray(exponent, np.float64)
    known = np.where(np.isnan(exponent), 0.0, exponent)
    height = np.asarray(specular_albedo, np.float64) * shading.normaliser(known)
    return np.where(np.isnan(exponent), np.nan, height)


def gloss_order(
    score: np.ndarray, glossy: np.ndarray, pair: np.ndarray | Sequence[str | None] | None = None
) -> float:
    """Return the share of (glossy, matte) couples in which the glossy photo has the higher score.

    This is the area under the ROC curve (AUC): 1 if the scores part the two finishes, 0.5 by
    chance, 0 if they are the wrong way round. A tie counts half, and so does a score of NaN.

    Args:
        score: estimated gloss `(N,)`; infinities are ordered.
        glossy: whether each photo is glossy `(N,)`; the others are matte.
        pair: name `(N,)`; if given, only photos of the same name are compared, those of None never.

    Returns:
        The share in [0, 1]; NaN if there are no couples.
    """
    right, counted = _couples(score, glossy, pair)
    return float(right.sum() / counted.sum()) if counted.any() else np.nan


def gloss_order_samples(
    score: np.ndarray, glossy: np.ndarray, pair: np.ndarray | Sequence[str | None] | None = None
) -> np.ndarray:
    """Return `gloss_order` of 1,000 bootstrap samples of the photos, `(1000,)`.

    Glossy and matte photos are drawn separately, so that every sample has both. Scores of the same
    photos get the same samples, so differences of two models are paired. A sample without a couple
    is NaN; so are all samples if there is a single photo of a finish, which shows no spread.

    Args:
        score: as `gloss_order` takes it.
        glossy: as `gloss_order` takes it.
        pair: as `gloss_order` takes it.
    """
    right, counted = _couples(score, glossy, pair)
    if min(right.shape) < 2:
        return np.full(_RESAMPLES, np.nan)
    rng = np.random.default_rng(_SEED)
    one, other = (_drawn(rng, count) for count in right.shape)
    total = np.sum((one @ counted) * other, axis=1)
    found = np.sum((one @ right) * other, axis=1)
    return np.divide(found, total, out=np.full(_RESAMPLES, np.nan), where=total > 0)


def _couples(
    score: np.ndarray, glossy: np.ndarray, pair: np.ndarray | Sequence[str | None] | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return how right each couple is (0, ½, 1) and whether it counts, `(glossy, matte)` each."""
    score, glossy = np.asarray(score, np.float64), np.asarray(glossy, bool)
    high, low = score[glossy][:, None], score[~glossy][None]
    counted = np.ones((high.size, low.size))
    if pair is not None:
        names = np.array([name or "" for name in pair])
        one, other = names[glossy][:, None], names[~glossy][None]
        counted = np.where((one == other) & (one != ""), 1.0, 0.0)
    return counted * np.where(high > low, 1.0, np.where(high < low, 0.0, 0.5)), counted


def specular_ratio(specular_albedo: np.ndarray) -> np.ndarray:
    """Return the estimated m_s over that of a dielectric, of the same shape.

    Args:
        specular_albedo: m_s of photos of dielectrics, at least 0, or NaN; less than
            `LEAST_SPECULAR` counts as that.
    """
    estimated = np.asarray(specular_albedo, np.float64)
    return np.maximum(estimated, LEAST_SPECULAR) / dielectric_specular_albedo()


def within_factor_of_2(ratio: np.ndarray) -> np.ndarray:
    """Return whether ratios of any shape lie in [½, 2]; NaN does not.

    Args:
        ratio: estimated over expected, above 0, or NaN.
    """
    return np.abs(np.log2(ratio)) <= 1 + 1e-9


def mean_colour(image_srgb: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the mean of an object's pixels that the camera did not clip, linear RGB `(3,)`.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        mask: coverage `(H, W, 1)` in [0, 1]; pixels of at least one half count.

    Returns:
        The mean; NaN if no pixel counts.
    """
    counted = (mask[..., 0] >= 0.5) & (image_srgb.max(-1) < colour.CLIPPED)
    if not counted.any():
        return np.full(3, np.nan)
    return colour.srgb_to_linear(image_srgb[counted].astype(np.float64)).mean(0)


def angle(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the angle between colours in degrees, `(...)` in [0, 90]; NaN if one is black.

    Args:
        one: linear RGB `(..., 3)`, at least 0; only its direction, the chromaticity, counts.
        other: linear RGB `(..., 3)`, at least 0.
    """
    one, other = _unit(one), _unit(other)
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    return np.degrees(np.arctan2(across, np.sum(one * other, axis=-1)))


def unexplained_angle(albedo: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the angle from m_d to the nearest colour that Eq. 4 allows, in degrees, `(...)`.

    By Eq. 4, an object's mean pixel is m_d · D̄ plus something grey, m_a + m_s · S̄. So m_d has a
    colour on the arc that begins at the mean pixel and leads away from grey, to where a channel is
    0. A right m_d has an angle of 0, whatever the object's gloss. An angle above 0 is wrong for any
    S, if the photo's light is white; where on the arc m_d lies remains open.

    Args:
        albedo: m_d, linear RGB `(..., 3)`, at least 0.
        pixels: mean of the object's pixels, linear RGB `(..., 3)`, at least 0.

    Returns:
        At most `angle(albedo, pixels)`; NaN if either colour is black.
    """
    m_d, begin = _unit(albedo), _unit(pixels)
    end = begin - begin.min(axis=-1, keepdims=True)
    length = np.linalg.norm(end, axis=-1, keepdims=True)
    # Grey pixels have no direction away from grey: their arc is a point.
    end = np.where(length > 1e-9, end / np.maximum(length, 1e-9), begin)
    normal = np.cross(begin, end)
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = normal / np.maximum(size, 1e-12)
    # Inside the arc: past its begin and not past its end, both in the direction of the arc.
    inside = (np.sum(np.cross(normal, begin) * m_d, axis=-1) >= 0) & (
        np.sum(np.cross(normal, end) * m_d, axis=-1) <= 0
    )
    height = np.abs(np.sum(m_d * normal, axis=-1))
    to_ends = np.minimum(angle(m_d, begin), angle(m_d, end))
    to_arc = np.degrees(np.arcsin(np.minimum(height, 1)))
    return np.where(inside & (size[..., 0] > 1e-12), to_arc, to_ends)


def others(colours: np.ndarray, distance: Callable[..., np.ndarray] = angle) -> np.ndarray:
    """Return how well each photo is answered with the colours of the other photos' objects, `(N,)`.

    The mean angle tells how far apart the objects' colours are: an answer that does not look at its
    photo does no better.

    Args:
        colours: mean pixel of each photo's object, linear RGB `(N, 3)`, or NaN.
        distance: `angle` or `unexplained_angle`.

    Returns:
        Mean angle in degrees over the other photos that have a colour; NaN if there are none.
    """
    angles = distance(colours[None], colours[:, None])
    np.fill_diagonal(angles, np.nan)
    return np.array([mean(row) for row in angles])


def overlap(mask: np.ndarray, found: np.ndarray) -> float:
    """Return the intersection over union (IoU) of two masks, in [0, 1]; 1 if both are empty.

    Args:
        mask: coverage `(H, W, 1)` in [0, 1]; pixels of at least one half count.
        found: coverage `(H, W, 1)`, likewise; NaN does not count.
    """
    true, estimated = mask >= 0.5, found >= 0.5
    union = np.count_nonzero(true | estimated)
    return np.count_nonzero(true & estimated) / union if union else 1.0


def mean(values: np.ndarray) -> float:
    """Return the mean of the values that are not NaN; NaN if there are none."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else np.nan


def mean_samples(values: np.ndarray) -> np.ndarray:
    """Return `mean` of 1,000 bootstrap samples of the photos, `(1000,)`.

    As many values always get the same samples, so differences of two models are paired. A sample of
    NaN alone is NaN; so are all samples if there is a single value, which shows no spread.

    Args:
        values: a number for each photo `(N,)`, or NaN.
    """
    known = ~np.isnan(values)
    if np.count_nonzero(known) < 2:
        return np.full(_RESAMPLES, np.nan)
    drawn = _drawn(np.random.default_rng(_SEED), len(values))
    total, count = drawn @ np.where(known, values, 0), drawn @ known
    return np.divide(total, count, out=np.full(_RESAMPLES, np.nan), where=count > 0)


def interval(samples: np.ndarray) -> tuple[float, float] | None:
    """Return the 95 % interval (low, high) of bootstrap samples; None if they are all NaN."""
    known = samples[~np.isnan(samples)]
    if not known.size:
        return None
    low, high = np.percentile(known, (2.5, 97.5))
    return float(low), float(high)


def _drawn(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return how often each of `count` photos is in each sample, `(1000, count)`."""
    return rng.multinomial(count, np.full(count, 1 / count), size=_RESAMPLES).astype(float)


def _unit(rgb: np.ndarray) -> np.ndarray:
    """Return colours at length 1; NaN for black, NaN and infinite ones."""
    rgb = np.asarray(rgb, np.float64)
    length = np.linalg.norm(rgb, axis=-1, keepdims=True)
    usable = np.isfinite(length) & (length > 0)
    return np.divide(rgb, length, out=np.full_like(rgb, np.nan), where=usable)
