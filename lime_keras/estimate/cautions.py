"""The reasons to distrust an estimate, by its photo and its mask, and the mask's confidence.

The limits below were chosen by looking at 20 photographs, and at 64 rendered scenes of the training
split as the camera model of training photographs them.
"""

import math
from collections.abc import Iterator

import cc3d
import numpy as np

from lime_keras.estimate import framing
from lime_keras.material import Caution
from lime_keras.optics import colour, dichromatic
from lime_keras.optics.highlights import WHITE

CONFIDENT = 0.925
"""Confidence from which a mask is trusted.

A mask is wrong if its IoU with the true one is below 0.7. On 512 validation scenes, with a set of
before the recipes, this limit finds 47 % of the wrong masks, and 40 % of those that it finds are
wrong (`docs/lab/masks.md`).
"""
SMALLEST_SHARE = 0.04
"""Share of a photo from which SegmentationNet's mask is trusted.

Of scenes shown ever smaller in a larger frame, one mask in six that covers less is wrong (IoU below
0.7), and one in twenty that covers more. Often it is a part of the object.
"""
FEWEST_PIXELS = 64
"""Length of an object in pixels from which it is trusted.

A scene whose object is made shorter has a diffuse albedo off by 0.13 and more, and a shininess by
0.12 decades and more, in the median: more than the networks' own errors on smooth objects.
"""
LARGEST_PART = 0.9
"""Smallest share of a mask that its largest part has; below it, the object may be in parts.

The rendered scene and the three photographs that stay below have parts of the object missing.
"""
ON_FRAME, NEAR_FRAME = 0.01, 1 / 128
"""Largest share of a photo's outline that a mask may reach, and the outline's share of its side.

The networks see 64 to 192 pixels, and their masks keep clear of the last one. Half of the scenes of
which a tenth is cut off reach more of the frame, and one in thirty of the whole ones.
"""
DARKEST = 0.05
"""Linear luminance that a tenth of the object exceeds in a photo that shows its shading.

The darkest rendered scene has 0.12. Three stops and more below that, the shininess is off by more
than half a decade, and an 8-bit photo is left with a few dozen levels. A photo without an object
is too dark if less than a hundredth of it exceeds this.
"""
BRIGHT, FEWEST_BRIGHT = 170 / 255, 0.01
"""sRGB level that some pixels of a well exposed photo reach in a channel, and their share.

40 % of white, of the pixels that are not black, as a cut-out's surroundings are. On 800 scenes of
training, fewer are as bright in 1.9 % of the photos, and in 85 % of those two stops shorter
(`benchmarks/cautions.py`); among 20 photographs in one, a dim one, and in all of them two stops
shorter.
"""
CLIPPED = 0.15
"""Share of the object that may be burnt out to white.

It is 0.12 at most in the rendered scenes, and 0.06 in the photographs. Two stops above, where it is
0.23 in the median, the specular albedo is off by 0.3.
"""
BURNT = 0.01
"""Share of the object that is burnt out to white from which a highlight has lost its height.

Two of the photographs are above: what a highlight has beyond white is missing in m_s.
"""
_GREY, GREY_SHARE = 2.5 / 255, 0.99
"""Range of sRGB up to which R, G and B count as one, and the share of a grey object that has it.

Colour shows where the highlights are; a black-and-white photo has none, and JPEG leaves two levels.
"""
SPREAD = 0.11
"""`dichromatic.colour_spread` above which an object has several colours.

Of 989 scenes of one material, under the camera's casts, 5 % are above. Of the twelve photographs of
things with prints, several glazes or several parts eleven are, and of the eight others the guitar,
whose hole is black (`benchmarks/cautions.py`).
"""
_JUDGED = 20_000  # number of pixels, about, whose brightness is looked at

_MESSAGES = {
    "no-object": "no object was found, so no material is estimated: pass a mask, or a photo that "
    "shows the object larger",
    "uncertain-mask": "the mask is uncertain (confidence {:.2f}), and so is what is read inside "
    "it: look at its outline in the preview, and pass a mask if it is wrong",
    "small-object": "the mask covers {:.1%} of the photo, and often so little is a part of the "
    "object: take the photo from nearer, cut it around the object, or pass a mask",
    "few-pixels": "the object is {} pixels long, too few to show its gloss: pass a photo of more "
    "pixels, or one from nearer",
    "touches-frame": "the mask reaches the frame of the photo, so a part of the object may be cut "
    "off: take a photo with room around it",
    "many-parts": "the mask falls into parts, the largest {:.0%} of it, and all are taken for one "
    "object of one material: pass a mask of that object",
    "too-dark": "the {} is nearly black: {:.0%} of it {}; expose the photo longer, or light the "
    "object",
    "underexposed": "hardly anything in the photo is brighter than 40% of white, so it seems "
    "exposed too short, and the albedos come out too low: expose the photo longer",
    "clipped": "{:.0%} of the object is burnt out to white, where nothing of its colour and gloss "
    "is left: expose the photo shorter",
    "burnt-highlight": "highlights are burnt out to white on {:.0%} of the object, so the specular "
    "albedo may be too low: expose the photo shorter",
    "grey": "the object is grey, so only the shape of its highlights tells them from its shading: "
    "if the photo is black-and-white, pass a photo in colour",
    "second-colour": "the object seems to have several colours, and the numbers are one for all of "
    "them: pass a mask of one colour; if it has one, it is a coloured metal, or the light is "
    "strongly coloured: take a photo in white light",
    "printed-lobe": "the model's m_s and S are in the unit of the paper's Eq. 3 (lime-render "
    "--lobe printed), so files for other programs show other highlights: for photos, train on a "
    "corpus without it",
}
"""Messages by code, in the order in which `of` returns them; braces take what was measured."""


def _caution(code: str, *measured: object) -> Caution:
    return Caution(code, _MESSAGES[code].format(*measured))


NO_OBJECT, PRINTED_LOBE = _caution("no-object"), _caution("printed-lobe")


def confidence(mask: np.ndarray) -> float | None:
    """Return the IoU that a mask, cut at one half, is expected to have with the true mask.

    With p the coverage, as the probability that a pixel is the object's, and T the pixels with p of
    at least one half: Σ_T p / (|T| + Σ_{not T} p), the expected intersection over the expected
    union. It is 1 where every p is 0 or 1. On the rendered scenes its rank correlation with the
    true IoU is 0.86, that of the mean of |2 p − 1| over the uncertain pixels 0.26. On 512
    validation scenes its rank correlation is 0.86, and it is 0.08 too high in the mean
    (`benchmarks/cautions.py`).

    Args:
        mask: coverage `(H, W, 1)` in [0, 1].

    Returns:
        Confidence in [0, 1]; None if no pixel reaches one half.

    Example:
        >>> confidence(np.array([[[1.0], [0.5], [0.0]]]))
        0.75
    """
    inside = mask >= framing.THRESHOLD
    count = int(np.count_nonzero(inside))
    if not count:
        return None
    shared = float(np.sum(mask, where=inside, dtype=np.float64))
    outside = float(np.sum(mask, where=~inside, dtype=np.float64))
    return shared / (count + outside)


def of(
    image_srgb: np.ndarray, mask: np.ndarray, mask_confidence: float | None
) -> tuple[Caution, ...]:
    """Return the reasons to distrust an estimate.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        mask: coverage `(H, W, 1)` in [0, 1].
        mask_confidence: confidence of an estimated mask; None for one that the user supplied, which
            is not doubted for being small.

    Returns:
        `NO_OBJECT` if the mask shows none, with `too-dark` if the whole photo is; else what is true
        of `_MESSAGES`, in their order.
    """
    inside = mask[..., 0] >= framing.THRESHOLD
    if not inside.any():
        pixels = _thinned(image_srgb.reshape(-1, 3), image_srgb.shape[1])
        return NO_OBJECT, *_of_darkness(pixels, "photo", 0.99)
    return tuple(_of_object(image_srgb, inside, mask_confidence))


def _thinned(pixels: np.ndarray, width: int = 1) -> np.ndarray:
    """Return `_JUDGED` pixels, about, of `(N, 3)`, from all columns of a photo of that width."""
    step = max(1, len(pixels) // _JUDGED)
    while math.gcd(step, width) > 1:
        step += 1
    return pixels[::step]


def _of_object(
    image_srgb: np.ndarray, inside: np.ndarray, mask_confidence: float | None
) -> Iterator[Caution]:
    """Yield what is true of an object, whose pixels are `inside` `(H, W)`, in order."""
    share, pixels = float(inside.mean()), _thinned(image_srgb[inside])
    if mask_confidence is not None and mask_confidence < CONFIDENT:
        yield _caution("uncertain-mask", mask_confidence)
    if mask_confidence is not None and share < SMALLEST_SHARE:
        yield _caution("small-object", share)
    yield from _of_shape(inside)
    darkness = tuple(_of_darkness(pixels, "object", 0.9))
    yield from darkness
    if not darkness and bright_share(image_srgb) < FEWEST_BRIGHT:
        yield _caution("underexposed")
    white = float(np.mean(pixels.min(axis=-1) >= WHITE))
    if white > BURNT:
        yield _caution("clipped" if white > CLIPPED else "burnt-highlight", white)
    yield from _of_colour(pixels, dichromatic.colour_spread(image_srgb, inside))


def _of_shape(inside: np.ndarray) -> Iterator[Caution]:
    extent = max(
        int(lit[-1] - lit[0]) + 1
        for lit in (np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0)))
    )
    if extent < FEWEST_PIXELS:
        yield _caution("few-pixels", extent)
    # An object that fills the frame reaches it whatever the frame's size.
    if _on_frame(inside) > ON_FRAME:
        yield _caution("touches-frame")
    parts = np.bincount(cc3d.connected_components(inside, connectivity=4).ravel())[1:]
    largest = float(parts.max() / parts.sum())
    if largest < LARGEST_PART:
        yield _caution("many-parts", largest)


def _on_frame(inside: np.ndarray) -> float:
    """Return the share of the photo's outline that a mask `(H, W)` reaches."""
    near = 1 + round(NEAR_FRAME * max(inside.shape))
    edges = (inside[:near].any(0), inside[-near:].any(0))
    sides = (inside[:, :near].any(1), inside[:, -near:].any(1))
    return float(np.concatenate([*edges, *sides]).mean())


def _of_darkness(pixels_srgb: np.ndarray, of_what: str, share: float) -> Iterator[Caution]:
    """Yield a caution if a share of the pixels `(N, 3)` is below `DARKEST`."""
    bright = float(np.quantile(colour.luminance(colour.srgb_to_linear(pixels_srgb)), share))
    if bright < DARKEST:
        below = f"is below {bright:.1%} of white" if bright >= 5e-4 else "is black"
        yield _caution("too-dark", of_what, share, below)


def bright_share(image_srgb: np.ndarray) -> float:
    """Return the share of a photo's pixels `(H, W, 3)`, sRGB, but black ones, that reach `BRIGHT`.

    Example:
        >>> bright_share(np.array([[[0.0, 0.0, 0.0], [0.1, 0.1, 0.1], [0.9, 0.1, 0.1]]]))
        0.5
    """
    levels = _thinned(image_srgb.reshape(-1, 3), image_srgb.shape[1]).max(axis=-1)
    return float(np.mean(levels[levels > 0] >= BRIGHT)) if levels.any() else 0.0


def _of_colour(pixels_srgb: np.ndarray, spread: float) -> Iterator[Caution]:
    """Yield a caution if an object's pixels `(N, 3)` have no colour, or several."""
    if float(np.mean(np.ptp(pixels_srgb, axis=-1) <= _GREY)) >= GREY_SHARE:
        yield _caution("grey")
        return
    second = dichromatic.second_colour(pixels_srgb[colour.brightest(pixels_srgb) < WHITE])
    if not (spread <= SPREAD and second <= dichromatic.SECOND_COLOUR):
        yield _caution("second-colour")
