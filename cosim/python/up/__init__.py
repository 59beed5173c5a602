# SPDX-License-Identifier: Apache-2.0
"""`fledge up`: all programs of a co-simulation, started, watched and ended together.

    description     reads and checks a SIM.toml
    missions        makes the same of a mission, one program for each of its processes
    processes       starts programs, each under a guard that leaves nothing behind
    logs            the output of the programs, one file each and one of all
    table           shows the progress
    session         the run itself
    rewind          a run that goes on from the past of another

Example:

    $ ./fledge up nadir_spin --until 10min
"""
