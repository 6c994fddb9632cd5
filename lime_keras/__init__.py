"""LIME: Live Intrinsic Material Estimation (CVPR 2018), in TensorFlow and Keras.

    from lime_keras import Estimator

    material = Estimator()("photo.jpg")
    print(material)          # what it is, in words
    material.show()          # its preview
    material.save("out")     # numbers, layers, files for Blender and others

`import lime_keras` is cheap: NumPy and ONNX Runtime are imported when `Estimator` is first used.
TensorFlow and Keras are imported for `Estimator(engine="keras")` alone.
"""

import os
from typing import TYPE_CHECKING, Any

from lime_keras.version import __version__

if TYPE_CHECKING:
    from lime_keras.estimate.estimator import Estimator
    from lime_keras.material import Caution, Material
    from lime_keras.video.estimate_video import estimate_video

__all__ = ["Caution", "Estimator", "Material", "__version__", "estimate_video"]

# Estimating tells nobody. ONNX Runtime reads its switch while its library is loaded,
# so it stands here, before any import of it; a user's own setting stays.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")


def __getattr__(name: str) -> Any:
    """Import the public names on first use, so that `--help` does not wait for NumPy."""
    if name == "Estimator":
        from lime_keras.estimate.estimator import Estimator

        return Estimator
    if name in ("Caution", "Material"):
        from lime_keras import material

        return getattr(material, name)
    if name == "estimate_video":
        from lime_keras.video.estimate_video import estimate_video

        return estimate_video
    raise AttributeError(f"module 'lime_keras' has no attribute {name!r}")
