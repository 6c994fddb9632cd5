"""Reading of PLY files: polygons of any sizes as triangles, with the file's own normals."""

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from . import obj

_LINE = re.compile(rb"^\s*(?:element\s+(\w+)\s+(\d+)|property\s+(.*\w))\s*$", re.MULTILINE)
_FORMAT = re.compile(rb"^\s*format\s+(\w+)", re.MULTILINE)
_ORDERS = {b"ascii": "<", b"binary_little_endian": "<", b"binary_big_endian": ">"}
_TYPES = {
    **{b"char": "i1", b"uchar": "u1", b"short": "i2", b"ushort": "u2", b"int": "i4"},
    **{b"uint": "u4", b"float": "f4", b"double": "f8", b"int8": "i1", b"uint8": "u1"},
    **{b"int16": "i2", b"uint16": "u2", b"int32": "i4", b"uint32": "u4"},
    **{b"float32": "f4", b"float64": "f8"},
}
_CORNERS = ("vertex_indices", "vertex_index")

Property = tuple[str, np.dtype | None, np.dtype]
"""Name of a property, type of its length if it is a list, and type of its values."""


def read(data: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read all polygons of a file as triangles; polygons need not be convex.

    Returns:
        Vertices, triangles and normals, as `obj.read` returns them.

    Raises:
        ValueError: if the file is cut short or damaged.
    """
    head, _, body = data.partition(b"end_header")
    head, body = head.replace(b"\r", b"\n"), body.removeprefix(b"\r").removeprefix(b"\n")
    match = _FORMAT.search(head)
    if match is None or match[1] not in _ORDERS:
        raise ValueError("it names no format of PLY")
    kinds = {name: np.dtype(_ORDERS[match[1]] + kind) for name, kind in _TYPES.items()}
    if match[1] == b"ascii":
        kinds = dict.fromkeys(kinds, np.dtype("<f8"))
        body = np.fromiter(map(float, body.split()), "<f8").tobytes()
    places, normals, polygons = np.full((1, 3), np.nan), np.full((1, 3), np.nan), []
    start = 0
    for name, count, properties in _elements(head, kinds):
        for rows in _rows(body, start, count, properties):
            start += rows.nbytes
            names = rows.dtype.names or ()
            if name == b"vertex":
                places = np.concatenate([places, _columns(rows, ("x", "y", "z"))])
                given = {"nx", "ny", "nz"} <= set(names)
                own = (
                    _columns(rows, ("nx", "ny", "nz")) if given else np.full((len(rows), 3), np.nan)
                )
                normals = np.concatenate([normals, own])
            elif name == b"face":
                polygons += [rows[corners].astype(int) for corners in _CORNERS if corners in names]
    triangles = [np.zeros((0, 3), int)]
    for outlines in polygons:
        if outlines.shape[1] >= 3:
            is_there = (outlines >= 0) & (outlines < len(places) - 1)
            outlines = np.where(is_there, outlines + 1, 0)
            triangles.append(obj.triangles(outlines[..., None], places)[..., 0])
    return places, np.concatenate(triangles), normals


def _columns(rows: np.ndarray, names: Sequence[str]) -> np.ndarray:
    return np.stack([rows[name].astype(float) for name in names], -1)


def _elements(
    head: bytes, kinds: Mapping[bytes, np.dtype]
) -> list[tuple[bytes, int, list[Property]]]:
    """Return name, number of rows and properties of each element that a head announces."""
    out: list[tuple[bytes, int, list[Property]]] = []
    for name, count, rest in _LINE.findall(head):
        if name:
            out.append((name, int(count), []))
        elif out:
            *types, own = rest.removeprefix(b"list").split()
            length = kinds[types[0]] if len(types) == 2 else None
            out[-1][2].append((own.decode(), length, kinds[types[-1]]))
    return out


def _rows(
    body: bytes, start: int, count: int, properties: Sequence[Property]
) -> Iterator[np.ndarray]:
    """Yield the rows of an element, as many at a time as have lists of the same lengths."""
    most = count
    while count > 0 and properties:
        kind = _row(body, start, properties)
        whole = (len(body) - start) // kind.itemsize
        if not whole:
            raise ValueError("it is cut short")
        rows = np.frombuffer(body, kind, min(most, count, whole), start)
        lengths = [rows[name] for name in kind.names or () if name.endswith("#")]
        alike = np.all([length == length[0] for length in lengths], axis=0)
        rows = rows[: int(np.argmin(alike)) if lengths and not alike.all() else len(rows)]
        yield rows
        start, count, most = start + rows.nbytes, count - len(rows), 2 * len(rows)


def _row(body: bytes, start: int, properties: Sequence[Property]) -> np.dtype:
    """Return the type of the row that begins at a byte; `NAME#` is the length of a list."""
    fields: list[tuple] = []
    for name, length, kind in properties:
        if length is None:
            fields.append((name, kind))
            continue
        place = start + np.dtype(fields).itemsize
        if place + length.itemsize > len(body):
            raise ValueError("it is cut short")
        (size,) = np.frombuffer(body, length, 1, place)
        if size < 0:
            raise ValueError("a list has less than no entries")
        fields += [(f"{name}#", length), (name, kind, (int(size),))]
    return np.dtype(fields)
