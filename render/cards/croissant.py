"""The Croissant metadata of a corpus: its files, and the fields of its records.

The format is version 1.0 of https://docs.mlcommons.org/croissant/docs/croissant-spec.html.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import Split
from lime_keras.version import __version__

FIELDS = {
    "image": ("sc:ImageObject", "LDR sRGB over its background, (S, S, 3); PNG, 8 bits"),
    "mask": ("sc:ImageObject", "coverage in [0, 1], (S, S, 1); PNG, 8 bits"),
    "diffuse_shading": ("sc:ImageObject", "D, linear radiance, (S, S, 1); bits of half floats"),
    "specular_shading": ("sc:ImageObject", "S, linear radiance, (S, S, 1); bits of half floats"),
    "mirror": ("sc:ImageObject", "M, linear radiance, (S, S, 1); bits of half floats"),
    "normal": ("sc:ImageObject", "normals in camera space, (S, S, 3); bits of half floats"),
    "environment": ("sc:ImageObject", "light in camera space, (64, 128, 1); bits of half floats"),
    "camera": ("sc:Float", "fx, fy, cx, cy in pixels"),
    "diffuse_albedo": ("sc:Float", "m_d, linear RGB in [0, 1]"),
    "specular_albedo": ("sc:Float", "m_s in [0, 1]"),
    "shininess": ("sc:Float", "s, Blinn-Phong exponent"),
    "ambient": ("sc:Float", "m_a, linear radiance"),
    "shape": ("sc:Text", "name of the mesh"),
    "light": ("sc:Text", "name of the environment map"),
    "seed": ("sc:Integer", "seed of the corpus"),
    "index": ("sc:Integer", "number of the example"),
}
"""Type and content of each feature of a record (`lime_keras.data.records`)."""
_REPEATED = ("camera", "diffuse_albedo")
_CONTEXT = Path(__file__).with_name("croissant_context.json")
"""The context that the format prescribes."""
_TYPE = "application/x-tfrecord"
_CITED = (
    "Meka, Maximov, Zollhöfer, Chatterjee, Seidel, Richardt, Theobalt: LIME: Live Intrinsic "
    "Material Estimation, CVPR 2018"
)


def text(name: str, parts: Sequence[Split]) -> str:
    """Return the metadata of a folder's complete splits, at least one, as JSON."""
    metadata: dict[str, Any] = {
        "@context": json.loads(_CONTEXT.read_text(encoding="utf-8")),
        "@type": "sc:Dataset",
        "name": name,
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "description": "Rendered images of single objects with layers, for the estimation of "
        "materials; README.md says more.",
        "citeAs": _CITED,
        "version": __version__,
        "distribution": [
            *(
                _file(f"{part.name}/{part.shard_path(number).name}", digest)
                for part in parts
                for number, digest in enumerate(part.sha256)
            ),
            *map(_shards, parts),
        ],
    }
    if all(map(is_built_in, parts)):
        metadata["license"] = "https://spdx.org/licenses/MIT.html"
    metadata["recordSet"] = [_records(part) for part in parts]
    return json.dumps(metadata, indent=1, ensure_ascii=False) + "\n"


def is_built_in(part: Split) -> bool:
    """Return whether no file of a user is in a split; ValueError if its manifest is broken."""
    return not any(part.inputs.values())


def _file(path: str, digest: str) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": path,
        "name": path,
        "contentUrl": path,
        "encodingFormat": _TYPE,
        "sha256": digest,
    }


def _shards(part: Split) -> dict[str, Any]:
    return {
        "@type": "cr:FileSet",
        "@id": f"{part.name}-shards",
        "name": f"{part.name}-shards",
        "encodingFormat": _TYPE,
        "includes": f"{part.name}/*.tfrecord",
    }


def _records(part: Split) -> dict[str, Any]:
    def field(name: str) -> dict[str, Any]:
        kind, content = FIELDS[name]
        repeated = {"repeated": True} if name in _REPEATED else {}
        return {
            "@type": "cr:Field",
            "@id": f"{part.name}/{name}",
            "name": name,
            "description": content,
            "dataType": kind,
            "source": {"fileSet": {"@id": f"{part.name}-shards"}, "extract": {"column": name}},
        } | repeated

    return {
        "@type": "cr:RecordSet",
        "@id": part.name,
        "name": part.name,
        "description": f"{part.count} examples, each a tf.train.Example.",
        "field": [field(name) for name in FIELDS],
    }
