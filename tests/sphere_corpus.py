"""A corpus in closed form: spheres under a smooth light with a lamp, shaded by Eqs. 1–4."""

import hashlib
import json
from pathlib import Path

import numpy as np
import tensorflow as tf

from lime_keras import colour, environment, records, shading
from lime_keras.compositing import compose

SIZE = 64


def example(index: int, seed: int = 0, size: int = SIZE) -> dict:
    """One record whose layers recompose to its image."""
    rng = np.random.default_rng((seed, index))
    camera = np.array([2.0 * size, 2.0 * size, size / 2, size / 2])
    view = shading.view_directions(camera, size, size)
    across, down = np.meshgrid(*[(np.arange(size) + 0.5 - size / 2) / (0.4 * size)] * 2)
    # Further out, the normals of a distant sphere face away from a camera this near.
    inside = np.hypot(across, down) < 0.97
    z = np.sqrt(np.maximum(1 - across**2 - down**2, 0))
    normal = np.stack([across, -down, z], axis=-1)
    light = _light(rng)
    exponent = 10.0 ** rng.uniform(0, 3)
    n, o = normal[inside], view[inside]
    layers = {
        "diffuse_shading": shading.diffuse(n, *shading.texels(light)),
        "specular_shading": shading.specular(n, o, exponent, *shading.texels(light)),
        "mirror": shading.mirror(n, o, light),
        "normal": n,
    }
    images = {name: _scatter(inside, values) for name, values in layers.items()}
    mask = inside[..., None].astype(np.float32)
    material = {
        "diffuse_albedo": rng.uniform(0.1, 0.9, 3),
        "specular_albedo": rng.uniform(),
        "ambient": 0.02,
    }
    composed = compose(
        material["diffuse_albedo"],
        np.float64(material["specular_albedo"]),
        np.float64(material["ambient"]),
        images["diffuse_shading"][None],
        images["specular_shading"][None],
    )[0]
    linear = np.where(mask > 0, np.clip(composed, 0, 1), rng.uniform(size=3))
    stored_light = environment.rotate(light, np.eye(3), *environment.STORED_SHAPE)
    return {
        "image": np.clip(colour.linear_to_srgb(linear), 0, 1),
        "mask": mask,
        **images,
        **material,
        "environment": stored_light[..., None],
        "camera": camera,
        "shininess": exponent,
        "shape": "sphere",
        "light": "lamp",
        "seed": seed,
        "index": index,
    }


def write_split(
    corpus: Path, split: str, shards: list[range], seed: int = 0, size: int = SIZE
) -> Path:
    """Write a complete split of closed-form records, one shard for each range of indices."""
    folder = corpus / split
    folder.mkdir(parents=True)
    for shard, indices in enumerate(shards):
        write_shard(folder, shard, [example(index, seed, size) for index in indices])
    description = {
        "split": split,
        "count": sum(map(len, shards)),
        "seed": seed,
        "size": size,
        "shard_size": max(map(len, shards)),
        "shading": "furnace",
        "shapes": None,
        "environments": None,
    }
    manifest = {
        "description": description,
        "shards": len(shards),
        "examples": description["count"],
        "sha256": [
            json.loads((folder / f"{shard:05d}.json").read_text(encoding="utf-8"))["sha256"]
            for shard in range(len(shards))
        ],
        "failures": [],
        "shapes": ["sphere"],
        "lights": ["lamp"],
        "inputs": {"shapes": {}, "environments": {}, "backgrounds": {}},
    }
    for name, content in (("description", description), ("manifest", manifest)):
        (folder / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    return corpus


def write_shard(folder: Path, shard: int, examples: list[dict]) -> str:
    """Write records and the sidecar that vouches for them; returns their SHA-256."""
    path = folder / f"{shard:05d}.tfrecord"
    with tf.io.TFRecordWriter(str(path)) as writer:
        for record in examples:
            writer.write(records.encode(record))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    sidecar = {"examples": len(examples), "sha256": digest, "failures": []}
    path.with_suffix(".json").write_text(json.dumps(sidecar), encoding="utf-8")
    return digest


def _light(rng: np.random.Generator) -> np.ndarray:
    """A map `(16, 32)` of mean 0.4: dim, with one lamp in front."""
    light = rng.uniform(0.1, 0.3, (16, 32))
    light[rng.integers(3, 8), rng.integers(12, 20)] = 30.0
    return light * 0.4 / environment.spherical_mean(light)


def _scatter(inside: np.ndarray, values: np.ndarray) -> np.ndarray:
    image = np.zeros((*inside.shape, values.shape[-1] if values.ndim > 1 else 1), np.float32)
    image[inside] = values.reshape(len(values), -1)
    return image
