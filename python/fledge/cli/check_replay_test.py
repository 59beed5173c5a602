# SPDX-License-Identifier: Apache-2.0
"""`fledge run --check-replay`: what depends on more than seed and parameters is found and named."""

import re
import textwrap

import pytest

from fledge import Archive, cli
from tests.circles import long_after

FLIGHT = """
    import os, random, time
    from fledge import flight as fsw, prototype
    from fledge.prototype import input, mem, out
    from fledge.units import s

    class Slew(prototype.Module):
        "Turns about an axis."
        reference = out(fsw.AttReference)
        angle     = mem(float, "[rad] of the turn")

        def update(self, t, dt):
            self.angle = 0.01 * t
            if t >= 2:
                self.angle += {what}
            self.reference.sigma_RN = [0, 0, self.angle]
            self.publish(self.reference)

    def build(f):
        f.vehicle = fsw.VehicleConfig(I_B=[1, 1, 1])
        f.slew = Slew()
        f.spin = fsw.EulerRotation(rates=[0, 0, 0.1])
        f.connect(f.slew.reference >> f.spin.base)
        f.task("gnc", every=0.5 * s, run=[f.slew, f.spin])
"""
WORLD = """
    from fledge import Orbit, world

    def build(w, f):
        w.craft = world.Spacecraft(I_B=3, gravity=[world.EARTH], orbit=Orbit(world.EARTH, altitude=500e3))
        w.nav = world.Navigation(attitude_noise=[1e-5, 1e-5, 1e-5])
        w.connect(w.craft.state >> w.nav.truth)
        w.task("dynamics", every=0.25, run=[w.craft, w.nav])
"""
SCENARIOS = '''
    import os
    from fledge.units import s

    def short(sim):
        """A few seconds, twice, and once more from the start."""
        log = sim.record(sim.flight.slew.reference, every=1 * s)
        sim.run(3 * s)
        sim.flight.spin.rates = [0, 0.1, 0]
        sim.run(2 * s)
        sim.reset()
        sim.run(4 * s)
        assert len(log) == 5

    def wrong(sim):
        """Fails each time."""
        sim.run(1 * s)
        assert False, "as ever"

    def moody(sim):
        """Fails without a variable."""
        sim.run(1 * s)
        assert "MOOD" in os.environ, "in no mood"

    def early(sim):
        """Fails before it flies."""
        assert False, "no flight"
'''


@pytest.fixture
def mission(tmp_path, monkeypatch):
    """Write a mission that adds something to an angle from 2 s on, and fly it from its folder's parent."""
    monkeypatch.chdir(tmp_path)

    def make(what="0"):
        folder = tmp_path / "missions/turn"
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in (("flight", FLIGHT.replace("{what}", what)), ("world", WORLD), ("scenarios", SCENARIOS)):
            (folder / f"{name}.py").write_text("# SPDX-License-Identifier: Apache-2.0\n" + textwrap.dedent(text))
        return tmp_path

    return make


def test_a_run_that_is_the_same_again_passes(mission, capsys):
    place = mission()
    assert cli.main(["run", "turn", "--check-replay"]) == 0
    output = capsys.readouterr().out
    assert re.search(r"\n  replay   the same bits again: 7 outputs, \d\d\d messages\n", output), output
    assert not (place / "runs/turn/short/replay").exists()
    assert len(list((place / "runs").rglob("*.mcap"))) == 2      # the run's own, of which one is before its reset


@pytest.mark.parametrize("what", long_after(2, [
    "1e-9 * (time.monotonic_ns() % 1000003)", "os.urandom(1)[0] + 256 * os.urandom(1)[0]", "1e-9 * id(object())",
    "len(os.environ)", 'float(os.environ.get("GAIN", "0"))', 'hash("a word") % 1000003'],
    "flies twice for another reason"))
def test_what_reads_more_than_it_may_is_named(mission, monkeypatch, capsys, what):
    place = mission(what)
    monkeypatch.setenv("GAIN", "7")
    assert cli.main(["run", "turn", "--check-replay"]) == 1
    captured = capsys.readouterr()
    line = (place / "missions/turn/flight.py").read_text().splitlines().index("class Slew(prototype.Module):") + 1
    assert re.search(r"fledge: turn, short: a second flight differs: t = 2 s  flight.slew.reference.sigma_RN\[2\]: "
                     rf"\S+ and \S+ .*\(class Slew, flight.py, line {line}\); a run depends on its seed and parameters "
                     "alone, so look there for a clock", captured.err), captured.err
    first, second = (Archive(place / f"runs/turn/short/replay/{flight}/outputs.mcap") for flight in ("first", "second"))
    assert (first["slew.reference.sigma_RN"][:4] == second["slew.reference.sigma_RN"][:4]).all()
    assert "replay" not in captured.out
    # The next check does not meet what is left of this one.
    mission()
    assert cli.main(["run", "turn", "--check-replay"]) == 0


def test_a_run_that_fails_must_fail_again(mission, monkeypatch, capsys):
    mission()
    assert cli.main(["run", "turn", "wrong", "--check-replay"]) == 1
    captured = capsys.readouterr()
    assert "replay   the same bits again" in captured.out
    assert "as ever" in captured.err and "differs" not in captured.err
    assert cli.main(["run", "turn", "early", "--check-replay"]) == 1
    assert "no flight" in capsys.readouterr().err
    monkeypatch.setenv("MOOD", "good")
    assert cli.main(["run", "turn", "moody", "--check-replay"]) == 1
    assert re.search("a second flight differs: it ended with code 0 the first time, and with 1 the second: .*no mood",
                     capsys.readouterr().err)
    assert cli.main(["run", "turn", "moody"]) == 0


def test_all_outputs_are_recorded_where_they_change(mission, tmp_path, capsys):
    mission()
    assert cli.main(["run", "turn", "--for", "10s", "--outputs", "all.mcap"]) == 0
    with Archive(tmp_path / "all.mcap") as archive:
        assert list(archive.topics) == ["/world/craft/state", "/world/nav/attitude", "/world/nav/orbit",
                                        "/flight/vehicle/vehicle", "/flight/slew/reference", "/flight/spin/reference",
                                        "/flight/spin/euler"]
        counts = {topic: channel.count for topic, channel in archive.topics.items()}
        assert counts["/world/craft/state"] == 41 and counts["/flight/slew/reference"] == 21
        assert counts["/flight/vehicle/vehicle"] == 1
    assert cli.main(["run", "turn", "--for", "1s", "--outputs", "x", "--check-replay"]) == 2
    assert cli.main(["run", "turn", "--for", "1s", "--outputs", "no/where.mcap"]) == 1
    assert "no/where.mcap" in capsys.readouterr().err
