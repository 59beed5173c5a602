# SPDX-License-Identifier: Apache-2.0
"""A simulation as described by its SIM.toml: read, checked, and told at once what is wrong with it.

docs/cosim.md lists the keys.
"""
from __future__ import annotations

import difflib
import errno
import math
import os
import re
import secrets
import shlex
import shutil
import socket
from dataclasses import dataclass, field
from pathlib import Path

from registers.checked_toml import Tables, TomlError, parse, shown
from registers.location import line_of

POLICIES = ("abort", "pause", "hold", "drop", "restart")
TRANSPORTS = ("ipc", "tcp")
PLACEHOLDERS = ("simulation", "node", "address", "seed", "until", "record")
WHEN_IT_COMES = "when it comes"

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_TAKEN = ("controller", "all", "exchange")      # by logs and records of our own
_PLACEHOLDER = re.compile(r"\{(\w+)\}")
_TOP = ("simulation", "until", "seed", "pace", "transport", "address", "keys", "unencrypted", "record",
        "exchange", "watch", "join", "reply", "node", "asynchronous")
_START = ("name", "mission", "process", "scenario", "free", "parameters", "command", "by_hand", "directory", "env",
          "host", "launcher", "fledge", "keys")
_NODE = (*_START, "on_loss", "restarts", "joins", "rejoins", "save_every", "reply")
_ASYNCHRONOUS = (*_START, "writes")
_OF_MISSION = ("process", "scenario", "free", "parameters")
SSH = ("ssh", "-o", "BatchMode=yes", "-o", "ServerAliveInterval=5", "{host}")


class SimError(Exception):
    """All that is wrong with a simulation's description, one complaint a line."""


@dataclass
class Program:
    """One program to be started, and what becomes of the run without it."""
    name: str
    command: list[str] | None = None    # None: a mission's process, or started by hand
    mission: str | None = None
    process: str | None = None
    scenario: str | None = None
    free: bool = False
    parameters: dict = field(default_factory=dict)
    by_hand: bool = False
    directory: str = "."                # of a host: there
    env: dict[str, str] = field(default_factory=dict)
    host: str | None = None
    launcher: list[str] | None = None
    fledge: str | None = None           # where Fledge is on the host
    keys: str | None = None
    asynchronous: bool = False
    writes: list[str] = field(default_factory=list)     # topics, of an asynchronous one
    on_loss: str = "abort"
    restarts: int = 0
    joins: float | str | None = None    # [s] simulated; None: at the start
    rejoins: bool = False
    save_every: float = 0.0             # [s] simulated
    reply: float | None = None          # [s]; None: as all


@dataclass
class Plan:
    """A whole simulation."""
    simulation: str
    until: float | None                 # [s]
    programs: list[Program]
    seed: int = 0
    pace: float = 0.0                   # 0: as fast as possible
    address: str | None = None
    transport: str = "ipc"
    keys: str | None = None
    unencrypted: bool = False
    record: bool = True                 # of each process of a mission
    watch: list[str] = field(default_factory=list)      # topics that are written though no node wants them
    exchange: bool = False              # of all that nodes write to one another
    join: float = 60.0                  # [s]
    reply: float = 60.0                 # [s]
    file: str = ""

    @property
    def nodes(self) -> list[Program]:
        return [p for p in self.programs if not p.asynchronous]

    @property
    def beyond(self) -> bool:
        """Whether other machines take part, or may."""
        return any(p.host for p in self.programs) or bool(self.address and not is_local(self.address))

    def listening(self) -> str:
        """Where the controller is to listen; of an abstract address, a new name each time."""
        if self.address:
            return self.address
        hosts = [p.host for p in self.programs if p.host]
        if hosts:
            return f"tcp://{own_address(hosts[0])}:*"
        if self.transport == "tcp":
            return "tcp://127.0.0.1:*"
        return f"ipc://@fledge-{self.simulation[:40]}-{os.getpid()}-{secrets.token_hex(4)}"


def is_local(address: str) -> bool:
    return address.startswith(("ipc://", "tcp://127.", "tcp://localhost:"))


def own_address(host: str) -> str:
    """The address of this machine that a host sees. No packet is sent for it. Raises OSError."""
    name = host.rpartition("@")[2]
    family, kind, _, _, where = socket.getaddrinfo(name, 9, type=socket.SOCK_DGRAM)[0]
    with socket.socket(family, kind) as probe:
        probe.connect(where)
        own = probe.getsockname()[0]
    return f"[{own}]" if family == socket.AF_INET6 else own


def read(path: Path) -> Plan:
    """The simulation of a file; SimError with all complaints if there are any."""
    try:
        data, lines = parse(path.read_text(encoding="utf-8"), path)
    except UnicodeDecodeError:
        raise SimError(f"{path}:1: the file must be TOML; it is no text in UTF-8") from None
    except TomlError as error:
        raise SimError(str(error)) from None
    reader = _Reader(str(path), lines)
    reader.folder = path.resolve().parent
    plan = reader.plan(data, path.stem)
    plan.file = str(path)
    if reader.problems:
        raise SimError(reader.complaints())
    return plan


class _Reader(Tables):
    """The tables of a simulation."""

    folder: Path

    def plan(self, data: dict, stem: str) -> Plan:
        self.keys(data, (), _TOP)
        names: dict[str, tuple] = {}
        programs = [self.program(table, ("node", i), names, False)
                    for i, table in enumerate(self.tables(data, (), "node"))]
        programs += [self.program(table, ("asynchronous", i), names, True)
                     for i, table in enumerate(self.tables(data, (), "asynchronous"))]
        if not any(not p.asynchronous for p in programs) and not self.problems:
            self.refuse((), "a simulation has nodes", "there is none", "write [[node]] with a name and a command, "
                        "or a mission")
        plan = Plan(
            simulation=self.text(data, (), "simulation", stem),
            until=self.seconds(data, (), "until", None),
            programs=programs,
            seed=self.integer(data, (), "seed", 0, 2**63 - 1, 0) or 0,
            pace=self.seconds(data, (), "pace", 0.0, "simulated seconds per second"),
            address=self.text(data, (), "address", None) or None,
            transport=self.choice(data, (), "transport", TRANSPORTS, "ipc"),
            keys=self.path(data, (), "keys"),
            unencrypted=self.value(data, (), "unencrypted", (bool,), "true or false", False),
            record=self.value(data, (), "record", (bool,), "true or false", True),
            exchange=self.value(data, (), "exchange", (bool,), "true or false", False),
            watch=self.topics(data, (), "watch"),
            join=self.seconds(data, (), "join", 60.0),
            reply=self.seconds(data, (), "reply", 60.0))
        if "simulation" in data and not _NAME.fullmatch(plan.simulation):
            self.refuse(("simulation",), "a simulation's name is of letters, digits, `_`, `-` and `.`",
                        f"it is {shown(plan.simulation)}", "it also names the folder of its runs")
        for i, p in enumerate(plan.nodes):
            if isinstance(p.joins, float) and plan.until is not None and p.joins >= plan.until:
                self.refuse(("node", i, "joins"), "a node joins before the end", f"{p.name} joins at {p.joins:g} s, "
                            f"the run ends at {plan.until:g} s", "choose an earlier time")
        if plan.nodes and all(p.joins is not None for p in plan.nodes):
            self.refuse(("node", 0, "joins"), "some node is there at the start", "all join later",
                        "leave `joins` out of one")
        self.network(plan)
        return plan

    # ---- where nodes meet

    def network(self, plan: Plan) -> None:
        address = plan.address
        if address is not None and not re.fullmatch(r"ipc://@[^/\s]+|tcp://[^\s/]+:(\d+|\*)", address):
            found = "a file of that name would stay behind" if address.startswith("ipc://") else \
                f"it is {shown(address)}"
            self.refuse(("address",), "an address is an abstract name of this machine, or a TCP port", found,
                        'write "ipc://@name", "tcp://127.0.0.1:7000", or "tcp://192.0.2.1:*" for any free port')
            return
        if address is None:
            for i, p in enumerate(plan.programs):
                if p.host and (why := unreachable(p.host)):
                    self.refuse(self.place(plan, i, "host"), "a host can be found", f"{p.host}: {why}",
                                "give its name or number as user@address")
                    return
                if p.launcher and not p.host and "netns" in p.launcher:
                    self.refuse(("address",), "in a network namespace nodes need an address that it reaches",
                                "there is no `address`", 'write address = "tcp://ADDRESS:*", that of this side')
                    return
        elif why := busy(address):
            self.refuse(("address",), "the controller can listen there", f"{address}: {why}",
                        "choose another port, or `*` for any that is free")
        if plan.beyond and not plan.keys and not plan.unencrypted:
            i = next((i for i, p in enumerate(plan.programs) if p.host), None)
            where = ("address",) if i is None else self.place(plan, i, "host")
            self.refuse(where, "what leaves the machine is encrypted", "there are no `keys`",
                        "make them with ./fledge keys new and write keys = \"FOLDER\"; or, in a network that you "
                        "trust, unencrypted = true")
        for key, folder, where in [("keys", plan.keys, ("keys",))] + [
                ("keys", p.keys, self.place(plan, i, "keys")) for i, p in enumerate(plan.programs) if not p.host]:
            if folder and not Path(folder).exists():
                self.refuse(where, f"`{key}` is a folder made by ./fledge keys", f"there is no {folder}",
                            "make it, or give the right one")
            elif folder and where == ("keys",):
                self.allowed(plan, Path(folder))

    def allowed(self, plan: Plan, folder: Path) -> None:
        """Whether the controller has its keys, and lets all in."""
        from fledge.cosim import keys

        if not (folder / "controller.secret").exists():
            self.refuse(("keys",), "the controller has keys of its own", f"there is no {folder}/controller.secret",
                        f"./fledge keys new controller --keys {folder} makes them")
        try:
            known = keys.allowed(folder)
        except keys.KeysError as error:
            self.refuse(("keys",), "keys can be read", str(error), "mend or remove it")
            return
        for i, p in enumerate(plan.nodes):
            if not any(p.name in key.nodes or "*" in key.nodes for key in known):
                self.refuse(("node", i, "name"), "a node is let in by its key", f"no key in {folder}/allowed is for "
                            f"{p.name}", f"./fledge keys allow KEY --as {p.name} --keys {folder} lets it in")

    @staticmethod
    def place(plan: Plan, i: int, key: str) -> tuple:
        nodes = len(plan.nodes)
        return ("node", i, key) if i < nodes else ("asynchronous", i - nodes, key)

    # ---- a program

    def program(self, table: dict, path: tuple, names: dict, asynchronous: bool) -> Program:
        self.keys(table, path, _ASYNCHRONOUS if asynchronous else _NODE)
        p = Program(self.name(table, path, names), asynchronous=asynchronous)
        p.mission = self.text(table, path, "mission", None) or None
        p.process = self.text(table, path, "process", None) or None
        p.scenario = self.text(table, path, "scenario", None) or None
        p.free = self.value(table, path, "free", (bool,), "true or false", False)
        p.parameters = self.table(table, path, "parameters")
        p.by_hand = self.value(table, path, "by_hand", (bool,), "true or false", False)
        p.command = self.words(table, path, "command")
        p.host = self.text(table, path, "host", None) or None
        p.launcher = self.words(table, path, "launcher", split=True)
        p.fledge = self.text(table, path, "fledge", None) or None
        p.env = self.environment(table, path)
        p.keys = self.text(table, path, "keys", None) or None if p.host else self.path(table, path, "keys")
        p.directory = self.text(table, path, "directory", "." if not p.host else "") or "."
        if not p.host:
            p.directory = str(self.folder / p.directory)
            if not Path(p.directory).is_dir():
                self.refuse((*path, "directory"), "a program starts in a folder", f"there is no {p.directory}",
                            "it is relative to the file's")
                p.command = None
        self.what(table, path, p)
        if asynchronous:
            p.writes = self.topics(table, path, "writes")
        else:
            self.taking_part(table, path, p)
        return p

    def name(self, table: dict, path: tuple, names: dict) -> str:
        name = self.text(table, path, "name", table.get("process", ...))
        if not isinstance(name, str) or not name:
            return "?"
        if not _NAME.fullmatch(name) or name in _TAKEN:
            self.refuse((*path, "name"), "a name is of letters, digits, `_`, `-` and `.`, and not `controller`, "
                        "`all` or `exchange`", f"it is {shown(name)}", "it also names the program's log")
        elif name in names:
            self.refuse((*path, "name"), "names differ", f"`{name}` stands in line "
                        f"{line_of(self.lines, names[name])} too", "rename one")
        names.setdefault(name, (*path, "name"))
        return name

    def what(self, table: dict, path: tuple, p: Program) -> None:
        """What is to be started."""
        given = [key for key in ("mission", "command", "by_hand") if table.get(key)]
        if len(given) != 1:
            self.refuse((*path, given[1] if given else "command"),
                        "a program is a `mission` with its `process`, a `command`, or started `by_hand`",
                        f"of {p.name} there is {'and '.join(f'`{g}` ' for g in given) or 'neither'}".rstrip(),
                        'write one, for example command = ["python3", "model.py"]')
            return
        if p.asynchronous and p.mission:
            self.refuse((*path, "mission"), "a mission's processes are nodes", f"{p.name} is asynchronous",
                        "write [[node]]")
        for key in _OF_MISSION:
            if key in table and not p.mission:
                self.refuse((*path, key), f"`{key}` is of a `mission`", f"{p.name} has none", "leave it out")
        if p.mission:
            p.process = p.process or p.name
            if not p.host:
                self.mission(table, path, p)
        elif p.command:
            self.executable(path, p)
        for i, word in enumerate(p.command or ()):
            for name in _PLACEHOLDER.findall(word):
                near = difflib.get_close_matches(name, PLACEHOLDERS, 1)
                if name not in PLACEHOLDERS and near:
                    self.refuse((*path, "command"), "only known words in braces are filled in",
                                f"there is {{{name}}}", f"did you mean {{{near[0]}}}?")

    def executable(self, path: tuple, p: Program) -> None:
        if p.host:
            return      # it is there, or the log will say that it is not
        if p.launcher and not shutil.which(p.launcher[0]):
            self.refuse((*path, "launcher"), "the launcher can be found", f"there is no {p.launcher[0]}",
                        "install it, or write its path")
        program, place = p.command[0], Path(p.directory)
        here = {"PATH": os.environ.get("PATH", os.defpath), **p.env}["PATH"]
        if "/" in program:
            file = place / program
            if not file.is_file():
                self.refuse((*path, "command"), "the program can be found", f"there is no {file}",
                            "build it, or write the path relative to `directory`")
            elif not os.access(file, os.X_OK):
                self.refuse((*path, "command"), "the program can be started", f"{file} is not executable",
                            f"chmod +x it, or write what runs it before: [\"python3\", \"{program}\"]")
        elif not shutil.which(program, path=here):
            near = difflib.get_close_matches(program, ("python3", "mono", "sh", "bash"), 1)
            self.refuse((*path, "command"), "the program can be found", f"{program} is not on the PATH",
                        f"did you mean {near[0]}?" if near else "install it, or write its path: "
                        f"\"./{program}\" is relative to `directory`")
        elif len(p.command) > 1 and re.fullmatch(r"[^-{][^{]*\.(py|exe|sh|jl|js)", p.command[1]) \
                and not (place / p.command[1]).is_file():
            self.refuse((*path, "command"), "the program can be found", f"there is no {place / p.command[1]}",
                        "it is relative to `directory`")

    def mission(self, table: dict, path: tuple, p: Program) -> None:
        from fledge.errors import SetupError

        p.mission = str(self.folder / p.mission) if os.sep in p.mission else p.mission
        try:
            processes = processes_of(p.mission, p.parameters)
        except SetupError as error:
            self.refuse((*path, "mission"), "the mission can be loaded", str(error), "see ./fledge list")
            return
        if p.process not in processes:
            near = difflib.get_close_matches(p.process, processes, 1)
            self.refuse((*path, "process" if "process" in table else "name"), "the process is one of the mission's",
                        f"{table['mission']} has no `{p.process}`",
                        f"did you mean `{near[0]}`?" if near else f"choose {', '.join(processes)}")

    def taking_part(self, table: dict, path: tuple, p: Program) -> None:
        """What is only of nodes."""
        p.on_loss = self.choice(table, path, "on_loss", POLICIES, "abort") or "abort"
        p.restarts = self.integer(table, path, "restarts", 0, 1_000_000, 3 if p.on_loss == "restart" else 0) or 0
        if "restarts" in table and p.on_loss != "restart":
            self.refuse((*path, "restarts"), '`restarts` is of on_loss = "restart"', f"{p.name} has "
                        f"{shown(p.on_loss)}", 'leave it out, or write on_loss = "restart"')
        if p.by_hand and p.on_loss == "restart":
            self.refuse((*path, "on_loss"), "who starts a program starts it again", f"{p.name} is started by hand",
                        'write on_loss = "pause"')
        p.rejoins = self.value(table, path, "rejoins", (bool,), "true or false", False)
        p.save_every = self.seconds(table, path, "save_every", 0.0)
        p.reply = self.seconds(table, path, "reply", None)
        joins = table.get("joins")
        if joins == WHEN_IT_COMES:
            p.joins = joins
        elif "joins" in table:
            p.joins = self.seconds(table, path, "joins", None,
                                   f"the simulated seconds after which it takes part, or {shown(WHEN_IT_COMES)}")

    # ---- values

    def seconds(self, table: dict, path: tuple, key: str, default, words="seconds"):
        if key not in table:
            return default
        value = table[key]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) \
                or not 0 <= value <= 1e9:
            self.refuse((*path, key), f"`{key}` is {words}, from 0 to 1e9", f"it is {shown(value)}",
                        "write a number such as 60 or 0.5")
            return default
        return float(value)

    def words(self, table: dict, path: tuple, key: str, split=False) -> list[str] | None:
        value = table.get(key)
        if value is None:
            return None
        if isinstance(value, str) and split:
            try:
                value = shlex.split(value)
            except ValueError:
                value = None
        if not isinstance(value, list) or not value or not all(isinstance(w, str) for w in value) or not value[0]:
            example = '"ip netns exec left"' if split else '["python3", "model.py"]'
            self.refuse((*path, key), f"`{key}` is a list of texts, the program first", f"it is {shown(table[key])}",
                        f"write for example {example}")
            return None
        return value

    def topics(self, table: dict, path: tuple, key: str) -> list[str]:
        value = table.get(key, [])
        if not isinstance(value, list) or not all(isinstance(t, str) and re.fullmatch(r"/[^,\s]+", t) for t in value):
            self.refuse((*path, key), f"`{key}` is a list of topics", f"it is {shown(value)}",
                        'write for example ["/ground/command"]')
            return []
        return value

    def environment(self, table: dict, path: tuple) -> dict[str, str]:
        env = self.table(table, path, "env")
        for name, value in env.items():
            if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z_]\w*", name):
                self.refuse((*path, "env"), "`env` holds texts by the names of variables",
                            f"{name} is {shown(value)}", 'write for example env = { LEVEL = "2" }')
                return {}
        return env

    def path(self, table: dict, path: tuple, key: str) -> str | None:
        text = self.text(table, path, key, None)
        return str(self.folder / text) if text else None


def processes_of(mission: str, parameters: dict) -> list[str]:
    """The names of a mission's processes. Raises SetupError."""
    from fledge.mission import load

    return [p.name for p in load(mission, **parameters).processes]


def unreachable(host: str) -> str:
    """Why a host cannot be reached from here; "" if there is a way."""
    try:
        own_address(host)
    except OSError as error:
        return (error.strerror or str(error)).lower()
    return ""


def busy(address: str) -> str:
    """Why nobody can listen at an address; "" if it is free. A name that only libzmq knows is free."""
    try:
        if address.startswith("ipc://@"):
            with socket.socket(socket.AF_UNIX) as probe:
                probe.bind("\0" + address.removeprefix("ipc://@"))
            return ""
        host, _, port = address.removeprefix("tcp://").rpartition(":")
        if port != "*" and int(port) > 65535:
            return "ports go up to 65535"
        if host == "*" or port == "*" and host.startswith("127."):
            host = "0.0.0.0"
        family, kind, _, _, where = socket.getaddrinfo(host.strip("[]"), 0 if port == "*" else int(port),
                                                       type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(where)
            probe.listen(1)
    except socket.gaierror:
        return ""
    except OSError as error:
        return {errno.EADDRINUSE: "somebody listens there already",
                errno.EADDRNOTAVAIL: "it is not an address of this machine"}.get(error.errno, error.strerror.lower())
    return ""
