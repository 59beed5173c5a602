# SPDX-License-Identifier: Apache-2.0
"""The scenarios fulfil their requirements, each requirement can fail, and what each names is there."""
import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import fledge
from fledge.mission import field_path
from fledge.mission.log import Log
from fledge.requirements import Requirements
from fledge.units import s
from tests.links_test import broken
from tests.tree import files

SIM = fledge.load("mars_orbiter")
ALL = Requirements(SIM).all
TESTED = [requirement for requirement in ALL if requirement.method == "test"]


def fields(requirement):
    """What it looks at: {(message, path of a field in it)}."""
    signals = [comparison.signal for comparison in requirement.formula.comparisons]
    return {(field.port, field.recorded.removeprefix(f"{field.port}.")) for signal in signals
            for field in signal.fields} | {
        (f"{process}.activity", "kind") for signal in signals for process, *_ in signal.events}


@cache
def flown(scenario):
    """A scenario that was judged while it flew, and the record of all that its requirements look at."""
    sim = fledge.load("mars_orbiter")
    sim.plots = False
    requirements = Requirements(sim)
    own = requirements.for_scenario(scenario)
    ports = {port for requirement in own for port, _ in fields(requirement)} - {"flight.mode", "flight.activity"}
    log = sim.record(*(field_path.port(sim, port) for port in sorted(ports)), every=1 * s)
    watch = requirements.watch(only=[requirement.id for requirement in own])
    sim.scenarios[scenario]()
    return SimpleNamespace(scenario=scenario, requirements=requirements, log=log, outcomes=watch.outcomes())


class Bent(Log):
    """A log in which a field has one number at all times."""

    def __init__(self, log, port, path, number):
        super().__init__(log.simulation, [recorded.core for recorded in log._ports()])
        self.port, self.path, self.number = port, path, number

    def _values(self, port):
        values = super()._values(port)
        if port.name == self.port:
            field = values = values.copy()
            for name, place in re.findall(r"(\w+)(?:\[(\d+)\])?", self.path):
                field = field[name][:, int(place)] if place else field[name]
            limits = np.finfo(float) if field.dtype.kind == "f" else np.iinfo(field.dtype)
            field[...] = np.clip(self.number, limits.min, limits.max)
        return values


@pytest.mark.long("flies hours of the orbiter")
@pytest.mark.parametrize("scenario", SIM.scenarios)
def test_a_scenario_fulfils_its_requirements_and_so_says_its_record(scenario):
    found = flown(scenario)
    assert [str(outcome) for outcome in found.outcomes if outcome.verdict != "holds"] == []
    again = found.requirements.judge(found.log, [outcome.requirement.id for outcome in found.outcomes])
    assert [str(outcome) for outcome in again if outcome.verdict != "holds"] == []
    for first, second in zip(found.outcomes, again, strict=True):     # the record has every other sample only
        assert first.margin == second.margin or first.margin == pytest.approx(second.margin, rel=0.05), (first, second)


@pytest.mark.long("flies the orbiter with each mistake")
@pytest.mark.parametrize("requirement", TESTED, ids=lambda requirement: requirement.id)
def test_each_can_fail_wherever_it_is_shown(requirement):
    """In a record in which one of its signals is something else."""
    for found in map(flown, requirement.shown_by):
        assert any(found.requirements.judge(Bent(found.log, *field, number), [requirement.id])[0].verdict == "violated"
                   for field in fields(requirement) for number in (0, 1, 2, 1e9)), found.scenario


def test_what_they_name_is_there():
    tree = {str(path) for path in files()}
    ids = {r.id for r in ALL}
    assert 35 <= len(ids) <= 42 and len(TESTED) / len(ids) > 0.9
    for r in ALL:
        assert r.parent in ids or (not r.parent and r.id.startswith("SYS-")), r.id
        assert r.rationale and r.text.startswith("The orbiter shall ") and r.text.endswith("."), r.id
        here = (Path(__file__).parents[2] / r.evidence).is_file()    # of Fledge, or of the project with this copy
        there = here or not broken(Path("x"), f"[]({r.evidence})", tree)
        assert r.shown_by if r.formula is not None else there, r.id
    assert "the instrument's angle to Mars < " in str(next(r for r in ALL if r.id == "PNT-1").formula)
    assert {name for r in TESTED for name in r.shown_by} == set(SIM.scenarios)
