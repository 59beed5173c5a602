# SPDX-License-Identifier: Apache-2.0
"""A spacecraft for scripts of the ground, and its links (docs/ground.md).

Example:

    import fledge
    from fledge import ground
    from fledge.units import s

    with ground.connect(fledge.load("nadir_spin")) as craft:
        craft.command("telemetry", "flight.tracking.error", every=2)
        craft.listen(10 * s)
        print(craft.telemetry["flight.tracking.error.sigma_BR"])
"""
