# SPDX-License-Identifier: Apache-2.0
"""What the imager must do when it speaks with its ground: `fledge verify earth_imager`."""
from fledge.requirements import after, always, eventually, implies, never, until, within
from fledge.units import minute, mrad, s


def contact(r):
    """Contact."""
    r.every = 0.5 * s
    ordered = r.command("flight", "telemetry")
    sent    = r.packet("flight", "flight.tracking.error")
    link    = r.signal("world.radio.up.lock") == 1
    error   = r.telemetry("flight", "flight.tracking.error.sigma_BR")
    off     = (4 * error.norm()).named("the angle that the ground reads")
    shown   = {"shown_by": "contact"}
    r.require("COM-1", "The imager shall send its pointing error twice a second from the ground's command on.",
              eventually(ordered) & always(implies(after(ordered), sent)),
              rationale="The ground looks at each handover as it happens.", **shown)
    r.require("COM-2", "The imager shall send nothing that the ground has not asked for.",
              until(~sent, ordered) & never(r.packet("flight", "housekeeping")),
              rationale="Other telemetry takes the link from the images.", **shown)
    r.require("COM-3", "The imager shall accept commands only while its receiver is locked, and refuse none of them.",
              always(implies(r.command("flight", became="accepted"), link))
              & never(r.command("flight", became="refused")),
              rationale="What comes without a lock is noise, or not from this ground.", **shown)
    r.require("COM-4", "The ground shall read a pointing error below 2 mrad at least once in 150 s.",
              always(implies(after(sent), within(150 * s, off < (2 * mrad).value))),
              rationale="A handover takes so long.", **shown)
