"""The choice of a Mitsuba variant that can run here, made without aborting this process.

`llvm_ad_rgb` needs a shared libLLVM. Some versions abort the whole process while compiling a kernel
(15 and 16 do, with Dr.Jit 1.5), so each candidate is tried in a child process first. Without a
usable libLLVM, `scalar_rgb` traces the rays, and NumPy shades.
"""

import contextlib
import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

FAST, SLOW = "llvm_ad_rgb", "scalar_rgb"
_LIBRARY_VARIABLE = "DRJIT_LIBLLVM_PATH"
_PROBE_SECONDS = 120
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # options of glibc's `mallopt`, from `malloc.h`

# Bad libraries aborted on a minimum of floats, then on a traced ray; the results are checked too.
_PROBE = """
import resource
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
from lime_keras.render.mitsuba_setup import variants
variants.load_companions()
import drjit as dr, mitsuba as mi
mi.set_variant("llvm_ad_rgb")
x = dr.linspace(mi.Float, -1, 1, 9)
assert abs(dr.sum(dr.minimum(dr.maximum(x, 0), dr.exp2(x)))[0] - 2.5) < 1e-5
scene = mi.load_dict({"type": "scene", "shape": {"type": "sphere"}})
hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0.5 * x, 0, 4), mi.Vector3f(0, 0, -1)))
assert dr.all(hit.is_valid())
"""
_SCALAR_PROBE = """
from lime_keras.render.mitsuba_setup import variants
variants.load_companions()
import mitsuba
mitsuba.set_variant("scalar_rgb")
"""


@dataclass(frozen=True)
class Choice:
    """A Mitsuba variant that was tried and runs, with the libLLVM it needs.

    Attributes:
        variant: `llvm_ad_rgb` or `scalar_rgb`.
        library: the libLLVM of `llvm_ad_rgb`, None for the other.
        tried: libraries that were found and do not work.
    """

    variant: str
    library: Path | None
    tried: tuple[Path, ...] = ()

    def explain(self) -> str:
        """Return lines for the user: the variant that runs, and how to get the faster variant."""
        if self.library:
            return f"rendering with {self.variant}, {self.library}"
        failed = f" (found but unusable: {', '.join(map(str, self.tried))})" if self.tried else ""
        return (
            f"rendering with {self.variant}: no usable libLLVM{failed}. This works, many times "
            "slower.\nFor the fast variant: `python -m "
            "lime_keras.render.mitsuba_setup.fetch_llvm`, or `apt-get install libllvm19`, or set "
            f"{_LIBRARY_VARIABLE} to a libLLVM of version 17 or later"
        )


def choose() -> Choice:
    """Find the fastest variant that works here; takes a second or two.

    The environment variable `DRJIT_LIBLLVM_PATH` is tried first, then the library of the virtual
    environment (`fetch_llvm` puts one there), and the system's, newest first.

    Raises:
        RuntimeError: if Mitsuba cannot be loaded at all; the message names what is missing.
    """
    tried: list[Path] = []
    for library in candidates():
        if works(library):
            return Choice(FAST, library, tuple(tried))
        tried.append(library)
    missing = _failure(_SCALAR_PROBE, os.environ)
    if missing is not None:
        raise RuntimeError(
            f"Mitsuba cannot be loaded: {missing or 'no reason given'}. On Debian or Ubuntu, "
            "`python -m lime_keras.render.mitsuba_setup.fetch_llvm` or `apt-get install "
            "libatomic1` may mend it"
        )
    return Choice(SLOW, None, tuple(tried))


def candidates() -> list[Path]:
    """Return the libLLVM files of this machine, each once, in the order in which to try them."""
    named = os.environ.get(_LIBRARY_VARIABLE)
    system = [*Path("/usr/lib").glob("llvm*/lib/libLLVM*.so*"), *_linker_cache()]
    ordered = [
        *([Path(named).resolve()] if named else []),
        *_newest_first(own_folder().rglob("libLLVM*.so*")),
        *_newest_first(system),
    ]
    return list(dict.fromkeys(ordered))


def own_folder() -> Path:
    """Return the folder in which this Python environment keeps its own libLLVM, if it has one."""
    return Path(sys.prefix) / "llvm"


def works(library: Path) -> bool:
    """Return whether Mitsuba's LLVM variant works with this libLLVM, tried in a child process."""
    return _failure(_PROBE, os.environ | {_LIBRARY_VARIABLE: str(library)}) is None


def _failure(probe: str, environment: Mapping[str, str]) -> str | None:
    """Run code in a child process; return None if it succeeded, else the reason if it is known."""
    try:
        child = subprocess.run(
            [sys.executable, "-c", probe],
            env=environment,
            capture_output=True,
            text=True,
            timeout=_PROBE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"it did not answer within {_PROBE_SECONDS} s"
    if child.returncode == 0:
        return None
    reasons = [line for line in child.stderr.splitlines() if line.startswith("ImportError: ")]
    return reasons[0].removeprefix("ImportError: ") if reasons else ""


def activate(choice: Choice, threads: int) -> None:
    """Set Mitsuba's variant in this process; call once, before anything is rendered.

    Args:
        choice: from `choose`.
        threads: number of threads of Dr.Jit and Mitsuba. With one thread, the order of every sum,
            and so every byte, is reproducible.

    Raises:
        RuntimeError: if TensorFlow was imported before Mitsuba, which ends in a segmentation fault,
            or if Mitsuba was imported before its libLLVM was chosen: it would use the system's.
    """
    if "tensorflow" in sys.modules and "drjit" not in sys.modules:
        raise RuntimeError(
            "TensorFlow was imported before Mitsuba, which crashes the process: put "
            "`import mitsuba` before the first import of tensorflow or keras"
        )
    if choice.library:
        if "drjit" in sys.modules and os.environ.get(_LIBRARY_VARIABLE) != str(choice.library):
            raise RuntimeError(
                "Mitsuba was imported before its libLLVM was chosen: call `variants.activate` "
                f"before the first `import mitsuba`, or set {_LIBRARY_VARIABLE} yourself"
            )
        os.environ[_LIBRARY_VARIABLE] = str(choice.library)
    load_companions()
    import drjit
    import mitsuba

    mitsuba.set_variant(choice.variant)
    drjit.set_thread_count(threads)
    _keep_memory()


def _keep_memory() -> None:
    """Tell glibc to keep freed memory: NumPy's arrays else cost a page fault every 4 kB."""
    with contextlib.suppress(AttributeError):  # another libc
        allocator = ctypes.CDLL(None)
        for option, size in ((_TRIM_THRESHOLD, 2**28), (_MMAP_THRESHOLD, 2**25)):
            allocator.mallopt(option, size)


def load_companions() -> None:
    """Load the libraries in `own_folder` that libLLVM and Mitsuba are linked to.

    The dynamic linker does not search this folder, but it uses libraries that are loaded already.
    """
    waiting = [
        path
        for path in own_folder().rglob("*.so.*")
        if not path.is_symlink() and not path.name.startswith("libLLVM")
    ]
    for _ in range(len(waiting)):
        for path in list(waiting):
            # A library may need another that is not loaded yet; then it is tried again.
            with contextlib.suppress(OSError):
                ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
                waiting.remove(path)


def _linker_cache() -> list[Path]:
    """Return the libLLVM files that the dynamic linker knows; none if `ldconfig` cannot run."""
    try:
        listing = subprocess.run(
            ["/sbin/ldconfig", "-p"], capture_output=True, text=True, timeout=20
        ).stdout
    except (OSError, subprocess.TimeoutExpired):
        return []
    return [Path(path) for path in re.findall(r"libLLVM\S* .*=> (\S+)", listing)]


def _newest_first(libraries: Iterable[Path]) -> list[Path]:
    """Sort libraries by the numbers in their names: libLLVM.so.19.1 before libLLVM-15.so.1."""
    return sorted(
        {path.resolve() for path in libraries},
        key=lambda path: [int(number) for number in re.findall(r"\d+", path.name)],
        reverse=True,
    )
