# SPDX-License-Identifier: Apache-2.0
"""A flight computer in software, under the hands of a flight-software engineer.

Example:

    from fledge import emulator
    from fledge.units import N, m, minute

    board = emulator.load("nadir_spin")         # exports, builds for a LEON3, boots; the world is around it
    board.sim.run(1 * minute)
    board.flight.control.K = 3 * N * m          # in the memory of the computer
    state = board.snapshot()                    # of the computer and the world
    board.flip("%l3", 7)
    board.sim.run(1 * minute)
    board.restore(state)

The modules:

    board.py      Board: a computer that runs a program, alone or in the loop
    memory.py     the variables of flight in its memory, by their C names
    flips         campaigns of bit flips: studies/flips
"""

from fledge.emulator.board import Board, load

__all__ = ["Board", "load"]
