"""NeCGS as a whole, tiny: what it learns, that it learns it twice alike, and what it refuses."""

import hashlib
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.codecs.necgs import QUICK, NecgsCodec
from meshreel_bench.codecs.necgs.stream import decode_stream, encode_stream
from meshreel_bench.codecs.necgs.volumes import box_of, extract, place_grids, truncated_distances

from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.errors import FormatError, InputError
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.spheres import deforming_sphere

TINY = NecgsCodec(resolution=16, features=4, channels=8, epochs=60, fitting=5, rate=1e-2, device="cpu")
HASTY = replace(TINY, epochs=10, fitting=1)
BALLS = deforming_sphere(4, levels=3)

torch_only = pytest.mark.skipif(
    find_spec("torch") is None, reason="the extra necgs is not installed: MESHREEL_NECGS=1 ./scripts/setup"
)


def quality(originals: Sequence[Mesh], decoded: Sequence[Mesh]) -> float:
    """The mean symmetric PSNR, dB; 0 for a frame that is not there."""
    pairs = zip(originals, decoded, strict=True)
    return float(np.mean([0 if b.is_empty else surface_errors(a, b).symmetric_psnr for a, b in pairs]))


def fingerprint(meshes: Sequence[Mesh]) -> str:
    """Equal for equal meshes."""
    return hashlib.sha256(b"".join(m.vertices.tobytes() + m.faces.tobytes() for m in meshes)).hexdigest()


@pytest.fixture(scope="module")
def balls() -> bytes:
    """The balls at the tiny operating point."""
    return TINY.encode(BALLS)


@torch_only
def test_a_set_of_frames_comes_back_better_than_any_of_them_stands_for_all(balls):
    decoded = TINY.decode(balls)
    stills = [min(quality([mesh], [still]) for mesh in BALLS) for still in BALLS]
    assert len(decoded) == len(BALLS)
    assert min(quality([a], [b]) for a, b in zip(BALLS, decoded, strict=True)) > max(stills) + 10
    assert len(balls) < 20_000


@torch_only
def test_larger_networks_take_more_bytes_and_are_better():
    points = []
    for channels in (4, 8, 16):
        codec = replace(TINY, channels=channels, epochs=25)
        data = codec.encode(BALLS)
        points.append((len(data), quality(BALLS, codec.decode(data))))
    sizes, qualities = zip(*points, strict=True)
    assert list(sizes) == sorted(sizes) and sizes[2] > 2 * sizes[0]
    assert qualities[0] < qualities[1] < qualities[2], points


@torch_only
@pytest.mark.parametrize(("less", "larger", "better"), [({"epochs": 10}, 0.0, 3), ({"bits": 5}, 1.5, 1)])
def test_more_epochs_are_better_and_more_bits_take_more_bytes_too(balls, less, larger, better):
    coarse = replace(TINY, **less)
    data = coarse.encode(BALLS)
    assert len(balls) > larger * len(data)
    assert quality(BALLS, coarse.decode(data)) < quality(BALLS, TINY.decode(balls)) - better


@torch_only
def test_fitted_volumes_are_nearer_to_their_meshes_than_distances_alone():
    from meshreel_bench.codecs.necgs.network import fit_volume

    [mesh] = soft_bodies(SoftBodiesOptions(frames=1, spacing=0.05, people=1))
    placement = place_grids([box_of(mesh)], 32)
    cells = placement.inverse(mesh, 0, 32)
    distances, _ = truncated_distances(cells, 32)
    plain, fitted = (fit_volume(distances, cells, steps) for steps in (0, 30))
    assert (plain[..., 1:] == 0).all() and (plain[..., 0] == distances).all()
    assert np.abs(fitted).max() <= 1
    before, after = (surface_errors(cells, extract(v, trimmed=False)).symmetric_psnr for v in (plain, fitted))
    assert after > before + 3


@torch_only
def test_the_same_frames_give_the_same_bytes_and_these_the_same_meshes_in_any_process(balls, tmp_path):
    pair = MeshList(BALLS.meshes[:2])
    assert HASTY.encode(pair) == HASTY.encode(pair)
    assert HASTY.encode(pair) != replace(HASTY, seed=1).encode(pair)
    (tmp_path / "set").write_bytes(balls)
    code = (
        "import hashlib, pathlib, sys; from meshreel_bench.codecs.necgs import NecgsCodec;"
        "meshes = NecgsCodec(device='cpu').decode(pathlib.Path(sys.argv[1]).read_bytes());"
        "print(hashlib.sha256(b''.join(m.vertices.tobytes() + m.faces.tobytes() for m in meshes)).hexdigest())"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "set")]
    fresh = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert fresh == fingerprint(TINY.decode(balls)) == fingerprint(TINY.decode(balls)[::-1][::-1])


@torch_only
def test_an_encode_that_was_killed_goes_on_to_the_same_bytes(monkeypatch, tmp_path):
    pair, epochs = MeshList(BALLS.meshes[:2]), list[int]()
    whole = replace(HASTY, workers=2).encode(pair)  # processes fit the same
    assert whole == HASTY.encode(pair)
    monkeypatch.setenv("MESHREEL_NECGS_KEEP", str(tmp_path))
    monkeypatch.setattr("meshreel_bench.codecs.necgs.network.KEPT_S", 0.0)

    def killed(stage, done, _total):
        if stage == "train" and done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        HASTY.encode(pair, killed)
    monkeypatch.setattr("meshreel_bench.codecs.necgs.network.fit_volume", lambda *_: pytest.fail("fitted again"))
    assert HASTY.encode(pair, lambda stage, done, _: epochs.append(done) if stage == "train" else None) == whole
    assert epochs[0] == 4


def _settings_of(torch):
    strict = torch.are_deterministic_algorithms_enabled(), torch.utils.deterministic.fill_uninitialized_memory
    return torch.get_num_threads(), *strict, torch.get_rng_state()


@torch_only
def test_coding_leaves_torch_as_it_was():
    import torch

    torch.manual_seed(5)
    before = _settings_of(torch)
    list(HASTY.decode(HASTY.encode(MeshList(BALLS.meshes[:1]))))
    after = _settings_of(torch)
    assert before[:3] == after[:3] and torch.equal(before[3], after[3])


@torch_only
def test_empty_frames_are_empty_and_the_others_are_there():
    frames = MeshList((Mesh.empty(), BALLS[0], Mesh.empty(), BALLS[1]))
    told = []
    decoded = TINY.decode(TINY.encode(frames, lambda *progress: told.append(progress)))
    assert [mesh.is_empty for mesh in decoded] == [True, False, True, False]
    assert told[0] == ("volumes", 1, 2) and told[-1] == ("train", TINY.epochs, TINY.epochs)
    with pytest.raises(IndexError):
        decoded[4]
    for nothing in (MeshList((Mesh.empty(), Mesh.empty())), MeshList(())):
        assert [mesh.is_empty for mesh in HASTY.decode(HASTY.encode(nothing))] == [True] * len(nothing)


@torch_only
def test_frames_that_share_nothing_and_lie_far_away_are_coded():
    far = np.array([5e5, -4e6, 100.0])
    line = Mesh.of([[0, 0, 0], [1, 0, 0], [2, 0, 0]] + far, [[0, 1, 2]])
    other = deforming_sphere(3, levels=2)[1]
    moved = [Mesh.of(mesh.vertices + far + [x, 0, 0], mesh.faces) for mesh, x in ((BALLS[0], 0), (other, 9))]
    frames = MeshList((*moved, line))
    decoded = TINY.decode(TINY.encode(frames))
    assert quality(frames.meshes[:2], decoded[:2]) > 30


@torch_only
def test_the_quick_configuration_has_a_person_s_shape():
    person = list(soft_bodies(SoftBodiesOptions(frames=1, spacing=0.05, people=1)))
    codec = NecgsCodec(**QUICK, device="cpu")
    assert quality(person, codec.decode(codec.encode(MeshList(tuple(person))))) > 36


@torch_only
def test_a_set_whose_training_lost_a_frame_is_refused_by_its_number():
    frames = MeshList((Mesh.empty(), *BALLS.meshes[:2]))
    for absurd in (replace(HASTY, epochs=1), replace(HASTY, rate=1e-9), replace(HASTY, rate=1.0)):
        with pytest.raises(InputError, match=r"frame 1: .* more epochs than .* another rate .* seed"):
            absurd.encode(frames)


@torch_only
def test_a_frame_that_became_another_body_is_refused(monkeypatch):
    from meshreel_bench.codecs.necgs import network

    def other(volumes, codec, told):
        turned = [np.ascontiguousarray(-volume) for volume in volumes]
        return trained(turned, codec, told)

    trained = network.train
    monkeypatch.setattr(network, "train", other)
    with pytest.raises(InputError, match=r"frame 0: training ended with \d% of its body"):
        TINY.encode(MeshList(BALLS.meshes[:1]))


@torch_only
def test_open_walls_are_trimmed_where_they_end():
    wall = Mesh.of([[0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 0]], [[0, 1, 2], [1, 3, 2]])
    codec = replace(TINY, epochs=200)
    data = codec.encode(MeshList((wall,)))
    coded = decode_stream(data)
    assert coded.trimmed
    trimmed, whole = quality([wall], codec.decode(data)), encode_stream(replace(coded, trimmed=False))
    assert trimmed > max(17, quality([wall], codec.decode(whole)) + 2)


@torch_only
def test_devices_that_are_not_there_and_what_is_no_mesh_are_told(balls):
    for device in ("nothing", "cuda:77"):
        with pytest.raises(InputError, match="cannot be used"):
            replace(TINY, device=device).decode(balls)
    broken = Mesh.of([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match="frame 1"):
        HASTY.encode(MeshList((BALLS[0], broken)))


def test_bytes_of_others_are_refused():
    for data in (b"", b"REEL\r\n\x1a\n" + bytes(100), b"NeCGS\r\n\x1a\x01" + bytes(100)):
        with pytest.raises(FormatError):
            TINY.decode(data)


def test_without_torch_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match=r"meshreel-bench\[necgs\]"):
        HASTY.encode(BALLS)


def test_naming_the_codec_does_not_load_torch():
    code = "import sys; from meshreel_bench.codecs import make_codec; make_codec('necgs', {});" + (
        "sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_configuration_is_a_codec():
    assert make_codec("necgs", {}) == NecgsCodec()
    assert make_codec("necgs", QUICK).shape.layers == ((16, 64), (8, 48), (6, 32), (4, 4))
    full = make_codec("necgs", {"configuration": "full", "epochs": 7})
    assert (full.name, full.resolution, full.channels, full.epochs, full.workers) == ("necgs_full", 128, 64, 7, 0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"resolution": 48}, "resolution 48: give one of 16, 32, 64, 128"),
        ({"features": 0}, "features 0: give 1 to 64"),
        ({"channels": 129}, "channels 129"),
        ({"bits": 3}, "bits 3: give 4 to 16"),
        ({"epochs": 0}, "epochs 0"),
        ({"fitting": -1}, "fitting -1"),
        ({"batch": 0}, "batch 0"),
        ({"seed": -1}, "seed -1"),
        ({"rate": float("nan")}, "rate nan"),
        ({"structure": -1.0}, "structure -1.0: give 0 to 1000"),
        ({"structure": float("inf")}, "structure inf"),
        ({"configuration": "huge"}, "configuration 'huge': give small or full"),
        ({"blocks": 8}, "does not take"),
    ],
)
def test_options_that_cannot_be_are_told(options, words):
    with pytest.raises(InputError, match=words):
        make_codec("necgs", options)
