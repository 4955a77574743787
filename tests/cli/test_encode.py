"""`meshreel encode`: accepted inputs and options, and a one-line error for all others."""

import inspect
import json
from dataclasses import replace

import pytest

import meshreel
from meshreel.cli.encode import encode as command
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.errors import InputError
from meshreel.io.sequence import SequenceOptions
from tests.cli.conftest import Said, failed

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def obj(folder, name, text):
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.usefixtures("quick_presets")
def test_a_folder_becomes_a_file_and_the_answer_says_what_it_cost(run, balls, tmp_path):
    out = tmp_path / "a.reel"
    said = run("encode", balls, "-o", out, "--frames", "0:2", "--fps", "25", "--scale", "2", "--json")
    assert said.code == 0
    assert said.row["bytes"] == out.stat().st_size
    assert said.row["mbps"] == pytest.approx(out.stat().st_size * 8 * 12.5 / 1e6)
    assert sum(group["frames"] for group in said.row["groups"]) == said.row["frames"] == 2
    video = meshreel.open(out)
    assert video.frame_rate == 25
    assert video[0].diagonal == pytest.approx(2 * 12**0.5, rel=0.03)


@pytest.mark.usefixtures("quick_presets")
def test_a_list_a_glob_and_an_archive_are_inputs_too(run, balls, archive, tmp_path):
    first = balls / "ball_0.ply"
    for number, inputs in enumerate([(first,), (f"{balls}/ball_[0].ply",)]):
        said = run("encode", *inputs, "-o", tmp_path / f"{number}.reel", "--quiet")
        assert (said.code, said.out, said.err) == (0, "", "")
    assert (tmp_path / "0.reel").read_bytes() == (tmp_path / "1.reel").read_bytes()
    said = run("encode", archive, "-o", tmp_path / "n.reel", "--frames", ":1")
    assert said.code == 0 and said.out.startswith(f"{tmp_path}/n.reel: 1 frames, ")


@pytest.mark.usefixtures("quick_presets")
def test_every_option_reaches_the_encoder(run, balls, tmp_path):
    options = ["--preset", "paper", "--quality", "70", "--basis-size", "2", "--centers", "100", "--group-size", "2"]
    files = [balls / f"ball_{i}.ply" for i in range(3)]
    said = run("encode", *files, "-o", tmp_path / "a.reel", *options, "--jobs", "1", "--json")
    assert [group["frames"] for group in said.row["groups"]] in ([1, 2], [2, 1])
    info = run("info", tmp_path / "a.reel", "--json").row
    assert info["metadata"]["quality"] == 70
    assert [g["layers"] for g in info["groups"] if g["form"] == "laplacian"] == [2]


@pytest.mark.usefixtures("quick_presets")
def test_groups_are_predicted_between_the_frames_that_the_key_interval_asks_for(run, balls, tmp_path):
    said = run(
        "encode",
        balls,
        "-o",
        tmp_path / "a.reel",
        "--group-size",
        "1",
        "--fps",
        "10",
        "--key-interval",
        "0.2",
        "--json",
    )
    groups = run("info", tmp_path / "a.reel", "--json").row["groups"]
    assert [group["predicted"] for group in said.row["groups"]] == [group["predicted"] for group in groups]
    assert [group["first_frame"] for group in groups if not group["predicted"]][:1] == [0]
    assert all(group["layers"] == 2 for group in groups if group["form"] == "layers")
    assert len(groups) == 3 and not groups[1]["predicted"]  # runs of one and of two frames


@pytest.mark.usefixtures("quick_presets")
def test_a_target_is_met_and_its_quality_reported(run, balls, tmp_path):
    out = tmp_path / "a.reel"
    first = run("encode", balls, "-o", out, "--frames", ":1", "--quality", "45.67891", "--json").row
    recorded = run("info", out, "--json").row["metadata"]
    assert recorded["quality"] == 45.68  # four digits of it
    assert first["d2_psnr_paper"] == pytest.approx(recorded["d2_psnr_paper"], abs=0.01)
    said = run("encode", balls, "-o", out, "--frames", ":1", "--target-mbps", first["mbps"])
    assert said.code == 0 and meshreel.open(out).reader.size * 8 * 30 / 1e6 == pytest.approx(first["mbps"], rel=0.05)
    recorded = run("info", out, "--json").row["metadata"]
    assert recorded["quality"] == float(f"{recorded['quality']:.4g}")
    assert f"; quality {recorded['quality']:g}, D2-PSNR {recorded['d2_psnr_paper']:.2f} dB\n" in said.out
    assert failed(run("encode", balls, "-o", out, "--frames", ":1", "--target-mbps", "1e-6"), "a.reel", "no quality")
    assert [path.name for path in tmp_path.iterdir()] == ["a.reel"]


@pytest.mark.usefixtures("quick_presets")
def test_digests_of_all_stages_are_written_on_request(run, balls, tmp_path):
    said = run("encode", balls, "-o", tmp_path / "a.reel", "--debug-digests", tmp_path / "a.jsonl", "--quiet")
    assert (said.code, said.err) == (0, "")
    rows = [json.loads(line) for line in (tmp_path / "a.jsonl").read_text(encoding="utf-8").splitlines()]
    assert {"numpy", "scipy"} <= set(rows[0]["libraries"])
    assert (rows[0]["stage"], rows[1]["stage"], rows[-1]["stage"]) == ("machine", "survey", "payload")


@pytest.mark.usefixtures("quick_presets")
def test_digests_replace_neither_an_input_nor_the_output_and_appear_when_they_are_whole(run, balls, tmp_path):
    frame = balls / "ball_0.ply"
    before = frame.read_bytes()
    assert failed(run("encode", frame, "-o", tmp_path / "b.reel", "--debug-digests", frame), "is the input", "name")
    assert frame.read_bytes() == before
    out = tmp_path / "b.reel"
    assert failed(run("encode", frame, "-o", out, "--debug-digests", out), "is the output, too", "--debug-digests")
    (tmp_path / "d.txt").write_text("old")
    said = run("encode", tmp_path / "none", "-o", out, "--debug-digests", tmp_path / "d.txt")
    assert said.code == 2 and (tmp_path / "d.txt").read_text() == "old"
    for flags in (("--resume",), ("--target-mbps", "1")):
        said = run("encode", frame, "-o", out, "--debug-digests", tmp_path / "d.txt", *flags)
        assert failed(said, "--debug-digests describes one whole encode", "leave out")


def test_digests_that_cannot_be_written_are_an_error(run, balls, tmp_path):
    said = run("encode", balls, "-o", tmp_path / "b.reel", "--debug-digests", tmp_path / "no" / "b.jsonl")
    assert failed(said, "b.jsonl: cannot be written", "choose another folder")


def test_flags_default_to_the_defaults_of_the_options():
    defaults = {name: parameter.default for name, parameter in inspect.signature(command).parameters.items()}
    assert replace(defaults["reading"].options(), weld=None) == SequenceOptions()
    assert defaults["settings"].resolved() == EncoderOptions()


@pytest.mark.usefixtures("quick_presets")
def test_what_is_dropped_or_welded_is_said_once(run, tmp_path):
    text = "vt 0 0\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 0 0 0 1 0 0\nf 1/1 2/1 3/1\nf 4/1 3/1 2/1\n"
    for number in range(2):
        obj(tmp_path, f"f{number}.obj", text)
    said = run("encode", tmp_path, "-o", tmp_path / "a.reel")
    assert said.code == 0
    warnings = said.err.splitlines()
    assert all(line.startswith("meshreel: warning: ") for line in warnings)
    assert sum("not kept: texture coordinates" in line for line in warnings) == 1
    assert sum("welded 2 of 8 vertices" in line for line in warnings) == 1
    assert run("encode", tmp_path, "-o", tmp_path / "a.reel", "--quiet").err == ""


def test_a_missing_input_and_an_empty_folder_are_reported(run, tmp_path):
    out = tmp_path / "a.reel"
    assert failed(run("encode", tmp_path / "none", "-o", out), "none", "no such file")
    assert failed(run("encode", tmp_path, "-o", out), "0 mesh files")
    assert failed(run("encode", tmp_path / "*.ply", "-o", out), "pattern")
    assert not out.exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (TRIANGLE + "f 1 2 4\n", ("vertex 4", "3 vertices")),
        (TRIANGLE.replace("1 0 0", "nan 0 0") + "f 1 2 3\n", ("vertex 1", "not within")),
    ],
)
def test_a_frame_that_cannot_be_used_is_reported_with_file_and_number(run, tmp_path, text, words):
    obj(tmp_path, "f0.obj", TRIANGLE + "f 1 2 3\n")
    obj(tmp_path, "f1.obj", text)
    said = run("encode", tmp_path, "-o", tmp_path / "a.reel")
    assert failed(said, "frame 1", "f1.obj", *words)
    assert not (tmp_path / "a.reel").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "a.mp4"], [".reel"]),
        (["-o", "a.reel", "--quality", "101"], ["quality", "101"]),
        (["-o", "a.reel", "--quality", "high"], ["high"]),
        (["-o", "a.reel", "--quality", "50", "--target-psnr", "60"], ["--quality 50", "one of both"]),
        (["-o", "a.reel", "--quality", "0", "--target-mbps", "1"], ["--quality 0", "one of both"]),
        (["-o", "a.reel", "--target-mbps", "1", "--target-psnr", "60"], ["60", "1", "one of them"]),
        (["-o", "a.reel", "--fps", "0"], ["frame rate"]),
        (["-o", "a.reel", "--frames", "1-2"], ["1-2"]),
        (["-o", "a.reel", "--frames", "7:"], ["leave 0"]),
        (["-o", "a.reel", "--jobs", "0"], ["jobs"]),
        (["-o", "a.reel", "--preset", "worst"], ["worst"]),
        (["-o", "a.reel", "--spped", "2"], ["--spped"]),
        ([], ["output"]),
    ],
)
def test_an_impossible_option_is_an_error_before_anything_is_read(run, balls, tmp_path, arguments, words, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert failed(run("encode", balls, *arguments), *words)
    assert list(tmp_path.iterdir()) == []


def test_debug_shows_the_traceback(run, tmp_path):
    with pytest.raises(meshreel.InputError):
        run("encode", tmp_path / "none", "-o", tmp_path / "a.reel", "--debug")


def test_frames_whose_faces_have_no_area_are_reported(run, tmp_path):
    obj(tmp_path, "f0.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    said = run("encode", tmp_path, "-o", tmp_path / "a.reel")
    assert said.code == 0 and "1 group of form empty" in said.out
    assert "1 frames have faces, but none with an area" in said.err


@pytest.mark.usefixtures("quick_presets")
def test_any_name_that_a_file_may_have_can_be_the_output(run, tmp_path):
    obj(tmp_path, "f0.obj", TRIANGLE + "f 1 2 3\n")
    out = tmp_path / ("n" * 250 + ".reel")
    assert run("encode", tmp_path, "-o", out).code == 0
    assert out.exists()


def test_a_size_that_no_header_holds_is_reported_before_anything_is_coded(run, tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.encoder.run.schedule.encode_interval", lambda *_: pytest.fail("coded"))
    obj(tmp_path, "f0.obj", TRIANGLE.replace("1", "1e12") + "f 1 2 3\n")
    assert failed(run("encode", tmp_path, "-o", tmp_path / "a.reel", "--scale", "1e9"), "Header.scale")


def test_more_effort_is_more_work_on_the_same_frames(run, balls, tmp_path):
    work = list[float]()
    for effort in ("fast", "normal", "thorough"):
        path = tmp_path / f"{effort}.reel"
        said = run("encode", balls, "-o", path, "--dynamic-only", "--effort", effort, "--json")
        assert said.code == 0 and len(meshreel.open(path)) == 3 and said.row["d2_psnr_paper"] > 50
        work.append(said.row["work"]["closest points"])
    assert work == sorted(set(work))
    assert failed(run("encode", balls, "-o", tmp_path / "c.reel", "--effort", "lazy"), "lazy", "fast")


def test_what_is_missing_for_colours_is_told_before_anything_is_encoded(run, tmp_path, monkeypatch):
    def encode(*_: object) -> None:
        raise InputError("encoding began")

    monkeypatch.setattr("meshreel.encoder.settings.options.find_spec", lambda _: None)
    monkeypatch.setattr("meshreel.cli.encode.Encoder.encode", encode)
    lines = TRIANGLE.replace("\n", " 1 0 0\n") + "f 1 2 3\n"
    for color, warned in (("auto", True), ("vertices", False)):
        said = run("encode", obj(tmp_path, "a.obj", lines), "-o", tmp_path / "a.reel", "--color", color)
        assert ("no textures: av and xatlas missing" in said.err) == warned
        assert failed(Said(said.code, said.out, said.err.splitlines(keepends=True)[-1]), "encoding began")
    said = run("encode", obj(tmp_path, "b.obj", TRIANGLE + "f 1 2 3\n"), "-o", tmp_path / "a.reel")
    assert failed(said, "encoding began") and "textures" not in said.err
    said = run("encode", tmp_path / "recording", "-o", tmp_path / "a.reel", "--splats", "100")
    assert failed(said, "torch", "meshreel[splats]")
