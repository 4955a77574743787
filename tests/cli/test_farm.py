"""The job array of docs/farm.md, as it stands there, writes the bytes of one encode."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from meshreel.io.write import write_mesh
from tests.spheres import sliding_sphere
from tests.test_docs import ROOT, run_environment

PAGE = ROOT / "docs" / "farm.md"
BASH = shutil.which("bash")
# A queue that runs the jobs of an array one after the other, the last first, and a job after others at once.
SBATCH = """#!{bash}
for flag in "$@"; do case $flag in
  --array=*) array=${{flag#--array=}};;
  --wrap=*) wrap=${{flag#--wrap=}};;
esac; done
for number in $(seq ${{array#*-}} -1 ${{array%-*}}); do
  SLURM_ARRAY_TASK_ID=$number {bash} -e -c "$wrap" >&2 || exit 1
done
[ -n "$array" ] || {bash} -e -c "$wrap" >&2 || exit 1
echo 4711
"""


@pytest.mark.slow
@pytest.mark.skipif(BASH is None or os.name == "nt", reason="the page's commands are for a POSIX shell")
def test_the_job_array_of_the_page_writes_the_bytes_of_one_encode(tmp_path: Path) -> None:
    """With 2 jobs in place of 100, of frames a second apart, of which a key interval has four."""
    (takes := tmp_path / "takes" / "walk").mkdir(parents=True)
    for number, mesh in enumerate(sliding_sphere(5, levels=1)):
        write_mesh(mesh, takes / f"frame_{number:05}.ply")
    section = PAGE.read_text(encoding="utf-8").split("## Slurm")[1]
    recipe = section.split("```sh\n")[1].split("```")[0]
    small = recipe.replace("100", "2").replace("--fps 30", "--fps 1")
    assert recipe.count("100") == 3 and recipe.count("--fps 30") == 2
    (binaries := tmp_path / "bin").mkdir()
    for name, text in (("sbatch", SBATCH.format(bash=BASH)), ("meshreel", _command())):
        (binaries / name).write_text(text, encoding="utf-8")
        (binaries / name).chmod(stat.S_IRWXU)
    whole = "meshreel encode takes/walk -o whole.reel --fps 1"
    environment = run_environment() | {"PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}"}
    for commands in (small, whole):
        done = subprocess.run(
            [BASH, "-e", "-c", commands], cwd=tmp_path, capture_output=True, text=True, env=environment
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert len(list((tmp_path / "parts").iterdir())) == 2
    assert (tmp_path / "walk.reel").read_bytes() == (tmp_path / "whole.reel").read_bytes()


def _command() -> str:
    return f'#!{BASH}\nexec "{sys.executable}" -m meshreel "$@"\n'
