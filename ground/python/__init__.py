# SPDX-License-Identifier: Apache-2.0
"""The ground's side of a mission: scripts that command a spacecraft and wait for its telemetry.

Example:

    import fledge
    from fledge import ground
    from fledge.units import N, m, s

    with ground.connect(fledge.load("nadir_spin")) as craft:    # a simulation, which runs while the script waits
        craft.command("write", "flight.control", K=3 * N * m).completed(within=5 * s)

In place of the simulation stands an address, "tcp://127.0.0.1:10025", with the dictionary "nadir_spin_packets.json";
docs/ground.md has all addresses. Packets of any spacecraft are decoded by its XTCE (docs/packets.md):
`Database.load("craft.xml").decode(packet).values`.
"""
from __future__ import annotations

from pathlib import Path
from typing import Any

from fledge.commands import Dictionary
from fledge.errors import SetupError
from fledge.frames import FILE
from fledge.ground.scripts.address import open_link
from fledge.ground.scripts.craft import Craft, NotSeen, Sent, accepts, packets
from fledge.ground.scripts.framed import Framed
from fledge.ground.scripts.links import Link, NoAnswer
from fledge.ground.scripts.simulated import Simulated, flight_of

__all__ = ["Craft", "Database", "Framed", "Link", "NoAnswer", "NotSeen", "Sent", "connect", "dictionary_of",
           "open_link", "packets", "perform"]

TYPE_CHECKING = False   # of `typing`
if TYPE_CHECKING:
    from fledge.ground.database import Database


def __getattr__(name: str) -> Any:
    if name != "Database":      # scripts of a mission do not need its extension
        raise AttributeError(f"fledge.ground has no '{name}'; there are {', '.join(__all__)}")
    from fledge.ground.database import Database

    return Database


def connect(where: Any, dictionary: Dictionary | Path | str | None = None, sequence: int = 0,
            process: str | None = None, radio: Any = None, keys: Path | str | None = None, role: int = 0,
            kind: type[Craft] = Craft, token: str | None = None) -> Craft:
    """A spacecraft behind a link. One that speaks frames, as its dictionary says, gets them.

    where: a simulation, which runs while the script waits; an address (fledge.ground.scripts.address), or a Link
    dictionary: of an address or a Link: what the mission can be commanded; a Dictionary, a file MISSION_packets.json
    of an export, or the name or folder of a mission
    process: the name of the flight process, if the mission has several
    radio: of a simulation, the world.Radio by which packets pass, or its path "world.radio"; None: they go straight to
    flight, and back
    sequence: of the first command; if flight has accepted later ones, the script counts on from those
    keys: the file of a secured link (`fledge keys link FILE`), role: the place of the role that commands; of a
    simulation keys is the file of its mission, unless another is given
    kind: what is made, a Craft or a class of that; token: of a server's address

    Raises SetupError for an address, file or mission that is none.
    """
    if hasattr(where, "processes"):
        link = Simulated(where, process, radio)
        dictionary = link.process.commands.dictionary
        mission = getattr(where, "mission", None)
        own = Path(mission.folder) / FILE if mission else None
        framed = Framed(link, dictionary.frames, keys or own, role) if dictionary.frames else link
        return kind(framed, dictionary, sequence)
    if str(where).startswith(("http://", "https://")):
        from fledge.ground.scripts.served import Served

        served = Served(str(where), token)
        return kind(served, served.dictionary, sequence)
    if radio is not None:
        raise SetupError("connect: a radio is in a simulation; give that in place of the address")
    if dictionary is None:
        raise SetupError("connect: give the dictionary: a file MISSION_packets.json of an export, or a mission's name")
    dictionary = dictionary_of(dictionary, process)
    if not isinstance(where, Link):
        options = f"&keys={keys}" * bool(keys) + f"&role={role}" * bool(role)
        where = open_link(_with(str(where), options), accepts(dictionary), dictionary.frames)
    elif dictionary.frames and not isinstance(where, Framed):
        where = Framed(where, dictionary.frames, keys, role)
    return kind(where, dictionary, sequence)


def perform(sim: Any, path: Path | str, radio: Any = None) -> None:
    """Run a script with steps (docs/ground.md) in a simulation, in which it commands the one process that flies; the
    operator confirms. A relative path is one in the mission's folder. radio: as of connect().

    Raises SetupError if there is no such script, fledge.ground.scripts.script.CheckFailed if it does not pass.
    """
    from fledge.ground.scripts import script as scripts

    path = Path(sim.mission.folder if sim.mission else "") / path
    function = scripts.load(path)
    with connect(sim, radio=radio, kind=scripts.Watched) as craft:
        assert isinstance(craft, scripts.Watched)
        script = scripts.Script(path, craft, lambda entry: None, lambda question: (True, "the scenario"))
        if why := script.run(function)[0]:
            raise scripts.CheckFailed(why)


def _with(address: str, options: str) -> str:
    """An address with further options."""
    return address + ("" if "?" in address or not options else "?") + (options if "?" in address else options[1:])


def dictionary_of(source: Dictionary | Path | str, process: str | None = None) -> Dictionary:
    """The Dictionary of a file MISSION_packets.json, or of a flight process of a mission, given by its name or folder;
    process: which, if there are several. Raises SetupError if there is none."""
    if isinstance(source, Dictionary):
        return source
    if str(source).endswith(".json"):
        return Dictionary.load(source)
    from fledge.mission import load

    return flight_of(load(str(source)), process).commands.dictionary
