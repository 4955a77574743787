"""Colours beside pictures, the bytes of colours and swimming, where the answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from meshreel_bench.codecs.meshreel import MeshreelCodec
from meshreel_bench.measure.color import (
    color_bytes,
    dark_shares,
    near_truth,
    picture_psnrs,
    picture_squares,
    swimming,
)

from meshreel.capture.simulated.simulated_rig import SceneFrame, shade_of
from meshreel.decoder.video import open as open_video
from meshreel.format.layout import ChunkKind
from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.color_views import ColorPicture
from meshreel.types import Mesh, MeshList
from tests.metrics.rendered import render_colors
from tests.spheres import sliding_sphere

BALL = sliding_sphere(1, levels=4)[0]
EYE = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 4], [0, 0, 0, 1]])  # looks at the ball from +z
CAMERA = Camera(120, 100, (110.0, 110.0), (60.0, 50.0), CameraPose.of_camera(EYE))


def painted(grey, mesh=BALL):
    return replace(mesh, colors=np.full(mesh.vertices.shape, grey, np.uint8))


def picture(mesh):
    return ColorPicture(CAMERA, render_colors(mesh, CAMERA))


def test_a_constant_difference_from_a_picture_is_that_of_the_formula():
    found = picture_psnrs([picture_squares(picture(painted(110)), BALL, painted(100), 0)])
    assert found.keys() == {"picture_y_psnr", "picture_moving_y_psnr"}
    assert list(found.values()) == pytest.approx([20 * np.log10(25.5)] * 2)


def test_what_stands_and_what_moves_are_told_apart_by_their_faces():
    right = BALL.vertices[BALL.faces].mean(axis=1)[:, 0] > 0
    order = np.concatenate([np.flatnonzero(right), np.flatnonzero(~right)])
    sorted_ball = Mesh(BALL.vertices, BALL.faces[order])
    colors = np.full(BALL.vertices.shape, 90, np.uint8)
    colors[BALL.vertices[:, 0] > -0.05] = 100  # all that the faces on the right show
    shown = replace(sorted_ball, colors=colors)
    found = picture_psnrs([picture_squares(picture(painted(100)), BALL, shown, int(right.sum()))] * 2)
    assert found["picture_still_y_psnr"] > 100 > found["picture_y_psnr"] > found["picture_moving_y_psnr"]


def test_pixels_that_only_one_frame_covers_do_not_count():
    half = BALL.with_faces(BALL.vertices[BALL.faces].mean(axis=1)[:, 0] > 0)
    squares = picture_squares(picture(painted(100)), half, painted(100), 0)
    assert squares[0, 0] < 1e-6
    assert 0 < squares[0, 1] < 0.5 * picture_squares(picture(BALL), BALL, BALL, 0)[0, 1]
    assert picture_psnrs([]) == {}


def test_dark_vertices_are_counted_at_open_edges_and_elsewhere():
    half = BALL.with_faces(BALL.vertices[BALL.faces].mean(axis=1)[:, 0] > 0)
    colors = np.full(BALL.vertices.shape, 200, np.uint8)
    colors[BALL.vertices[:, 0] < 0.02] = 59
    found = dark_shares(replace(half, colors=colors))
    assert found["dark_open_edges"] > 0.9 and found["dark_inside"] < 0.05
    assert dark_shares(half) == {}


def scene_of(left, right):
    """The ball in two greys, whatever the light."""
    lit = shade_of(BALL, np.arange(len(BALL.faces)), 0)

    def paint(points, faces):
        return np.where(points[:, :1] < 0, left, right).repeat(3, axis=1) / lit[faces, None]

    return SceneFrame(BALL, np.ones(len(BALL.faces), bool), paint)


@pytest.mark.parametrize("right, off, least, most", [(100, 10, 1, 1), (100, 20, 0, 0), (180, 0, 0.5, 0.6)])
def test_colours_are_near_the_truth_within_some_levels_and_a_pixel(right, off, least, most):
    shown = painted(100 + off, BALL.at(1.002 * BALL.vertices))
    near, other = near_truth(scene_of(100.0, float(right)), 0, [picture(BALL), None], shown)
    assert near + other > 1000 and least <= near / (near + other) <= most


@pytest.fixture(scope="module")
def frames():
    """A ball with a dark half that slides."""
    colors = np.where(BALL.vertices[:, :1] > 0, 40, 200).astype(np.uint8).repeat(3, axis=1)
    return MeshList(tuple(replace(mesh, colors=colors) for mesh in sliding_sphere(3, levels=4)))


@pytest.fixture(scope="module")
def video(frames):
    return open_video(MeshreelCodec("best", color="texture", texture=512).encode(frames))


def test_a_surface_that_only_slides_hardly_swims_and_one_whose_colours_turn_does(video, frames):
    found = swimming(video, frames)
    assert found["swimming_psnr"] > 30 and found["texture_psnr"] > 36
    turned = [replace(mesh, colors=np.roll(mesh.colors, 40 * k, axis=0)) for k, mesh in enumerate(frames)]
    other = swimming(video, MeshList(tuple(turned)))
    assert other["swimming_psnr"] < found["swimming_psnr"] - 6 and other["texture_psnr"] == found["texture_psnr"]


def test_what_has_no_colours_has_no_swimming():
    plain = open_video(MeshreelCodec("best").encode(sliding_sphere(2, levels=2)))
    assert swimming(plain, sliding_sphere(2, levels=2)) == {} and color_bytes(plain.reader) is None


def test_the_bytes_of_colours_are_those_of_their_chunks(video):
    found = color_bytes(video.reader)
    sizes = {kind: sum(c.size for c in video.reader.chunks if c.kind == kind) for kind in ChunkKind}
    assert (found.vertices, found.atlas) == (sizes[ChunkKind.COLORS], sizes[ChunkKind.ATLAS])
    assert len(found.pictures) == 3 and 0 < sizes[ChunkKind.PICTURES] - sum(found.pictures) < 40
    assert found.chains == 1 and 0 < found.base < sizes[ChunkKind.GROUP] and found.background == 0
