# SPDX-License-Identifier: Apache-2.0
"""The formation as numbers; and each computer on a target of its own, of both byte orders."""

import subprocess
import sys

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.cosim import crossing_wires
from fledge.targets import TARGETS, loop
from fledge.units import minute, s


@pytest.mark.parametrize("scenario", ["commanded", "sensed", "changes"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("formation")
    sim.plots = False
    sim.scenarios[scenario]()


def test_three_computers_and_what_passes_between_them():
    sim = fledge.load("formation")
    assert [(p.name, [t.period / 1e9 for t in p.tasks]) for p in sim.flights] == [
        ("chief_guidance", [1.0]), ("chief", [0.25]), ("deputy", [1.0, 0.5])]
    crossing = {(w.source, w.port): w.latency for w in crossing_wires(sim)
                if not w.source.startswith(("chief_world", "deputy_world"))}
    assert crossing == {
        ("chief_guidance.offset.reference", "chief.base.commanded"): "same_instant",
        ("chief_guidance.vehicle.vehicle", "chief.control.vehicle"): "same_instant",
        ("chief_guidance.wheels.wheels", "chief.control.wheels"): "same_instant",
        ("chief_guidance.wheels.wheels", "chief.motor.wheels"): "same_instant",
        ("chief_guidance.offset.reference", "deputy.base.commanded"): "next_exchange",
        ("chief_guidance.beacon.body", "deputy.look.primary"): "next_exchange",
        ("chief.motor.command", "chief_world.wheels.command"): "next_instant",
        ("deputy.motor.command", "deputy_world.wheels.command"): "next_instant"}


def test_what_the_radio_brings_late_is_carried_to_now():
    sim = fledge.load("formation")
    log = sim.record(sim.process("chief").base.reference, sim.process("deputy").base.reference, every=1 * s)
    sim.run(10 * minute)
    chief, deputy = (log[f"{name}.base.reference.sigma_RN"][5:] for name in ("chief", "deputy"))
    heard = sim.process("deputy").base.commanded
    assert sim.time - heard.head.t / 1e9 == 1.0
    assert np.linalg.norm(heard.omega_RN_N) * 1.0 / 4 > 3e-5        # what it would be off, else
    assert np.abs(chief - deputy).max() < 1e-11


def test_the_beacon_says_where_the_chief_is():
    sim = fledge.load("formation")
    sim.run(20 * minute)
    there, truth = sim.process("deputy").look.primary, sim.process("chief_world").craft.state
    assert np.linalg.norm(there.r_PN_N - truth.r_BN_N) < 1e-3
    way = truth.r_BN_N - sim.process("deputy_world").craft.state.r_BN_N
    assert 5e4 < np.linalg.norm(way) < 1e5


def test_without_the_radio_the_deputy_holds_what_it_heard_last():
    sim = fledge.load("formation")
    sim.run(5 * minute)
    base = sim.process("deputy").base
    before = base.reference.head.t
    base.hold = 0.4         # what the radio brings is older
    sim.run(1 * minute)
    assert base.reference.head.quality == 2 and base.reference.head.t == before


def test_a_dead_camera_leaves_the_deputy_what_it_saw_last():
    sim = fledge.load("formation")
    deputy, camera = sim.process("deputy"), sim.process("deputy_world").camera
    deputy.base.source = "SENSED"
    sim.run(5 * minute)
    assert deputy.base.reference.head.quality == 3
    camera.faults = [{"kind": "DEAD"}]
    sim.run(1 * minute)
    assert camera.seen.head.quality == 2 and camera.seen.head.t == 300e9
    assert deputy.base.reference.head.quality == 2 and deputy.base.reference.head.t < 312e9
    camera.n_faults = 0
    sim.run(1 * minute)
    assert deputy.base.reference.head.quality == 3 and deputy.base.reference.head.t == 420e9


# --- on targets ------------------------------------------------------------------------------------

def test_two_byte_orders_in_one_run_give_the_bits_of_the_desktop(tmp_path, capsys):
    far = "linux" if TARGETS["sparc64"].missing() else "sparc64"
    flown(f"chief=linux,deputy={far}", tmp_path, capsys, ["desktop", "linux", far])


def test_so_does_an_app_of_the_core_flight_system(tmp_path, capsys):
    far = "linux" if TARGETS["aarch64"].missing() else "aarch64"
    flown(f"chief=cfs,deputy={far},chief_guidance=cfs", tmp_path, capsys, ["cfs", "cfs", far])


def flown(on, folder, capsys, targets):
    assert cli.main(["fly", "formation", "--for", "2min", "--on", on, "--out", str(folder)]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if " on " in line]
    desktop, apart = rows[:3], rows[3:]
    assert [row[2] for row in apart] == targets
    assert [(row[0], row[3]) for row in apart] == [("chief_guidance", "121"), ("chief", "481"), ("deputy", "241")]
    assert [row[4] for row in apart] == [row[4] for row in desktop] and all(row[5] == "none" for row in apart)
    assert np.nanmax(np.abs(Archive(folder / "desktop.mcap")["deputy.motor.command.u"])) > 0.1     # it did fly
    records = [str(folder / name) for name in ("desktop.mcap", f"deputy/{targets[2]}.mcap")]
    assert cli.main(["compare", *records, "--topics", "chief"]) == 1                # the deputy's has none of these
    assert cli.main(["compare", *records, "--topics", "deputy"]) == 0


def test_one_computer_joins_a_run_elsewhere_on_its_target(tmp_path):
    """As a node of `fledge up`; the other programs fly the desktop's code."""
    nodes = "".join(f'[[node]]\nmission = "formation"\nprocess = "{name}"\n'
                    for name in ("chief_world", "deputy_world", "chief_guidance", "deputy"))
    (tmp_path / "sim.toml").write_text(f'''
simulation = "formation"
until = 30
{nodes}
[[node]]
name = "chief"
command = ["{sys.executable}", "-m", "fledge.cli", "fly", "formation", "--on", "chief=linux", "--join", "--out", "fly"]
''')
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", "sim.toml"], cwd=tmp_path, capture_output=True,
                          text=True, timeout=120, env=loop.environment())
    assert done.returncode == 0, done.stdout + done.stderr
    sim = fledge.load("formation")
    sim.record(*sim.process("chief"), every=0.25 * s)
    sim.archive(tmp_path / "desktop.mcap")
    sim.run(30 * s)
    sim.close_archive()
    desktop, linux = Archive(tmp_path / "desktop.mcap"), Archive(tmp_path / "fly/chief/linux.mcap")
    assert len(linux.topics) == 5 and compare(desktop, linux) == []


def test_a_change_between_runs_reaches_the_deputy_on_its_target(tmp_path, capsys):
    """Over the moment at which the scenario chooses the camera."""
    assert cli.main(["fly", "formation", "changes", "--for", "31min", "--on", "deputy=linux", "--out",
                     str(tmp_path)]) == 0, capsys.readouterr()
    with Archive(tmp_path / "deputy/linux.mcap") as record:
        accelerations = np.abs(record["base.reference.domega_RN_N"]).max(axis=1)
        late = record.time("base.reference") > 1800
        assert accelerations[~late][10:].min() > 0 and accelerations[late].max() == 0     # a camera sees none


def test_it_reaches_the_deputy_on_the_code_of_the_desktop_too(tmp_path, capsys):
    assert cli.main(["fly", "formation", "changes", "--for", "31min", "--on", "chief=linux", "--out",
                     str(tmp_path)]) == 0, capsys.readouterr()
    with Archive(tmp_path / "deputy/node.mcap") as record:
        assert not record["base.reference.domega_RN_N"][-1].any()
