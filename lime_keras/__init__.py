"""LIME: Live Intrinsic Material Estimation (CVPR 2018), in TensorFlow and Keras.

`import lime_keras` is cheap: TensorFlow is imported when `Estimator` is first accessed.

    from lime_keras import Estimator
    material = Estimator().estimate(image_srgb)
"""

from typing import Any

from lime_keras.version import __version__

__all__ = ["Estimator", "Material", "__version__"]


def __getattr__(name: str) -> Any:
    """Import the two public classes on first use, so that `--help` does not wait for TensorFlow."""
    if name == "Estimator":
        from lime_keras.estimate.estimator import Estimator

        return Estimator
    if name == "Material":
        from lime_keras.material import Material

        return Material
    raise AttributeError(f"module 'lime_keras' has no attribute {name!r}")
