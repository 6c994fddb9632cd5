"""OBJ files as programs and people write them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lime_keras.render.shapes import obj

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def corners(text):
    """Positions of the triangles' corners, `(F, 3, 3)`."""
    vertices, faces, _ = obj.read(text.encode() if isinstance(text, str) else text)
    assert np.isnan(vertices[0]).all()
    return vertices[faces]


def area_vectors(triangles):
    a, b, c = triangles.swapaxes(0, 1)
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 3\nf 1 3 4\n",
        SQUARE + "f 1 2 3 4\n",
        SQUARE + "f 1/1 2/1 3/1 4/1\n",
        SQUARE + "f 1//1 2//1 3//1 4//1\nvn 0 0 1\n",
        SQUARE + "vn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1 4/1/1\n",
        SQUARE + "f -4 -3 -2 -1\n",
        SQUARE + "f 1 2 \\\n 3 4\n",
        SQUARE + "f 1 2 3 4 # all of it\n",
        SQUARE.replace("\n", "\r\n") + "f 1 2 3 4\r\n",
        SQUARE.replace("\n", "\r") + "f 1 2 3 4\r",
        SQUARE.replace(" ", "\t") + "f\t1\t2\t3\t4",
        SQUARE.replace(" 0\n", " 0 0.5 0.5 0.5\n") + "f 1 2 3 4\n",
        "mtllib lost.mtl\no one\n" + SQUARE + "g left\nusemtl a\nf 1 2 3\ng right\ns 1\nf 1 3 4\n",
        SQUARE + "l 1 3\np 2\nf 1 2\nf 1 2 3 4\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\no next\nv 0 1 0\nf 1 3 -1\n",
        "f 1 2 3 4\n" + SQUARE,
        b"\xef\xbb\xbf" + (SQUARE + "f 1 2 3 4\n").encode(),
        b"# caf\xe9\no \xc5\x85\n" + (SQUARE + "f 1 2 3 4\n").encode(),
    ],
)
def test_a_square_is_a_square_however_it_is_written(text):
    triangles = corners(text)
    assert len(triangles) == 2
    np.testing.assert_allclose(area_vectors(triangles), [[0, 0, 0.5]] * 2)


def test_indices_below_zero_count_from_where_they_stand():
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n"
    np.testing.assert_allclose(corners(text)[:, 0], [[0, 0, 0], [5, 0, 0]])


def test_normals_belong_to_corners():
    text = SQUARE + "vn 0 0 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1//2 3//-1 4//2\nf 1 2 4\n"
    vertices, faces, normals = obj.read(text.encode())
    np.testing.assert_array_equal(normals[faces[0]], [[0, 0, 1]] * 3)
    np.testing.assert_array_equal(normals[faces[1]], [[1, 0, 0]] * 3)
    assert np.isnan(normals[faces[2]]).all()
    np.testing.assert_array_equal(vertices[faces[0, 0]], vertices[faces[1, 0]])


@pytest.mark.parametrize("index", ["9", "-9", "0"])
def test_corners_that_are_not_there_are_nowhere(index):
    vertices, faces, _ = obj.read(f"{SQUARE}f 1 2 {index}\nf 1 2 3\n".encode())
    assert np.isnan(vertices[faces]).any((1, 2)).tolist() == [True, False]


@pytest.mark.parametrize("text", ["", "# nothing\n", SQUARE, "v 0 0 0\nl 1 1\n"])
def test_a_file_without_polygons_gives_none(text):
    assert corners(text).shape == (0, 3, 3)


@pytest.mark.parametrize("line", ["v 1,5 0 0", "v 1 2", "vn up", "f a b c", "v 1.#QNAN 0 0"])
def test_a_line_that_cannot_be_read_is_told(line):
    with pytest.raises(ValueError, match=line.split("#")[0].replace(".", r"\.")):
        obj.read(f"{SQUARE}{line}\n".encode())


@settings(max_examples=60)
@given(st.integers(4, 24), st.integers(0, 2**32 - 1))
def test_any_simple_polygon_keeps_its_area(count, seed):
    """Star-shaped around its middle, so simple, but seldom convex; somewhere in space."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.9, count)) / count
    flat = rng.uniform(0.05, 1, (count, 1)) * np.stack([np.cos(turn), np.sin(turn)], 1)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = np.roll(flat, rng.integers(count), axis=0) @ frame[:2] + rng.normal(size=3)
    text = "".join("v {} {} {}\n".format(*point) for point in points)
    triangles = corners(f"{text}f {' '.join(str(k + 1) for k in range(count))}\n")
    assert len(triangles) == count - 2
    areas = area_vectors(triangles) @ np.cross(*frame[:2])
    x, y = flat.T
    shoelace = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert areas.min() > -1e-9
    np.testing.assert_allclose(areas.sum(), shoelace, rtol=1e-6)


def test_many_concave_polygons_of_many_corners_are_cut():
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    radius = np.where(np.arange(2000) % 2, 1.0, 0.3)
    star = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
    text = "".join("v {} {} {}\n".format(*corner) for corner in star)
    text += ("f " + " ".join(str(k + 1) for k in range(2000)) + "\n") * 20
    areas = area_vectors(corners(text))
    expected = 0.3 * np.sin(2 * np.pi / 2000) / 2 * 2000
    assert len(areas) == 20 * 1998 and (areas[:, 2] > -1e-12).all()
    assert areas[:, 2].sum() == pytest.approx(20 * expected)


def test_a_polygon_around_a_hole_leaves_it_open():
    """The outline goes in to the hole and out again by the same edge."""
    square = "v {0} {0} 0\nv {1} {0} 0\nv {1} {1} 0\nv {0} {1} 0\n"
    text = square.format(0, 4) + square.format(1, 3) + "f 1 2 3 4 1 5 8 7 6 5\n"
    areas = area_vectors(corners(text))[:, 2]
    assert areas.min() >= 0 and areas.sum() == pytest.approx(12)


def test_a_polygon_that_crosses_itself_is_cut_into_something():
    assert len(corners("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nv 0.5 2 0\nf 1 2 3 4 5\n")) == 3
