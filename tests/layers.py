# SPDX-License-Identifier: Apache-2.0
"""Which folder and which part of the Python package may use which: the tables that include_direction_test.py checks,
and that docs/architecture.md shows.

    /usr/bin/python3 -m tests.layers        writes the tables into docs/architecture.md

A rule holds for its folder and all folders below it that have no rule of their own. The rule `flight/*` holds for each
sub-folder of flight/ by itself: they do not use one another.
"""

from typing import NamedTuple

from tests.tree import ROOT

DOCUMENT = ROOT / "docs/architecture.md"
BEGIN, END = "<!-- printed by tests/layers.py: {} -->\n", "<!-- end of what tests/layers.py prints -->\n"


class Rule(NamedTuple):
    """The description of a folder in the documents, and the folders, besides its own, that it may include or import."""

    language: str
    what: str
    uses: list[str]


FLIGHT = ["flight/math", "flight/msg"]

RULES = {
    "ccsds": Rule("C99", "the protocols between ground and flight: packets, frames, COP-1, security, files", []),
    "flight/math": Rule("C99", "vectors, attitudes, elementary functions", []),
    "flight/msg": Rule("C99", "the messages", ["flight/math"]),
    "flight/exec": Rule("C99", "the rules of time, for the desktop and for every exported mission", FLIGHT),
    "flight/command": Rule("C99", "commands to flight: packets, their checks and their execution",
                           [*FLIGHT, "flight/exec", "ccsds"]),
    "flight/telemetry": Rule("C99", "packets of flight's outputs", [*FLIGHT, "flight/exec", "flight/command", "ccsds"]),
    "flight/services": Rule("C99", "modules that commands drive: stored commands, monitors, fault protection, files",
                            [*FLIGHT, "flight/exec", "flight/command", "flight/telemetry", "ccsds"]),
    "flight/*": Rule("C99", "the modules; these folders do not use one another", FLIGHT),
    "record": Rule("C99, C++20", "one writer of MCAP without a heap, for every target, and one reader", []),
    "registers": Rule("C99, C++20, Python", "boards from TOML; lanes between flight and models, also across processes "
                      "and byte orders", [*FLIGHT, "flight/exec", "record", "introspect"]),
    "introspect": Rule("Python", "the reader of headers, and the emitters", []),
    "targets": Rule("C99, Python", "what hosts an exported mission (`mission.h`), and a folder for each target, whose "
                    "Python is a part of `fledge`",
                    [*FLIGHT, "flight/exec", "flight/command", "flight/telemetry", "registers", "record", "ccsds"]),
    "sim": Rule("C++20", "the kernel: instances, wires, tasks, processes, clock, recorder",
                [*FLIGHT, "flight/exec", "flight/command", "flight/telemetry", "record"]),
    "world": Rule("C++20", "dynamics, environment, sensors, actuators, avionics", [*FLIGHT, "flight/exec", "sim"]),
    "cosim": Rule("C, C++20, Python", "a simulation of many programs; `bindings`: nodes in other languages",
                  [*FLIGHT, "record", "registers", "sim", "targets", "cosim"]),
    "cosim/protocol": Rule("C++20", "the frames that the programs exchange", ["record"]),
    "cosim/security": Rule("C++20", "keys, and which programs may take part", []),
    "cosim/transport": Rule("C++20", "sockets and shared memory", ["cosim/protocol", "cosim/security"]),
    "cosim/controller": Rule("C++20", "which program may step how far; without sockets or clocks",
                             ["cosim/protocol", "sim"]),
    "cosim/node": Rule("C++20", "programs that take part", [*FLIGHT, "cosim/protocol", "cosim/security",
                                                            "cosim/transport", "sim", "registers", "targets"]),
    "cosim/router": Rule("C++20", "the controller on its sockets", ["cosim/protocol", "cosim/security",
                         "cosim/transport", "cosim/controller", "cosim/node", "sim"]),
    "cosim/tools": Rule("C++20, C99", "the programs", ["options", "record", "cosim/protocol", "cosim/security",
                        "cosim/transport", "cosim/controller", "cosim/node", "cosim/router", "sim", "registers",
                                                       "targets"]),
    "fmi": Rule("C99, C++20", "FMUs: what Fledge exports, and others' models in a simulation", []),
    "fmi/standard": Rule("C99", "the C interface of FMI 2.0 and 3.0", []),
    "fmi/fmu": Rule("C99", "what an exported FMU is made of", [*FLIGHT, "flight/exec", "flight/command",
                    "flight/telemetry", "flight/services", "targets", "ccsds", "fmi/standard"]),
    "fmi/simulation": Rule("C++20", "the world, or a whole mission, as an FMU: the kernel with the mission as data",
                           [*FLIGHT, "flight/exec", "flight/command", "flight/telemetry", "registers", "sim", "world",
                            "fmi/fmu"]),
    "fmi/board": Rule("C++20", "flight on the emulated computer as an FMU",
                      [*FLIGHT, "flight/exec", "flight/command", "targets", "emulator", "fmi/fmu"]),
    "fmi/importer": Rule("C++20", "others' FMUs as models", [*FLIGHT, "flight/exec", "sim", "fmi/standard"]),
    "fmi/testing": Rule("C99, Python", "an importer, and FMUs that misbehave", ["flight/exec", "fmi", "fledge"]),
    "options": Rule("C++20", "the command lines of the programs in C++", []),
    "emulator": Rule("C++20", "the flight computer; it meets the avionics at the registers alone",
                     ["options", "registers"]),
    "emulator/mission": Rule("C++20", "a mission that flies on the computer",
                             [*FLIGHT, "flight/exec", "registers", "targets", "emulator"]),
    "emulator/tools": Rule("C++20", "the programs", ["options", "record", "registers", "targets", "emulator"]),
    "ground": Rule("C++20", "the ground: the database of packets and commands, their decoder and encoder; the newest "
                   "values of telemetry with limits; files of packets, and captures",
                   ["ccsds", "record"]),
    "ground/python": Rule("Python, C++", "`fledge.ground`", ["fledge", "ccsds", "record", "ground"]),
    "ground/server": Rule("Python", "`fledge.ground.server`, of the control room", ["fledge", "registers", "ground"]),
    "ground/console": Rule("JavaScript, Python", "the pages of the control room", ["fledge", "ground"]),
    "ground/cli": Rule("Python", "the commands of the ground", ["fledge"]),
    "cosim/python": Rule("Python, C++", "`fledge.cosim`; `up`: all programs of a simulation, started together",
                         ["fledge", "flight", "registers", "cosim", "fmi"]),
    "cosim/cli": Rule("Python", "the commands of co-simulation", ["fledge"]),
    "emulator/python": Rule("Python, C++", "`fledge.emulator`", ["fledge", "flight", "registers", "emulator"]),
    "fmi/python": Rule("Python", "`fledge.fmi`: others' FMUs, unpacked, described, and what a model of the "
                       "world has of them", ["fledge", "introspect", "fmi"]),
    "fmi/export": Rule("Python", "`fledge.export.fmu`", ["fledge", "fmi"]),
    "fledge": Rule("Python, C++", "`python/fledge`: what the user imports, the extension `_core`, the command line; "
                   "its links lead to the packages of other folders",
                   ["ccsds", "flight", "registers", "record", "introspect", "sim", "world", "fmi", "targets"]),
    "studies": Rule("Python", "many runs, and what is shown of flight: campaigns, faults, falsification, proofs, "
                    "verification, profiles; each folder is a package of `fledge`", ["fledge", "flight", "introspect"]),
    "missions": Rule("Python", "worked missions", ["fledge"]),
    "docs": Rule("Markdown, Python", "the documents, and the settings of their HTML", ["introspect", "fledge"]),
    "bench": Rule("Python, C++", "measurements",
                  ["ccsds", "flight", "record", "sim", "world", "cosim", "emulator", "fmi", "ground", "fledge",
                   "missions"]),
    "cmake": Rule("CMake, Python", "the build, the package for CMake, the wheel for pip, the .deb", ["fledge"]),
    "tests": Rule("Python, C++, C99", "tests of the whole",
                  ["flight", "registers", "record", "sim", "world", "cosim", "emulator", "fmi", "ground", "targets",
                   "introspect", "fledge", "missions"]),
}

# The parts of the package fledge, its sub-packages and the modules beside them: from the bottom up, rows of parts and
# what these are. A part may import itself and the rows before it here, also inside its functions; the launcher comes
# last. A part with a dot has a folder of its own, to which a link leads. So the core, up to its commands, imports no
# capability but FMI.
PARTS = [
    ("basilisk", "what its words are here, for errors"),
    ("units elements errors disk columns display interruption loopback programs", "what all others need"),
    ("progress folders frames elf serial_line contents junit", "a progress bar; the folders of a project and of "
     "missions; the frames of a link; what an ELF file says of itself; serial lines to "
     "boards; builds that follow contents, not times; results for a CI"),
    ("attitude", "representations of attitudes"),
    ("files", "files of orbits and attitudes that others write and read: two-line elements, CCSDS, SPICE, STK"),
    ("objects commands", "C structs as Python objects; packets of commands and telemetry"),
    ("records", "recorded fields by name, of a run in memory or of a file; modes, events, commands and resets"),
    ("archive", "MCAP files: read, compare, convert; conversions"),
    ("fmi", "FMUs of others: the archive, unpacked with care, the description, and what a model has of it"),
    ("plot", "figures of fields, boresights and orbits; the wiring as a graph"),
    ("flight flight_math", "the flight modules by name; the functions of `flight/math`"),
    ("world", "the world's models by name, bodies, orbits, the sky"),
    ("motion", "where a spacecraft was by a run, written in the forms of others and compared with their files"),
    ("mission", "load a mission; processes, simulation, log, wiring, batches; linear systems and their margins"),
    ("requirements", "requirements as formulas of signal temporal logic, judged on a run or a record"),
    ("prototype", "modules and models that are Python classes"),
    ("new", "what `fledge new` writes"),
    ("pool", "flights in many processes, of this machine or of a cluster"),
    ("export scene", "a mission as C, with boards; a run in 3-D"),
    ("report targets", "a run on one page; the same flight software on several targets, compared; each target is a "
     "folder of `targets`"),
    ("export.fmu", "FMUs of a mission, its world or its flight"),
    ("cli", "the commands of `./fledge` that fly, export and show, and how those of capabilities are found"),
    ("emulator", "the LEON3 board as a Python object and as the flight of a simulation"),
    ("mission.learning", "reset and step of reinforcement learning, which requirements may end"),
    ("montecarlo", "campaigns"),
    ("emulator.flips", "campaigns of bit flips"),
    ("falsify", "the search for the run with the least margin of a requirement, and failure probabilities"),
    ("prove", "no run-time errors in flight C, and bounds of its loops, by Frama-C"),
    ("rules", "the rules of MISRA C:2012 that flight C keeps, and the reasons of deviations, by cppcheck"),
    ("profile", "what flight costs on a target"),
    ("verify", "all requirements of a mission over scenarios and targets, with a report"),
    ("analysis", "faults of units, versions of flight, and the time of tasks, over many runs"),
    ("ground", "scripts of the ground, their links to spacecraft; databases of packets, and captures"),
    ("ground.server ground.console", "the server of the control room, and its pages"),
    ("cosim", "a mission in several programs, which `fledge up` starts together"),
    ("cli.ground cli.cosim cli.studies", "the commands of capabilities"),
    ("launcher", "what `./fledge` does before a command: packages and the build; and tests"),
]

LEVEL = {part: level for level, (parts, _) in enumerate(PARTS) for part in parts.split()}

# Python packages of other projects, and where each may be imported. They are Debian's.
THIRD_PARTIES = {
    "cmake":      {"fledge_wheel"},
    "flight":     {"mpmath"},                      # flight/math/tools: how the coefficients were found
    "introspect": {"clang"},
    "docs":       {"nbclient", "nbconvert", "nbformat"},    # settings of the HTML: they run the notebook
    "fledge":     {"IPython", "PIL", "_core", "_core_build", "_cosim", "_emulator", "_fledge_protocol", "_fledge_world",
                   "_ground", "_project_world", "cloudpickle", "distributed", "h5py", "jinja2", "markupsafe",
                   "matplotlib", "numpy", "pandas", "scipy"},
    "cosim":      {"_cosim", "numpy", "zmq"},
    "emulator":   {"_emulator", "numpy"},
    "fmi":        {"numpy"},
    "ground":     {"_ground", "aiohttp", "fledge_node", "numpy", "psycopg", "scipy", "serial"},
    "studies":    {"h5py", "markupsafe", "matplotlib", "numpy", "scipy"},
    "missions":   {"PIL", "fledge_node", "numpy", "scipy"},     # a node in Python imports fledge_node alone of Fledge
    "bench":      {"_core", "aiohttp", "erfa", "jplephem", "mpmath", "numpy"},
    "tests":      {"_core", "numpy", "pytest"},
}


def rule_of(path: str) -> str:
    """The folder whose rule holds for a path: the longest that the path begins with."""
    if path.startswith("targets/") and path.endswith(".py"):
        return "fledge"
    parts = path.removeprefix("python/").split("/")
    for length in range(len(parts) - 1, 0, -1):
        folder = "/".join(parts[:length])
        if folder in RULES or "/".join([*parts[:length - 1], "*"]) in RULES:
            return folder
    return parts[0]


def part_of(module: str) -> str:
    """The part of the package that has a module: "ground.server" of "ground.server.web"."""
    names = module.split(".")
    return whole if (whole := ".".join(names[:2])) in LEVEL else names[0]


def uses(folder: str) -> list[str]:
    """The folders that this one may use; those below one of them count too."""
    rule = RULES.get(folder) or RULES.get(f"{folder.rpartition('/')[0]}/*")
    return rule.uses if rule else []


def may_use(folder: str, other: str) -> bool:
    return other == folder or any(other == name or other.startswith(f"{name}/") for name in uses(folder))


def table_of_parts() -> str:
    """The parts of the package, as Markdown."""
    return "\n".join(["| part | what it does |", "|---|---|",
                      *(f"| `{'`, `'.join(parts.split())}` | {what} |" for parts, what in PARTS)]) + "\n"


def table_of_folders() -> str:
    """The rules of the folders that there are, as Markdown."""
    rows = ["| folder | language | what it is | may use |", "|---|---|---|---|"]
    for folder, rule in RULES.items():
        if (ROOT / folder.removesuffix("/*")).is_dir() or folder == "fledge":
            used = ", ".join(f"`{name}`" for name in rule.uses if (ROOT / name).is_dir() or name == "fledge")
            rows.append(f"| `{folder}` | {rule.language} | {rule.what} | {used or 'nothing'} |")
    return "\n".join(rows) + "\n"


def with_tables(text: str) -> str:
    """A document with the tables of today, each between its two marks."""
    for name, table in (("folders", table_of_folders()), ("parts", table_of_parts())):
        before, rest = text.split(BEGIN.format(name))
        text = before + BEGIN.format(name) + table + END + rest.split(END, 1)[1]
    return text


if __name__ == "__main__":
    DOCUMENT.write_text(with_tables(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
