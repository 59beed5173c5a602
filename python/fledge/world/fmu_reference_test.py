# SPDX-License-Identifier: Apache-2.0
"""The FMI project's reference FMUs, each against the rows that it carries itself: FLEDGE_TEST_DATA has them as
fmi/3.0/NAME.fmu and fmi/2.0/NAME.fmu, as https://github.com/modelica/Reference-FMUs builds them."""

import csv
import io
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fledge import RunError, Simulation, world
from fledge.units import s

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("FLEDGE_TEST_DATA", ROOT.parent / "shared" / "data"))
FILES = [f"{version}/{name}.fmu" for version in ("2.0", "3.0")
         for name in ("BouncingBall", "Dahlquist", "Feedthrough", "Resource", "Stair", "VanDerPol")]


def real(name):
    path = DATA / "fmi" / name
    if not path.exists():
        pytest.skip(f"not here: {path}")
    return path


def rows_of(path):
    """Times [s], and each output's values, of the default experiment."""
    with zipfile.ZipFile(path) as archive:
        text = archive.read(f"extra/org.fmi-standard.fmi-ls-ref/{path.stem}_out.csv").decode()
    rows = list(csv.reader(io.StringIO(text)))
    table = {name: [cell.split() for cell in column] for name, *column in zip(*rows)}
    return np.array(table.pop("time"), float).ravel(), table


def numbers(cells):
    return np.array([[float({"true": 1, "false": 0}.get(cell, cell)) for cell in row] for row in cells])


@pytest.mark.parametrize("name", [*FILES, "3.0/StateSpace.fmu"])
def test_reference_fmus_give_their_published_rows(name):
    path = real(name)
    times, table = rows_of(path)
    sim = Simulation("reference")
    sim.world.model = world.Fmu(path)
    step = np.diff(times)[0]
    sim.world.task("steps", every=float(step) * s, run=[sim.world.model])
    log = sim.record(sim.world.model.outputs)
    try:
        sim.run(float(times[-1]) * s)
    except RunError as ended:       # Stair ends the simulation where its rows end
        assert path.stem == "Stair" and "ends the simulation" in str(ended)
    there = [output for output in table if hasattr(sim.world.model.outputs, output) and output[:6] != "String"]
    assert there
    for output in there:
        flown = np.asarray(log[f"outputs.{output}"], float)
        published = numbers(table[output])[:len(flown)].reshape(flown.shape)
        np.testing.assert_allclose(flown, published, rtol=1e-12, atol=1e-300, err_msg=output)
