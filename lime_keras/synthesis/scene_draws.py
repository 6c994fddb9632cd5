"""Draws of each scene beside geometry and light: material, camera and background.

NumPy on the host. The arrays are small and of fixed shapes; those of a batch are stacked
(`batched`) and handed to `backdrop` and `photograph`, which do the work on the device.
"""

import math
from collections.abc import Sequence

import numpy as np

from lime_keras.optics import camera_law
from lime_keras.optics.material_law import UNIFORM, sample_material
from lime_keras.synthesis.symmetries import SYMMETRIES

BLENDED = 0.4
"""Share of the backgrounds that blend two textures (or a texture and the surroundings)."""
SURROUNDED = 0.3
"""Share of the backgrounds whose first part is the room that lights the object, out of focus."""
LATTICE = 6
"""Nodes along each side of the smooth field that parts the two halves of a blended background."""

_CONTRAST = 1.0, 12.0  # of the field's smooth step: from a gradual change to a border
_ALL_FIRST = -1e3  # of the field: its smooth step is 0
_GAIN = -0.7, 0.4  # stops of brightness of a texture; corpora show theirs as they are
_ROOM_GAIN = -1.0, 1.0  # stops; at 0 the surroundings are as bright as they light the object
_TINT, _ROOM_TINT = 0.08, 0.2  # standard deviations of each channel's log gain; light is grey
_UNIFORM = 24


Draws = dict[str, np.ndarray | np.generic]
"""The draws of one scene, by name."""


def draw(
    rng: np.random.Generator,
    size: int,
    textures: tuple[int, ...],
    materials: tuple[str, ...] = (UNIFORM,),
) -> Draws:
    """Draw a scene's material, symmetry, background and camera.

    Args:
        rng: source of all randomness.
        size: height and width of the images in pixels.
        textures: shape `(K, T, T, 3)` of the bank's textures; K is at least 1, T at least `size`.
        materials: names out of `material_law.LAWS`, one of which the material follows.

    Returns:
        By name, float32 unless said otherwise:

        - the material (`optics.material_law`): `diffuse_albedo` `(3,)`, `specular_albedo`,
          `shininess`, `ambient`;
        - `turn` int32, 0 … 7, the symmetry of the G-buffer (`symmetries.turned`);
        - the background (`backdrop.background`): `texture` `(2,)` int32; `corner` `(2, 2)` int32,
          row and column of each crop; `texture_turn` `(2,)` int32, 0 … 7; `blend`
          `(LATTICE, LATTICE)`; `tint` `(2, 3)`, linear gains; `surrounded`, 0 or 1; `sharpness`,
          0 … 1;
        - the camera (`photograph.photograph`): `exposure`; `defocus`, 0 … 1; `full_well`; `cast`
          `(4,)`; `quality`, whole; `compressed`, 0 or 1; `grain` `(n,)` int32, n so that n ·
          `GRAIN_LENGTH` numbers suffice for an image.

    Raises:
        ValueError: if there is no texture, or the textures are smaller than the images.
    """
    count, side = textures[:2]
    if not count or side < size:
        raise ValueError(
            f"backgrounds of {size}×{size} pixels cannot be cut from {count} textures of "
            f"{side}×{side}: render the bank with textures at least as large as its images"
        )
    # Material.
    law = materials[rng.integers(len(materials))] if len(materials) > 1 else materials[0]
    material = sample_material(rng, law)
    uniform = rng.random(_UNIFORM)
    share = uniform.tolist()
    # Background.
    surrounded = share[0] < SURROUNDED
    gain, deviation = (_ROOM_GAIN, _ROOM_TINT) if surrounded else (_GAIN, _TINT)
    stops = np.array([[_between(gain, share[1])], [_between(_GAIN, share[2])]])
    tint = rng.normal(stops * math.log(2), [[deviation], [_TINT]], (2, 3))
    if share[3] < BLENDED:
        low, high = np.log(_CONTRAST)
        blend = rng.normal(0.0, math.exp(low + (high - low) * share[4]), (LATTICE, LATTICE))
    else:
        blend = np.full((LATTICE, LATTICE), _ALL_FIRST)
    # Camera.
    rows = -(-size * size * 3 // camera_law.GRAIN_LENGTH)
    return {
        "diffuse_albedo": np.asarray(material.diffuse_albedo, np.float32),
        "specular_albedo": np.float32(material.specular_albedo),
        "shininess": np.float32(material.exponent),
        "ambient": np.float32(material.ambient),
        "turn": np.int32(SYMMETRIES * share[5]),
        "texture": (count * uniform[6:8]).astype(np.int32),
        "corner": ((side - size + 1) * uniform[8:12]).astype(np.int32).reshape(2, 2),
        "texture_turn": (SYMMETRIES * uniform[12:14]).astype(np.int32),
        "blend": blend.astype(np.float32),
        "tint": np.exp(tint).astype(np.float32),
        "surrounded": np.float32(surrounded),
        "sharpness": np.float32(share[14]),
        "exposure": np.float32(camera_law.exposure(share[15])),
        "defocus": np.float32(share[16]),
        "full_well": np.float32(camera_law.full_well(share[17])),
        "quality": np.float32(round(camera_law.quality(share[18]))),
        "compressed": np.float32(share[19] >= camera_law.NEVER_COMPRESSED),
        "cast": camera_law.cast(uniform[20:24]).astype(np.float32),
        "grain": rng.integers(camera_law.GRAIN_ROWS, size=rows, dtype=np.int32),
    }


def batched(scenes: Sequence[Draws]) -> dict[str, np.ndarray]:
    """Stack the draws of B scenes: each array gets a leading axis of B."""
    return {name: np.stack([scene[name] for scene in scenes]) for name in scenes[0]}


def _between(limits: tuple[float, float], share: float) -> float:
    low, high = limits
    return low + (high - low) * share
