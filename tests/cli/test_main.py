"""The command line as a whole: help, version, codes, and what it loads."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import meshreel
from meshreel.cli import COMMANDS, one_line
from tests.cli.conftest import FILE, failed


def test_help_names_every_command(run):
    for arguments in (("--help",), ()):
        said = run(*arguments)
        assert said.code == 0
        assert all(name in said.out for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_that_explains_its_options(run, name):
    said = run(name, "--help") if name != "bench" else run(name, "run", "--help")
    assert said.code == 0
    assert all(flag in said.out for flag in ("--json", "--quiet", "--debug"))


def test_version_is_the_packages(run):
    assert run("--version").out.strip() == meshreel.__version__


def test_an_unknown_command_is_reported(run):
    assert failed(run("encod"), "encod")


@pytest.mark.parametrize(
    ("typed", "meant"), [("enc", "encode"), ("encdoe", "encode"), ("ex", "export"), ("s", "segment or survey or serve")]
)
def test_a_beginning_or_a_slip_suggests_the_command(run, typed, meant):
    assert failed(run(typed), f"Did you mean {meant}?")
    assert failed(run("xyz"), 'Unknown command "xyz". Commands: capture')


def test_ctrl_c_exits_with_130_and_prints_one_line(run, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("meshreel.cli.decode.open_video", interrupted)
    said = run("decode", FILE, "-o", "unused")
    assert (said.code, said.out, said.err) == (130, "", "meshreel: interrupted\n")


def test_the_handler_of_sigterm_is_given_back(run):
    before = signal.getsignal(signal.SIGTERM)
    run("--version")
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("bench", "run", "figure6"), "meshreel bench run: --output is missing: A JSON-lines file"),
        (("bench", "run", "figure6", "-o"), "meshreel bench run: -o is missing: A JSON-lines file"),
        (("bench", "run"), "meshreel bench run: EXPERIMENT is missing: Name of the experiment"),
        (("decode", "x.reel"), "meshreel decode: --output is missing"),
        (("export",), "meshreel export: FILE is missing"),
    ],
)
def test_an_argument_that_is_missing_is_named_with_what_it_is(run, arguments, told):
    said = run(*arguments)
    assert failed(said, told, "--help)")


def test_a_fault_of_ours_is_one_line_too():
    assert one_line(ValueError("a\nb")).startswith("ValueError: a b; this is a fault of meshreel")
    assert "fewer --jobs" in one_line(MemoryError())
    for name, extra in (("scipy.ndimage", "encode"), ("matplotlib.figure", "demo"), ("cyclopts", "cli")):
        missing = ModuleNotFoundError(f"No module named '{name}'", name=name)
        assert one_line(missing) == f"{name} is missing; install it with: pip install 'meshreel[{extra}]'"


def test_without_the_extra_of_the_command_line_the_command_names_it():
    script = "import sys; sys.modules['cyclopts'] = None; from meshreel.cli import main; sys.exit(main(['info', 'a']))"
    answer = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert answer.returncode == 2 and answer.stderr.count("\n") == 1
    assert "pip install 'meshreel[cli]'" in answer.stderr


def test_decode_and_info_need_nothing_of_the_encoder(tmp_path):
    script = (
        "import sys; from meshreel.cli import main\n"
        "commands = [['decode', sys.argv[1], '-o', sys.argv[2], '--quiet'], ['info', sys.argv[1], '--quiet']]\n"
        "codes = [main(command) for command in commands]\n"
        "heavy = ('open3d', 'scipy', 'skimage', 'igl', 'fast_simplification', 'matplotlib', 'meshreel.encoder')\n"
        "print(codes, [name for name in heavy if name in sys.modules])"
    )
    command = [sys.executable, "-c", script, str(FILE), str(tmp_path)]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "[0, 0] []\n"


@pytest.mark.skipif(sys.platform == "win32", reason="a shell of POSIX")
def test_a_closed_standard_output_is_no_fault():
    command = ["sh", "-c", '"$@" >&-', "sh", sys.executable, "-m", "meshreel", "info", str(FILE)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_a_module_run_exits_with_the_code(tmp_path):
    command = [sys.executable, "-m", "meshreel", "info", str(tmp_path / "none.reel")]
    answer = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert answer.stderr.count("\n") == 1 and "none.reel" in answer.stderr


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_that_an_import_made_an_error_of_is_still_reported_as_a_signal(run, monkeypatch, number, code):
    def importing(*_):
        try:
            signal.raise_signal(number)
        except BaseException as error:
            raise ImportError("initialization failed") from error

    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}[number]
    outer = signal.signal(number, usual)  # a shell has jobs in the background ignore interrupts
    monkeypatch.setattr("meshreel.cli.info.describe_file", importing)
    try:
        said = run("info", "a.reel")
        assert signal.getsignal(number) is usual
    finally:
        signal.signal(number, outer)
    assert (said.code, said.out, said.err.count("\n")) == (code, "", 1)
    assert said.err in ("meshreel: interrupted\n", "meshreel: terminated\n")


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX pipes")
def test_a_reader_that_leaves_is_no_error():
    closed = "import os; r, w = os.pipe(); os.close(r); os.dup2(w, 1)"
    code = f"{closed}; from meshreel.cli import main; main()"
    golden = Path(__file__).parents[2] / "conformance" / "v1" / "draco.reel"
    done = subprocess.run([sys.executable, "-c", code, "info", golden, "--json"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize("arguments", [(), ("run", "figure6", "-o", "rows.jsonl", "--jobs", "2")])
def test_without_the_bench_its_command_names_the_distribution(run, monkeypatch, arguments):
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: [])
    assert failed(run("bench", *arguments), "pip install meshreel-bench")
