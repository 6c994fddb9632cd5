"""`lime-estimate`: estimate materials from photos and videos."""

import argparse
import contextlib
import functools
import hashlib
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lime_keras import console
from lime_keras.commands import model_option
from lime_keras.io.scanner import SUFFIXES, inside, is_camera, is_video, photo_of_mask
from lime_keras.model import folder as model_folder
from lime_keras.outputs import NEEDED, OF_A_FRAME

if TYPE_CHECKING:
    from lime_keras.estimate.batch import Clone
    from lime_keras.estimate.estimator import Estimator
    from lime_keras.estimate.results import Results
    from lime_keras.estimate.terminal import Printer

_FAMILIES = ("u2net", "birefnet", "isnet")
_SCENE_ENDS = (".mtl", ".gltf", "-mitsuba.json", "-preview.png")
_VIDEO_ENDS = (".csv", "-overlay.mp4", ".json", *_SCENE_ENDS)

INTERRUPTED = "what is done so far is in the output folder"
_EXAMPLE = """
examples:
  lime-estimate cup.jpg
  lime-estimate cup.jpg --mask mask.png --weights runs/mine
  lime-estimate cup.jpg --clone-onto teapot.ply --shadow
  lime-estimate photos/ --out materials --only albedo,exponent
  lime-estimate turntable.mp4               (or camera:0, until Ctrl-C)

DIR/NAME.json has the numbers of a photo and says what may make them wrong. Beside it are the
layers, a preview, and the material for Blender (glTF), OBJ and Mitsuba; of a video, a table and a
clip. DIR/index.html shows all results. Run again, the command keeps the results that would come out
the same, and goes on where it stopped.

Exit status: 0 done; 1 a file cannot be read or shows no object (standard error names it; the others
are done), or options contradict each other; 2 an option is unknown; 130 interrupted.

More: docs/how-to/photos.md, docs/how-to/folders.md, docs/how-to/videos.md, docs/how-to/light.md.
"""


class _Source(NamedTuple):
    """A photo or a video."""

    text: str  # path of its file, or name of a camera
    place: Path  # after which its files are named: relative to the folder it was found in

    @property
    def is_video(self) -> bool:
        return is_video(self.text)

    @property
    def file(self) -> Path | None:
        return None if is_camera(self.text) else Path(self.text)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    out = console.parser(
        prog="lime-estimate",
        usage="lime-estimate PHOTO [PHOTO ...] [options]",
        description="Estimate the material of the one object in each photo or video: its mask, "
        "colour and gloss, its highlights and mirror image.",
        epilog=_EXAMPLE,
    )
    _add_input(out.add_argument_group("input"))
    _add_estimated(out.add_argument_group("what is estimated"))
    _add_output(out.add_argument_group("output"))
    out.add_argument_group("light").add_argument(
        "--normals",
        type=Path,
        metavar="FILE",
        help="the object's normals in camera space (x right, y up, z towards the camera), of the "
        "photo's size: OpenEXR, or PNG of (n + 1) / 2; for several photos, a folder as for --mask. "
        "The light is then written as DIR/NAME-environment.exr",
    )
    speed = out.add_argument_group("speed")
    speed.add_argument(
        "--engine",
        choices=model_folder.ENGINES,
        default=model_folder.ENGINES[0],
        help="what runs the networks: ONNX Runtime, which runs a RUN's graphs, or Keras (default: "
        "onnx)",
    )
    model_option.add_precision(speed)
    return out


def _add_input(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "sources",
        nargs="+",
        metavar="PHOTO",
        help="picture, video, camera, or folder of pictures and videos at any depth",
    )
    group.add_argument(
        "--mask",
        type=Path,
        metavar="FILE",
        help="picture of the photo's size, white where the object is; for several photos, a folder "
        "with one of the same name for each. NAME_mask.png beside a photo, or its transparency, "
        "also counts as its mask",
    )
    group.add_argument(
        "--masker",
        type=_masker,
        metavar="[FAMILY:]FILE",
        help="ONNX file of another network that finds the object, and its family: "
        f"{', '.join(_FAMILIES)} (default: {_FAMILIES[0]}); nothing is downloaded",
    )


def _add_estimated(estimated: argparse._ArgumentGroup) -> None:
    model_option.add(estimated, model_folder.FOR_PHOTOS)
    estimated.add_argument(
        "--only",
        type=console.names(tuple(NEEDED)),
        metavar="NAMES",
        help=f"comma-separated: {', '.join(NEEDED)}; only the subnetworks that these need are run "
        "(default: all)",
    )
    estimated.add_argument(
        "--full-size",
        action="store_true",
        help="let the edges of mask and layers follow those of the photo; by default the "
        "networks' own pixels are interpolated",
    )


def _add_output(output: argparse._ArgumentGroup) -> None:
    output.add_argument(
        "--out",
        type=Path,
        default=Path("materials"),
        metavar="DIR",
        help="folder of the results (default: materials)",
    )
    output.add_argument(
        "--json",
        action="store_true",
        help="print one line of JSON for each photo at a terminal, too; a pipe always gets it",
    )
    output.add_argument(
        "--folders",
        action="store_true",
        help="give each photo's files a folder of their own, DIR/NAME/",
    )
    output.add_argument(
        "--overwrite",
        action="store_true",
        help="replace results of other photos, weights or options; without it, the command refuses "
        "to begin",
    )


def main(argv: list[str] | None = None) -> int:
    """Estimate the materials in photos and videos and return the exit status."""
    options = parser().parse_args(argv)
    return console.run(lambda: run(options), INTERRUPTED)


def run(
    options: argparse.Namespace,
    clone_options: Mapping[str, object] | None = None,
    make_clone: "Callable[[], Clone] | None" = None,
) -> int:
    """Estimate what the options name, and return the exit status.

    Args:
        options: options of `parser`.
        clone_options: options that change a clone, by name, for the results' provenance.
        make_clone: function that returns the renderer of clones; called once the options are
            checked. None to render none.
    """
    missing = [text for text in options.sources if not (is_camera(text) or os.path.exists(text))]
    for text in missing:
        print(f"error: {text} does not exist: check its name", file=sys.stderr)
    there = [text for text in options.sources if text not in missing]
    for text in there:
        if not is_camera(text) and os.path.isdir(text) and not any(inside(Path(text))):
            missing.append(text)
            ends = ", ".join(SUFFIXES)
            print(f"error: {text} has no pictures: their names end in {ends}", file=sys.stderr)
    sources = _sorted(there)
    if not sources:
        return 1
    _check(options, sources, clones=make_clone is not None)
    if not (options.normals or make_clone):
        # Threads that wait for the next small product by spinning would take the processor from
        # the networks and the writers; the products of a light or a clone are large.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Mitsuba must be imported before TensorFlow, or the process crashes.
    clone = make_clone() if make_clone else None
    from lime_keras.io import atomic, locking

    with contextlib.ExitStack() as locked:
        with atomic.naming_writer(options.out):
            locked.enter_context(locking.lock_folder(options.out, "lime-estimate is writing into"))
        results = _results(options, clone_options or {})
        failed = _write(options, results, clone, sources, len(missing))
    return 1 if failed else 0


def _write(
    options: argparse.Namespace,
    results: "Results",
    clone: "Clone | None",
    sources: list[_Source],
    missing: int,
) -> int:
    """Write all results, and return how many sources, with the missing ones, have none."""
    from lime_keras.estimate import gallery
    from lime_keras.estimate.batch import Batch
    from lime_keras.estimate.terminal import Printer

    # Print the results that are there already; refuse to begin if another is in the way.
    gallery.check(options.out)
    named = _named(sources, results, folders=options.folders)
    printer = Printer(for_people=sys.stdout.isatty() and not options.json)
    batch = Batch(results, printer, masks=options.mask, normals=options.normals, clone=clone)
    batch.check_names([Path(source.text) for source in sources if not source.is_video])
    provenances = {
        name: functools.partial(results.provenance, source.file, {})
        if source.is_video
        else functools.partial(batch.provenance, Path(source.text))
        for name, source in named.items()
    }
    existing = results.existing(provenances)
    for name, content in existing.items():
        printer.show(content, results.json(name).parent)

    # Estimate the others.
    left = {name: source for name, source in named.items() if name not in existing}
    photos = {name: Path(source.text) for name, source in left.items() if not source.is_video}
    videos = {name: source.text for name, source in left.items() if source.is_video}
    of_videos: dict[str, dict[str, Any]] = {}
    try:
        if photos:
            batch.run(_estimator(options, options.only), photos)
        if videos:
            estimator = _estimator(options, options.only or OF_A_FRAME)
            for name, video in videos.items():
                if summary := _estimate_video(
                    estimator, video, results, name, provenances[name], printer
                ):
                    of_videos[name] = summary
    finally:
        finished = existing | batch.finished | of_videos
        if finished:
            gallery.update(options.out, finished)
            print(f"all results: {options.out / gallery.PAGE}", file=sys.stderr)

    # Count.
    failed = missing + len(named) - len(finished)
    empty = sum(not one.get("found", one.get("mask_coverage")) for one in finished.values())
    there = f"{len(existing)} there already, " if existing else ""
    timing = f"; {batch.timing()}" if batch.finished else ""
    print(
        f"{len(finished) - len(existing)} done, {there}{failed} failed, {empty} without an object, "
        f"in {options.out}{timing}",
        file=sys.stderr,
    )
    return failed + empty


def _named(sources: list[_Source], results: "Results", *, folders: bool) -> dict[str, _Source]:
    """Return the sources by the names of their results, each of which may get a folder."""
    from lime_keras.estimate.files import distinct_names

    places = [source.place for source in sources]
    names = distinct_names(places)
    if folders:
        names = [f"{name}/{Path(name).name}" for name in names]
    names = results.keep_names(names, [source.file for source in sources], places)
    return dict(zip(names, sources, strict=True))


def _results(options: argparse.Namespace, clone_options: Mapping[str, object]) -> "Results":
    """Return the results in the output folder, with what this run makes them with."""
    from lime_keras.estimate.results import Results, digest
    from lime_keras.model import gloss_file

    masker = options.masker
    changing: dict[str, object] = {
        "only": options.only and sorted(options.only),
        "full-size": options.full_size,
        "masker": masker and f"{masker[0]}:{digest(masker[1])}",
        "engine": options.engine if options.engine != model_folder.ENGINES[0] else None,
        "precision": options.precision if options.precision != "float32" else None,
        **clone_options,
    }
    beside = (
        model_folder.folder(options.weights) / gloss_file.NAME,
        model_folder.graphs(options.weights, options.precision) / model_folder.DESCRIPTION,
    )
    parts = (
        model_folder.digest(options.weights),
        *(digest(path) for path in beside if path.is_file()),
    )
    weights = hashlib.sha256("".join(parts).encode()).hexdigest()
    return Results(options.out, weights, changing, overwrite=options.overwrite)


def _check(options: argparse.Namespace, sources: list[_Source], *, clones: bool) -> None:
    """Raise an error if options cannot be carried out, before anything is loaded."""
    photos = [source.text for source in sources if not source.is_video]
    videos = [source.text for source in sources if source.is_video]
    # Folders and files.
    console.check_folder(options.out, "--out")
    for option, path in (("--mask", options.mask), ("--normals", options.normals)):
        if path and videos:
            raise ValueError(f"{option} is for photos, and {videos[0]} is a video: leave one out")
        if path and not path.exists():
            raise ValueError(f"{path} does not exist: check what is passed to {option}")
        if path and not path.is_dir() and len(photos) > 1:
            raise ValueError(
                f"{option} {path} is one file for {len(photos)} photos: pass a folder that holds "
                "one of the same name for each"
            )
    if options.mask and options.masker:
        raise ValueError("--mask and --masker both say where the object is: leave one out")
    if options.masker and not options.masker[1].is_file():
        raise ValueError(
            f"{options.masker[1]} is no file: pass an ONNX file to --masker; none is downloaded"
        )
    # Options that exclude each other.
    if options.only and videos and not set(options.only) & set(OF_A_FRAME):
        raise ValueError(
            f"a video leaves no layers, so --only {','.join(options.only)} leaves nothing of "
            f"{videos[0]}: choose from {', '.join(OF_A_FRAME)}"
        )
    if clones and videos:
        raise ValueError(
            f"--clone-onto is for photos, and {videos[0]} is a video, whose light and outline "
            "would flicker from frame to frame: pass a frame of it as a photo"
        )
    if options.only and (options.normals or clones):
        raise ValueError("--normals and --clone-onto take the whole estimate: leave out --only")
    # What options need.
    model_folder.files(options.weights)


def _estimator(options: argparse.Namespace, only: tuple[str, ...] | None) -> "Estimator":
    from lime_keras.estimate.estimator import Estimator

    masker = None
    if options.masker:
        from lime_keras.runtime.masker import Masker

        family, file = options.masker
        masker = Masker(file, family)
    return Estimator(
        options.weights,
        only,
        options.engine,
        masker,
        full_size=options.full_size,
        precision=options.precision,
    )


def _masker(text: str) -> tuple[str, Path]:
    """Return the family and the path in `FAMILY:FILE`, or in `FILE` alone."""
    family, _, file = text.partition(":")
    return (family, Path(file)) if family in _FAMILIES and file else (_FAMILIES[0], Path(text))


def _estimate_video(
    estimator: "Estimator",
    source: str,
    results: "Results",
    name: str,
    provenance: Callable[[], dict[str, Any]],
    printer: "Printer",
) -> dict[str, Any] | None:
    """Estimate a video and print its material; return the content of its JSON, None if it fails."""
    from lime_keras.estimate import interchange
    from lime_keras.io.video_reader import Footage
    from lime_keras.video.estimate_video import estimate_video

    target = results.json(name)
    ends = (*_VIDEO_ENDS, *(f"-scene-*{end}" for end in _SCENE_ENDS))
    try:
        made_with = provenance()
        if target.exists():  # an earlier result makes room for one whose source can be opened
            with Footage(source) as footage:
                next(iter(footage), None)
    except (OSError, ValueError) as error:
        printer.error(str(error))
        return None
    try:
        with results.growing(name, made_with, ends) as draft:
            summary = estimate_video(source, estimator, target.parent, target.stem)
            draft.numbers, draft.files = {"video": source} | summary.to_json(), [*summary.files]
    except ValueError as error:
        printer.error(str(error))
        return None
    remarks = [
        f"scene {scene.number}: {remark}"
        for scene in summary.scenes
        for remark in interchange.remarks(scene.material)
    ]
    for remark in summary.remarks:
        printer.warning(remark)
    printer.result(draft.numbers, target.parent, remarks)
    print(
        f"{source}: {summary.frames} frames, an object in {summary.found} of them, "
        f"{summary.cuts} scene cuts; {summary.table}, {summary.overlay}",
        file=sys.stderr,
    )
    return draft.numbers


def _sorted(texts: Iterable[str]) -> list[_Source]:
    """Return the photos, then the videos, among the sources and in the folders among them."""
    sources: dict[str, _Source] = {}
    for text in texts:
        path = Path(text)
        if not is_camera(text) and path.is_dir():
            files = {str(file): file.relative_to(path) for file in inside(path)}
        elif masked := photo_of_mask(path):
            print(f"{path} is the mask of {masked}, not a photo", file=sys.stderr)
            continue
        else:
            # The files of a camera need a valid name; `./a.png` is `a.png`.
            camera = {text: Path(re.sub("[:/]", "-", text))}
            files = camera if is_camera(text) else {str(path): Path(path.name)}
        sources |= {name: _Source(name, place) for name, place in files.items()}
    return sorted(sources.values(), key=lambda source: source.is_video)
