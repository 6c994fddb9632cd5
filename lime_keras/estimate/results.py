"""The results in an output folder: kept if they would be the same, and never overwritten unasked.

The JSON of a result has its provenance (`lime_keras.io.result_json`). A run keeps what would come
out the same, and refuses to begin where it would replace something else. The files of a result are
moved to their places together, the JSON last: a result is there completely, or not at all.
"""

import contextlib
import glob
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lime_keras.io import atomic, result_json, untrusted
from lime_keras.io.scanner import folded
from lime_keras.version import __version__

_MEND = "pass --overwrite to replace it, or another folder to --out"
_DIGITS = 16
"""Number of hexadecimal digits that are kept of a digest: enough to tell all files apart."""


@dataclass
class Draft:
    """A result that is being written.

    Attributes:
        folder: folder for its files.
        numbers: numbers for its JSON; once the result is in place, the whole content of that.
        files: names of files that grow in their places (`Results.growing`).
    """

    folder: Path
    numbers: dict[str, Any] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)


class Results:
    """The results of one run and of earlier ones in one folder.

    Args:
        out: folder of the results.
        weights: digest of the model, and of what of it changes results beside its weights.
        options: options of the run that change its results, by name; None stands for the default.
        overwrite: whether other results, and other files, may be replaced.
    """

    def __init__(
        self, out: Path, weights: str, options: Mapping[str, object], *, overwrite: bool = False
    ):
        self.out, self._overwrite = out, overwrite
        self._made = {
            "version": __version__,
            "weights": weights[:_DIGITS],
            "options": {name: value for name, value in options.items() if value},
        }

    def json(self, name: str) -> Path:
        """Return the path of the numbers of a result, whose name may begin with folders."""
        return self.out / f"{name}.json"

    def keep_names(
        self, names: Sequence[str], sources: Sequence[Path | None], places: Sequence[Path]
    ) -> list[str]:
        """Return the names of sources, so that each keeps the name under which it is there already.

        A new photo `a.jpg` beside the finished `a.png` may come first, and is called `a-2`. Photos
        of which no two have the same stem, as in a sequence, keep their names.

        Args:
            names: names of the sources (`files.distinct_names`).
            sources: photos and videos; None for cameras.
            places: paths after which they were named.
        """
        out = list(names)
        alike: dict[str, list[int]] = {}
        for index, place in enumerate(places):
            stem = re.sub(r"(-\d+)+$", "", folded(place.with_suffix("").as_posix()))
            alike.setdefault(stem, []).append(index)
        for group in alike.values():
            done = {k: earlier for k in group if (earlier := result_json.read(self.json(names[k])))}
            stems = {folded(places[k].with_suffix("").as_posix()) for k in group}
            if len(stems) == len(group) or not done:
                continue
            left = {k: _digest_or_none(sources[k]) for k in group}
            kept = {}
            for k, earlier in done.items():
                owner = next((i for i in left if left[i] == earlier["made"].get("source")), None)
                if owner is not None and left.pop(owner):
                    kept[owner] = names[k]
            others = iter(names[k] for k in group if names[k] not in kept.values())
            for k in group:
                out[k] = kept.get(k) or next(others)
        return out

    def provenance(self, source: Path | None, beside: Mapping[str, Path]) -> dict[str, Any]:
        """Return what a result depends on, ready for JSON.

        Args:
            source: photo or video; None for a camera, which never shows the same again.
            beside: further files that the result depends on, such as a mask, by what they are.

        Raises:
            ValueError: if a file is missing, or is none but a pipe or a folder, say.
            OSError: if a file cannot be read.
        """
        others = {name: digest(path) for name, path in beside.items()}
        return (
            self._made
            | {"source": source and digest(source)}
            | ({"beside": others} if others else {})
        )

    def existing(
        self, provenances: Mapping[str, Callable[[], Mapping[str, Any]]]
    ) -> dict[str, dict[str, Any]]:
        """Return the finished results that would come out the same, by name.

        Args:
            provenances: function that returns the `provenance` of each source, by the result's
                name; called only where there is a result.

        Raises:
            ValueError: if a result of one of the names has another provenance, or another file has
                its name, and nothing may be overwritten.
        """
        results, conflicts = {}, []
        for name, compute in provenances.items():
            if not os.path.lexists(self.json(name)):
                continue
            try:
                provenance = compute()
            except (ValueError, OSError):
                continue  # a source that cannot be read is reported when its turn comes
            try:
                result = self._existing(self.json(name), provenance)
            except ValueError as error:
                if not self._overwrite:
                    conflicts.append(str(error))
                continue
            if result is not None:
                results[name] = result
        if conflicts:
            more = f" ({len(conflicts)} results are in the way)" if len(conflicts) > 1 else ""
            raise ValueError(f"{conflicts[0]}{more}")
        return results

    def _existing(self, path: Path, provenance: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return a result if it is whole; raise ValueError if its provenance differs."""
        result = result_json.read(path)
        if result is None:
            raise ValueError(f"{path} is no result of lime-estimate: {_MEND}")
        if differing := _differing(result["made"], provenance):
            raise ValueError(f"{path} was made with another {', '.join(differing)}: {_MEND}")
        if provenance["source"] is None:
            raise ValueError(f"{path} was made of an earlier recording: {_MEND}")
        is_whole = all((path.parent / file).is_file() for file in result["files"])
        return result if is_whole and not result["made"].get("unfinished") else None

    @contextlib.contextmanager
    def writing(self, name: str, provenance: Mapping[str, Any]) -> Iterator[Draft]:
        """Yield a draft, and at the end move the result that was written there into place.

        The block writes the files of the result but `NAME.json`, and sets its numbers. If it fails,
        nothing is left. Of an earlier result of this name, all files are removed.

        Raises:
            ValueError: if another file has the name of one of the result's, and nothing may be
                overwritten.
            OSError: if a file cannot be written.
        """
        target = self.json(name)
        partial = target.with_name(f"partial-{target.stem}")
        with atomic.naming_writer(target):
            atomic.remove(partial)
            partial.mkdir(parents=True)
        try:
            draft = Draft(partial)
            yield draft
            files = sorted([*(path.name for path in partial.iterdir()), target.name])
            self._clear(name, files)
            draft.numbers = result_json.write(
                partial / target.name, draft.numbers, provenance, files
            )
            # The numbers come last: with them, the result counts as complete.
            with atomic.naming_writer(target):
                for file in sorted(files, key=target.name.__eq__):
                    os.replace(partial / file, target.with_name(file))
        except OSError as error:
            # Told with the names that the files were to have: the folder is removed.
            text, *others = error.args
            if isinstance(text, str):
                text = text.replace(f"{partial}{os.sep}", f"{target.parent}{os.sep}")
            error.args = (text, *others)
            raise
        finally:
            atomic.remove(partial)

    @contextlib.contextmanager
    def growing(
        self, name: str, provenance: Mapping[str, Any], ends: Sequence[str]
    ) -> Iterator[Draft]:
        """Yield a draft whose files grow in their places, as those of a video do.

        An interruption leaves them there, marked as unfinished. After a ValueError nothing is left.

        Args:
            name: name of the result.
            provenance: what it depends on.
            ends: ends of the names of the files that it may have, with a star for any number.

        Raises:
            ValueError: if another file has one of these names, and nothing may be overwritten.
        """
        target = self.json(name)
        draft = Draft(target.parent, files=[target.stem + end for end in ends if "*" not in end])
        several = [end for end in ends if "*" in end]
        self._clear(name, draft.files, several)
        result_json.write(target, {}, dict(provenance) | {"unfinished": True}, draft.files)
        try:
            yield draft
        except ValueError:
            self._clear(name, [], several)
            raise
        files = [*draft.files, target.name]
        draft.numbers = result_json.write(target, draft.numbers, provenance, files)

    def _clear(self, name: str, files: list[str], several: Sequence[str] = ()) -> None:
        """Remove an earlier result; raise ValueError if a file in the way is another's."""
        target = self.json(name)
        earlier, start = result_json.read(target), glob.escape(target.stem)
        there = {path.name for end in several for path in target.parent.glob(start + end)}
        # What another result names is its own: `a-scene-1` may be a photo.
        others = map(result_json.read, target.parent.glob(f"{start}-*.json")) if there else ()
        foreign = {file for one in others if one for file in one["files"]}
        own = set(earlier["files"]) if earlier else set()
        if earlier and earlier["made"].get("unfinished"):
            own |= there - foreign  # it was interrupted before it could name them
        for file in (*files, *sorted(there)):
            path = target.with_name(file)
            if not self._overwrite and file not in own and os.path.lexists(path):
                raise ValueError(f"{path} is there, and no part of an earlier result: {_MEND}")
        # The numbers go first: without them, what is left does not count as a result.
        for file in sorted(own, key=target.name.__ne__):
            target.with_name(file).unlink(missing_ok=True)


def digest(path: Path) -> str:
    """Return the beginning of the SHA-256 of a file's content.

    Raises:
        ValueError: if the file is missing, or is none but a pipe or a folder, say.
        OSError: if the file cannot be read.
    """
    untrusted.check(path, "a source of a result")
    return untrusted.sha256(path)[:_DIGITS]


def _digest_or_none(path: Path | None) -> str | None:
    """Return the digest of a file; None if it cannot be read, which is reported later."""
    try:
        return None if path is None else digest(path)
    except (OSError, ValueError):
        return None


def _differing(earlier: Mapping[str, Any], provenance: Mapping[str, Any]) -> list[str]:
    """Return the names of what a result was made with, where that is not `provenance`."""
    words = {"beside": "mask or normals"}
    parts = ("source", "weights", "beside", "version")
    out = [words.get(name, name) for name in parts if earlier.get(name) != provenance.get(name)]
    then, now = (each.get("options") or {} for each in (earlier, provenance))
    return out + [f"--{name}" for name in sorted({*then, *now}) if then.get(name) != now.get(name)]
