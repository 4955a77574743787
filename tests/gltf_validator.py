"""Khronos's validator for glTF files, if Node and its npm package are installed."""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

_WEB = Path(__file__).resolve().parents[1] / "web" / "node_modules" / "gltf-validator"
_SCRIPT = """
const [folder, ...paths] = process.argv.slice(1);
const validator = require(folder), fs = require("fs");
Promise.all(paths.map((path) => validator.validateBytes(new Uint8Array(fs.readFileSync(path)), {maxIssues: 0})))
  .then((reports) => console.log(JSON.stringify(reports.map((report) => report.issues))));
"""


def find_validator() -> str:
    """The folder of the package `gltf-validator`: of web/, or MESHREEL_GLTF_VALIDATOR. Skips the test without."""
    folder = os.environ.get("MESHREEL_GLTF_VALIDATOR") or str(_WEB)
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    if not (Path(folder) / "package.json").is_file():
        pytest.skip(f"npm's gltf-validator is not in {folder}; set MESHREEL_GLTF_VALIDATOR to its folder")
    return folder


def validate(*paths: Path) -> list[dict[str, Any]]:
    """What is wrong with each file: numErrors, numWarnings ... and messages."""
    command = ["node", "-e", _SCRIPT, find_validator(), *map(str, paths)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    issues: list[dict[str, Any]] = json.loads(answer.stdout)
    return issues
