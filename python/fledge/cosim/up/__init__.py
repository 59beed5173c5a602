# SPDX-License-Identifier: Apache-2.0
"""`fledge up`: all programs of a co-simulation, started, watched and ended together.

    description     what a SIM.toml says, or is told to be wrong
    processes       programs, each under a guard that leaves nothing behind
    logs            what they say, one file each and one of all
    table           how it goes, for people
    session         the run itself
"""
