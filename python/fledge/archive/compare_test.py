# SPDX-License-Identifier: Apache-2.0
"""Two records compared: all differences are named, and nothing else."""

import math
import struct

import pytest

import fledge
from fledge import cli
from fledge.archive import Archive, ArchiveError
from fledge.archive.compare import STRUCTURE, compare, digest, origins


def fly(path, change=None, duration=20.0, every=1.0, ports=None):
    sim = fledge.load("nadir_spin")
    f = sim.flight
    sim.record(*(ports(f) if ports else (f.tracking.error, f.motor.command)), every=every)
    if change:
        change(sim)
    sim.archive(path)
    sim.run(duration)
    sim.close_archive()
    return Archive(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("runs") / "a.mcap")


def test_the_same_run_is_the_same(run, tmp_path, capsys):
    again = fly(tmp_path / "b.mcap")
    assert compare(run, again) == []
    assert digest(run, run.topics) == digest(again, again.topics)
    assert cli.main(["compare", str(run.path), str(again.path)]) == 0
    assert capsys.readouterr().out == f"identical: 2 topics, 42 messages in each, hash {digest(run, run.topics)}\n"


def test_the_first_difference_is_named_with_both_values(run, tmp_path, capsys):
    other = fly(tmp_path / "b.mcap", lambda sim: setattr(sim.flight.control, "K", math.nextafter(2.531, 3)))
    first = compare(run, other)[0]
    assert (first.topic, first.t) == ("flight.motor.command", 0)
    i = int(first.name[2])
    a, b = run["command.u"][0, i], other["command.u"][0, i]
    assert first.name == f"u[{i}]" and (first.a, first.b) == (a, b) and a != b
    steps = abs(struct.unpack("<q", struct.pack("<d", a))[0] - struct.unpack("<q", struct.pack("<d", b))[0])
    assert first.ulps == steps and first.worst >= abs(a - b) and 1 <= first.count <= first.total == 21
    assert digest(run, run.topics) != digest(other, other.topics)
    assert cli.main(["compare", str(run.path), str(other.path)]) == 1
    out = capsys.readouterr().out.splitlines()
    assert out[2:5] == ["what the runs began with", "  flight.control.K: 2.531 N m and 2.5310000000000006 N m",
                        "messages"]
    assert out[5].startswith(f"  t = 0 s  flight.motor.command.u[{i}]: {float(a)!r} and {float(b)!r} N m, {steps} ulp")
    assert cli.main(["compare", str(run.path), str(other.path), "--tolerance", "1"]) == 0
    assert cli.main(["compare", str(run.path), str(other.path), "--tolerance", "0", "--all"]) == 1
    assert " of 21 messages, by up to " in capsys.readouterr().out


def test_differences_in_set_ups_are_reported_apart_from_those_in_values(run, tmp_path, capsys):
    def differ(sim):
        sim.world.wheels.Omega_max[1] = 900      # which these runs do not reach
        sim.seed = 5

    other = fly(tmp_path / "b.mcap", differ)
    other.metadata["revisions"] = {"fledge": "0123456789ab"}
    run.metadata["revisions"] = {"fledge": "ba9876543210-dirty"}
    assert origins(run, run) == []
    assert origins(run, other) == [("seed", "0", "5"), ("revision of fledge", "ba9876543210-dirty", "0123456789ab"),
                                   ("world.wheels.Omega_max[1]", "0.0 rad/s", "900.0 rad/s")]
    assert digest(run, run.topics) == digest(other, other.topics)
    assert cli.main(["compare", str(run.path), str(other.path)]) == 0
    out = capsys.readouterr().out
    assert out.startswith("identical: ") and "  world.wheels.Omega_max[1]: 0.0 rad/s and 900.0 rad/s\n" in out
    assert "messages\n" not in out
    other.metadata = {"run": {"target": "linux"}}       # of a target, which knows less
    assert origins(run, other) == origins(other, run) == []
    other.metadata = {"run": {"parameters": "stiffness=0.4"}}
    assert origins(run, other) == [("parameters", "none", "stiffness=0.4")]


def changed(run, topic, change):
    """The run once more, with other values in a topic."""
    other = Archive(run.path)
    values = other[topic].copy()
    change(values)
    other._decoded["/" + topic.replace(".", "/")] = values
    return other


def test_enumerators_have_their_names(run):
    def worse(values):
        values["head"]["quality"][7:] = 2

    found = compare(run, changed(run, "flight.tracking.error", worse))
    assert [str(d) for d in found] == ["t = 7 s  flight.tracking.error.head.quality: 'GOOD' and 'DEGRADED'"]
    assert (found[0].count, found[0].total) == (14, 21)
    assert compare(run, changed(run, "flight.tracking.error", worse), ignore=["quality"]) == []


def test_missing_shorter_and_later_topics(run, tmp_path):
    short = fly(tmp_path / "short.mcap", duration=15.0)
    found = compare(run, short)
    assert [(d.topic, d.t, d.what) for d in found] == [
        (t, 16 * 10**9, f"5 more messages in {run.path}, from here to 20 s")
        for t in ("flight.tracking.error", "flight.motor.command")]
    slower = fly(tmp_path / "slower.mcap", every=2.0)
    assert {(d.t, d.what) for d in compare(run, slower)} == {
        (10**9, f"a message only in {run.path}; from here on the two have other times")}
    other = fly(tmp_path / "other.mcap", ports=lambda f: (f.tracking.error, f.spin.euler))
    assert [(d.topic, d.t, d.what) for d in compare(run, other)] == [
        ("flight.motor.command", STRUCTURE, f"only in {run.path}, 21 messages"),
        ("flight.spin.euler", STRUCTURE, f"only in {other.path}, 21 messages")]
    assert compare(run, other, ["tracking.error"]) == []
    with pytest.raises(ArchiveError, match="there is no topic tracking.eror; there are flight.motor.command"):
        compare(run, other, ["tracking.eror"])


@pytest.mark.parametrize("old, new, ulps", [(1.0, math.nan, None),
                                            (0.0, -0.0, 0), (-5e-324, 5e-324, 2), (1.0, 2.0, 2**52)])
def test_numbers_are_looked_at_as_bits(run, old, new, ulps):
    def put(value):
        def change(values):
            values["u"][3:, 1] = value
        return change

    first, second = (changed(run, "flight.motor.command", put(v)) for v in (old, new))
    differences = compare(first, second)
    assert [(d.name, d.t, d.count, d.ulps) for d in differences] == [("u[1]", 3 * 10**9, 18, ulps)]
    assert (repr(differences[0].a), repr(differences[0].b)) == (repr(old), repr(new))
    assert compare(first, changed(run, "flight.motor.command", put(old))) == []


def test_a_wrong_name_is_refused(run, capsys):
    assert cli.main(["compare", str(run.path), "no_such_run"]) == 2
    assert "there is no record 'no_such_run'" in capsys.readouterr().err
    assert cli.main(["compare", str(run.path), str(run.path), "--topics", "x"]) == 2
