"""All pictures and clips of README and docs that the shipped weights make: `make pictures`.

python docs/pictures --help

Run it after a change of the weights, and look at each picture. The pictures that belong to a
measurement (`pareto.png`, `quality.png`, `preview.jpg`, `result.jpg`) are written by its command.
"""

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
DOCS = Path(__file__).parents[1]


def main() -> None:
    """Make the pictures that are asked for."""
    options = _parser().parse_args()
    # They import Mitsuba, which has to come before anything of TensorFlow.
    import dichromatic
    import first_material
    import photographs
    import road
    import scene_model

    pictures = options.out / "pictures"
    for folder in (pictures, options.out / "images"):
        folder.mkdir(parents=True, exist_ok=True)
    photos = _ordered(options.photos)
    makers: dict[str, Callable[[], None]] = {
        "layers": lambda: scene_model.main(pictures),
        "road": lambda: road.main(pictures),
        "dichromatic": lambda: dichromatic.main(EXAMPLES, pictures),
        "first-material": lambda: first_material.main(options.first, pictures),
        "photographs": lambda: photographs.main(photos, options.mesh, pictures),
        "live": lambda: _live(*options.moved, options.out / "images"),
    }
    for name in options.only or makers:
        print(f"{name}:", flush=True)
        makers[name]()


def _ordered(folder: Path) -> list[Path]:
    """Return the photos of a folder, glossy ones first, in the order of its `labels.csv`."""
    photos = sorted(path for path in folder.iterdir() if path.suffix in (".png", ".jpg"))
    labels = folder / "labels.csv"
    lines = labels.read_text(encoding="utf-8").splitlines() if labels.exists() else []
    places = {line.split(",")[0]: place for place, line in enumerate(lines)}
    return sorted(photos, key=lambda photo: places.get(photo.name, len(places)))


def _parser() -> argparse.ArgumentParser:
    out = argparse.ArgumentParser(prog="docs/pictures", description="Make the pictures anew.")
    out.add_argument(
        "--photos",
        type=Path,
        default=EXAMPLES / "photos",
        metavar="DIR",
        help="photos of the README's picture, a row each (default: examples/photos)",
    )
    out.add_argument(
        "--mesh",
        type=Path,
        metavar="FILE",
        help="shape that takes their materials (default: a built-in vase)",
    )
    out.add_argument(
        "--first",
        type=Path,
        default=EXAMPLES / "photos" / "helmet.png",
        metavar="PHOTO",
        help="photo of the first material (default: the helmet)",
    )
    out.add_argument(
        "--moved",
        type=Path,
        nargs=2,
        default=(EXAMPLES / "photos" / "fox.png", EXAMPLES / "masks" / "fox.png"),
        metavar=("PHOTO", "MASK"),
        help="photo of the live page, and its mask (default: the fox)",
    )
    out.add_argument(
        "--only",
        nargs="+",
        choices=("layers", "road", "dichromatic", "first-material", "photographs", "live"),
    )
    out.add_argument(
        "--out",
        type=Path,
        default=DOCS,
        metavar="DIR",
        help="folder whose pictures/ and images/ are written (default: docs)",
    )
    return out


def _live(photo: Path, mask: Path, images: Path) -> None:
    import live_page

    program = Path(sys.executable).with_name("lime-live")
    command = [program, "--no-browser", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            if server.stdout is None or not (said := server.stdout.readline()):
                raise SystemExit("lime-live did not start")
            live_page.main(said.split()[0], photo, mask, images)
        finally:
            server.terminate()


if __name__ == "__main__":
    main()
