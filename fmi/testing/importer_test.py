# SPDX-License-Identifier: Apache-2.0
"""The importer in C and the oscillator, each by the other, and by the closed form."""

import math
import os
import struct
from pathlib import Path

import pytest

from fmi.testing import oscillator
from fmi.testing.flying import Failed, Place, Plan, hashes

X, V, FORCE, OMEGA, X0, LONGEST, EVERY = (Place(i, "f64") for i in range(1, 8))
EVENTS = Place(8, "i32")
VERSIONS = pytest.mark.parametrize("version", [2, 3])


def plan_of(folder: Path, version: int, **options: bool) -> Plan:
    plan = Plan()
    plan.fmu(oscillator.make(folder, version), folder, **options)
    return plan


@VERSIONS
@pytest.mark.parametrize("longest", [0.0, 0.03])
def test_it_swings_as_the_closed_form_by_steps_of_any_size(tmp_path, version, longest):
    plan = plan_of(tmp_path, version)
    for place, value in ((OMEGA, 3.0), (X0, 0.5), (LONGEST, longest)):
        plan.set(0, place, [value])
    plan.set(0, FORCE, [1.8], at=101)
    plan.show(0, [X, V])
    x, v = (float(plan.fly(tmp_path, 200, 0.1).values[place.reference][0]) for place in (X, V))
    x1, v1 = 0.5 * math.cos(30.0), -1.5 * math.sin(30.0)    # after 10 s; then it rests at 0.2
    c, s = math.cos(30.0), math.sin(30.0)
    assert x == pytest.approx(0.2 + (x1 - 0.2) * c + v1 / 3 * s, abs=1e-12)
    assert v == pytest.approx(v1 * c - (x1 - 0.2) * 3 * s, abs=1e-12)


@VERSIONS
def test_states_and_other_instances_go_on_with_the_same_bits(tmp_path, version):
    plan = plan_of(tmp_path, version)
    plan.set(0, FORCE, [0.3], at=7)
    plan.hash(0, [X, V])
    flown = plan.fly(tmp_path, 300, 0.1)
    assert len(set(flown.hashes)) == 301
    assert flown == plan.fly(tmp_path, 300, 0.1, sets=3, states=100)


def test_elements_of_all_types_come_back(tmp_path):
    values = [("f32", -1.5), ("i8", -128), ("u8", 255), ("i16", -32768), ("u16", 65535), ("i32", -2**31),
              ("u32", 2**32 - 1), ("i64", -9 * 10**15), ("u64", 9 * 10**15)]
    plan = plan_of(tmp_path, 3)
    for i, (kind, value) in enumerate(values):
        plan.set(0, Place(10 + i, kind), [value], at=1)
    plan.set(0, Place(20, "char", 64), ["a_text"], at=1)
    plan.set(0, Place(21, "enum"), [2], at=1)
    plan.set(0, Place(22, "f64", 3), [1.0, 2.0, 3.0], at=1)
    plan.show(0, [*(Place(30 + i, kind) for i, (kind, _) in enumerate(values)), Place(40, "char", 64),
                  Place(41, "enum"), Place(42, "f64", 3)])
    shown = plan.fly(tmp_path, 1, 0.1).values
    assert [float(shown[30 + i][0]) for i in range(9)] == [value for _, value in values]
    assert (shown[40], shown[41], shown[42]) == (["a_text"], ["2"], ["1", "2", "3"])


@pytest.mark.parametrize("events", [False, True])
def test_events_end_steps_early_where_the_importer_allows_it(tmp_path, events):
    plan = plan_of(tmp_path, 3, events=events)
    plan.set(0, EVERY, [0.25])
    plan.show(0, [X, EVENTS])
    if events:
        plan.clock(0, 9)
    shown = plan.fly(tmp_path, 10, 0.1).values
    assert float(shown[1][0]) == pytest.approx(math.cos(2.0), abs=1e-12)
    assert shown[8] == ["4"] and shown.get(9) == (["4"] if events else None)


def test_two_fly_in_turn(tmp_path):
    """The second one follows the first at the same point, the first the second at the next one."""
    path = oscillator.make(tmp_path)
    plan = Plan()
    a, b = plan.fmu(path, tmp_path), plan.fmu(path, tmp_path)
    plan.wire(a, X, b, FORCE)
    plan.wire(b, X, a, FORCE)
    plan.hash(a, [X])
    plan.hash(b, [X])
    c, s = math.cos(0.2), math.sin(0.2)
    (xa, va), (xb, vb), points = (1.0, 0.0), (1.0, 0.0), []

    def step(x, v, force):
        return force / 4 + (x - force / 4) * c + v / 2 * s, v * c - (x - force / 4) * 2 * s

    for _ in range(20):
        xa, va = step(xa, va, xb)
        xb, vb = step(xb, vb, xa)
        points.append((xa, xb))
    plan.show(b, [X])
    flown = plan.fly(tmp_path, 20, 0.1, sets=2, states=5)
    assert float(flown.values[1][0]) == pytest.approx(xb, abs=1e-12)
    assert flown.hashes[0] == hashes([struct.pack("=dd", 1.0, 1.0)])[0]


@VERSIONS
@pytest.mark.parametrize("fault, says", [
    pytest.param("segv DoStep", "exit code -11", marks=oscillator.CRASH),
    pytest.param("abort EnterInitializationMode", "exit code -6", marks=oscillator.CRASH),
    ("error DoStep 0.45", "DoStep: Error"), ("nothing DoStep", "DoStep: it makes no progress"),
    ("nothing Instantiate", "it gives no instance"), ("version GetVersion", "GetVersion: is not"),
    ("error ExitInitializationMode", "ExitInitializationMode: Error")])
def test_a_fault_is_named(tmp_path, version, fault, says):
    plan = plan_of(tmp_path, version)
    with pytest.raises(Failed, match=says):
        plan.fly(tmp_path, 10, 0.1, env={**os.environ, "OSCILLATOR": fault})
