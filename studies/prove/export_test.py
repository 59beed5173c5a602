# SPDX-License-Identifier: Apache-2.0
"""The executive of a mission in three modes is proved; what is planted into it is found."""

import dataclasses
from pathlib import Path

import pytest

import fledge
from fledge import export, prove
from fledge.cli import main
from fledge.prove import eva
from fledge.prove import export as executive
from fledge.prove.sources import Tree
from tests.circles import long_after
from tests.needs import needs

pytestmark = needs("frama-c-base")

FLIGHT = '''
"""Follow a spin in some modes."""
from fledge import flight as fsw
from fledge.units import N, m, ms, s


def build(f):
    f.spin     = fsw.InertialPointing(sigma_RN=[0, 0.1, 0])
    f.tracking = fsw.TrackingError(hold=2 * s)
    f.connect(f.spin.reference >> f.tracking.reference)
    f.task("turn", every=700 * ms, run=[f.spin])
    f.task("track", every=100 * ms, offset=1.2 * s, run=[f.tracking])
    f.mode("wait", [])
    f.mode("point", ["turn", "track"])
    f.start_in("wait")
    error = f.watch(f.tracking.error)
    f.event("start", when=error.sigma_BR.norm() < 0.05, hold=7.3 * s, enter="point",
            set=[(f.watch(f.tracking).hold, 3 * s)])
'''
WORLD = '''
from fledge import Orbit, world
from fledge.units import kg, km, m


def build(w, f):
    w.craft = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, gravity=[world.MARS],
                               orbit=Orbit(world.MARS, a=7471.618 * km))
    w.nav   = world.Navigation()
    w.connect(w.craft.state >> w.nav.truth, w.nav.attitude >> f.tracking.attitude)
    w.task("dynamics", every=0.1, run=[w.craft, w.nav])
'''

# What is planted into one program: (text, text in its place); the kind of an alarm, and of what function.
FAULTS = {
    "that stop it": [("100000000, 1200000000}", "0, 1200000000}", "division by zero", "exec_on_grid")],
    "that are small": [
        ("m->tracking.in.reference = m->spin.out.reference",
         "m->tracking.in.reference = (&m->spin.out.reference)[m->in.nav_attitude.head.sequence]",
         "pointer out of range", "run_track"),
        ("m->tracking.par.hold = 3.0", "m->tracking.par.hold = -3.0", "assertion", "within_tracking_error"),
        ("m->tracking.in.attitude = m->in.nav_attitude;",
         "m->tracking.in.attitude.head.quality = (Quality)(m->in.nav_attitude.head.quality * 2);", "assertion",
         "tracking_error_update")],
}


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("follow")
    (folder / "flight.py").write_text(FLIGHT)
    (folder / "world.py").write_text(WORLD)
    return folder


@pytest.fixture(scope="module")
def program(mission: Path) -> eva.Program:
    return executive.program(Tree.of(None), export.read(fledge.load(str(mission))))


def test_an_executive_is_proved(program: eva.Program) -> None:
    """Most of its statements are reached, all but those of commands, and its loops have bounds."""
    result = eva.analyse(program)
    assert not result.alarms
    assert result.loops and all(bound is not None for _, bound in result.loops)
    assert result.reached > 0.85 * result.statements


@pytest.mark.parametrize("faults", long_after(1, sorted(FAULTS), "an analysis: 5 s"))
def test_planted_faults_are_found(faults: str, program: eva.Program) -> None:
    texts = dict(program.texts)
    for old, new, _, _ in FAULTS[faults]:
        name, = (name for name in texts if name.endswith(".c") and old in texts[name])
        texts[name] = texts[name].replace(old, new)
    found = {(alarm.kind, alarm.function) for alarm in eva.analyse(dataclasses.replace(program, texts=texts)).alarms}
    assert {(kind, function) for _, _, kind, function in FAULTS[faults]} <= found


@pytest.mark.long("analyses of minutes")
@pytest.mark.parametrize("name", ["cubesat", "flatsat", "mars_orbiter", "nadir_spin", "sun_gazer", "sun_safe"])
def test_the_executives_of_missions_stay_proved(name: str) -> None:
    """With modes, events and their settings, services, choices of wires, and many modules."""
    result = executive.prove_export(export.read(fledge.load(name)))
    assert [*result.left, *result.endless] == []


def test_the_command_proves_modules_or_an_executive(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", "MrpFeedback", "--export", "nadir_spin"]) == 2
    assert main(["prove", "--process", "flight"]) == 2
    words = capfd.readouterr().err
    assert "prove modules by another command" in words and "--process is for --export MISSION" in words
