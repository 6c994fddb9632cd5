"""The live page's modules under Node, on arrays of NumPy."""

import base64
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras import live

PAGE = Path(live.__file__).parent / "page"  # folder of the page's modules

_SCRIPT = """
const { arrays, values, script } = JSON.parse((await import("node:fs")).readFileSync(0, "utf8"));
const given = { ...values };
for (const [name, { kind, data }] of Object.entries(arrays)) {
  const bytes = Uint8Array.from(Buffer.from(data, "base64"));
  given[name] = new globalThis[kind](bytes.buffer);
}
const plain = (value) => {
  if (!ArrayBuffer.isView(value)) return value;
  const data = Buffer.from(value.buffer, value.byteOffset, value.byteLength).toString("base64");
  return { kind: value.constructor.name, data };
};
const run = new (async () => {}).constructor(...Object.keys(given), script);
const found = await run(...Object.values(given));
console.log(JSON.stringify(found, (_, value) => plain(value)));
"""
_KINDS: dict[np.dtype, str] = {
    np.dtype(np.uint8): "Uint8ClampedArray",
    np.dtype(np.float32): "Float32Array",
    np.dtype(np.float64): "Float64Array",
}
_TYPES: dict[str, np.dtype] = {
    "Uint8Array": np.dtype(np.uint8),
    **{kind: dtype for dtype, kind in _KINDS.items()},
}


def node() -> str | None:
    """Return the path of Node.js, or None where there is none."""
    return shutil.which("node")


def run(script: str, **given: Any) -> Any:
    """Return what a script returns; arrays in both directions are flat, typed arrays.

    Args:
        script: body of an asynchronous function, which imports modules of the page by
            `await import(page + "…")`.
        given: arrays and plain values that the script uses by name.

    Raises:
        FileNotFoundError: if there is no Node.js.
        ValueError: if the script fails.
    """
    program = node()
    if program is None:
        raise FileNotFoundError("there is no node: install Node.js 20 or newer")
    arrays = {name: value for name, value in given.items() if isinstance(value, np.ndarray)}
    sent = {
        "script": script,
        "values": {name: value for name, value in given.items() if name not in arrays}
        | {"page": f"{PAGE.as_uri()}/"},
        "arrays": {
            name: {"kind": _KINDS[value.dtype], "data": base64.b64encode(value.tobytes()).decode()}
            for name, value in arrays.items()
        },
    }
    done = subprocess.run(
        [program, "--input-type=module", "--eval", _SCRIPT],
        input=json.dumps(sent),
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise ValueError(done.stderr)
    return json.loads(done.stdout, object_hook=_array)


def _array(found: Any) -> Any:
    if set(found) != {"kind", "data"}:
        return found
    return np.frombuffer(base64.b64decode(found["data"]), _TYPES[found["kind"]])
