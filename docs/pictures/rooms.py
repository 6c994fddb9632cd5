"""The picture of the rooms in CONTRIBUTING.md, drawn from the imports, as a Mermaid diagram.

    python docs/pictures/rooms.py

A room is a folder of modules; an arrow leads from a room to one that it imports. Arrows that follow
from others are left out, and so are the modules that lie beside the rooms, such as `losses.py`.
"""

import ast
import functools
import importlib.util
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from lime_keras.io import atomic

PAGE = Path(__file__).parents[2] / "CONTRIBUTING.md"
_BLOCK = re.compile(r"(?<=```mermaid\n).*?(?=```)", re.DOTALL)

_PACKAGES = ("lime_keras", "lime_keras.render", "lime_keras.train", "lime_keras.eval")

Arrows = Mapping[str, set[str]]
"""The rooms that each room imports, such as `render/scene`; one of the four folders with a single
folder inside is one room."""


def page() -> str:
    """Return the text of CONTRIBUTING.md with the picture as the imports are now."""
    return _BLOCK.sub(lambda _: diagram(arrows()), PAGE.read_text(encoding="utf-8"), count=1)


def diagram(arrows: Arrows) -> str:
    """Return the Mermaid source of rooms and arrows, in a box for each of the four folders.

    Between boxes only the arrows of the boxes are drawn, and those of rooms that run the renderer.
    """
    inside: dict[str, list[str]] = {}
    for room in arrows:
        inside.setdefault(_box(room), []).append(room)
    lines, across = ["graph LR"], set()
    for box, rooms in inside.items():
        nodes = [f"    {_id(room)}([{room.partition('/')[2]}])" for room in rooms if room != box]
        lines += [f"  subgraph {box}", *nodes, "  end"] if nodes else [f"  {box}"]
    for room, others in reduced(arrows).items():
        for other in sorted(others):
            if _box(room) == _box(other):
                lines.append(f"  {_id(room)} --> {_id(other)}")
            else:
                across.add((_id(room if _box(room) == "lime_keras" else _box(room)), _box(other)))
    return "\n".join([*lines, *(f"  {one} --> {other}" for one, other in sorted(across)), ""])


def arrows() -> Arrows:
    """Return the rooms with what they import, in alphabetical order."""
    folders = folders_of_packages()
    found: dict[str, set[str]] = {}
    for package, folder in folders.items():
        for path in folder.rglob("*.py"):
            names = path.relative_to(folder).with_suffix("").parts
            module = ".".join([package, *names]).removesuffix(".__init__")
            room = _room(module, folders)
            if room is not None:
                named = {_room(name, folders) for name in imports(module, path, folders)}
                found.setdefault(room, set()).update(one for one in named if one is not None)
    return {room: found[room] - {room} for room in sorted(found)}


def reduced(arrows: Arrows) -> Arrows:
    """Return the arrows without those that follow from others; no arrows may go in a circle."""

    def reached(room: str) -> set[str]:
        return arrows[room].union(*map(reached, arrows[room]))

    return {
        room: {one for one in others if not any(one in reached(other) for other in others)}
        for room, others in arrows.items()
    }


def _room(module: str, folders: Mapping[str, Path]) -> str | None:
    """Return the room that a module lies in; None beside the rooms or outside the packages."""
    owners = [name for name in folders if f"{module}.".startswith(f"{name}.")]
    if not owners:
        return None
    owner = max(owners, key=len)
    folder, box = folders[owner], owner.rpartition(".")[2]
    if len(list(folder.glob("*/__init__.py"))) < 2:
        return box
    first = module.removeprefix(owner).strip(".").partition(".")[0]
    return f"{box}/{first}" if first and (folder / first).is_dir() else None


def _box(room: str) -> str:
    return room.partition("/")[0]


def _id(room: str) -> str:
    return room.replace("/", "_")


def imports(module: str, path: Path, folders: Mapping[str, Path]) -> Iterator[str]:
    """Yield the dotted names of the modules that a file imports."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            named = f"{'.' * node.level}{node.module or ''}"
            origin = importlib.util.resolve_name(named, package)
            for alias in node.names:
                inside = f"{origin}.{alias.name}"
                yield inside if _file(inside, folders) else origin


def _file(module: str, folders: Mapping[str, Path]) -> Path | None:
    """Return the file of a module, or None if these packages have no such module."""
    owners = [name for name in folders if module == name or module.startswith(f"{name}.")]
    if not owners:
        return None
    owner = max(owners, key=len)
    path = folders[owner].joinpath(*module.removeprefix(owner).strip(".").split("."))
    places = (path / "__init__.py", path.with_name(f"{path.name}.py"))
    return next((place for place in places if place.is_file()), None)


@functools.cache
def folders_of_packages() -> dict[str, Path]:
    """Return the folders of the library, the renderer, training and evaluation, by dotted name."""
    specs = {name: importlib.util.find_spec(name) for name in _PACKAGES}
    return {
        name: Path(place)
        for name, spec in specs.items()
        if spec
        for place in spec.submodule_search_locations or ()
    }


if __name__ == "__main__":
    atomic.write(PAGE, page())
