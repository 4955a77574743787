"""docs/huggingface.md is true: its commands and its Python run in order, on local folders, without a network."""

import os
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

import meshreel
from tests.golden import GOLDEN
from tests.run_page import blocks

PAGE = Path(__file__).resolve().parents[1] / "docs" / "huggingface.md"


@pytest.mark.skipif(
    find_spec("datasets") is None, reason="datasets is not installed: MESHREEL_VIEWERS=1 ./scripts/setup"
)
def test_the_page_runs_and_every_row_leads_to_its_recording(tmp_path: Path) -> None:
    (walks := tmp_path / "walks").mkdir()
    shutil.copy(GOLDEN / "colored" / "vertices.reel", walks / "walk.reel")
    shutil.copy(GOLDEN / "scene.reel", walks / "room.reel")
    (walks / "README.md").write_text(blocks(PAGE, "yaml") + "# Walks\n", encoding="utf-8")
    environment = os.environ | {"HF_HOME": str(tmp_path / "home"), "HF_HUB_OFFLINE": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(
        filter(None, [str(Path(meshreel.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    )

    def run(*command: str) -> str:
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    for line in blocks(PAGE, "sh").splitlines():
        program, *arguments = shlex.split(line)
        assert program == "meshreel"
        run(sys.executable, "-m", "meshreel", *arguments)
    printed = run(sys.executable, str(PAGE.parents[1] / "tests" / "run_page.py"), str(PAGE))
    with meshreel.open(walks / "walk.reel") as walk, meshreel.open(walks / "room.reel") as room:
        coarse = walk.at(layers=1)
        assert f"'frames': {len(room)}, 'frame_rate': {room.frame_rate}, 'tracks': 2, 'background': True" in printed
        assert f"walk {walk!r}" in printed and f"room {room!r}" in printed  # of the shards
        assert "'label': ClassLabel(names=['coarse', 'walk'])" in printed
        for frame in (0, 1):
            assert (
                f"vertices.shape=({len(coarse[frame].vertices)}, 3), faces.shape=({len(coarse[frame].faces)}, 3)"
                in printed
            )


def test_the_card_of_the_page_is_one_that_hubs_read() -> None:
    card = yaml.safe_load(blocks(PAGE, "yaml").strip().strip("-"))
    assert card["configs"] == [{"config_name": "default", "data_files": [{"split": "train", "path": "metadata.csv"}]}]
    if find_spec("huggingface_hub") is not None:
        from huggingface_hub import DatasetCard

        assert DatasetCard(blocks(PAGE, "yaml") + "# Walks\n").data.to_dict() == card
