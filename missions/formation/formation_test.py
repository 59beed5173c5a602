# SPDX-License-Identifier: Apache-2.0
"""The formation as numbers; and each computer on a target of its own, of both byte orders."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge import flight as fsw
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.attitude import mrp_to_dcm
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
    commanded = sim.process("deputy").base.commanded
    assert sim.time - commanded.head.t / 1e9 == 1.0
    assert np.linalg.norm(commanded.omega_RN_N) * 1.0 / 4 > 3e-5        # what it would be off, else
    assert np.abs(chief - deputy).max() < 1e-11


def test_the_beacon_says_where_the_chief_is():
    sim = fledge.load("formation")
    sim.run(20 * minute)
    there, truth = sim.process("deputy").look.primary, sim.process("chief_world").craft.state
    assert np.linalg.norm(there.r_PN_N - truth.r_BN_N) < 1e-3
    way = truth.r_BN_N - sim.process("deputy_world").craft.state.r_BN_N
    assert 5e4 < np.linalg.norm(way) < 1e5


def test_without_the_radio_the_deputy_holds_what_it_received_last():
    sim = fledge.load("formation")
    sim.run(5 * minute)
    base = sim.process("deputy").base
    before = base.reference.head.t
    base.hold = 0.4         # what the radio brings is older
    sim.run(1 * minute)
    assert base.reference.head.quality.name == "DEGRADED" and base.reference.head.t == before


@pytest.mark.long("flies several spacecraft twice")
@pytest.mark.parametrize("scenario", ["commanded", "sensed"])
def test_several_deputies_fly_what_one_flies(scenario):
    sim = fledge.load("formation", deputies=3)
    sim.plots = False
    sim.scenarios[scenario]()
    roll = sim.process("chief_guidance").roll.state
    assert roll.heard == 0b111 and roll.lost == 0 and list(roll.age[:4]) == [1, 1, 1, 0]
    assert sim.process("deputy2").roll.state.heard == 0b101      # a deputy does not hear itself
    with pytest.raises(fledge.SetupError, match="the scenario changes is of one deputy"):
        sim.clone().scenarios["changes"]()


@pytest.mark.parametrize("wrong", [0, 9, 1.5, "two"])
def test_a_number_that_is_no_formation_is_refused(wrong):
    with pytest.raises(fledge.SetupError, match="deputies(: expected .* from 1 to 8;| is a number, as 1;) found"):
        fledge.load("formation", deputies=wrong)


def test_a_dead_camera_leaves_the_deputy_what_it_saw_last():
    sim = fledge.load("formation")
    deputy, camera = sim.process("deputy"), sim.process("deputy_world").camera
    deputy.base.source = "SENSED"
    sim.run(5 * minute)
    assert deputy.base.reference.head.quality.name == "GOOD"
    camera.faults = [{"kind": "DEAD"}]
    sim.run(1 * minute)
    assert camera.seen.head.quality.name == "DEGRADED" and camera.seen.head.t == 300e9
    assert deputy.base.reference.head.quality.name == "DEGRADED" and deputy.base.reference.head.t < 312e9
    camera.n_faults = 0
    sim.run(1 * minute)
    assert deputy.base.reference.head.quality.name == "GOOD" and deputy.base.reference.head.t == 420e9


# --- as programs -----------------------------------------------------------------------------------

def up(folder, file, *words):
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", str(file), *words], cwd=folder,
                          capture_output=True, text=True, env=loop.environment())
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def flown_in_one(path, scenario, **parameters):
    """The record of `fledge run`."""
    assert cli.main(["run", "formation", scenario, "--no-plots", "--out", str(path),
                     *(word for name, value in parameters.items() for word in ("--set", f"{name}={value}"))]) == 0
    return Archive(path / "run.mcap")


HERE = Path(__file__).parent


@pytest.mark.long("a co-simulation of many programs")
def test_the_programs_of_the_thesis_fly_what_one_program_flies(tmp_path, capsys):
    file = HERE / "formation.toml"
    if TARGETS["aarch64"].missing():
        file = tmp_path / "formation.toml"
        file.write_text((HERE / "formation.toml").read_text().replace("aarch64", "linux"))
    output = up(tmp_path, file, "--report")
    assert output.startswith("formation: 5 nodes, 6000 s\n") and output.endswith("\n  passed\n")
    run = tmp_path / "runs/formation"
    judged, whole = Archive(run / "report/run.mcap"), flown_in_one(tmp_path / "one", "commanded")
    assert len(whole.topics) == 10 and compare(whole, judged) == []
    assert {file.name for file in (run / "report").glob("*.png")} == {
        "formation_deputy_commanded.png", "formation_deputy_commanded_plane.png"}

    # And sensed, for two minutes, by what each program has recorded.
    up(tmp_path, file, "sensed", "--until", "2min")
    whole = flown_in_one(tmp_path / "one", "sensed")
    for name in ("deputy_world", "chief_world", "chief"):
        apart = Archive(run / f"{name}.mcap")
        assert apart.topics and compare(whole, apart, apart.topics, times=lambda t: t <= 120 * 10**9) == []


def momentum_misfit(record, name, after):
    """[N m s] How far the angular momentum is from constant in N, by a fit of what the wheels hold in B."""
    late = record.time(f"{name}_world.craft.state") > after
    state = record[f"{name}_world.craft.state"][late]
    BN = mrp_to_dcm(state["sigma_BN"])
    h_N = np.einsum("nji,nj->ni", BN, state["omega_BN_B"] * [700, 700, 800]).ravel()
    unknown = np.concatenate([np.swapaxes(BN, 1, 2), -np.broadcast_to(np.eye(3), BN.shape)], axis=2).reshape(-1, 6)
    return np.abs(unknown @ np.linalg.lstsq(unknown, -h_N, rcond=None)[0] + h_N).max()


@pytest.mark.long("a co-simulation of many programs")
def test_a_lost_and_a_late_deputy_disturb_no_other(tmp_path, capsys):
    """As fleet.toml, with three deputies."""
    text = (HERE / "fleet.toml").read_text()
    for old, new in (("deputies = 8", "deputies = 3"), ("deputy3", "deputy2"), ("deputy6", "deputy3")):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "fleet.toml").write_text(text)
    output = up(tmp_path, "fleet.toml", "--report")
    assert "deputy2 is killed at 3300 s, as the file says" in output and output.endswith("\n  passed\n")
    judged, whole = (Archive(tmp_path / "runs/fleet/report/run.mcap"),
                     flown_in_one(tmp_path / "one", "commanded", deputies=3))

    def same(topic, until=1e9):
        early = whole.time(topic) <= until
        return (whole.raw[topic][early].tobytes() == judged.raw[topic][judged.time(topic) <= until].tobytes())

    # The others fly as in a run in which all is well; so does the lost deputy, until it is lost.
    for topic in whole.topics:
        if topic.split("/")[1] in ("chief", "chief_world", "deputy1_world") or \
                topic.startswith("/deputy1/") and "roll" not in topic:
            assert same(topic), topic
    for topic in ("/deputy2_world/craft/state", "/deputy2/scan/reference", "/deputy2/motor/command"):
        assert same(topic, until=3300) and not same(topic)
    # Then its wheels get no more torque, so that nothing changes its momentum.
    assert momentum_misfit(judged, "deputy2", after=3301) < 1e-12
    assert momentum_misfit(judged, "deputy1", after=3301) > 0.1

    # What the others see of the two: nothing of the late one for ten minutes, nothing of the lost one from then on.
    for name, own in (("chief_guidance", 0), ("deputy1", 1), ("deputy3", 4)):
        t, roll = judged.time(f"{name}.roll.state"), judged[f"{name}.roll.state"]
        written = roll["head"]["quality"] > fsw.Quality.NONE
        for begin, end, present, lost in ((5, 600, 0b011, 0), (605, 3301, 0b111, 0), (3302, 6601, 0b101, 0b010)):
            now = roll[(t >= begin) & (t < end) & written]
            if len(now):
                assert set(now["heard"]) == {present & ~own} and set(now["lost"]) == {lost}
        assert roll["age"][-1][1] == 3300
    assert not (roll["head"]["quality"][t <= 600]).any() and written[t > 600].all()


@pytest.mark.long("a co-simulation for each answer to a loss")
@pytest.mark.parametrize("policy, seen", [("drop", 12), ("hold", 14), ("restart", None)])
def test_what_the_chief_sees_of_a_lost_deputy_is_declared(policy, seen, tmp_path):
    """Nothing from its next second on; its last message, until the wire calls it stale; or no loss. Each time."""
    (tmp_path / "two.toml").write_text(f'''
mission = "formation"
parameters = {{ deputies = 2 }}
until = 20
exchange = true
[[node]]
process = "deputy1"
killed = 10
on_loss = "{policy}"
[[node]]
process = "deputy2"
joins = 5
''')
    up(tmp_path, "two.toml")
    record = Archive(tmp_path / "runs/two/chief_guidance.mcap")
    t, roll = record.time("roll.state"), record["roll.state"]
    assert [next((when for when, bits in zip(t, roll["lost"]) if bits >> i & 1), None) for i in (0, 1)] == [seen, None]
    assert next(when for when, bits in zip(t, roll["heard"]) if bits & 2) == 7      # its first second, a second later
    assert t[-1] == 20 and list(roll["age"][-1][:2]) == [10 if seen else 1, 1]
    up(tmp_path, "two.toml", "--out", "again")
    assert compare(*(Archive(tmp_path / folder / "exchange.mcap") for folder in ("runs/two", "again"))) == []


def test_a_report_is_of_a_whole_mission(tmp_path):
    (tmp_path / "part.toml").write_text('mission = "formation"\nuntil = 60\n')
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", "part.toml", "--report"], cwd=tmp_path,
                          capture_output=True, text=True, env=loop.environment())
    assert (done.returncode, done.stderr) == (2, "fledge: part.toml: a report is of a whole scenario, 6000 s; the run "
                                              "ends at 60 s\n")


# --- on targets ------------------------------------------------------------------------------------

@pytest.mark.long("builds and flies on two targets")
def test_two_byte_orders_in_one_run_give_the_bits_of_the_desktop(tmp_path, capsys):
    far = "linux" if TARGETS["sparc64"].missing() else "sparc64"
    flown(f"chief=linux,deputy={far}", tmp_path, capsys, ["desktop", "linux", far])


@pytest.mark.long("builds and flies on two targets")
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


@pytest.mark.long("builds and flies on a target")
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
                          text=True, env=loop.environment())
    assert done.returncode == 0, done.stdout + done.stderr
    sim = fledge.load("formation")
    sim.record(*sim.process("chief"), every=0.25 * s)
    sim.archive(tmp_path / "desktop.mcap")
    sim.run(30 * s)
    sim.close_archive()
    desktop, linux = Archive(tmp_path / "desktop.mcap"), Archive(tmp_path / "fly/chief/linux.mcap")
    assert len(linux.topics) == 5 and compare(desktop, linux) == []


@pytest.mark.long("builds and flies on a target")
def test_a_change_between_runs_reaches_the_deputy_on_its_target(tmp_path, capsys):
    """Over the moment at which the scenario chooses the camera."""
    assert cli.main(["fly", "formation", "changes", "--for", "31min", "--on", "deputy=linux", "--out",
                     str(tmp_path)]) == 0, capsys.readouterr()
    with Archive(tmp_path / "deputy/linux.mcap") as record:
        accelerations = np.abs(record["base.reference.domega_RN_N"]).max(axis=1)
        late = record.time("base.reference") > 1800
        assert accelerations[~late][10:].min() > 0 and accelerations[late].max() == 0     # a camera sees none


@pytest.mark.long("a co-simulation")
def test_it_reaches_the_deputy_on_the_code_of_the_desktop_too(tmp_path, capsys):
    assert cli.main(["fly", "formation", "changes", "--for", "31min", "--on", "chief=linux", "--out",
                     str(tmp_path)]) == 0, capsys.readouterr()
    with Archive(tmp_path / "deputy/node.mcap") as record:
        assert not record["base.reference.domega_RN_N"][-1].any()
