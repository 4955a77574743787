"""Draco meshes: what they claim is held against their bytes before Draco sees them; encoders keep the same rules."""

import json
import subprocess
import sys
import time
from pathlib import Path

import DracoPy
import pytest

import meshreel
from meshreel.coding.mesh import check_claims, decode_intra, decode_mesh, encode_intra, encode_mesh
from meshreel.errors import FormatError, InputError
from meshreel.io.meshes import read_mesh
from tests.coding.draco_bombs import FAN, SLOW, Draco, bombs, flat, reel_of
from tests.coding.draco_mutants import MOST_MEMORY, MOST_SECONDS, peak, run, valid_meshes  # noqa: F401
from tests.shared_data import performer

BOMBS = bombs()
ROOT = Path(__file__).resolve().parents[2]
FREE, PER_BYTE = 1 << 17, 16  # faces or points: the law of FORMAT.md, "A mesh"


@pytest.mark.parametrize("name", BOMBS)
def test_a_mesh_that_claims_what_it_has_not_got_is_refused_in_words(name: str) -> None:
    data, words = BOMBS[name]
    with pytest.raises(FormatError, match=words):
        decode_mesh(data, 0.001)


def test_a_mesh_that_is_written_by_hand_and_honest_is_decoded() -> None:
    mesh = decode_mesh(FAN.pack(), 1.0)
    assert (len(mesh.vertices), len(mesh.faces)) == (403, 401)


def cost_of_bombs() -> dict[str, float]:
    """Decode each bomb, in a file whose sums are right; return MB that the peak grew, and seconds."""
    files = [reel_of(data) for data, _ in BOMBS.values()]
    meshreel.open(reel_of(FAN.pack()))[0]  # what a process takes once
    before, begin = peak(is_new=True), time.process_time()
    for file in files:
        with pytest.raises(FormatError, match="damaged Draco data"):
            meshreel.open(file)[0]
    return {"peak": peak() - before, "seconds": time.process_time() - begin}


def in_a_process(call: str) -> dict[str, float]:
    """What a function of this module returns in a process of its own, whose peak of memory is its own."""
    code = f"import json; from tests.coding import test_mesh; print(json.dumps(test_mesh.{call}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_files_of_what_is_not_there_cost_neither_memory_nor_time() -> None:
    cost = in_a_process("cost_of_bombs()")
    assert cost["peak"] < 20 and cost["seconds"] < 5


def test_damaged_meshes_that_draco_gets_to_see_cost_little() -> None:
    cost = in_a_process("run(2000)")
    assert cost["decoded"] > 200 and cost["refused"] > 1000
    assert cost["longest"] < MOST_SECONDS and cost["peak"] < MOST_MEMORY


def cost_of(data: bytes) -> dict[str, float]:
    """Decode a mesh; return MB that the peak grew, and faces."""
    decode_mesh(FAN.pack(), 1.0)
    before = peak(is_new=True)
    faces = len(decode_mesh(data, 1.0).faces)
    return {"peak": peak() - before, "faces": faces}


def test_the_most_faces_that_few_bytes_may_claim_cost_little() -> None:
    data = encode_mesh(flat(257), 1.0)
    cost = in_a_process(f"cost_of(bytes.fromhex('{data.hex()}'))")
    assert cost["faces"] == FREE and len(data) < 1000
    assert (2 if sys.platform == "linux" else -1) < cost["peak"] < 60


@pytest.mark.parametrize("seed", range(3))
def test_what_draco_writes_is_what_the_check_expects(seed: int) -> None:
    meshes = valid_meshes(seed)
    check_claims(meshes)
    assert {data[11] for data in meshes} == {0, 2}  # both traversals
    for data in meshes:
        assert decode_mesh(data, 0.02).faces.size
        with pytest.raises(FormatError, match="Draco"):
            decode_mesh(data[:-1], 0.02)


def test_a_large_flat_mesh_is_coded_plainly_so_that_it_keeps_the_law() -> None:
    mesh = flat(420)
    assert len(mesh.faces) > FREE + PER_BYTE * 2000
    data = encode_mesh(mesh, 1.0)
    assert len(mesh.faces) < FREE + PER_BYTE * len(data)
    assert len(decode_mesh(data, 1.0).faces) == len(mesh.faces)


def test_the_frames_of_a_group_have_steps_that_are_free_once() -> None:
    slow = Draco("E" * 1000 + "E" + "R" * 10_000 + "SCC" * 1000).pack()
    check_claims([slow])
    with pytest.raises(FormatError, match="joined again"):
        check_claims([slow] * 2)


def test_the_frames_of_a_group_have_what_is_free_once() -> None:
    frames = [flat(200)] * 4
    alone = encode_mesh(frames[0], 1.0)
    check_claims([alone])
    with pytest.raises(FormatError, match="so few bytes"):
        check_claims([alone] * 4)
    with pytest.raises(FormatError, match="so few bytes"):
        meshreel.open(reel_of(*[alone] * 4))[0]
    assert [len(mesh.faces) for mesh in decode_intra(encode_intra(frames, 1.0, 0))] == [len(frames[0].faces)] * 4


@pytest.mark.parametrize("name", ["dancer", "collision", "mitch"])
def test_a_captured_surface_claims_far_less_than_its_bytes_may(name: str) -> None:
    mesh = read_mesh(sorted(performer(name).glob("*.obj"))[0]).mesh
    width = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
    data = encode_mesh(mesh, width / 60)  # coarser than any encoder goes: 6 bits
    assert len(mesh.faces) < (FREE + PER_BYTE * len(data)) / 3 and len(mesh.faces) < 6 * len(data)


def test_the_bytes_of_ordinary_meshes_are_those_of_the_papers_level() -> None:
    mesh = flat(60)
    low, bits = mesh.vertices.min(axis=0), 6
    plain = DracoPy.encode(
        mesh.vertices,
        mesh.faces,
        quantization_bits=bits,
        compression_level=7,
        quantization_range=2.0**bits - 1,
        quantization_origin=low,
    )
    assert encode_mesh(mesh, 1.0) == bytes(plain)


def test_a_mesh_that_no_reader_would_take_is_an_input_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DracoPy, "encode", lambda *_, **__: SLOW.pack())
    with pytest.raises(
        InputError, match="7200 faces that no reader would decode: vertices of many faces that are joined"
    ):
        encode_mesh(flat(61), 1.0)
