"""The C library follows the edits of a file as Python does, bit for bit, and refuses those that Python refuses."""

import shutil
from dataclasses import replace
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

import meshreel
from meshreel import edit
from meshreel.errors import FormatError
from meshreel.format.layout import EDITED, MAGIC, VERSION, Checksum, Preamble
from meshreel.format.records import least_size, pack
from tests.decoder.c_abi import AV1, BACKGROUND, BAD_ARGUMENT, DAMAGED, CError, CVideo
from tests.decoder.test_c_abi import check_same
from tests.golden import GOLDEN

pytestmark = pytest.mark.skipif(shutil.which("cmake") is None, reason="needs CMake, of the extra dev")
TURN = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]]
FILES = sorted(GOLDEN.rglob("*.reel"))


@pytest.fixture(params=FILES, ids=lambda path: f"{path.parent.stem}-{path.stem}")
def edited(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a golden file that is cut where it has frames enough, scaled, turned and moved."""
    path, frames = request.param, len(meshreel.open(request.param))
    if frames > 2:
        edit.cut(path, tmp_path / "cut.reel", f"1:{min(frames - 1, 40)}")
        path = tmp_path / "cut.reel"
    edit.transform(path, tmp_path / "edited.reel", 0.5, TURN, (1, 2, 3))
    return tmp_path / "edited.reel"


def joined(path: Path, folder: Path) -> Path:
    """Return a golden file of which two cuts are joined the other way round, without audio, and cut again."""
    count = len(meshreel.open(path))
    edit.tag(path, folder / "plain.reel", audio=b"")
    for name, frames in (("a", f"{count // 2}:"), ("b", f":{max(count // 2, 1)}")):
        edit.cut(folder / "plain.reel", folder / f"{name}.reel", frames)
    edit.concat([folder / "a.reel", folder / "b.reel", folder / "a.reel"], folder / "joined.reel")
    edit.cut(folder / "joined.reel", folder / "again.reel", "1:-1" if count > 2 else ":")
    return folder / "again.reel"


def test_every_part_of_every_frame_is_cut_and_turned_as_by_python(edited: Path):
    known = meshreel.open(edited)
    assert known.reader.edit.rotation
    with CVideo(edited.read_bytes()) as video:
        assert [video.time(frame) for frame in range(video.info.frames)] == known.timestamps
        assert (tuple(video.info.minimum), tuple(video.info.maximum)) == tuple(map(tuple, known.box))
        for frame in [*range(len(known)), 0]:
            for name, mesh in known.parts(frame).items():
                check_same(mesh, video.decode(frame, BACKGROUND if name == "background" else int(name.split()[1])))
            check_same(replace(known[frame], uv=None), video.decode(frame))


def test_splats_are_turned_with_their_axes(tmp_path: Path):
    edit.cut(GOLDEN / "splats/splats.reel", tmp_path / "cut.reel", "1:3")
    edit.transform(tmp_path / "cut.reel", tmp_path / "edited.reel", rotation=TURN)
    known = meshreel.open(tmp_path / "edited.reel")
    with CVideo((tmp_path / "edited.reel").read_bytes()) as video:
        found = [(known.splats(frame), video.splats(frame, 0)) for frame in range(len(known))]
        assert any(wanted is not None for wanted, _ in found)
        for wanted, arrays in found:
            assert (wanted is None) == (arrays is None)
            for name, array in (arrays or {}).items():
                np.testing.assert_allclose(array, getattr(wanted, name), rtol=0, atol=1e-9)


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.stem}-{path.stem}")
def test_a_joined_file_with_hidden_frames_in_its_middle_is_shown_as_by_python(path: Path, tmp_path: Path):
    known = meshreel.open(joined(path, tmp_path))
    with CVideo((tmp_path / "again.reel").read_bytes()) as video:
        assert [video.time(frame) for frame in range(video.info.frames)] == known.timestamps
        for frame in range(len(known)):
            for name, mesh in known.parts(frame).items():
                check_same(mesh, video.decode(frame, BACKGROUND if name == "background" else int(name.split()[1])))


@pytest.mark.parametrize(("name", "part"), [("textures", 0), ("scene", BACKGROUND)])
def test_pictures_of_a_joined_file_are_those_of_its_frames(name: str, part: int, tmp_path: Path):
    path = GOLDEN / f"colored/{name}.reel"
    count = len(meshreel.open(path))
    wanted = [*range(count // 2, count), *range(count // 2), *range(count // 2, count)][1:-1]
    with CVideo(path.read_bytes()) as whole, CVideo(joined(path, tmp_path).read_bytes()) as video:
        before = [picture and picture[0] for picture in (whole.picture(k, part, AV1) for k in range(count))]
        after = [picture and picture[0] for picture in (video.picture(k, part, AV1) for k in range(len(wanted)))]
        assert any(before) and after == [before[frame] for frame in wanted]


@pytest.mark.parametrize(("name", "part"), [("textures", 0), ("scene", BACKGROUND)])
def test_pictures_are_those_of_the_frames_that_are_shown(name: str, part: int, tmp_path: Path):
    path = GOLDEN / f"colored/{name}.reel"
    frames = len(meshreel.open(path))
    edit.cut(path, tmp_path / "cut.reel", f"1:{frames}")
    with CVideo(path.read_bytes()) as whole, CVideo((tmp_path / "cut.reel").read_bytes()) as cut:
        assert meshreel.open(tmp_path / "cut.reel").reader.edit.shown[0].start == 1
        wanted = [picture and picture[0] for picture in (whole.picture(k, part, AV1) for k in range(1, frames))]
        assert any(wanted)
        assert [picture and picture[0] for picture in (cut.picture(k, part, AV1) for k in range(frames - 1))] == wanted


ROTATION = "[1,0,0,0,0.6,-0.8,0,8e-1,0.6]"
GOOD = [
    "{}",
    '{"frames":[0,3]}',
    ' {"frames" : [ 1 , 3 ] , "rotation":[]} ',
    '{"frames":[-0,1]}',
    '{"frames":[0.0,2e0]}',
    f'{{"rotation":{ROTATION}}}',
    f'{{"frames":[1,2],"rotation":{ROTATION}}}',
    '{"rotation":[1,0,0,0,1,0,0,0,1]}',
    '{"rotation":[1.0000003,0,0,0,1,-4.5E-7,0,0.0e+5,1]}',
]
BAD = [
    "null",
    "7",
    "[]",
    '"edit"',
    '{"frame":[0,3]}',
    '{"frames":[0,3],"more":[]}',
    '{"frames":[0,4]}',
    '{"frames":[-1,3]}',
    '{"frames":[2,2]}',
    '{"frames":[2,1]}',
    '{"frames":[0]}',
    '{"frames":[0,1,2]}',
    '{"frames":[0,2.5]}',
    '{"frames":[0,1,2,3]}',
    '{"frames":[0,1,1,3]}',
    '{"frames":[2,3,0,1]}',
    '{"frames":[0,1,2,4]}',
    '{"frames":[0,"2"]}',
    '{"frames":[false,true]}',
    '{"frames":[0,99999999999999999999999999]}',
    '{"frames":{}}',
    '{"frames":null}',
    '{"frames":[]}',
    '{"rotation":[1,0,0,0,1,0,0,0]}',
    '{"rotation":[1,0,0,0,1,0,0,0,1,0]}',
    '{"rotation":[1,0,0,0,1,0,0,0,-1]}',
    '{"rotation":[1,0,0,0,1,0,0,0,1.000002]}',
    '{"rotation":[1,0,0,0,1,0,0,0,true]}',
    '{"rotation":[[1,0,0],[0,1,0],[0,0,1]]}',
    '{"rotation":[1e999,0,0,0,1,0,0,0,1]}',
    '{"rotation":[1,0,0,0,1,0,0,0,NaN]}',
    '{"rotation":7}',
    '{"rotation":null}',
]
NO_JSON = [
    '{"frames":[0,3}',
    '{"frames":[0,03]}',
    '{"frames":[0,3,]}',
    '{"frames"[0,3]}',
    '{"frames":[0,3],}',
    "{",
    "{,}",
]


def of_metadata(text: str | bytes, flags: int = EDITED) -> bytes:
    """Return a file of three frames with any text as its metadata, whose flag says that it has an edit."""
    data = (GOLDEN / "draco.reel").read_bytes()
    reader = meshreel.open(data).reader
    written = text.encode() if isinstance(text, str) else text
    header = pack(replace(reader.header, metadata="x" * len(written))).replace(b"x" * len(written), written)
    body = header + pack(reader.index)
    size = least_size(Preamble) + len(body) + least_size(Checksum)
    head = pack(Preamble(MAGIC, VERSION, flags, size)) + body
    return head + pack(Checksum(crc32(head))) + data[reader.head_size :]


@pytest.mark.parametrize("text", [*GOOD, *BAD, *NO_JSON])
def test_an_edit_is_refused_where_python_refuses_it(text: str):
    data = of_metadata(f'{{"a":{{"edit":{{}}}},"b":"edit","edit":{text},"up":"z"}}')
    if text not in GOOD:
        with pytest.raises(FormatError, match=r"Header\.metadata"):
            meshreel.open(data)
        with pytest.raises(CError, match=r"edit|JSON") as error:
            CVideo(data)
        assert error.value.status == DAMAGED
        return
    known = meshreel.open(data)
    with CVideo(data) as video:
        assert (video.info.frames, video.info.up) == (len(known), 1)
        check_same(known[0], video.decode(0))


@pytest.mark.parametrize(
    "text", ["{}", "[]", "", '{"a":{"edit":{}}}', '{"edit":{}}}', '{"edit":{}', '{"edit":{} "a":1}']
)
def test_a_flag_without_an_edit_is_refused(text: str):
    for opened in (meshreel.open, CVideo):
        with pytest.raises((FormatError, CError), match="metadata"):
            opened(of_metadata(text))


JSON = r""" {"up" : "z", "a":[1, -2.5e+3,true,false,null,{"b\u00e9":"\ud83d\ude00 \n\"/"}],"d":{}, "c":"\\é€😀"} """
NOT_WRITTEN = [
    "",
    "[]",
    "7",
    "{}x",
    "\ufeff{}",
    "{} \0",
    '{"a":NaN}',
    '{"a":-Infinity}',
    '{"a":1e999}',
    '{"a":"\\ud800"}',
]
NOT_WRITTEN += [
    '{"a":"\\ud800\\u0041"}',
    '{"a":"\\ude00"}',
    '{"a":"\t"}',
    '{"a":"\\x"}',
    '{"a":tru}',
    '{"a":}',
    "{a:1}",
]
NOT_WRITTEN += [f'{{"a":{"[" * 2000}{"]" * 2000}}}', f'{{"a":{"1" * 310}}}', '{"a":[1 2]}', '{"a":{"b"}}', '{"a":[1}}']


def is_refused(data: bytes) -> bool:
    """Return whether the C library refuses a file, which it must where Python does, and only there."""
    try:
        known = meshreel.open(data)
    except FormatError:
        with pytest.raises(CError) as error:
            CVideo(data)
        assert error.value.status == DAMAGED
        return True
    with CVideo(data) as video:
        assert ("y", "z", "-y", "-z")[video.info.up] == known.reader.up
    return False


@pytest.mark.parametrize("text", NOT_WRITTEN)
def test_metadata_that_are_no_json_are_refused_without_an_edit_too(text: str):
    assert is_refused(of_metadata(text, flags=0))


def test_metadata_with_other_bytes_are_refused_where_python_refuses_them():
    numbers, text = np.random.default_rng(5), JSON.encode()
    assert not is_refused(of_metadata(text, flags=0))
    assert not is_refused(of_metadata(f'{{"a":{"1" * 308},"\\u0075p":"\\u007a"}}', flags=0))
    verdicts = list[bool]()
    for _ in range(1500):
        changed = bytearray(text)
        for at in numbers.integers(len(text), size=numbers.integers(1, 3)):
            changed[at] = (
                numbers.choice(list(b'"\\{}[],:0e.u \n\xc3\xe2\x80'))
                if numbers.random() < 0.7
                else numbers.integers(256)
            )
        verdicts.append(is_refused(of_metadata(bytes(changed), flags=0)))
    assert 100 < sum(verdicts) < 1400


def test_an_edit_without_the_flag_means_nothing_and_another_flag_is_refused():
    data = bytearray(of_metadata('{"edit":{"frames":[0,1]}}'))
    for flags, frames in ((0, 3), (1, 1), (2, None), (3, None)):
        data[9] = flags
        size = int.from_bytes(data[10:14], "little")
        data[size - 4 : size] = crc32(data[: size - 4]).to_bytes(4, "little")
        if frames is None:
            with pytest.raises(CError, match="flags"):
                CVideo(bytes(data))
            continue
        with CVideo(bytes(data)) as video:
            assert video.info.frames == frames
            with pytest.raises(CError) as error:
                video.decode(frames)
            assert error.value.status == BAD_ARGUMENT
