# SPDX-License-Identifier: Apache-2.0
"""A spacecraft for scripts of the ground, and its links (docs/ground.md).

    craft.py    commands with their reports, and telemetry; files.py: files by CFDP
    script.py   scripts with steps
    address.py  opens the link of an address: links.py: sockets and serial lines; simulated.py: a simulation;
                member.py: a co-simulation; served.py: a control room; framed.py: frames on any of them

Example:

    import fledge
    from fledge import ground
    from fledge.units import s

    with ground.connect(fledge.load("nadir_spin")) as craft:
        craft.command("telemetry", "flight.tracking.error", every=2)
        craft.listen(10 * s)
        print(craft.telemetry["flight.tracking.error.sigma_BR"])
"""
