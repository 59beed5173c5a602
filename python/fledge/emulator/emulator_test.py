# SPDX-License-Identifier: Apache-2.0
"""A LEON3 in software, in the hands of an engineer: in the loop, in Python, under gdb, traced, covered, profiled."""

import re
import subprocess
import threading

import numpy as np
import pytest

import fledge
from fledge import emulator, objects
from fledge.units import N, m, s


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fly")


@pytest.fixture
def board(folder):
    return emulator.load("nadir_spin", folder=folder)


def every_output(sim):
    return [port for task in sim.flight.tasks for port in (getattr(sim.flight, name) for name in task.run)]


def test_the_computer_flies_to_the_bit_as_the_desktop_does(board):
    desktop = fledge.load("nadir_spin")
    for sim in (board.sim, desktop):
        sim.record(*every_output(sim), sim.world.craft, every=0)
        sim.run(10)
    assert len(desktop.records) >= 8
    for ours, theirs in zip(board.sim.records, desktop.records, strict=True):
        assert (ours.path, ours.times(), ours.bytes()) == (theirs.path, theirs.times(), theirs.bytes())
    assert board.core.instructions > 100_000        # and it is not the desktop that flew
    assert objects.memory(board.sim.flight.control) != objects.memory(desktop.flight.control)


def test_variables_of_flight_are_read_and_written_by_their_names(board):
    board.sim.run(5)
    f = board.flight
    assert f.control.K == 2.531 and f.control.P[1, 1] == 45.0 and f.tracking.sigma_BcB.tolist() == [0, 0, 1]
    assert f.tracking.error.sigma_BR.tolist() == board.sim.flight.tracking.error.sigma_BR.tolist()
    assert f.motor.command.head.t == 5_000_000_000
    f.control.K = 3 * N * m
    f.tracking.sigma_BcB = [0.0, 0.0, 0.5]
    assert f.control.K == 3.0 and f.tracking.sigma_BcB.tolist() == [0, 0, 0.5]
    assert board.peek("fledge_mission", 4) != bytes(4)
    changed = fledge.load("nadir_spin")
    changed.run(5)
    changed.flight.control.K = 3 * N * m
    changed.flight.tracking.sigma_BcB = [0.0, 0.0, 0.5]
    for sim in (board.sim, changed):
        sim.run(5)
    assert objects.memory(board.sim.flight.motor.command) == objects.memory(changed.flight.motor.command)


@pytest.mark.parametrize("attempt, complaint", [
    (lambda f: setattr(f.control, "K", 3 * s), "flight.control.K: expected a quantity in N m; found"),
    (lambda f: setattr(f.control, "P", [1.0, 2.0]), r"flight.control.P has shape \[3, 3\]; found \[2\]"),
    (lambda f: setattr(f.control, "error", 1.0), "flight.control.error is a struct; write its numbers"),
    (lambda f: f.control.k, "flight.control has no 'k'; did you mean 'K'"),
    (lambda f: f.controls, "flight has no 'controls'; did you mean 'control'"),
    (lambda f: setattr(f, "control", 1), "flight.control: set a field of it"),
])
def test_a_wrong_variable_is_refused_with_advice(board, attempt, complaint):
    with pytest.raises((AttributeError, fledge.SetupError), match=complaint):
        attempt(board.flight)


def test_computer_and_world_go_back_together(board, tmp_path):
    board.sim.run(5)
    start = board.snapshot()
    ends = []
    for _ in range(2):
        board.sim.run(5)
        ends.append((objects.memory(board.sim.flight.motor.command), objects.memory(board.sim.world.craft.state),
                     board.registers, board.core.instructions))
        board.restore(start)
    assert ends[0] == ends[1]
    board.flip("%f2", 62)       # and another flight after a fault
    board.flight.tracking.sigma_BcB = [0.0, 0.0, 0.9]
    board.sim.run(5)
    assert objects.memory(board.sim.flight.motor.command) != ends[0][0]
    board.save(tmp_path / "state")
    before = board.registers
    board.step(100)
    assert board.registers != before
    board.load(tmp_path / "state")
    assert board.registers == before


def test_breakpoints_watchpoints_and_steps_stop_the_computer(board):
    board.sim.run(1)
    update = board.address("mrp_feedback_update")
    stops = []
    board.on_stop = lambda reason: stops.append((reason, board.registers["%pc"], board.flight.control.newest))
    board.breakpoint("mrp_feedback_update")
    board.sim.run(1)
    assert [stop[:2] for stop in stops] == [("breakpoint", update)] * 2
    board.breakpoint("mrp_feedback_update", on=False)
    board.watchpoint("flight.control.newest", 8)
    stops.clear()
    board.sim.run(0.5)
    assert [reason for reason, *_ in stops] == ["watchpoint"]
    assert "mrp_feedback_update" in board.core.place(stops[0][1])
    with pytest.raises(fledge.SetupError, match="no symbol 'mrp_feedback_updat'; did you mean 'mrp_feedback_update'"):
        board.breakpoint("mrp_feedback_updat")


def test_faults_show_where_the_computer_failed(board):
    board.sim.run(1)
    board.poke("mrp_feedback_update", bytes(4))         # unimp
    with pytest.raises(fledge.RunError, match=r"(?s)error mode, in the tick at 1.5 s.*illegal_instruction.*backtrace"):
        board.sim.run(20)


def test_ticks_can_be_lost_and_interrupts_stick(board):
    board.sim.run(1)
    answers = board.in_flight.record()
    board.lose_ticks(2)
    board.sim.run(2)
    assert [answer is None for _, answer in answers[:4]].count(True) >= 1
    board.core.raise_interrupt(9)       # spurious: no handler is there
    board.core.stick_interrupts(1 << 9, 0)
    board.sim.run(1)
    assert answers[-1][1] is not None
