# SPDX-License-Identifier: Apache-2.0
"""FMUs as nodes of `fledge up`: in the place of a process, alone, and how a run ends by what they do."""
import os
import subprocess
import sys
from pathlib import Path

import pytest

import fledge
from fledge.archive import Archive
from fledge.cosim.up.description import SimError, read
from fledge.cosim.up.testing import BUILT
from fledge.export.fmu import build
from fledge.export.fmu.mission import flight_fmu
from fledge.targets import TARGETS
from fmi.testing import oscillator

pytestmark = pytest.mark.skipif(not (BUILT / "fledge_controller").exists(), reason="the controller is not built")


def up(folder: Path, text: str, name: str = "run", code: int = 0, **env: str) -> str:
    """What `fledge up` prints for a file."""
    (folder / f"{name}.toml").write_text(text)
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", f"{name}.toml"], cwd=folder, text=True,
                          timeout=120, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**os.environ, **env})
    assert done.returncode == code, done.stdout
    return done.stdout


def messages(file: Path) -> dict[str, tuple[list, list]]:
    with Archive(file) as archive:
        return {topic: (list(archive.time_ns(topic)), list(archive.contents(topic))) for topic in archive.topics}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build.export(flight_fmu(fledge.load("nadir_spin")), tmp_path_factory.mktemp("fmu") / "flight.fmu")


def test_in_the_place_of_flight_the_record_is_that_of_flight_also_after_it_was_killed(tmp_path, flight):
    text = 'mission = "nadir_spin"\nuntil = 60\n'
    up(tmp_path, text, "modules")
    text += f'[[node]]\nname = "flight"\nfmu = "{flight}"\n'
    up(tmp_path, text, "fmu")
    up(tmp_path, f'{text}on_loss = "restart"\nkilled = 30\nsave_every = 10\n', "killed")
    record = messages(tmp_path / "runs/modules/flight.mcap")
    assert record and record == messages(tmp_path / "runs/fmu/flight.mcap")
    assert record == messages(tmp_path / "runs/killed/flight.mcap")


def test_alone_it_steps_with_the_world_of_its_mission(tmp_path, flight):
    """The message that it writes to the world is that of the process, so the world is, too."""
    world = '[[node]]\nmission = "nadir_spin"\nprocess = "world"\nfree = true\n'
    rest = f'until = 60\n{world}[[node]]\nname = "flight"\n'
    up(tmp_path, f'{rest}mission = "nadir_spin"\n', "process")
    up(tmp_path, f'{rest}fmu = "{flight}"\nevery = 0.5\nlatency = "same_instant"\n', "alone")
    record = messages(tmp_path / "runs/process/world.mcap")
    assert record and record == messages(tmp_path / "runs/alone/world.mcap")


def test_two_alone_join_by_messages_with_given_types(tmp_path):
    text = oscillator.description(2).replace('modelName="Oscillator"', 'modelName="Other"')
    other = oscillator.make(tmp_path, 2, text, "other.fmu")
    oscillator.make(tmp_path)
    up(tmp_path, f"""until = 2
        [[node]]
        name = "left"
        fmu = "oscillator.fmu"
        every = 0.1
        reads = {{ push = "/right/fmu/outputs" }}
        messages.push = {{ type = "{other.name}", x = "in.f32" }}
        [[node]]
        name = "right"
        fmu = "{other.name}"
        every = 0.1
        parameters = {{ omega = 3, x0 = 0.5 }}
        """)
    with Archive(tmp_path / "runs/run/left.mcap") as left, Archive(tmp_path / "runs/run/right.mcap") as right:
        assert left["left.fmu.outputs.out_f32"][-1] == pytest.approx(right["right.fmu.outputs.x"][-2], rel=1e-6)


@pytest.mark.parametrize("fault, says", [
    pytest.param("segv DoStep 0.5", "segmentation fault (SIGSEGV) in fmi3DoStep of oscillator.fmu",
                 marks=oscillator.CRASH),
    ("error DoStep 0.5", "left.fmu (oscillator.fmu): fmi3DoStep answers with an error at t = 0.5 s"),
    ("endless DoStep 0.5", "in fmi3DoStep of oscillator.fmu: it has taken longer than 1 s"),
    ("nothing DoStep 0.5", "no step from t = 0.5 s of the FMU comes to 0.6 s"),
    ("nothing Instantiate", "left.fmu (oscillator.fmu)")])
def test_a_fault_ends_the_node_alone_and_the_end_names_it(tmp_path, fault, says):
    oscillator.make(tmp_path)
    out = up(tmp_path, f"""until = 2
        [[node]]
        name = "left"
        fmu = "oscillator.fmu"
        every = 0.1
        on_loss = "hold"
        step_timeout = 1
        env = {{ OSCILLATOR = "{fault}" }}
        [[node]]
        name = "right"
        fmu = "oscillator.fmu"
        every = 0.1
        """, code=1)
    assert says in out + (tmp_path / "runs/run/log/left.log").read_text(), out
    if "Instantiate" not in fault:
        with Archive(tmp_path / "runs/run/right.mcap") as right:
            assert right.time("/right/fmu/outputs")[-1] == pytest.approx(2.0)


def test_mistakes_in_the_file_have_their_line(tmp_path):
    oscillator.make(tmp_path)
    (tmp_path / "broken.fmu").write_text("no archive")
    node = '[[node]]\nname = "left"\n'
    for text, says in ((f'{node}fmu = "none.fmu"\nevery = 1', "4: an FMU can be flown; "),
                       (f'{node}fmu = "broken.fmu"\nevery = 1', "4: an FMU can be flown; "),
                       (f'{node}fmu = "oscillator.fmu"', "every"),
                       (f'{node}fmu = "oscillator.fmu"\nevery = 1\nreads = {{ x = 3 }}', "`reads` has topics"),
                       (f'{node}fmu = "oscillator.fmu"\nevery = 1\nlatency = "soon"', "latency"),
                       (f'{node}fmu = "oscillator.fmu"\nevery = 1\nparameters = {{ omga = 3 }}', "omga"),
                       (f'{node}command = ["sh"]\nevery = 1', "`every` is of an `fmu` alone"),
                       (f'{node}command = ["sh"]\nfmu = "oscillator.fmu"\nevery = 1', "a program is a `mission`"),
                       ('[[node]]\nmission = "nadir_spin"\nprocess = "flight"\nfmu = "oscillator.fmu"\nevery = 1',
                        "`every` is of an `fmu` alone"),
                       ('[[node]]\nmission = "nadir_spin"\nprocess = "flight"\nfmu = "oscillator.fmu"\n'
                        'target = "linux"', "a target or an FMU flies a process")):
        (tmp_path / "sim.toml").write_text(f"until = 1\n{text}\n")
        with pytest.raises(SimError) as error:
            read(tmp_path / "sim.toml", TARGETS)
        assert says in str(error.value) and str(error.value).count("\n") == 0, str(error.value)
