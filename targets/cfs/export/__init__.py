# SPDX-License-Identifier: Apache-2.0
"""A mission as an app of the core Flight System: a folder for the `apps` of a cFS tree, of Caelum, Draco or 7.x.

Example:

    import fledge
    from fledge import export
    from fledge.targets.cfs import export as cfs

    mission = export.read(fledge.load("nadir_spin"))
    cfs.write(mission, cfs.App("nav", topic=0xC0), "cFS/apps/nav")

Most of the app's C is the same for every mission and stands in templates/*.in; what is generated: packets and
tables (packets.py, tables.py), what joins app and mission (joint.py), the files around it (around.py), and
copies of all source that it needs, under names of its own (sources.py).
"""

from fledge.targets.cfs.export.app import App, check_taken
from fledge.targets.cfs.export.folder import emit, write

__all__ = ["App", "check_taken", "emit", "write"]
