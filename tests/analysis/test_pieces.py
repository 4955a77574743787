"""Pieces of frames: large ones, each with the bits near it; what is one piece in any frame is one body in all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.analysis.survey import Piece, bodies_of, piece_of_faces, pieces_of
from meshreel.format.checks import MOST_TRACKS
from meshreel.geometry.topology import concatenate, part_of
from meshreel.types import Mesh
from tests.metrics.shapes import moved, sphere

BALL = sphere(levels=3)  # 258 vertices, 512 faces
COARSE = sphere(levels=2)
SMALL = moved(BALL, scale=0.2)


def at(x: float, y: float = 0.0, z: float = 0.0, mesh: Mesh = BALL) -> Mesh:
    return moved(mesh, (x, y, z))


def bodies(*frames: list[Mesh]) -> list[list[int]] | None:
    """The body of each mesh, in each frame."""
    found = bodies_of([pieces_of(concatenate(meshes)) for meshes in frames])
    return None if found is None else [some.tolist() for some in found]


@pytest.mark.parametrize("mesh", [Mesh.empty(), BALL, concatenate([BALL, at(3, mesh=COARSE), at(5, mesh=SMALL)])])
def test_a_frame_that_is_one_piece_and_bits_has_no_pieces(mesh):
    """A coarse ball has too few faces for a track of its own, a small one too little area."""
    assert pieces_of(mesh) == () and not piece_of_faces(mesh).any()


def test_a_piece_tells_its_box_with_and_without_its_bits():
    near, bit = at(1.0), at(10.0, 3.0, mesh=SMALL)
    first, second = pieces_of(concatenate([near, bit, at(8.0)]))
    assert first.box == first.around == (0, -1, -1, 2, 1, 1) and first.vertices == 258
    assert second.box == (7, -1, -1, 9, 1, 1) and second.vertices == 516
    assert second.around == pytest.approx((7, -1, -1, 10.2, 3.2, 1))


def test_of_boxes_as_near_the_bit_goes_with_the_nearer_middle():
    inside = at(1.1, mesh=moved(SMALL, scale=0.2))
    assert piece_of_faces(concatenate([at(0), at(1.5), inside]))[-1] == 1
    assert piece_of_faces(concatenate([at(1.5), at(0), inside]))[-1] == 0


@given(st.permutations(range(5)))
def test_the_order_of_faces_changes_the_numbers_of_pieces_and_nothing_else(order):
    meshes = [at(0), at(4), at(9), at(1, 2, mesh=SMALL), at(9, 3, mesh=COARSE)]
    wanted = {0: 0, 1: 4, 2: 9, 3: 0, 4: 9}  # the place of the piece that each is in
    mixed = concatenate([meshes[k] for k in order])
    piece, pieces = piece_of_faces(mixed), pieces_of(mixed)
    owner = np.repeat(order, [len(meshes[k].faces) for k in order])
    for k, x in wanted.items():
        assert {pieces[number].box[0] + 1 for number in piece[owner == k]} == {x}
    parts = [part_of(mixed, piece == number) for number in range(len(pieces))]
    assert [len(part.vertices) for part in parts] == [one.vertices for one in pieces]
    assert [(*part.vertices.min(axis=0), *part.vertices.max(axis=0)) for part in parts] == [p.around for p in pieces]


def test_rings_of_a_chain_are_bodies():
    """Their boxes overlap, their surfaces share no vertex."""
    frames = [
        [ring(turn), moved(Mesh(ring(turn).vertices[:, [0, 2, 1]], ring(turn).faces), (1, 0, 0))] for turn in range(3)
    ]
    assert bodies(*frames) == [[0, 1]] * 3


def ring(turn: float) -> Mesh:
    """A ring about the z axis, of radius 1, turned about it."""
    u, v = np.meshgrid(np.arange(40), np.arange(12), indexing="ij")
    along, around = 2 * np.pi * u / 40 + 0.1 * turn, 2 * np.pi * v / 12
    radius = 1 + 0.2 * np.cos(around)
    points = np.stack([radius * np.cos(along), radius * np.sin(along), 0.2 * np.sin(around)], axis=2)
    here, right, above = 12 * u + v, 12 * ((u + 1) % 40) + v, 12 * u + (v + 1) % 12
    beyond = 12 * ((u + 1) % 40) + (v + 1) % 12
    faces = [np.stack(corners, axis=2).reshape(-1, 3) for corners in ((here, right, beyond), (here, beyond, above))]
    return Mesh.of(points, np.concatenate(faces))


def test_what_comes_or_goes_is_one_body_with_what_is_most_like_it():
    assert bodies([at(0), at(9)], [at(0), at(9), at(6)], [at(0), at(9)]) == [[0, 1], [0, 1, 1], [0, 1]]
    assert bodies([at(0), at(9), at(6)], [at(0)], [at(0), at(9)]) is None


def test_a_frame_without_neighbours_has_a_body_for_each_piece():
    assert bodies([at(0), at(3), at(6)]) == [[0, 1, 2]] and bodies_of([]) is None


def test_more_bodies_than_a_file_has_tracks_are_one():
    many = [Piece((k, 0, 0, k + 0.5, 1, 1), (k, 0, 0, k + 0.5, 1, 1), 9) for k in range(MOST_TRACKS + 1)]
    assert bodies_of([tuple(many)]) is None
    assert bodies_of([tuple(many[1:])])[0].tolist() == list(range(MOST_TRACKS))
