"""One example in a report: its numbers, its layers and its renderings, as sRGB images."""

from typing import Any

import numpy as np

from lime_keras.material import srgb_hex
from lime_keras.optics import colour, shading, shininess
from lime_keras.optics.compositing import compose
from lime_keras.optics.reflectance_map import disc, true_reflectance_map

from ..accuracy.measures import DECIBEL
from ..accuracy.tone import coloured, white_point
from .examples import Example

_LAYERS = {"specular_shading": "Specular shading S", "mirror": "Mirror image M"}

Pair = tuple[str, np.ndarray, np.ndarray]
"""A title, a true picture and its estimate, `(H, W, 3)` each, sRGB in [0, 1]."""


def card(example: Example, relit: np.ndarray) -> dict[str, Any]:
    """Return the template's values for one example, given the PSNR `(N,)` of all of them."""
    truth, estimate = example.truth, example.estimate
    probabilities = estimate.get("exponent_bin_probabilities", ())
    true_bin = int(shininess.bin_of(truth["shininess"]))
    albedos = truth["diffuse_albedo"], estimate["diffuse_albedo"]
    return {
        "reason": example.choice.reason,
        "source": f"{truth['shape'].decode()} under {truth['light'].decode()}, "
        f"seed {truth['seed']}, index {truth['index']}",
        "psnr": DECIBEL.number(relit[example.choice.position]),
        "photo": truth["image"],
        "pairs": pairs(example),
        "diffuse": [(srgb_hex(m_d), " ".join(f"{value:.2f}" for value in m_d)) for m_d in albedos],
        "specular": [f"{float(m['specular_albedo'].item()):.2f}" for m in (truth, estimate)],
        "exponent": [f"{s:.1f}" for s in (float(truth["shininess"]), example.exponent)],
        "bars": [
            (round(100 * float(p), 1), shininess.bin_label(k), k == true_bin)
            for k, p in enumerate(probabilities)
        ],
    }


def pairs(example: Example) -> list[Pair]:
    """Return the mask, the layers that the system estimates, and last the renders of `both`."""
    truth, estimate = example.truth, example.estimate
    layers = [
        _hdr_pair(title, truth[name], estimate[name], truth["mask"])
        for name, title in _LAYERS.items()
        if name in estimate
    ]
    if "reflectance_map" in estimate:
        sphere = disc(len(truth["mask"]))
        batch = {name: np.asarray(value)[None] for name, value in truth.items()}
        factor = shading.lobe_factor(truth["shininess"], example.lobe)
        batch["specular_albedo"] = batch["specular_albedo"] * factor
        true = np.asarray(true_reflectance_map(batch))[0]
        predicted = estimate["reflectance_map"]
        layers.append(_hdr_pair("Reflectance map", true, predicted, sphere))
    return [
        ("Mask", coloured(truth["mask"]), coloured(estimate["mask"])),
        *layers,
        ("Rendered with the material", *both(example)),
    ]


def both(example: Example) -> tuple[np.ndarray, np.ndarray]:
    """Render Eq. 4 with the true and with the estimated material, over the photo's background.

    Only m_d, m_s and s differ: light, shape, D and m_a are the true ones, and the S of the estimate
    is computed from the record's environment with the estimated exponent.

    Returns:
        Two images `(H, W, 3)`, sRGB in [0, 1], the object clipped at 1 as a camera does.
    """
    truth, mask = example.truth, example.truth["mask"]
    inside = mask[..., 0] > 0
    view = shading.view_directions(truth["camera"], *mask.shape[:2]).astype(np.float32)
    light = shading.texels(truth["environment"][..., 0])
    specular = np.zeros(mask.shape, np.float32)
    specular[inside, 0] = shading.specular(
        truth["normal"][inside], view[inside], example.exponent, *light
    )
    specular *= np.float32(shading.lobe_factor(example.exponent, example.lobe))
    photo = colour.srgb_to_linear(truth["image"])

    def render(material: dict[str, np.ndarray], specular_shading: np.ndarray) -> np.ndarray:
        radiance = compose(
            material["diffuse_albedo"],
            np.asarray(material["specular_albedo"]),
            truth["ambient"],
            truth["diffuse_shading"][None],
            specular_shading[None],
        )[0]
        mixed = np.clip(radiance, 0.0, 1.0) * mask + photo * (1 - mask)
        return np.clip(colour.linear_to_srgb(mixed), 0.0, 1.0)

    return render(truth, truth["specular_shading"]), render(example.estimate, specular)


def _hdr_pair(title: str, true: np.ndarray, found: np.ndarray, mask: np.ndarray) -> Pair:
    """Tone-map a true layer and its estimate by one white point, the truth's 99th percentile."""
    true = true * mask
    white = white_point(true, mask)
    shown, guessed = (coloured(colour.linear_to_srgb(one / white)) for one in (true, found))
    return title, shown, guessed
