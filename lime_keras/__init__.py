"""LIME: Live Intrinsic Material Estimation (CVPR 2018), in TensorFlow and Keras.

    from lime_keras import Estimator
    material = Estimator().estimate("photo.jpg")

`import lime_keras` is cheap: NumPy and ONNX Runtime are imported when `Estimator` is first used.
TensorFlow and Keras are imported for `Estimator(engine="keras")` alone, and once to export a run.
"""

from typing import Any

from lime_keras.version import __version__

__all__ = ["Estimator", "Material", "__version__"]


def __getattr__(name: str) -> Any:
    """Import the two public classes on first use, so that `--help` does not wait for NumPy."""
    if name == "Estimator":
        from lime_keras.estimate.estimator import Estimator

        return Estimator
    if name == "Material":
        from lime_keras.material import Material

        return Material
    raise AttributeError(f"module 'lime_keras' has no attribute {name!r}")
