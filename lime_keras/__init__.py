"""LIME: Live Intrinsic Material Estimation (CVPR 2018), in TensorFlow and Keras.

    from lime_keras import Estimator
    material = Estimator().estimate("photo.jpg")

`import lime_keras` is cheap: NumPy and ONNX Runtime are imported when `Estimator` is first used.
TensorFlow and Keras are imported for `Estimator(engine="keras")` alone, and once to export a run.
"""

import os
from typing import Any

from lime_keras.version import __version__

__all__ = ["Estimator", "Material", "__version__"]

# Estimating and rendering tell nobody. ONNX Runtime reads its switch while its library is loaded,
# so it stands here, before any import of it; a user's own setting stays.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")


def __getattr__(name: str) -> Any:
    """Import the two public classes on first use, so that `--help` does not wait for NumPy."""
    if name == "Estimator":
        from lime_keras.estimate.estimator import Estimator

        return Estimator
    if name == "Material":
        from lime_keras.material import Material

        return Material
    raise AttributeError(f"module 'lime_keras' has no attribute {name!r}")
