# SPDX-License-Identifier: Apache-2.0
"""A simulation as its SIM.toml describes it: read and checked; all mistakes in one error.

docs/cosim.md lists the keys.
"""
from __future__ import annotations

import difflib
import errno
import os
import re
import secrets
import shlex
import shutil
import socket
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from fledge import serial_line
from fledge.errors import Mistakes
from fledge.loopback import is_loopback
from registers.checked_toml import Tables, TomlError, parse, shown, text_of
from registers.location import line_of

POLICIES = ("abort", "pause", "hold", "drop", "restart")
TRANSPORTS = ("ipc", "tcp")
LATENCIES = ("same_instant", "next_instant", "next_exchange")
PLACEHOLDERS = ("simulation", "node", "address", "seed", "until", "record")
WHEN_IT_COMES = "when it comes"
SSH = ("ssh", "-o", "BatchMode=yes", "-o", "ServerAliveInterval=5", "{host}")

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_TAKEN = ("controller", "all", "exchange")      # by Fledge's own logs and records
_OF_FMU = ("every", "reads", "messages", "latency")     # alone
_OF_MISSION = ("process", "scenario", "free", "parameters", "target", "board", "elf")


class SimError(Mistakes):
    """All mistakes in the description of a simulation, one a line."""


def _key(check: str, default: Any = None, *arguments: Any, of: str = "") -> Any:
    """A field that a key of the file fills. check: the method of _Reader that reads it; of: "node" if only nodes have
    the key, "asynchronous" if only asynchronous programs have it."""
    default_ = {"default_factory": default} if callable(default) else {"default": default}
    return field(**default_, metadata={"check": check, "arguments": arguments, "of": of})


@dataclass
class Program:
    """One program to start, and what the run does without it."""
    name: str = _key("name", "?")
    mission: str | None = _key("text")
    process: str | None = _key("text")
    scenario: str | None = _key("text")
    free: bool = _key("flag", False)
    parameters: dict = _key("table", dict)
    target: str | None = _key("text", of="node")        # flies the process, as `fledge fly --on` does
    board: list[str] = _key("words", list, of="node")   # files of the target's boards, or folders
    elf: str | None = _key("text", of="node")           # the program of a target at a serial line
    fmu: str | None = _key("text", of="node")           # flies in the place of the process, or alone
    every: float = _key("seconds", 0.0, of="node")      # [s] a step of an FMU alone
    reads: dict[str, str] = _key("table", dict, of="node")      # its input messages -> topics
    messages: dict[str, dict] = _key("table", dict, of="node")  # its further ones -> type, and field -> variable
    latency: str = _key("choice", "next_exchange", LATENCIES, of="node")    # of what it reads
    step_timeout: float = _key("seconds", 30.0, of="node")      # [s] of the clock, for a step of an FMU
    command: list[str] | None = _key("words")           # None: a process of a mission, or started by hand
    by_hand: bool = _key("flag", False)
    directory: str = _key("text", ".")                  # on the host if there is one
    env: dict[str, str] = _key("environment", dict)
    host: str | None = _key("text")
    launcher: list[str] | None = _key("words", None, True)
    fledge: str | None = _key("text")                   # the folder of Fledge on the host
    keys: str | None = _key("text")
    on_loss: str = _key("choice", "abort", POLICIES)    # "abort" of an asynchronous program: the run goes on without it
    restarts: int = _key("integer", 0, 0, 1_000_000)
    joins: float | str | None = _key("joins", of="node")        # [s] simulated; None: at the start
    killed: float | None = _key("seconds", of="node")   # [s] simulated, after which its program is killed
    rejoins: bool = _key("flag", False, of="node")
    save_every: float = _key("seconds", 0.0, of="node")         # [s] simulated
    reply: float | None = _key("seconds", of="node")            # [s]; None: as the others
    prefix: str = _key("prefix", "", of="node")                 # its topics begin with it in the run
    topics: dict[str, str] = _key("topic_map", dict, of="node")     # its name of a topic -> that of the run
    writes: list[str] = _key("topics", list, of="asynchronous")
    link: str | None = _key("text", of="asynchronous")          # carries the packets of a flight process there,
    radio: str | None = _key("text", of="asynchronous")         # by this radio of the world
    steers: bool = _key("flag", False, of="asynchronous")       # it may pause the run and change its pace
    serve: str | None = _key("text", of="asynchronous")         # the file of a control room's server
    complete: bool = _key("flag", False, of="asynchronous")     # it misses no message: the run waits for it
    observers: int = 1                                          # by so many connections
    sees: list[str] = field(default_factory=list)               # the topics of packets that it carries
    asynchronous: bool = False
    flies: bool = False     # a flight process of a mission

    def named(self, topic: str) -> str:
        """What the run calls a topic of it."""
        return self.topics.get(topic) or (f"/{self.prefix}{topic}" if self.prefix else topic)


@dataclass
class Plan:
    """A whole simulation."""
    simulation: str = _key("simulation_name")
    until: float | None = _key("seconds")               # [s]
    programs: list[Program] = field(default_factory=list)
    mission: str | None = _key("text")                  # whose processes are nodes
    scenario: str | None = _key("text")
    parameters: dict = _key("table", dict)
    seed: int = _key("integer", 0, 0, 2**63 - 1)
    pace: float = _key("seconds", 0.0, "simulated seconds per second")      # 0: as fast as possible
    transport: str = _key("choice", "ipc", TRANSPORTS)
    address: str | None = _key("text")
    keys: str | None = _key("path")
    unencrypted: bool = _key("flag", False)
    any_user: bool = _key("flag", False)                # programs of other users of this machine
    record: bool = _key("flag", True)                   # of each process of a mission
    exchange: bool = _key("flag", False)                # record every message between nodes
    keep_every: float = _key("seconds", 0.0)            # [s] simulated, between snapshots of all nodes; 0: none
    watch: list[str] = _key("topics", list)             # topics to write although no node subscribes to them
    join: float = _key("seconds", 60.0)                 # [s]
    greet: float = _key("seconds", 30.0)                # [s]
    reply: float = _key("seconds", 60.0)                # [s]
    file: str = ""
    report: bool = False                                # flight records all outputs, for the scenario's checks

    @property
    def recorded(self) -> bool:
        """Whether there is a record of all messages between nodes."""
        return self.exchange or self.report or self.keep_every > 0

    @property
    def nodes(self) -> list[Program]:
        return [p for p in self.programs if not p.asynchronous]

    @property
    def beyond(self) -> bool:
        """Whether other machines take part, or may."""
        return any(p.host for p in self.programs) or bool(self.address and not is_local(self.address))

    def tables(self) -> Iterator[tuple[tuple, Program]]:
        """Each program with the path of its table in the file."""
        for kind, programs in (("node", self.nodes), ("asynchronous", [p for p in self.programs if p.asynchronous])):
            yield from (((kind, i), p) for i, p in enumerate(programs))

    def listening(self) -> str:
        """The address at which the controller listens; if none is given, a new abstract name each time."""
        if self.address:
            return self.address
        hosts = [p.host for p in self.programs if p.host]
        if hosts:
            return f"tcp://{own_address(hosts[0])}:*"
        if self.transport == "tcp":
            return "tcp://127.0.0.1:*"
        return f"ipc://@fledge-{self.simulation[:40]}-{os.getpid()}-{secrets.token_hex(4)}"


def is_local(address: str) -> bool:
    host = address.removeprefix("tcp://").rpartition(":")[0]
    return address.startswith("ipc://") or is_loopback(host.removeprefix("[").removesuffix("]"))


def own_address(host: str) -> str:
    """The address of this machine that a host sees. No packet is sent for it. Raises OSError."""
    name = host.rpartition("@")[2]
    family, kind, _, _, where = socket.getaddrinfo(name, 9, type=socket.SOCK_DGRAM)[0]
    with socket.socket(family, kind) as probe:
        probe.connect(where)
        own = probe.getsockname()[0]
    return f"[{own}]" if family == socket.AF_INET6 else own


def read(path: Path, targets: Mapping[str, Any] | None = None, scenario: str | None = None) -> Plan:
    """The simulation of a file. targets: those that may fly its processes; scenario: instead of the file's, of its
    `mission`. Raises SimError with all mistakes."""
    try:
        data, lines = parse(text_of(path), path)
    except TomlError as error:
        raise SimError(str(error)) from None
    reader = _Reader(path, lines, targets or {})
    for place, text in _texts(data, ()):
        if "\0" in text:   # no program, file or variable takes it
            reader.refuse(place, "no text holds the character U+0000", f"it is {shown(text)}", "leave it out")
    if reader.problems:
        raise SimError(reader.complaints())
    plan = reader.plan({**data, "scenario": scenario} if scenario else data)
    if reader.problems:
        raise SimError(reader.complaints())
    return plan


def _texts(value: Any, path: tuple) -> Iterator[tuple[tuple, str]]:
    """All texts of a file with their places, those of its keys included."""
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield (*path, key), key
            yield from _texts(inner, (*path, key))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from _texts(inner, (*path, i))


class _Reader(Tables):
    """The tables of a simulation."""

    def __init__(self, path: Path, lines: dict, targets: Mapping[str, Any]):
        super().__init__(str(path), lines)
        self.targets = targets
        self.folder, self.stem = path.resolve().parent, path.stem
        self.names: dict[str, tuple] = {}
        self.devices: dict[str, str] = {}           # of serial lines -> the node
        self.written: dict[str, list[str]] = {}     # the topics that a process of a mission writes, by program

    def plan(self, data: dict) -> Plan:
        plan = Plan(self.stem, file=self.file)
        self.fill(plan, data, (), "", ("node", "asynchronous"))
        tables = {kind: self.tables(data, (), kind) for kind in ("node", "asynchronous")}
        order = self.of_mission(plan, tables["node"])
        plan.programs = [self.program(table, (kind, i), kind) for kind in tables for i, table in
                         enumerate(tables[kind])]
        plan.watch += sorted({topic for p in plan.programs for topic in p.sees} - {*plan.watch})
        if not plan.nodes and not self.problems:
            self.refuse((), "a simulation has nodes", "there is none", "write [[node]] with a name and a command, "
                        "or a mission")
        for path, p in plan.tables():
            if isinstance(p.joins, float) and plan.until is not None and p.joins >= plan.until:
                self.refuse((*path, "joins"), "a node joins before the end", f"{p.name} joins at {p.joins:g} s, "
                            f"the run ends at {plan.until:g} s", "choose an earlier time")
            if p.killed is not None and (p.by_hand or p.killed <= (p.joins if isinstance(p.joins, float) else -1.0)
                                         or plan.until is not None and p.killed >= plan.until):
                self.refuse((*path, "killed"), "`killed` is a time at which a program that `fledge up` starts takes "
                            "part", f"{p.name} is to be killed at {p.killed:g} s" +
                            ", but is started by hand" * p.by_hand,
                            "choose a time after it joins and before the end")
        if plan.nodes and all(p.joins is not None for p in plan.nodes):
            self.refuse(("node", 0, "joins"), "some node is there at the start", "all join later",
                        "leave `joins` out of one")
        self.writers(plan)
        self.network(plan)
        plan.programs.sort(key=lambda p: order.index(p.process) if p.process in order else len(order))
        return plan

    def of_mission(self, plan: Plan, nodes: list[dict]) -> list[str]:
        """Let the processes of the file's `mission` be nodes: each table of one gets the mission, and those without a
        table get one. Returns the names of the processes in their order."""
        for key in ("scenario", "parameters"):
            if getattr(plan, key) and not plan.mission:
                self.refuse((key,), f"`{key}` is of a `mission`", "there is none", "write mission = \"NAME\"")
        if not plan.mission:
            return []
        from fledge.errors import CompositionError, SetupError

        name = str(self.folder / plan.mission) if os.sep in plan.mission else plan.mission
        try:
            sim, duration = processes_of(name, plan.scenario, plan.parameters)
        except CompositionError:
            raise
        except (SetupError, TypeError) as error:
            self.refuse(("mission",), "the mission can be loaded", str(error), "see ./fledge list")
            nodes.clear()
            return []
        plan.until = duration if plan.until is None else plan.until
        own = {"mission": plan.mission, "parameters": plan.parameters} | (
            {"scenario": plan.scenario} if plan.scenario else {})
        order = [p.name for p in sim.processes if p.tasks]
        for table in nodes:
            alone = "fmu" in table and table.get("process", table.get("name")) not in order
            if not alone and not any(key in table for key in ("mission", "command", "by_hand")):
                table |= {key: value for key, value in own.items() if key not in table}
        given = [table.get("process", table.get("name")) for table in nodes
                 if table.get("mission") in (None, plan.mission)]    # a program of its name stands in for a process
        nodes += [{**own, "process": process} for process in order if process not in given]
        return order

    def writers(self, plan: Plan) -> None:
        """Refuse a map that gives a topic two writers, as far as the missions tell, and asynchronous programs of one
        topic: the controller would take the messages of one of them."""
        asynchronous: dict[str, Program] = {}
        for path, p in plan.tables():
            if path[0] == "asynchronous":
                for topic in p.writes:
                    own = next((q for q in plan.programs if q.asynchronous and not q.writes and q is not p
                                and topic.startswith(f"/{q.name}/")), None)
                    other = own or asynchronous.setdefault(topic, p)
                    if other is not p:
                        self.refuse((*path, "writes"), "a topic has one writer",
                                    f"{other.name} and {p.name} both write {topic}",
                                    f"let {p.name} write another topic, or give {own.name} the topics that it writes"
                                    if own else "let one of them write `writes = []`, or another topic")
        found: dict[str, tuple[tuple, Program]] = {}
        for path, p in plan.tables():
            for topic in self.written.get(p.name, ()):
                place, other = found.setdefault(p.named(topic), (path, p))
                ends = (path, p), (place, other)
                mapped = next(((where, program) for where, program in ends if program.topics or program.prefix),
                              None)
                if other is not p and mapped:
                    self.refuse((*mapped[0], "topics" if mapped[1].topics else "prefix"), "a topic has one writer",
                                f"{other.name} and {p.name} both write {p.named(topic)}",
                                "give one of them another prefix, or this topic another name")
                    break

    def fill(self, target: Plan | Program, table: dict, path: tuple, kind: str, others: tuple[str, ...] = ()) -> None:
        """Fill a Plan or Program from a table. A wrong value leaves the default. others: further keys of the table."""
        keys = {f.name: f.metadata for f in fields(target) if f.metadata and f.metadata["of"] in ("", kind)}
        self.keys(table, path, (*keys, *others))
        for key, how in keys.items():
            if key in table:
                value = getattr(self, how["check"])(table, path, key, *how["arguments"])
                if value not in (None, ""):
                    setattr(target, key, value)

    # ---- the network

    def network(self, plan: Plan) -> None:
        address = plan.address
        if address is not None and not re.fullmatch(r"ipc://@[^/\s]+|tcp://[^\s/]+:(\d+|\*)", address):
            found = "a file of that name would stay behind" if address.startswith("ipc://") else \
                f"it is {shown(address)}"
            self.refuse(("address",), "an address is an abstract name of this machine, or a TCP port", found,
                        'write "ipc://@name", "tcp://127.0.0.1:7000", or "tcp://192.0.2.1:*" for any free port')
            return
        for path, p in plan.tables() if address is None else ():
            if p.host and (why := unreachable(p.host)):
                self.refuse((*path, "host"), "a host can be found", f"{p.host}: {why}",
                            "give its name or number as user@address")
                return
            if p.launcher and not p.host and "netns" in p.launcher:
                self.refuse(("address",), "in a network namespace nodes need an address that it reaches",
                            "there is no `address`", 'write address = "tcp://ADDRESS:*", that of this side')
                return
        if address is not None and (why := busy(address)):
            self.refuse(("address",), "the controller can listen there", f"{address}: {why}",
                        "choose another port, or `*` for any that is free")
        if plan.beyond and not plan.keys and not plan.unencrypted:
            where = next(((*path, "host") for path, p in plan.tables() if p.host), ("address",))
            self.refuse(where, "what leaves the machine is encrypted", "there are no `keys`",
                        "make them with ./fledge keys new and write keys = \"FOLDER\"; or, in a network that you "
                        "trust, unencrypted = true")
        for path, keys in [((), plan.keys), *((path, p.keys) for path, p in plan.tables() if not p.host)]:
            if keys and not Path(keys).exists():
                self.refuse((*path, "keys"), "`keys` is a folder made by ./fledge keys", f"there is no {keys}",
                            "make it, or give the right one")
            elif keys and not path:
                self.allowed(plan, Path(keys))

    def allowed(self, plan: Plan, folder: Path) -> None:
        """Check that the controller has its keys, and that they admit all nodes."""
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

    # ---- a program

    def program(self, table: dict, path: tuple, kind: str) -> Program:
        p = Program(asynchronous=kind == "asynchronous")
        if "name" not in table:
            p.name = self.name(table, path, "name", table.get("process", ...))
        self.fill(p, table, path, kind)
        if not p.host:
            p.keys = p.keys and str(self.folder / p.keys)
            p.directory = str(self.folder / p.directory)
            if not Path(p.directory).is_dir():
                self.refuse((*path, "directory"), "a program starts in a folder", f"there is no {p.directory}",
                            "it is relative to the file's")
                p.command = None
        self.start(table, path, p)
        if p.asynchronous and table.get("on_loss", "restart") != "restart":
            self.refuse((*path, "on_loss"), "no node waits for an asynchronous program", f"{p.name} has "
                        f"{shown(p.on_loss)}", 'write on_loss = "restart", or leave it out: the run goes on without it')
        if p.on_loss == "restart":
            p.restarts = p.restarts if "restarts" in table else 3
            if p.by_hand:
                self.refuse((*path, "on_loss"), "who starts a program starts it again", f"{p.name} is started by hand",
                            'write on_loss = "pause"')
        elif "restarts" in table:
            self.refuse((*path, "restarts"), '`restarts` is of on_loss = "restart"', f"{p.name} has "
                        f"{shown(p.on_loss)}", 'leave it out, or write on_loss = "restart"')
        return p

    def start(self, table: dict, path: tuple, p: Program) -> None:
        """Check how the program starts."""
        given = [key for key in ("mission", "command", "by_hand", "link", "serve") if table.get(key)]
        if p.fmu and not p.mission:
            given.append("fmu")
        if len(given) != 1:
            self.refuse((*path, given[1] if given else "command"),
                        "a program is a `mission` with its `process`, an `fmu`, a `command`, or started `by_hand`",
                        f"of {p.name} there is {'and '.join(f'`{g}` ' for g in given) or 'neither'}".rstrip(),
                        'write one, for example command = ["python3", "model.py"]')
            return
        if p.asynchronous and p.mission:
            self.refuse((*path, "mission"), "a mission's processes are nodes", f"{p.name} is asynchronous",
                        "write [[node]]")
        if p.radio and not p.link:
            self.refuse((*path, "radio"), "`radio` is of a `link`", f"{p.name} has none", "leave it out")
        if p.fmu and not p.host:
            self.fmu(table, path, p)
        for key in (*_OF_FMU, "step_timeout"):
            if key in table and not (p.fmu and (key == "step_timeout" or not p.mission)):
                self.refuse((*path, key), f"`{key}` is of an `fmu`" + " alone" * (key in _OF_FMU),
                            f"{p.name} is none", "leave it out")
        for key in _OF_MISSION:
            if key in table and not p.mission and not (p.link and key == "process" or p.fmu and key == "parameters"):
                self.refuse((*path, key), f"`{key}` is of a `mission`", f"{p.name} has none", "leave it out")
        if p.mission:
            p.process = p.process or p.name
            if not p.host:
                self.mission(table, path, p, p.mission, p.process)
        elif p.link:
            self.link(table, path, p, p.link)
        elif p.serve:
            self.serve(table, path, p, self.folder / p.serve)
        elif p.command and not p.host:      # on a host the log will say if it is missing
            self.executable(path, p, p.command)
        for name in re.findall(r"\{(\w+)\}", "\0".join(p.command or ())):
            near = difflib.get_close_matches(name, PLACEHOLDERS, 1)
            if name not in PLACEHOLDERS and near:
                self.refuse((*path, "command"), "only known words in braces are filled in",
                            f"there is {{{name}}}", f"did you mean {{{near[0]}}}?")

    def fmu(self, table: dict, path: tuple, p: Program) -> None:
        """Check an FMU in the place of a process, or alone, by its model description."""
        from fledge.cosim.fmu import fmu_node, own_topics
        from fledge.errors import SetupError
        from fledge.fmi import Archive

        p.fmu = str(self.folder / str(p.fmu))
        if p.target:
            self.refuse((*path, "fmu"), "a target or an FMU flies a process", f"{p.name} has both", "leave one out")
        for message in p.messages.values():
            if isinstance(message, dict) and str(message.get("type")).endswith(".fmu"):
                message["type"] = str(self.folder / message["type"])
        words = [key for key in ("reads", "messages") if not all(
            isinstance(value, str if key == "reads" else dict) for value in getattr(p, key).values())]
        for key in words:
            self.refuse((*path, key), f"`{key}` has " + ("topics by input messages" if key == "reads" else
                        "types, and variables by fields"), f"it is {shown(getattr(p, key))}", "write for example " + (
                            'reads = { inputs = "/wind/fmu/outputs" }' if key == "reads" else
                            'messages.torque = { type = "BodyTorque", torque_B = "tau" }'))
        if words or not p.mission and not p.every:
            if not p.mission and not p.every:
                self.refuse((*path, "every"), "an FMU alone has a time from step to step", f"{p.name} has none",
                            "write for example every = 0.01")
            return
        try:
            if p.mission:
                Archive(p.fmu)
            else:
                node = fmu_node(p.fmu, p.name, p.every, reads=p.reads or None, parameters=p.parameters, messages={
                    name: (str(message.get("type")), {key: value for key, value in message.items() if key != "type"})
                    for name, message in p.messages.items()})
                p.topics = {**own_topics(node, p.fmu), **p.topics}
                self.written[p.name] = list(own_topics(node, p.fmu))
        except SetupError as error:
            self.refuse((*path, "fmu"), "an FMU can be flown", str(error), "docs/fmi.md says what it needs")

    def link(self, table: dict, path: tuple, p: Program, address: str) -> None:
        """A link by which foreign tools command a flight process; with `writes = []` they only see its telemetry."""
        from fledge.errors import SetupError
        from fledge.ground.scripts.address import link_of

        try:
            link_of(address)
        except SetupError as error:
            self.refuse((*path, "link"), "a link has an address", str(error), "docs/ground.md lists them")
        if not p.process:
            self.refuse((*path, "link"), "a link is of a flight process", f"{p.name} names none",
                        'write process = "flight"')
        else:
            self.carries(table, p, [(p.process, p.radio)])

    def serve(self, table: dict, path: tuple, p: Program, file: Path) -> None:
        """The server of a control room (docs/control-room.md), whose spacecraft have the links cosim:PROCESS."""
        p.serve, p.steers = str(file), True
        try:
            crafts = parse(text_of(file), file)[0].get("craft", [])
        except (TomlError, OSError) as error:
            self.refuse((*path, "serve"), "`serve` is the file of a control room", str(error),
                        "it is relative to this file's folder")
            return
        links = [urlsplit(str(craft.get("link", ""))) for craft in crafts if isinstance(craft, dict)]
        radios = [(link.path, dict(parse_qsl(link.query)).get("radio")) for link in links if link.scheme == "cosim"]
        if not radios:
            self.refuse((*path, "serve"), "a control room in a co-simulation has a spacecraft there",
                        f"none in {file} has a link cosim:PROCESS", 'write link = "cosim:flight" in its [[craft]]')
        self.carries(table, p, radios)

    @staticmethod
    def carries(table: dict, p: Program, links: list[tuple[str, str | None]]) -> None:
        """The packets of these processes, by a radio or without; without `writes` their commands, too."""
        from fledge.ground.scripts.member import topics_of

        topics = [topics_of(process, radio) for process, radio in links]
        p.sees = [down for _, down in topics]
        p.complete, p.observers = table.get("complete") is not False, len(links)
        if "writes" not in table:
            p.writes = [up for up, _ in topics]

    def executable(self, path: tuple, p: Program, command: list[str]) -> None:
        if p.launcher and not shutil.which(p.launcher[0]):
            self.refuse((*path, "launcher"), "the launcher can be found", f"there is no {p.launcher[0]}",
                        "install it, or write its path")
        program, folder = command[0], Path(p.directory)
        here = {"PATH": os.environ.get("PATH", os.defpath), **p.env}["PATH"]
        if "/" in program:
            file = folder / program
            if not file.is_file():
                self.refuse((*path, "command"), "the program can be found", f"there is no {file}",
                            "build it, or write the path relative to `directory`")
            elif not os.access(file, os.X_OK):
                self.refuse((*path, "command"), "the program can be started", f"{file} is not executable",
                            f"chmod +x it, or write what runs it before: [\"python3\", \"{program}\"]")
        elif not shutil.which(program, path=here):
            near = difflib.get_close_matches(program, ("python3", "sh", "bash"), 1)
            self.refuse((*path, "command"), "the program can be found", f"{program} is not on the PATH",
                        f"did you mean {near[0]}?" if near else "install it, or write its path: "
                        f"\"./{program}\" is relative to `directory`")
        elif len(command) > 1 and re.fullmatch(r"[^-{][^{]*\.(py|exe|sh|jl|js)", command[1]) \
                and not (folder / command[1]).is_file():
            self.refuse((*path, "command"), "the program can be found", f"there is no {folder / command[1]}",
                        "it is relative to `directory`")

    def mission(self, table: dict, path: tuple, p: Program, mission: str, process: str) -> None:
        from fledge.errors import CompositionError, SetupError

        p.mission = str(self.folder / mission) if os.sep in mission else mission
        try:
            processes = topics_of(p.mission, p.parameters, None if p.free else p.scenario or "")
        except CompositionError:
            raise
        except SetupError as error:
            self.refuse((*path, "mission"), "the mission can be loaded", str(error), "see ./fledge list")
            return
        if process not in processes:
            near = difflib.get_close_matches(process, processes, 1)
            self.refuse((*path, "process" if "process" in table else "name"), "the process is one of the mission's",
                        f"{table['mission']} has no `{process}`",
                        f"did you mean `{near[0]}`?" if near else f"choose {', '.join(processes)}")
            return
        writes, reads, p.flies = processes[process]
        if p.target or p.board or p.elf:
            self.target(path, p)
            writes, reads = [*writes, f"/{process}/telemetry"], [*reads, f"/{process}/commands"]
        self.written[p.name] = writes
        known = [*writes, *reads]
        for topic in p.topics:
            if topic not in known:
                near = difflib.get_close_matches(topic, known, 1)
                self.refuse((*path, "topics"), "`topics` renames what the process reads or writes",
                            f"{process} has no {topic}", f"did you mean {near[0]}?" if near else
                            f"choose of {', '.join(known)}")
        for topic in known:
            other = next((name for name in p.topics if name != topic and p.topics[name] == p.named(topic)), None)
            if other:
                self.refuse((*path, "topics"), "topics stay apart", f"{other} and {topic} of {process} both become "
                            f"{p.named(topic)}", "choose another name")
                break

    def target(self, path: tuple, p: Program) -> None:
        names = [name for name in self.targets if name != "desktop"]
        p.elf = p.elf and str(self.folder / p.elf)
        if p.elf and not serial_line.is_line(p.target):
            self.refuse((*path, "elf"), "`elf` is of a target at a serial line", f"{p.name} has {shown(p.target)}",
                        f"leave it out, or write target = {shown(serial_line.EXAMPLE)}")
        p.board = [str(self.folder / file) for file in p.board]
        if not p.target:
            self.refuse((*path, "board"), "`board` is of a `target`", f"{p.name} has none", 'write target = "linux"')
        elif not p.flies:
            self.refuse((*path, "target"), "a target flies a flight process", f"{p.process} is none", "leave it out")
        elif serial_line.is_line(p.target):
            self.at_line(path, p)
        elif serial_line.is_apart(p.target):
            pass        # problems of a host show when the session connects to it
        elif p.target not in names:
            near = difflib.get_close_matches(p.target, names, 1)
            self.refuse((*path, "target"), "the target is one of Fledge or of this project",
                        f"there is no `{p.target}`",
                        f"did you mean `{near[0]}`?" if near else f"choose {', '.join(names)}")
        elif missing := self.targets[p.target].missing():
            self.refuse((*path, "target"), "the target is installed", f"{p.target} needs {', '.join(missing)}",
                        f"./fledge setup --on {p.target}")
        for file in p.board:
            if not Path(file).is_file() and not [*Path(file).glob("*.toml")]:
                self.refuse((*path, "board"), "the files of boards are there, or folders with files *.toml",
                            f"there is no {file}", "it is relative to the file's folder")

    def at_line(self, path: tuple, p: Program) -> None:
        """Check a target that is a board at a serial line."""
        from fledge import elf
        from fledge.errors import Failure
        try:
            device, _ = serial_line.read(str(p.target))
        except Failure as error:
            self.refuse((*path, "target"), "a serial line is serial:DEVICE?baud=N&reset=end|go-on&cut=SECONDS",
                        str(error), f"write for example {shown(serial_line.EXAMPLE)}")
            return
        other = self.devices.setdefault(device, p.name)
        if other != p.name:
            self.refuse((*path, "target"), "a board flies one process", f"{other} flies on {device}, too",
                        "connect one more")
        elif not os.path.exists(device):
            self.refuse((*path, "target"), "the board is connected", f"there is no device {device}",
                        f"choose {', '.join(serial_line.devices()) or 'another one; there is no serial device here'}")
        if p.elf:
            try:
                elf.read(p.elf)
            except Failure as error:
                self.refuse((*path, "elf"), "`elf` is the program that the board has", str(error),
                            "it is relative to the file's folder")

    # ---- values

    def name(self, table: dict, path: tuple, key: str, default: Any = ...) -> str:
        name = Tables.text(self, table, path, key, default)
        if not isinstance(name, str) or not name:
            return "?"
        if not _NAME.fullmatch(name) or name in _TAKEN:
            self.refuse((*path, "name"), "a name is of letters, digits, `_`, `-` and `.`, and not `controller`, "
                        "`all` or `exchange`", f"it is {shown(name)}", "it also names the program's log")
        elif name in self.names:
            self.refuse((*path, "name"), "names differ", f"`{name}` stands in line "
                        f"{line_of(self.lines, self.names[name])} too", "rename one")
        self.names.setdefault(name, (*path, "name"))
        return name

    def simulation_name(self, table: dict, path: tuple, key: str) -> str:
        name = self.text(table, path, key)
        if isinstance(table[key], str) and not _NAME.fullmatch(name):
            self.refuse((key,), "a simulation's name is of letters, digits, `_`, `-` and `.`", f"it is {shown(name)}",
                        "it also names the folder of its runs")
        return name

    def flag(self, table: dict, path: tuple, key: str) -> bool | None:
        return self.value(table, path, key, (bool,), "true or false", ...)

    def path(self, table: dict, path: tuple, key: str) -> str | None:
        text = self.text(table, path, key)
        return text and str(self.folder / text)

    def seconds(self, table: dict, path: tuple, key: str, words: str = "seconds") -> float | None:
        value = table[key]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= 1e9:
            self.refuse((*path, key), f"`{key}` is {words}, from 0 to 1e9", f"it is {shown(value)}",
                        "write a number such as 60 or 0.5")
            return None
        return float(value)

    def joins(self, table: dict, path: tuple, key: str) -> float | str | None:
        return WHEN_IT_COMES if table[key] == WHEN_IT_COMES else self.seconds(
            table, path, key, f"the simulated seconds after which it takes part, or {shown(WHEN_IT_COMES)}")

    def words(self, table: dict, path: tuple, key: str, split: bool = False) -> list[str] | None:
        value = table[key]
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

    def topics(self, table: dict, path: tuple, key: str) -> list[str] | None:
        value = table[key]
        if not isinstance(value, list) or not all(isinstance(t, str) and re.fullmatch(r"/[^,\s]{1,254}", t)
                                                  and t.isprintable() for t in value):
            self.refuse((*path, key), f"`{key}` is a list of topics", f"it is {shown(value)}",
                        'write for example ["/ground/command"]')
            return None
        return value

    def prefix(self, table: dict, path: tuple, key: str) -> str:
        prefix = self.text(table, path, key)
        if isinstance(table[key], str) and not _NAME.fullmatch(prefix):
            self.refuse((*path, key), "`prefix` is of letters, digits, `_`, `-` and `.`", f"it is {shown(prefix)}",
                        'write for example prefix = "a": /world/x of the node is /a/world/x in the run')
            return ""
        return prefix

    def topic_map(self, table: dict, path: tuple, key: str) -> dict[str, str] | None:
        value = self.table(table, path, key)
        for ours, of_run in value.items():
            if not all(isinstance(t, str) and re.fullmatch(r"/[^,>\s]{1,254}", t) and t.isprintable()
                       for t in (ours, of_run)):
                self.refuse((*path, key), "`topics` renames topics", f"{shown(ours)} is {shown(of_run)}",
                            'write for example topics = { "/world/nav/orbit" = "/other/orbit" }')
                return None
        for of_run in {t for t in value.values() if list(value.values()).count(t) > 1}:
            self.refuse((*path, key), "topics stay apart", f"two of them become {of_run}", "choose another name")
            return None
        return value

    def environment(self, table: dict, path: tuple, key: str) -> dict[str, str] | None:
        env = self.table(table, path, key)
        for name, value in env.items():
            if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z_]\w*", name):
                self.refuse((*path, key), "`env` holds texts by the names of variables",
                            f"{name} is {shown(value)}", 'write for example env = { LEVEL = "2" }')
                return None
        return env


def processes_of(mission: str, scenario: str | None, parameters: dict) -> tuple[Any, float | None]:
    """(the loaded mission, the duration of the scenario's first run [s]), of a mission without a scenario None. Raises
    SetupError."""
    from fledge.mission import load
    from fledge.mission.scenario import chosen, set_up

    sim = load(mission, **parameters)
    assert sim.mission      # load() gives one
    duration = set_up(sim, chosen(sim, scenario)[1]) if scenario or sim.mission.scenarios else None
    sim.check()
    return sim, duration


def topics_of(mission: str, parameters: dict, scenario: str | None) -> dict[str, tuple[list[str], list[str], bool]]:
    """(topics that it writes, that it reads of others, whether it is flight) of a mission's processes, by name.
    scenario: "": the first; None: none. Raises SetupError, also if neither files nor scenario make it fly."""
    from fledge import objects
    from fledge.mission import load
    from fledge.mission.crossing import crossing_wires
    from fledge.mission.scenario import chosen, set_up

    sim = load(mission, **parameters)
    assert sim.mission      # load() gives one
    if sim.problems and sim.mission.scenarios and scenario is not None:
        set_up(sim, chosen(sim, scenario)[1])
    sim.check()
    crossing = crossing_wires(sim)
    return {p.name: ([f"/{p.name}/{name}/{f.name}" for name, instance in p.instances.items()
                      for f in objects.struct(instance).fields if f.group == "out"],
                     list(dict.fromkeys(wire.topic for wire in crossing if wire.port.startswith(p.name + "."))),
                     p in sim.flights)
            for p in sim.processes}


def unreachable(host: str) -> str:
    """Why a host cannot be reached from here; "" if there is a way."""
    try:
        own_address(host)
    except OSError as error:
        return (error.strerror or str(error)).lower()
    return ""


def busy(address: str) -> str:
    """Why the controller cannot listen at an address; "" if it is free, or if only libzmq can resolve it."""
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
        return {errno.EADDRINUSE: "another program listens there already",
                errno.EADDRNOTAVAIL: "it is not an address of this machine"}.get(error.errno, error.strerror.lower())
    return ""
