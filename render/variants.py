"""Which Mitsuba variant can run here, chosen without ever aborting the process.

`llvm_ad_rgb` needs a shared libLLVM. Some versions abort the whole process while compiling a
kernel (15 and 16 do, with Dr.Jit 1.5), so each candidate library is tried in a child process first.
Without a usable one, `scalar_rgb` traces rays and NumPy shades.
"""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

FAST, SLOW = "llvm_ad_rgb", "scalar_rgb"
_LIBRARY_VARIABLE = "DRJIT_LIBLLVM_PATH"
_PROBE_SECONDS = 120

# What aborted with a bad library: a float minimum, a loop, a traced ray; the answer is checked.
_PROBE = """
import resource
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
import drjit as dr, mitsuba as mi
mi.set_variant("llvm_ad_rgb")
x = dr.linspace(mi.Float, -1, 1, 9)
assert abs(dr.sum(dr.minimum(dr.maximum(x, 0), dr.exp2(x)))[0] - 2.5) < 1e-5
scene = mi.load_dict({"type": "scene", "shape": {"type": "sphere"}})
hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0.5 * x, 0, 4), mi.Vector3f(0, 0, -1)))
assert dr.all(hit.is_valid())
"""


@dataclass(frozen=True)
class Choice:
    """A Mitsuba variant that was seen to run, with the libLLVM it needs.

    Attributes:
        variant: `llvm_ad_rgb` or `scalar_rgb`.
        library: the libLLVM of the former, None for the latter.
        tried: libraries that were found and do not work.
    """

    variant: str
    library: Path | None
    tried: tuple[Path, ...] = ()

    def explain(self) -> str:
        """One or two lines for the user: what runs, and how to get the faster one."""
        if self.library:
            return f"rendering with {self.variant}, {self.library}"
        found = f" (found but unusable: {', '.join(map(str, self.tried))})" if self.tried else ""
        return (
            f"rendering with {self.variant}: no usable libLLVM{found}. This works, many times "
            "slower.\nFor the fast variant: `make llvm` in a checkout, or `apt-get install "
            f"libllvm19`, or set {_LIBRARY_VARIABLE} to a libLLVM of version 17 or later"
        )


def choose() -> Choice:
    """Find the fastest variant that works here; takes a second or two.

    The environment variable `DRJIT_LIBLLVM_PATH` is tried first, then the libraries of the virtual
    environment (`make llvm` puts one there), then the system's, newest first.
    """
    tried = []
    for library in candidates():
        if works(library):
            return Choice(FAST, library, tuple(tried))
        tried.append(library)
    return Choice(SLOW, None, tuple(tried))


def candidates() -> list[Path]:
    """libLLVM files on this machine, each once, in the order in which to try them."""
    folders = [Path(sys.prefix) / "llvm", Path("/usr/lib"), Path("/usr/local/lib")]
    listed = _linker_cache()
    found = [path for folder in folders for path in folder.glob("llvm*/lib/libLLVM*.so*")]
    found += [path for path in folders[0].rglob("libLLVM*.so*")]
    ordered = sorted({path.resolve() for path in [*listed, *found]}, key=_version, reverse=True)
    chosen = os.environ.get(_LIBRARY_VARIABLE)
    if chosen:
        ordered = [Path(chosen), *(path for path in ordered if path != Path(chosen).resolve())]
    return ordered


def works(library: Path) -> bool:
    """Whether Mitsuba's LLVM variant computes rightly with this libLLVM, tried in a child."""
    environment = os.environ | {_LIBRARY_VARIABLE: str(library)}
    try:
        child = subprocess.run(
            [sys.executable, "-c", _PROBE],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_PROBE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return False
    return child.returncode == 0


def activate(choice: Choice, threads: int) -> None:
    """Set Mitsuba's variant in this process; call once, before anything is rendered.

    Args:
        choice: from `choose`.
        threads: of Dr.Jit's and Mitsuba's pool. One thread makes every sum's order, and so every
            byte, reproducible.

    Raises:
        RuntimeError: if TensorFlow was imported before Mitsuba, which ends in a segmentation fault.
    """
    if "tensorflow" in sys.modules and "drjit" not in sys.modules:
        raise RuntimeError(
            "TensorFlow was imported before Mitsuba, which crashes the process: put "
            "`import mitsuba` before the first import of tensorflow or keras"
        )
    if choice.library:
        os.environ[_LIBRARY_VARIABLE] = str(choice.library)
    import drjit
    import mitsuba

    mitsuba.set_variant(choice.variant)
    drjit.set_thread_count(threads)


def _linker_cache() -> list[Path]:
    """libLLVM files known to the dynamic linker; none where there is no `ldconfig`."""
    try:
        listing = subprocess.run(
            ["/sbin/ldconfig", "-p"], capture_output=True, text=True, timeout=20
        ).stdout
    except (OSError, subprocess.TimeoutExpired):
        return []
    return [Path(path) for path in re.findall(r"libLLVM\S* .*=> (\S+)", listing)]


def _version(path: Path) -> tuple[int, ...]:
    """The numbers in a library's file name: libLLVM.so.19.1 → (19, 1)."""
    return tuple(int(number) for number in re.findall(r"\d+", path.name))
