"""What of a picture's transparency is its mask on the page, as in Python."""

import javascript
import numpy as np
import pytest

# What a browser has and Node has not, as far as the page reads a photo with it.
BROWSER = """
globalThis.ImageData = class {
  constructor(width, height) {
    Object.assign(this, { width, height, data: new Uint8ClampedArray(4 * width * height) });
  }
};
globalThis.OffscreenCanvas = class {
  constructor(width, height) {
    const all = new ImageData(width, height);
    Object.assign(this, { width, height });
    this.getContext = () => ({
      clearRect: () => all.data.fill(0),
      drawImage: (bitmap, x, y) => {
        for (let row = 0; row < height; row++) {
          const from = 4 * (row - y) * bitmap.width;
          all.data.set(bitmap.data.slice(from, from + 4 * bitmap.width), 4 * row * width);
        }
      },
      getImageData: () => all,
    });
  }
};
globalThis.createImageBitmap = async ({ given }) => ({ ...given, close() {} });
const { openPhoto } = await import(page + "source.js");
const data = new Uint8ClampedArray(4 * width * height);
for (let at = 0; at < width * height; at++) {
  data.set([200, 100, 50, at % width < width / 2 ? left : right], 4 * at);
}
const blob = Object.assign(new Blob(), { given: { width, height, data } });
const { image, mask } = await openPhoto(blob, "photo.png");
return { first: [...image.data.slice(0, 4)], mask: mask && [mask[0], mask[mask.length - 1]] };
"""


@pytest.mark.parametrize("width", [32, 8194], ids=["small", "made smaller"])
@pytest.mark.parametrize(
    ("left", "right", "mask"),
    [
        (255, 255, None),
        (200, 200, None),  # all alike
        (10, 127, None),  # nowhere opaque by half
        (0, 255, [0, 255]),
        (200, 255, [200, 255]),
    ],
)
def test_alpha_that_masks_nothing_is_ignored(left, right, mask, width):
    found = javascript.run(BROWSER, width=width, height=54, left=left, right=right)
    assert found["mask"] == mask
    weight = 1 if mask is None else left / 255
    expected = [*(np.round(np.array([200, 100, 50]) * weight)), 255]
    np.testing.assert_allclose(found["first"], expected, atol=1)
