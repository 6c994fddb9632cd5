"""Adobe RGB that EXIF alone tells: the page's profile means what Python reads."""

import javascript
import numpy as np
import pytest
from PIL import Image, ImageCms

from lime_keras.io import photo

PROFILE = """
const { withProfile } = await import(page + "adobe_rgb.js");
const blob = new Blob([bytes], { type: "image/jpeg" });
const out = await withProfile(blob);
return { type: out.type, bytes: new Uint8Array(await out.arrayBuffer()) };
"""


def jpeg(path, space, interoperability, **options):
    tags = Image.Exif()
    tags[0x8769] = {} if space is None else {0xA001: space}
    if interoperability:
        tags[0x8769][0xA005] = {1: interoperability, 2: b"0100"}
    greys = np.array([0, 5, 10, 20, 40, 80, 160, 255], np.uint8)
    colours = np.random.default_rng(0).integers(0, 256, (8, 3), np.uint8)
    patches = np.stack([np.repeat(greys[:, None], 3, 1), colours])
    pixels = patches.repeat(16, 0).repeat(16, 1)
    Image.fromarray(pixels).save(path, quality=100, subsampling=0, exif=tags, **options)
    return np.frombuffer(path.read_bytes(), np.uint8)


@pytest.mark.parametrize(("space", "mark"), [(0xFFFF, "R03"), (2, None), (None, "R03")])
def test_the_profile_means_what_exif_says(space, mark, tmp_path):
    path, other = tmp_path / "photo.jpg", tmp_path / "tagged.jpg"
    found = javascript.run(PROFILE, bytes=jpeg(path, space, mark))
    other.write_bytes(found["bytes"].tobytes())
    assert found["type"] == "image/jpeg" and Image.open(other).info["icc_profile"]
    expected, seen = photo.load(path)[0], photo.load(other)[0]
    assert np.abs(seen - expected).max() <= 1.01 / 255
    # The file's own numbers are others, above all those of the dark.
    assert np.abs(np.asarray(Image.open(path)) / 255 - expected).max() > 20 / 255


@pytest.mark.parametrize(("space", "mark"), [(1, None), (1, "R03"), (0xFFFF, "R98"), (None, None)])
def test_any_other_photo_stays_as_it_is(space, mark, tmp_path):
    content = jpeg(tmp_path / "photo.jpg", space, mark)
    assert np.array_equal(javascript.run(PROFILE, bytes=content)["bytes"], content)


def test_a_photos_own_profile_stays_and_damage_does_no_harm(tmp_path):
    own = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    content = jpeg(tmp_path / "photo.jpg", 0xFFFF, "R03", icc_profile=own)
    for given in (content, content[:60], content[:2], content[:0]):
        assert np.array_equal(javascript.run(PROFILE, bytes=given)["bytes"], given)
