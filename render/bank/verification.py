"""The verification of a bank on disk against its manifest, for `lime-render verify`.

Every file is hashed and every entry is decoded. The verification goes on after a fault and reports
all faults.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.io import untrusted
from lime_keras.optics import octahedral
from lime_keras.optics.shading import view_directions
from lime_keras.synthesis import bank, geometry
from lime_keras.synthesis.lights import LightBank

from ..inspect import input_checks
from ..inspect.faults import Faults
from ..scene.example import LEAST_COVERAGE

_AGAIN = "run the same `lime-render bank` again"
_ROUNDING = 1 / 255
_UNIT = 1e-5
_STEEPEST = 2.5
"""Largest tangent of the angle between a pixel and the camera's axis: crops lie near the axis."""


def verify(folder: Path, on_entry: Callable[[int, int], None]) -> Faults:
    """Check a bank: files, checksums, and every entry, light and texture.

    Args:
        folder: folder by `lime-render bank`.
        on_entry: called with (done, total) as entries are checked.
    """
    faults = Faults()
    try:
        manifest = bank.manifest(folder)
    except (FileNotFoundError, ValueError) as error:
        path = folder / bank.MANIFEST
        faults.add("manifest", path, str(error).removeprefix(f"{path} "))
        return faults
    _check_description(folder, manifest, faults)
    input_checks.check(folder / "inputs.json", manifest, faults)
    _check_files(folder, manifest, faults)
    _check_strays(folder, manifest, faults)
    # To read them is to check them: every light is finite, not negative, and has a mean of 1.
    for kind, place, read in (
        ("lights", "lights", LightBank),
        ("textures", bank.TEXTURES, bank.textures),
    ):
        try:
            read(folder)
        except (FileNotFoundError, ValueError) as error:
            faults.add(kind, folder / place, str(error))
    names = sorted(n for n in manifest["files"] if n.startswith("geometry/") and n.endswith(".bin"))
    done = 0
    for name in names:
        done += _check_shard(folder / name, manifest, faults)
        on_entry(min(done, manifest["count"]), manifest["count"])
    if done != manifest["count"]:
        what = f"tells of {manifest['count']} entries, and the shards hold {done}: {_AGAIN}"
        faults.add("count", folder / bank.MANIFEST, what)
    return faults


def _check_description(folder: Path, manifest: dict[str, Any], faults: Faults) -> None:
    """Check that the manifest agrees with itself and with the description beside it."""
    path, beside = folder / bank.MANIFEST, folder / "description.json"
    description = manifest["description"]
    for name in ("size", "count"):
        if manifest[name] != description.get(name):
            what = f"{name} is {manifest[name]}, and its description has {description.get(name)}"
            faults.add("manifest", path, what)
    if untrusted.json_or_none(beside) != description:
        faults.add(
            "manifest", beside, f"is missing, or differs from the description in {path.name}"
        )


def _check_files(folder: Path, manifest: dict[str, Any], faults: Faults) -> None:
    """Check that every file is there, with the checksum of the manifest."""
    for name, expected in manifest["files"].items():
        path = folder / name
        if not path.is_file():
            faults.add("file", path, f"is missing: {_AGAIN}")
            continue
        digest = untrusted.sha256(path)
        if digest != expected:
            faults.add("sha256", path, f"is {digest}, expected {expected}: delete it and {_AGAIN}")


def _check_strays(folder: Path, manifest: dict[str, Any], faults: Faults) -> None:
    """Check that no files of an interrupted or another run are left in the folder."""
    known = {folder / name for name in manifest["files"]}
    for path in sorted([*folder.glob("partial-*"), *folder.glob("*/*"), folder / "parts"]):
        vouching = path.suffix == ".json" and path.with_suffix(".bin") in known
        if path.exists() and path not in known and not vouching:
            faults.add("file", path, "is no part of the bank: delete it")


def _check_shard(path: Path, manifest: dict[str, Any], faults: Faults) -> int:
    """Check the entries of a shard; return their number."""
    sidecar = untrusted.json_or_none(path.with_suffix(".json"))
    try:
        table = geometry.read_index(path, len(manifest["shapes"]))
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        faults.add("index", path, str(error))
        return 0
    if not isinstance(sidecar, dict) or sidecar.get("entries") != len(table):
        what = f"is missing, or does not tell of {len(table)} entries: it vouches for the shard"
        faults.add("file", path.with_suffix(".json"), what)
    elif sidecar.get("sha256") != _listed(path, manifest):
        what = f"vouches for another shard than the manifest: {_AGAIN}"
        faults.add("sha256", path.with_suffix(".json"), what)
    ends = np.cumsum(table["length"], dtype=np.uint64)
    if (table["offset"] != ends - table["length"]).any() or ends[-1:].tolist() != [len(data)]:
        what = f"its entries do not follow one another to its end: delete it and {_AGAIN}"
        faults.add("index", path, what)
    for number, row in enumerate(table):
        where = f"{path}, entry {number}"
        try:
            content = data[row["offset"] : row["offset"] + row["length"]]
            arrays = geometry.decode(content, manifest["size"])
        except ValueError as error:
            faults.add("entry", where, f"{error}; delete the file and {_AGAIN}")
        else:
            faults.examples += 1
            for kind, what in _faults(*arrays, row["camera"]):
                faults.add(kind, where, f"{what}; delete the file and {_AGAIN}")
    return len(table)


def _listed(path: Path, manifest: dict[str, Any]) -> dict[str, str | None]:
    """Return the manifest's checksums of a shard and its index, by name."""
    names = (path.name, path.with_suffix(".npy").name)
    return {name: manifest["files"].get(f"{path.parent.name}/{name}") for name in names}


def _faults(
    coverage: np.ndarray,
    share: np.ndarray,
    normal: np.ndarray,
    spread: np.ndarray,
    camera: np.ndarray,
) -> list[tuple[str, str]]:
    """Return kind and description of each fault of a G-buffer (see `geometry.decode`)."""
    size, found = len(coverage), []
    mean = coverage.mean(dtype=float) / 255
    if mean < LEAST_COVERAGE - _ROUNDING:
        found.append(("coverage", f"its object covers {mean:.1%} of the picture"))
    fx, fy, cx, cy = camera.astype(float)
    corners = np.array([-cx / fx, (size - cx) / fx, -cy / fy, (size - cy) / fy])
    if fx != fy or np.abs(corners).max() > _STEEPEST:
        found.append(("camera", f"its camera {camera.tolist()} is none of a crop"))
    covered = coverage > 0
    two = covered & (share < geometry.ONE_SURFACE)
    if (share[covered] == 0).any():
        found.append(("share", "a pixel has a first surface without a share"))
    if spread.max(initial=0) > geometry.WIDEST:
        found.append(("spread", f"a code of the spread is {spread.max()}"))
    view = view_directions(camera, size, size)
    for codes, there, name in ((normal[0], covered, "first"), (normal[1], two, "second")):
        if codes.max(initial=0) > octahedral.LARGEST:
            found.append(("normal", f"a code of a {name} normal is {codes.max()}"))
            continue
        vectors = octahedral.decode(codes[there])
        if (np.abs(np.linalg.norm(vectors, axis=-1) - 1) > _UNIT).any():
            found.append(("normal", f"a {name} normal is not of length 1"))
        away = int((np.sum(vectors * view[there], axis=-1) <= 0).sum())
        if away:
            found.append(("normal", f"{away} {name} normals face away from the viewer"))
    return found
