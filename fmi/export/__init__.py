# SPDX-License-Identifier: Apache-2.0
"""A mission, its world or its flight as an FMU for co-simulation, by FMI 3.0 and 2.0.

    variables.py    the variables of messages, parameters, modes and events
    mission.py      flight in C; composition.py: processes as the kernel flies them; board.py: flight on the LEON3
    description.py  the model description
    build.py        libraries and archive; archive.py: the same content gives the same bytes

Example:

    from pathlib import Path

    import fledge
    from fledge.export.fmu.build import export
    from fledge.export.fmu.mission import flight_fmu

    export(flight_fmu(fledge.load("nadir_spin")), Path("flight.fmu"), "2")
"""
