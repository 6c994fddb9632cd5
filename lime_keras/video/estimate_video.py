"""The material of a video: estimated in each frame alone, and fused over time (section 5.5).

Example:
    from lime_keras import estimate_video

    summary = estimate_video("turntable.mp4", folder="materials")
    print(summary.material, summary.table, summary.overlay)
"""

import csv
import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from lime_keras import console
from lime_keras.estimate.cautions import NO_OBJECT
from lime_keras.estimate.estimator import Estimator
from lime_keras.io import atomic
from lime_keras.io.scanner import is_camera
from lime_keras.io.video_reader import Footage, Frame
from lime_keras.io.video_writer import Movie
from lime_keras.material import Material
from lime_keras.outputs import OF_A_FRAME
from lime_keras.video import scenes
from lime_keras.video.overlay import draw
from lime_keras.video.scenes import Scene, Scenes
from lime_keras.video.tracking import PARAMETERS, Step, Tracker, material_of

COLUMNS = (
    *("frame", "time", "found", "cut", "coverage"),
    *PARAMETERS,
    *(f"fused_{name}" for name in PARAMETERS),
    *("mask_confidence", "warnings"),
)
"""Columns of the table that `estimate_video` writes; warnings are codes with a space between."""


@dataclass(frozen=True)
class Summary:
    """The result of estimating a video.

    Attributes:
        frames: number of frames read.
        found: number of frames with an object.
        cuts: number of scene cuts.
        seconds: time from the first frame to the last, in seconds.
        material: fused material at the end of the last scene with an object, without layers, with
            the warnings of that scene (`video.scenes`); every number is None if no frame
            had an object.
        remarks: messages for the user about the source (see `video_reader.Footage`).
        table: path of the CSV file.
        overlay: path of the video with outline and panel.
        scenes: the scenes that have an object.
        files: names of all files that were written.
    """

    frames: int
    found: int
    cuts: int
    seconds: float
    material: Material
    remarks: tuple[str, ...]
    table: Path
    overlay: Path
    scenes: tuple[Scene, ...]
    files: tuple[str, ...]

    def to_json(self) -> dict[str, object]:
        """Return counts, the last fused material and all scenes, ready for `json.dumps`."""
        counts = {"frames": self.frames, "found": self.found, "seconds": round(self.seconds, 6)}
        listed = {"scenes": [scene.to_json() for scene in self.scenes]}
        return counts | self.material.to_json() | listed


def estimate_video(
    source: str | Path,
    estimator: Estimator | None = None,
    folder: str | Path = "materials",
    name: str | None = None,
) -> Summary:
    """Estimate every frame of a video, and write its table and overlay frame by frame.

    At the end the fused material of each scene is written, too (`scenes.write`).

    Progress goes to standard error. Ctrl-C leaves both files valid. With a camera, Ctrl-C ends the
    video in the usual way; with a file, KeyboardInterrupt is raised again.

    Args:
        source: path of a video file, or name of a camera (see `video_reader.Footage`).
        estimator: estimator of single frames; by default that of the weights for photos.
        folder: folder for `NAME.csv`, `NAME-overlay.mp4` and the materials; made if it is missing.
            Files of these names are replaced.
        name: NAME of the files; by default that of the video.

    Returns:
        Counts, fused material and paths of the files.

    Raises:
        ValueError: if the source cannot be opened or holds no picture; nothing is written then.
        OSError: if a file cannot be written.
    """
    source, folder = str(source), Path(folder)
    name = name or ("camera" if is_camera(source) else Path(source).stem)
    with Footage(source) as footage:
        pictures = iter(footage)
        first = next(pictures, None)
        if first is None:
            reason = "; ".join([f"{source} holds no frame that can be decoded", *footage.remarks])
            raise ValueError(f"{reason}: export it anew, as MP4 say")
        shown = tqdm(
            itertools.chain([first], pictures),
            total=footage.expected,
            unit="frame",
            **console.bar_options(),
        )
        folder.mkdir(parents=True, exist_ok=True)
        table, overlay = folder / f"{name}.csv", folder / f"{name}-overlay.mp4"
        followed = Scenes()
        try:
            _follow(shown, estimator or Estimator(only=OF_A_FRAME), table, overlay, followed)
        except KeyboardInterrupt:
            if not is_camera(source):
                raise
        with_objects = followed.with_objects()
        found = sum(scene.found for scene in followed.every)
        return Summary(
            frames=sum(scene.frames for scene in followed.every),
            found=found,
            cuts=sum(scene.is_cut for scene in followed.every),
            seconds=followed.every[-1].end,
            material=_last(with_objects, found),
            remarks=tuple(footage.remarks),
            table=table,
            overlay=overlay,
            scenes=tuple(with_objects),
            files=(table.name, overlay.name, *scenes.write(folder, name, with_objects)),
        )


def _follow(
    frames: Iterable[Frame], estimator: Estimator, table: Path, overlay: Path, followed: Scenes
) -> None:
    """Estimate and fuse each frame, and write its row and picture."""
    tracker = Tracker()
    with (
        atomic.naming_writer(table),
        table.open("w", newline="", buffering=1, encoding="utf-8") as file,
        Movie(overlay) as video,
    ):
        rows = csv.writer(file)  # line by line, so that the table can be read while it grows
        rows.writerow(COLUMNS)
        for number, frame in enumerate(frames):
            material = estimator.estimate(frame.image_srgb / np.float32(255))
            step = tracker.step(frame.image_srgb, material)
            rows.writerow(_row(number, frame.time, material, step))
            status = "new scene" if step.cut else "" if step.found else "no object"
            shown = material if step.found else Material(layers=material.layers)
            fused = material_of(step.fused, material.gloss_calibration)
            video.write(draw(frame.image_srgb, frame.time, status, shown, fused), frame.time)
            followed.add(frame, material, step)


def _last(with_objects: list[Scene], found: int) -> Material:
    """Return the fused material of the last scene, without what belongs to one of its frames."""
    if not with_objects:
        return Material(warnings=() if found else (NO_OBJECT,))
    return replace(with_objects[-1].material, mask_coverage=None, square=None, layers={})


def _row(number: int, seconds: float, material: Material, step: Step) -> Iterator[str]:
    """Yield the cells of one row of the table; a cell is empty if its value is unknown."""
    yield from (str(number), f"{seconds:.6f}", str(int(step.found)), str(int(step.cut)))
    yield f"{material.mask_coverage or 0:.6g}"
    for values in (step.estimate, step.fused):
        linear = [*values[:4], 10.0 ** values[4]]
        yield from ("" if math.isnan(value) else f"{value:.6g}" for value in linear)
    yield "" if material.mask_confidence is None else f"{material.mask_confidence:.6g}"
    yield " ".join(caution.code for caution in material.warnings)
