# SPDX-License-Identifier: Apache-2.0
"""The notebooks in docs/ run from their first cell to their last, and hold nothing that a run has put out."""
import json
import os
import subprocess
import sys

import pytest

from tests.needs import module
from tests.tree import ROOT

SLOW = pytest.mark.skipif(os.environ.get("FLEDGE_PRESET") == "asan", reason="kernels start slowly under the sanitizer")
NOTEBOOKS = sorted((ROOT / "docs").glob("*.ipynb"))
EXECUTE = """
import sys
import nbclient, nbformat
notebook = nbformat.reads(sys.stdin.read(), 4)
nbclient.NotebookClient(notebook, kernel_name="python3").execute()
print(nbformat.writes(notebook))
"""


def executed(notebook, folder):
    """The notebook with its outputs. A process of its own runs the client: the client takes over SIGINT, and its
    imports look through the modules that other threads of a test process may be loading."""
    nbformat = module("nbformat", "python3-nbconvert", "python3-ipykernel")
    run = subprocess.run([sys.executable, "-c", EXECUTE], input=nbformat.writes(notebook), cwd=folder, text=True,
                         capture_output=True)
    assert run.returncode == 0, run.stderr
    return nbformat.reads(run.stdout, 4)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_the_source_has_no_outputs(path):
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        assert cell["metadata"] == {} and not cell.get("outputs") and cell.get("execution_count") is None


@SLOW
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_no_cell_fails(path, tmp_path):
    notebook = executed(module("nbformat", "python3-nbconvert").read(path, 4), tmp_path)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    kinds = [set(output.get("data", ())) for output in outputs]
    assert not [output for output in outputs if output.output_type == "error" or output.get("name") == "stderr"]
    assert sum("text/html" in kind for kind in kinds) >= 5 and sum("image/png" in kind for kind in kinds) == 1


@pytest.mark.long("starts a notebook's kernel")
@SLOW
def test_a_figure_is_shown_once_in_its_cell_and_again_on_request(tmp_path):
    nbformat = module("nbformat", "python3-nbconvert")
    begin = "import fledge\nsim = fledge.load('nadir_spin')\nlog = sim.record(sim.flight.tracking.error)\nsim.run(10)\n"
    draw = "figure = log.plot('sigma_BR')\n"
    cells = [begin + draw + "figure", "figure", draw + "1"]
    notebook = executed(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in cells]),
                        tmp_path)
    pictures = [sum("image/png" in output.get("data", ()) for output in cell.outputs) for cell in notebook.cells]
    assert pictures == [1, 1, 1]


def test_there_are_notebooks():
    assert NOTEBOOKS
