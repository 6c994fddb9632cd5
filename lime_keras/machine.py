"""The machine on which something is trained or timed: processor, system and packages."""

import os
import platform
from pathlib import Path

from lime_keras import processors
from lime_keras.version import installed

_PACKAGES = (
    *("tensorflow", "jax", "keras", "onnxruntime", "onnx", "tf2onnx"),
    *("numpy", "mitsuba", "drjit", "lime-keras"),
)
"""Packages that compute, or that write the models."""
_DECIDE_PRECISION = (
    *("avx2", "avx512f", "avx_vnni", "avx512_vnni", "avx512_bf16", "avx512_fp16"),
    *("amx_int8", "amx_bf16", "asimdhp", "asimddp", "bf16", "i8mm"),
)
"""Names of the instructions that make a precision narrower than float32 faster."""


def describe() -> dict:
    """Return a description of the machine, as JSON.

    Returns:
        `processor`, usable `cores`, `instructions` that decide a precision's speed, `memory_gib`,
        `system`, `python` (version), and versions of the installed `packages` by name.
    """
    about = _processor()
    flags = set(about.get("flags", about.get("Features", "")).split())
    return {
        "processor": about.get("model name") or platform.processor() or platform.machine(),
        "cores": processors.count(),
        "instructions": [name for name in _DECIDE_PRECISION if name in flags],
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": {k: v for k, v in installed(_PACKAGES).items() if v is not None},
    }


def _processor() -> dict[str, str]:
    """Return Linux's description of the first processor, by field; empty on other systems."""
    path = Path("/proc/cpuinfo")
    if not path.is_file():
        return {}
    first = path.read_text(encoding="utf-8").split("\n\n")[0]
    pairs = (line.partition(":") for line in first.splitlines())
    return {name.strip(): value.strip() for name, _, value in pairs}
