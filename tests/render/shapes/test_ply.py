"""PLY files: polygons of any sizes, in any order of bytes, are the shape that they show."""

import struct

import numpy as np
import pytest

from lime_keras.render.shapes import ply

# A notched roof: a pentagon whose corner 3 is pushed in, a quadrangle and a triangle.
PLACES = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0], [0, 0, 2], [4, 0, 2]])
POLYGONS = [[0, 1, 2, 3, 4], [0, 5, 6, 1], [0, 4, 5], [1, 0, 6, 5]]
AREAS = [10, 8, 4, 8]


def write(order, count="uchar", index="int", polygons=POLYGONS, newline="\n"):
    """The bytes of a file in an order, `<`, `>` or text, with lists between its elements."""
    name = {"<": "binary_little_endian", ">": "binary_big_endian", "text": "ascii"}[order]
    head = f"""ply
format {name} 1.0
comment element face 99
element vertex {len(PLACES)}
property double x
property double y
property double z
element camera 2
property list uchar float numbers
property short kind
element face {len(polygons)}
property uchar flags
property list {count} {index} vertex_indices
end_header
"""
    rows = [("ddd", place) for place in PLACES.tolist()]
    rows += [("B2fh", (2, 0.5, 1.5, 7)), ("Bh", (0, 7))]
    letters = {"uchar": "B", "char": "b", "ushort": "H", "int": "i", "uint": "I", "double": "d"}
    for polygon in polygons:
        corners = f"{len(polygon)}{letters[index]}"
        rows.append((f"B{letters[count]}{corners}", (1, len(polygon), *polygon)))
    content = head.replace("\n", newline).encode()
    if order == "text":
        return content + "".join(f"{' '.join(map(str, row))}\n" for _, row in rows).encode()
    return content + b"".join(struct.pack(order + kind, *row) for kind, row in rows)


def area(vertices, faces):
    a, b, c = vertices[faces].swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize("order", ["<", ">", "text"])
@pytest.mark.parametrize(
    ("count", "index", "newline"),
    [("uchar", "int", "\n"), ("ushort", "uint", "\r\n"), ("char", "uchar", "\n")],
)
def test_polygons_of_all_sizes_are_cut_where_they_are(order, count, index, newline):
    """A fan would cover the notch of the pentagon, and so more than its area."""
    content = write(order, count, index, newline=newline)
    vertices, faces, normals = ply.read(content)
    np.testing.assert_array_equal(vertices[1:], PLACES)
    assert len(faces) == 3 + 2 + 1 + 2 and np.isnan(normals).all()
    assert area(vertices, faces) == pytest.approx(sum(AREAS))


def test_rows_of_changing_lengths_keep_their_order():
    polygons = [POLYGONS[k] for k in np.random.default_rng(0).integers(1, 4, 500)]
    _, faces, _ = ply.read(write("<", polygons=polygons))
    assert len(faces) == sum(len(polygon) - 2 for polygon in polygons)
    assert area(PLACES, faces - 1) == pytest.approx(
        sum(AREAS[POLYGONS.index(polygon)] for polygon in polygons)
    )


def test_a_corner_without_a_vertex_is_the_one_that_is_no_place():
    _, faces, _ = ply.read(write("<", polygons=[[0, 1, len(PLACES)], [2, -1, 4], [0, 1, 6]]))
    np.testing.assert_array_equal(faces, [[1, 2, 0], [3, 0, 5], [1, 2, 7]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda content: content[:-3], "cut short"),
        (lambda content: content.replace(b"face 4", b"face 5"), "cut short"),
        (lambda content: content.replace(b"little", b"middle"), "no format of PLY"),
        (
            lambda content: (
                content.replace(b"list uchar int", b"list char int")[:-17] + 17 * b"\xff"
            ),
            "less",
        ),
    ],
)
def test_damaged_files_are_told(change, words):
    with pytest.raises(ValueError, match=words):
        ply.read(change(write("<")))
