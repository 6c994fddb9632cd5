"""Checks of the user's input files, which are all read once before rendering starts.

Whether a file is usable depends on the file alone. The caller chooses whether unusable files are
refused or skipped. Findings are stored beside the split: when rendering goes on after an
interruption, unchanged files are not read again, and changed files are noticed.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lime_keras.io import untrusted

from ..scene import backgrounds, environments
from ..scene.example import LEAST_COVERAGE
from ..scene.sources import ROOMS
from ..shapes import meshes

KINDS = ("shapes", "environments", "backgrounds")
_LISTED = 20


@dataclasses.dataclass(frozen=True)
class Finding:
    """The result of checking one file.

    Attributes:
        name: name of the file, without its folder.
        sha256: checksum of the file's bytes; empty if the file cannot be read.
        size: size of the file in bytes.
        mtime_ns: time of the file's last change, in nanoseconds.
        problem: why the file cannot be used, and how to mend it; None for a usable file.
        notes: notes on what was repaired in a usable file.
    """

    name: str
    sha256: str
    size: int
    mtime_ns: int
    problem: str | None = None
    notes: tuple[str, ...] = ()


Findings = dict[str, list[Finding]]  # findings of a split by kind, in the order of the files


def check(kind: str, path: Path) -> Finding:
    """Check one file, of one of `KINDS`, by reading it as rendering will read it."""
    try:
        untrusted.check(path, "an input")
        stat = path.stat()
        digest = untrusted.sha256(path)
    except ValueError as error:
        return Finding(path.name, "", 0, 0, _reason(error, path))
    except OSError as error:
        return Finding(path.name, "", 0, 0, f"cannot be read: {error.strerror}")
    finding = Finding(path.name, digest, stat.st_size, stat.st_mtime_ns)
    try:
        return dataclasses.replace(finding, notes=_notes(kind, path))
    except ValueError as error:
        return dataclasses.replace(finding, problem=_reason(error, path))
    except MemoryError:
        return dataclasses.replace(finding, problem="is too large for this machine's memory.")


def _reason(error: ValueError, path: Path) -> str:
    """Return an error's words without the file's folder."""
    words = str(error).removeprefix(f"{path}: ").removeprefix(f"{path} ")
    return words.replace(str(path), path.name)


def _notes(kind: str, path: Path) -> tuple[str, ...]:
    """Read a file, return notes on what was repaired in it; raise ValueError if it is unusable."""
    if kind == "environments":
        return environments.read(path)[1]
    if kind == "backgrounds":
        return backgrounds.read(path)[1]
    mesh, notes = meshes.read(path)
    if not meshes.may_cover(mesh, LEAST_COVERAGE):
        raise ValueError(
            f"{path}: covers less than {LEAST_COVERAGE:.0%} of a picture from every side, as it is "
            "too thin or a part of it lies far off; remove what is stray."
        )
    return notes


def inspect(
    files: dict[str, list[Path]],
    earlier: Findings | None,
    run: Callable[[Callable[[tuple[str, Path]], Finding], list[tuple[str, Path]]], list[Finding]],
) -> Findings:
    """Check all files of a split; files whose size and time of change are known are not read again.

    Args:
        files: Files by kind; an empty list for a built-in kind.
        earlier: Findings from when the split was begun; None for a new split.
        run: `run(function, items)` returns the function's result for each item, in order; the
            function can be sent to another process.

    Raises:
        ValueError: If files were changed, added or removed since the split was begun.
    """
    known = {(kind, f.name): f for kind, some in (earlier or {}).items() for f in some}
    asked = {(kind, path.name): path for kind, paths in files.items() for path in paths}
    if earlier is not None and known.keys() != asked.keys():
        differing = sorted(name for _, name in known.keys() ^ asked.keys())
        raise ValueError(
            f"{_listed(differing)} came or went since the split was begun: restore the folders, or "
            "remove the split to render it anew"
        )
    checked = {
        key: known[key] for key, path in asked.items() if _is_unchanged(path, known.get(key))
    }
    unread = [(kind, path) for (kind, name), path in asked.items() if (kind, name) not in checked]
    for (kind, _), finding in zip(unread, run(_checked, unread), strict=True):
        checked[kind, finding.name] = finding
    changed = [key[1] for key in known if known[key].sha256 != checked[key].sha256]
    if changed:
        raise ValueError(
            f"{_listed(changed)} changed since the split was begun, and shards may show either: "
            "remove the split to render it anew"
        )
    return {kind: [checked[kind, path.name] for path in paths] for kind, paths in files.items()}


def _checked(file: tuple[str, Path]) -> Finding:
    return check(*file)


def _is_unchanged(path: Path, earlier: Finding | None) -> bool:
    """Return whether a file has the size and the time of change of its stored finding."""
    if earlier is None or not path.is_file():
        return False
    stat = path.stat()
    return (stat.st_size, stat.st_mtime_ns) == (earlier.size, earlier.mtime_ns)


def unusable(findings: Findings) -> dict[str, dict[str, str]]:
    """Return the reasons why files cannot be used, by kind and file name."""
    return {
        kind: {f.name: f.problem for f in found if f.problem is not None}
        for kind, found in findings.items()
    }


def usable(
    files: dict[str, list[Path]], findings: Findings, *, skip: bool = False
) -> dict[str, list[Path]]:
    """Return the files to use, by kind; none of a built-in kind.

    Args:
        files: files by kind, as they were given to `inspect`.
        findings: what it found.
        skip: whether unusable files are left out, as long as others of their kind are usable.

    Raises:
        ValueError: If a file cannot be used; the message tells at most 20 of them with the reasons.
    """
    problems = unusable(findings)
    left = {
        kind: [path for path in paths if path.name not in problems[kind]]
        for kind, paths in files.items()
    }
    emptied = [kind for kind, paths in files.items() if paths and not left[kind]]
    reasons = [
        f"{kind}: {name}: {problem}"
        for kind in (emptied if skip else problems)
        for name, problem in problems[kind].items()
    ]
    if not reasons:
        return left
    listed = _listed(reasons, "\n  ")
    if skip:
        raise ValueError(f"none of the split's {' and '.join(emptied)} can be used:\n  {listed}")
    raise ValueError(
        f"{len(reasons)} file{'s' if len(reasons) > 1 else ''} cannot be used:\n  {listed}\n"
        "mend or remove them, or pass --unusable skip"
    )


def digests(findings: Findings) -> dict[str, dict[str, str]]:
    """Return the checksums of the files that are used, by kind and name."""
    return {
        kind: {finding.name: finding.sha256 for finding in found if finding.problem is None}
        for kind, found in findings.items()
    }


def clashes(
    described: Sequence[Mapping[str, Any]], used: Sequence[Mapping[str, Mapping[str, str]]]
) -> Iterator[str]:
    """Yield what a split and its corpus' other split share and may not, or must share and do not.

    Built-in shapes and rooms need no check: they are seeded by split.

    Args:
        described: descriptions of the split and of the other one, as they are recorded.
        used: checksums of the files that the two use (see `digests`).
    """
    separate = ["shapes", "environments"]
    if any(one.get("light_split") for one in described):
        separate.remove("environments")
        maps = [of_one.get("environments", {}) for of_one in used]
        count = ROOMS["train"]
        rooms = [(one.get("seed"), one.get("light_count") or count) for one in described]
        is_mixed = any(one.get("light_law") for one in described)
        if is_mixed or maps[0] != maps[1] or (not maps[0] and rooms[0] != rooms[1]):
            yield (
                "both splits are to have the same lights, by --lights known, and have others: pass "
                "the same --environments, or the same --seed and --light-count, and render the "
                "train split with --light-law maps"
            )
    for kind in separate:
        # Contents are compared: files of one name may differ, and one file may have two names.
        names = {digest: name for name, digest in used[1].get(kind, {}).items()}
        for name, digest in used[0].get(kind, {}).items():
            if digest in names:
                yield (
                    f"{kind}: {name} has the contents of {names[digest]}, which the "
                    f"{described[1].get('split')} split is rendered from: remove one of them, or "
                    "sort the files into subfolders train and test, and render that split anew"
                )


def repairs(findings: Findings) -> list[str]:
    """Return one line for the user for each note on a repaired file."""
    return [
        f"{kind}: {finding.name}: {note}"
        for kind, found in findings.items()
        for finding in found
        for note in finding.notes
    ]


def recorded(findings: Findings) -> dict[str, Any]:
    """Return findings as they are stored in JSON."""
    return {kind: [dataclasses.asdict(f) for f in found] for kind, found in findings.items()}


def read(path: Path) -> Findings | None:
    """Read findings from a JSON file; return None if there is no such file.

    Raises:
        ValueError: If the file holds something else.
    """
    if not path.is_file():
        return None
    with untrusted.naming(path, "findings", "remove it"):
        value: dict[str, list[dict[str, Any]]] = untrusted.read_json(path)
        return {
            kind: [_sound(Finding(**{**f, "notes": tuple(f["notes"])})) for f in found]
            for kind, found in value.items()
        }


def _sound(finding: Finding) -> Finding:
    """Return a finding; raise TypeError if one of its values is of another type than it has."""
    texts = (finding.name, finding.sha256, finding.problem or "", *finding.notes)
    numbers = (finding.size, finding.mtime_ns)
    if not all(isinstance(x, str) for x in texts) or not all(isinstance(x, int) for x in numbers):
        raise TypeError(f"a finding is {finding}")
    return finding


def _listed(items: list[str], separator: str = ", ") -> str:
    shown = separator.join(items[:_LISTED])
    return shown if len(items) <= _LISTED else f"{shown}{separator}and {len(items) - _LISTED} more"
