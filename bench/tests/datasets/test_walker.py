"""The walker: cameras that err, and what they would see without errors."""

import numpy as np
from meshreel_bench.datasets import WALKER, Store
from meshreel_bench.datasets.walker import true_luma
from meshreel_bench.measure.color import texel_products, texel_psnr

from meshreel.metrics.color import TO_YUV
from meshreel.types import Mesh, Texture


def test_cameras_err_in_exposure_and_pose(tmp_path):
    known = Store(tmp_path, tmp_path).open(WALKER, 1)
    [mesh], taken = list(known.sequence), known.sequence.colors[0]
    assert len(taken) == 6 and 1.6 < np.ptp(mesh.vertices[:, 1]) < 1.9
    brightness = [one.pixels[one.pixels.min(axis=2) > 20].mean() for one in taken]
    assert 0.02 < np.std(np.log(brightness)) < 0.2
    points = mesh.vertices[::7]
    luma, seen = known.truth(0, points)
    assert 0.8 < seen.mean() <= 1 and 30 < luma.mean() < 200
    for one in taken:  # the same luma, but for what errs
        places, depth = one.project(points)
        assert (depth > 0).all() and (np.abs(places - [512, 640]) < [512, 640]).all()


def test_a_texture_is_compared_at_its_texels_whatever_all_cameras_gain():
    def stripes(number, points):
        assert number == 0
        return 100.0 + 50.0 * (np.floor(points[:, 0]) % 2), points[:, 1] < 6.0

    corners = np.array([[0.0, 0, 0], [8, 0, 0], [0, 8, 0]])
    for gain, noise in ((1.0, 0.0), (1.2, 0.0), (1.0, 5.0)):
        luma = gain * (100 + 50 * (np.arange(8) % 2)) + noise * np.array([1, 1, -1, -1] * 2)
        pixels = np.rint(np.repeat(np.tile(luma[None, :, None], (8, 1, 1)), 3, axis=2)).astype(np.uint8)
        faces, uv = np.array([[0, 1, 2]], np.int32), np.float32(corners[None, :, :2] / 8)
        mesh = Mesh(corners, faces, uv=uv, texture=Texture.of(pixels))
        found = texel_psnr([texel_products(stripes, 0, mesh)])["texel_y_psnr"]
        assert found > 60 if not noise else abs(found - 20 * np.log10(255 / 5)) < 0.5
    assert texel_psnr([texel_products(true_luma, 0, Mesh.empty())]) == {}
    assert abs(TO_YUV[0].sum() - 1) < 1e-12
