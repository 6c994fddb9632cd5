"""Verification: a sound bank has no fault, and every broken one has its own."""

import hashlib
import json

import numpy as np
import pytest

from lime_keras.render.bank import verification
from lime_keras.synthesis import bank as banks
from lime_keras.synthesis import geometry
from lime_keras.synthesis.lights import RADIANCE


def nothing(done, total):
    """Follows no progress."""


def kinds(folder):
    return verification.verify(folder, nothing).kinds


def lines(folder):
    return "\n".join(verification.verify(folder, nothing).lines())


def vouch(folder):
    """Give the files as they are the checksums of the manifest."""
    path = folder / banks.MANIFEST
    manifest = json.loads(path.read_text())
    for name in manifest["files"]:
        manifest["files"][name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    path.write_text(json.dumps(manifest))
    for beside in (folder / "geometry").glob("*.json"):
        names = [beside.with_suffix(suffix).name for suffix in (".bin", ".npy")]
        digests = {name: manifest["files"][f"geometry/{name}"] for name in names}
        beside.write_text(json.dumps(json.loads(beside.read_text()) | {"sha256": digests}))


def test_a_sound_bank_has_no_fault(rendered):
    told = []
    faults = verification.verify(rendered, lambda *t: told.append(t))
    assert faults.lines() == [] and faults.examples == 20
    assert told == [(8, 20), (16, 20), (20, 20)]


@pytest.mark.parametrize(
    "name", ["geometry/00001.bin", "geometry/00001.npy", RADIANCE, banks.TEXTURES]
)
def test_a_flipped_bit_is_a_fault_of_its_file(bank, name):
    content = bytearray((bank / name).read_bytes())
    content[-1] ^= 1
    (bank / name).write_bytes(bytes(content))
    assert f"sha256: {bank / name}: is " in lines(bank)


@pytest.mark.parametrize("name", ["geometry/00000.bin", "geometry/00002.npy", banks.TEXTURES])
def test_a_missing_file_is_a_fault(bank, name):
    (bank / name).unlink()
    assert f"file: {bank / name}: is missing" in lines(bank)


def test_sidecars_that_were_exchanged_are_faults(bank):
    first, second = (bank / f"geometry/0000{shard}.json" for shard in (0, 1))
    held = first.read_bytes(), second.read_bytes()
    first.write_bytes(held[1])
    second.write_bytes(held[0])
    assert kinds(bank) == {"sha256": 2}


@pytest.mark.parametrize("content", [None, "{", '{"shapes": [{}]}', '{"shapes": []}'])
def test_inputs_that_are_missing_or_others_are_faults(content, bank):
    (bank / "inputs.json").unlink() if content is None else (bank / "inputs.json").write_text(
        content
    )
    assert kinds(bank) == {"inputs": 1}


def test_a_missing_sidecar_is_a_fault(bank):
    (bank / "geometry/00001.json").unlink()
    assert kinds(bank) == {"file": 1}


def test_strays_are_faults(bank):
    (bank / "geometry" / "00003.bin").write_bytes(b"")
    (bank / "lights" / "partial-radiance.npy").write_bytes(b"")
    (bank / "parts").mkdir()
    assert kinds(bank) == {"file": 3}


@pytest.mark.parametrize("change", [{"version": 9}, {"format": "x"}])
def test_another_manifest_ends_the_verification(bank, change):
    path = bank / banks.MANIFEST
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    assert kinds(bank) == {"manifest": 1}


def test_a_bank_that_is_not_complete_is_a_fault(bank):
    (bank / banks.MANIFEST).unlink()
    assert "bank.json: is missing: `lime-render bank" in lines(bank)


def test_a_manifest_of_other_entries_is_a_fault(bank):
    path = bank / banks.MANIFEST
    path.write_text(json.dumps(json.loads(path.read_text()) | {"count": 21}))
    assert kinds(bank) == {"manifest": 1, "count": 1}


def test_a_light_that_is_none_is_a_fault(bank):
    radiance = np.load(bank / RADIANCE)
    radiance[1, 2, 3] = np.nan
    np.save(bank / RADIANCE, radiance)
    vouch(bank)
    assert "map 1, room-0000.exr" in lines(bank) and kinds(bank) == {"lights": 1}


def rewrite(folder, shard, change):
    """Decode the first entry of a shard, change it, and write the shard anew with its index."""
    path = folder / "geometry" / f"{shard:05d}.bin"
    table, data = np.load(path.with_suffix(".npy")), path.read_bytes()
    parts = [data[row["offset"] : row["offset"] + row["length"]] for row in table]
    arrays = geometry.decode(parts[0], 32)
    camera = change(*arrays)
    if camera is not None:
        table["camera"][0] = camera
    parts[0] = geometry.encode(*arrays)
    table["length"] = [len(part) for part in parts]
    table["offset"] = np.cumsum(table["length"]) - table["length"]
    path.write_bytes(b"".join(parts))
    np.save(path.with_suffix(".npy"), table)
    vouch(folder)


def away(coverage, share, normal, spread):
    normal[0][coverage > 0] = 0  # −z


def second_away(coverage, share, normal, spread):
    normal[1][(coverage > 0) & (share < 255)] = 0


def too_small(coverage, share, normal, spread):
    coverage[2:] = 0


def no_share(coverage, share, normal, spread):
    share[coverage > 0] = 0


def no_code(coverage, share, normal, spread):
    normal[0][coverage > 0] = 4095


def wide(coverage, share, normal, spread):
    spread[0][coverage > 0] = 16


def no_camera(coverage, share, normal, spread):
    return 50, 60, 16, 16


def far_off(coverage, share, normal, spread):
    return 50, 50, 1e6, 16


@pytest.mark.parametrize(
    ("change", "kind", "told"),
    [
        (away, "normal", "first normals face away"),
        (second_away, "normal", "second normals face away"),
        (too_small, "coverage", "covers"),
        (no_share, "share", "without a share"),
        (no_code, "normal", "a code of a first normal is 4095"),
        (wide, "spread", "a code of the spread is 16"),
        (no_camera, "camera", "none of a crop"),
        (far_off, "camera", "none of a crop"),
    ],
)
def test_an_entry_that_cannot_be_is_a_fault_of_its_own(bank, change, kind, told):
    rewrite(bank, 1, change)
    found = lines(bank)
    assert f"{kind}: {bank / 'geometry/00001.bin'}, entry 0: " in found and told in found
    assert "delete the file and run the same" in found


def test_sound_entries_written_anew_are_sound(bank):
    """So the faults above are of the changes."""
    rewrite(bank, 1, lambda *arrays: None)
    assert kinds(bank) == {}


def test_an_entry_that_cannot_be_decoded_is_a_fault_and_the_others_are_read(bank):
    path = bank / "geometry/00000.bin"
    path.write_bytes(b"\xff" * 8 + path.read_bytes()[8:])
    vouch(bank)
    faults = verification.verify(bank, nothing)
    assert faults.kinds == {"entry": 1} and faults.examples == 19


def test_an_index_with_a_gap_is_a_fault(bank):
    path = bank / "geometry/00000.bin"
    path.write_bytes(path.read_bytes() + b"more")
    vouch(bank)
    assert kinds(bank) == {"index": 1}
