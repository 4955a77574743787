"""Runs a notebook that shows a video and a mesh, and writes it as a page: `python notebook.py RECORDING FOLDER`."""

import sys
from pathlib import Path

import nbformat
from nbconvert import HTMLExporter
from nbconvert.preprocessors import ExecutePreprocessor

import meshreel

recording, folder = Path(sys.argv[1]), Path(sys.argv[2])
cells = [f"import meshreel\nvideo = meshreel.open({str(recording)!r})\nvideo", "video[3]", "video.show()"]
notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
notebook, _ = ExecutePreprocessor(timeout=120, kernel_name="python3").preprocess(notebook)
(folder / "notebook.html").write_text(HTMLExporter().from_notebook_node(notebook)[0], encoding="utf-8")
(folder / "page.html").write_text(meshreel.open(recording)._page(), encoding="utf-8")
