"""Scenes of a bank: drawn on the host, lit, composed and photographed on the device that trains.

A scene is a G-buffer of the bank in the light of `light_law`, with a material, a background and a
camera of `scene_draws`. It follows from the bank, a seed and its position alone.
"""

import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from keras import ops

from lime_keras.arrays import compiled
from lime_keras.optics import environment, material_law, octahedral, shininess
from lime_keras.optics.compositing import compose

from . import backdrop, bank, light_law, panorama, scene_draws
from .geometry import GeometryBank, variance_of
from .lights import LightBank
from .mixing import mixed
from .photograph import photograph
from .reduction import reduced
from .shading import layers, pieces
from .symmetries import turned

_HELD_OUT = 10
"""One of so many shapes and maps is held out from training."""
_COVERED = 255
_LIGHTS, _TEXTURES = "lights", "textures"
_DRAWN = ("seed", "index", "exponent_bin")
"""Features that are drawn on the host and need not be made."""


class Scenes:
    """The scenes of a bank, without end.

    Attributes:
        shapes: names of the shapes that the scenes show.
        lights: names of the maps that light them.

    Args:
        folder: folder by `lime-render bank`.
        size: height and width of the images; a divisor of the bank's.
        camera: whether a camera photographs the scenes; else they are as in a corpus' records.
        features: names of the features in a batch, of `data.features` or `normal`, `camera`,
            `environment`, `shininess`, `shape`, `light`.
        held_out: whether the scenes are of the shapes and maps that training does not see.
        materials: names out of `material_law.LAWS`; each scene's is any of them, with the same
            chance.

    Raises:
        FileNotFoundError: if the bank is incomplete.
        ValueError: if a file of the bank is broken, the bank has one shape or one map only, or
            `size` does not divide the size of its images.
    """

    def __init__(
        self,
        folder: Path,
        *,
        size: int,
        camera: bool,
        features: Collection[str],
        held_out: bool = False,
        materials: tuple[str, ...] = (material_law.UNIFORM,),
    ):
        self._geometry, self._lights = GeometryBank(folder), LightBank(folder)
        if self._geometry.size % size:
            raise ValueError(
                f"{folder} holds images of {self._geometry.size} pixels, which cannot be averaged "
                f"to {size}: pass --size with a divisor of {self._geometry.size}"
            )
        shapes = _chosen(self._geometry.shape_names, held_out, f"{folder}: shapes")
        self.shapes = [self._geometry.shape_names[shape] for shape in shapes]
        self._entries = np.flatnonzero(np.isin(self._geometry.shape, shapes))
        self._maps = _chosen(self._lights.names, held_out, f"{folder}: light maps")
        self.lights = [self._lights.names[number] for number in self._maps]
        self._textures = bank.textures(folder)
        self._size, self._camera, self._features = size, camera, frozenset(features)
        self._held_out, self._materials = held_out, materials
        self._compiled = compiled(self._made)
        self._on_device: dict[str, Any] | None = None

    def draw(self, seed: int, positions: np.ndarray) -> dict[str, Any]:
        """Draw the scenes at some positions, on the host.

        Args:
            seed: seed of the scenes, at least 0.
            positions: positions `(B,)`, at least 0.

        Returns:
            The draws, NumPy arrays by name, for `make`.
        """
        generators = [
            np.random.default_rng(
                np.random.SeedSequence(seed, spawn_key=(int(self._held_out), int(position)))
            )
            for position in positions
        ]
        entries = self._entries[[rng.integers(len(self._entries)) for rng in generators]]
        light = light_law.draw(generators, self._lights, self._maps)
        side = self._geometry.size
        drawn = [
            scene_draws.draw(rng, side, self._textures.shape, self._materials) for rng in generators
        ]
        draws: dict[str, Any] = scene_draws.batched(drawn)
        gbuffer = turned(self._geometry.read(entries), draws.pop("turn"))
        coverage, share = gbuffer["coverage"], gbuffer["share"]
        there = np.stack([coverage > 0, (coverage > 0) & (share < _COVERED)], axis=1)
        return {
            "draws": draws,
            "light": light,
            "gbuffer": gbuffer,
            "work": pieces(there, draws["shininess"]),
            "exponent_bin": shininess.bin_of(draws["shininess"]).astype(np.int32),
            "seed": np.full(len(positions), seed, np.int64),
            "index": np.asarray(positions, np.int64),
            "names": {
                "shape": np.array(self._geometry.shape_names)[self._geometry.shape[entries]],
                "light": np.array(self._lights.names)[_strongest(light, self._lights.scale)],
            },
        }

    def make(self, drawn: Mapping[str, Any]) -> dict[str, Any]:
        """Make a batch of drawn scenes on the device.

        Returns:
            The features of the batch by name, as `data.pipeline` names them, tensors of the
            backend. `seed`, `index`, the position, `shape` and `light`, the name of the map that
            gives most of the light, are NumPy arrays if they are asked for.
        """
        if self._on_device is None:
            self._on_device = {
                _LIGHTS: ops.convert_to_tensor(np.asarray(self._lights.radiance)),
                _TEXTURES: ops.convert_to_tensor(np.asarray(self._textures)),
            }
        given = {name: drawn[name] for name in ("draws", "light", "gbuffer", "work")}
        batch = self._compiled(self._on_device[_LIGHTS], self._on_device[_TEXTURES], given)
        batch |= {name: drawn[name] for name in _DRAWN} | drawn["names"]
        return {name: value for name, value in batch.items() if name in self._features}

    def _made(self, maps: Any, textures: Any, given: Mapping[str, Any]) -> dict[str, Any]:
        draws, light, gbuffer = given["draws"], given["light"], given["gbuffer"]
        # Decode.
        normal = octahedral.decode(gbuffer["normal"])
        variance = ops.take(variance_of(np.arange(16)), ops.cast(gbuffer["spread"], "int32"))
        # Light.
        radiance = mixed(maps, light)
        camera, rotation = gbuffer["camera"], light.rotation
        coverage = ops.cast(gbuffer["coverage"], "float32")[..., None] / _COVERED
        share = ops.cast(gbuffer["share"], "float32") / _COVERED
        diffuse, specular, mirror = layers(
            normal, variance, share, camera, radiance, rotation, draws["shininess"], given["work"]
        )
        # Compose before the background.
        composed = compose(
            draws["diffuse_albedo"], draws["specular_albedo"], draws["ambient"], diffuse, specular
        )
        side = self._geometry.size
        behind = backdrop.background(textures, radiance, rotation, camera, side, draws)
        image = backdrop.compose(composed, coverage, behind)
        scene = {
            "mask": coverage,
            "diffuse_shading": diffuse,
            "specular_shading": specular,
            "mirror": mirror,
            "camera": camera,
            **{
                name: draws[name]
                for name in ("diffuse_albedo", "specular_albedo", "shininess", "ambient")
            },
        }
        if "normal" in self._features:
            scene["normal"] = normal[:, 0] * ops.cast(coverage > 0, "float32")
        if "environment" in self._features:
            scene["environment"] = _in_camera_space(radiance, rotation)
        # Photograph.
        taken = photograph(image, scene, draws if self._camera else None)
        wanted = self._features | {"mask"}
        return reduced({name: value for name, value in taken.items() if name in wanted}, self._size)


def _strongest(light: light_law.LightDraw, scale: np.ndarray) -> np.ndarray:
    """Return the index of the map that gives most of each scene's light, `(B,)`."""
    power = np.where(light.weights > 0, light.weights / scale[light.maps], 0.0)
    return np.take_along_axis(light.maps, power.argmax(axis=1)[:, None], axis=1)[:, 0]


def _chosen(names: list[str], held_out: bool, whose: str) -> np.ndarray:
    """Return the indices of the names that are held out, or of all others.

    A tenth is held out, and at least one: those whose names have the least checksums.
    """
    if len(names) < 2:
        raise ValueError(f"{whose}: there is {len(names)}, and training and validation share none")
    ranked = sorted(range(len(names)), key=lambda k: (zlib.crc32(names[k].encode()), names[k]))
    count = max(1, len(names) // _HELD_OUT)
    return np.array(sorted(ranked[:count] if held_out else ranked[count:]))


def _in_camera_space(radiance: Any, rotation: Any) -> Any:
    """Return the lights as a record stores them, `(B, 64, 128, 1)` in camera space.

    A texel is the mean of 2 × 2 look-ups in maps of twice the rows.
    """
    height, width = environment.STORED_SHAPE
    shape = 2 * height, 2 * width
    fine = environment.directions(*shape).reshape(-1, 3).T.astype(np.float32)
    towards = ops.matmul(ops.transpose(rotation, (0, 2, 1)), fine)
    at = panorama.place(towards[:, 0], towards[:, 1], towards[:, 2])
    seen = panorama.looked_up(panorama.reduced(radiance, 2 * height), *at)
    angles = environment.solid_angles(*shape).reshape(height, 2, width, 2)
    weights = angles / angles.sum(axis=(1, 3), keepdims=True)
    blocks = ops.reshape(seen, (-1, *weights.shape)) * weights.astype(np.float32)
    return ops.sum(blocks, axis=(2, 4))[..., None]
