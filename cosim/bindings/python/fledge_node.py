# SPDX-License-Identifier: Apache-2.0
"""A Python program as a node of a co-simulation. This file is all that is needed, with pyzmq.

    from fledge_node import Node, s

    node = Node("spin", "thermal", "tcp://127.0.0.1:7000", every=1 * s)
    node.reads("/world/sun/direction")
    node.writes("/thermal/plate/state", "PlateState", '''
        float64 T  # T [K] temperature
    ''')

    @node.step
    def step(t):
        sun = node["/world/sun/direction"]            # {"head.t": ..., "s_B": [0.0, 0.6, 0.8]}
        node["/thermal/plate/state"] = {"T": 300 + 10 * sun["s_B"][2]}

    node.run()

A program that steps with nobody, a viewer or a ground system, watches and writes as an Observer, on a
thread of its own or beside a script:

    with Observer("spin", "ground") as observer:
        observer.subscribe("/thermal/")
        for message in observer:                      # until the run is over
            print(message.topic, message.t, message["T"])
            observer.write("/ground/heater", {"on": 1})

Messages are dicts from the true names of their fields (nested ones with dots) to numbers, or lists
of numbers in memory order. Where a field is an enumeration or holds a text, a str may be given; what
is read has the name of an enumeration's value as `.name`, and text() makes a str of its numbers.

A definition is needed on one side only: without one here, that of the partner comes when the run
begins, so that all messages of a mission are known. Where it begins with a Fledge head, its time,
quality and sequence are filled in unless they are given. Times are integers in nanoseconds.

The format is described in cosim/protocol.h; names here follow it.
"""
import os
import pathlib
import re
import struct
import textwrap
import threading
import time
import zlib

import zmq
import zmq.auth

ns, us, ms, s = 1, 10**3, 10**6, 10**9

LATENCIES = {"same_instant": 0, "next_instant": 1, "next_exchange": 2}
KINDS = ["Hello", "Welcome", "Refused", "Initialize", "Initialized", "ProvideDesired", "Desired", "Match",
         "Matched", "Start", "Ready", "Tick", "Tock", "Finish", "Finished", "Failed", "Attached", "Published",
         "Save", "Saved"]
VERSION = 1
LARGEST = 64 << 20  # bytes of a frame


class NodeError(RuntimeError):
    """The controller refuses the node, is not there, or breaks the format."""


# ---- definitions

PRIMITIVES = {"float64": "d", "float32": "f", "int64": "q", "uint64": "Q", "int32": "i", "uint32": "I",
              "int16": "h", "uint16": "H", "int8": "b", "uint8": "B", "bool": "B", "byte": "B", "char": "B"}
_MEMBER = re.compile(r"([^\s\[#]+)(?:\[(\d+)\])?\s+([A-Za-z_]\w*)\s*(?:#\s*(\S*)(.*))?", re.ASCII)
_CHOICES = re.compile(r"\{([^{}]*)\}\s*$")


class Choice(int):
    """The value of an enumeration. name: as its definition says, None if it says nothing."""

    def __new__(cls, value, choices):
        self = super().__new__(cls, value)
        self.name = next((name for name, number in choices.items() if number == value), None)
        return self


def text(numbers):
    """The str that is in an array of characters, up to the first zero."""
    return bytes(x & 255 for x in numbers).partition(b"\0")[0].decode()


class Schema:
    """What a message looks like: its name and ros2msg text. Packs dicts and unpacks bytes."""

    def __init__(self, name, text):
        self.name = name
        self.text = textwrap.dedent(text).strip("\n") + "\n" if text else ""
        self.fields = []  # (true name, numbers, is an array)
        self.choices = {}  # of those that are enumerations: true name -> {name: value}
        self.size = self.hash = 0
        if self.text:
            codes = self._walk(self._sections(), None, "", 0)
            for code, n in codes:
                item = struct.calcsize(code)
                if self.size % item:
                    raise NodeError(f"{name}: padding would be needed before a {code} at byte {self.size}")
                self.size += item * n
            form = "".join(f"{n}{code}" for code, n in codes)
            self._packers = {order: struct.Struct(order + form) for order in "<>"}
            self.hash = 0xcbf29ce484222325
            for byte in self.text.encode():
                self.hash = (self.hash ^ byte) * 0x100000001b3 & 0xffffffffffffffff

    def _sections(self):
        sections, name = {None: []}, None
        lines = iter(self.text.split("\n"))
        for line in lines:
            if len(line) == 80 and not line.strip("="):
                name = next(lines, "").rpartition(":")[2].strip().rpartition("/")[2]
                sections[name] = []
            elif line.partition("#")[0].strip():
                sections[name].append(line.strip())
        return sections

    def _walk(self, sections, section, prefix, depth):
        codes = []
        for line in sections[section]:
            match = _MEMBER.fullmatch(line)
            if not match or depth > 16:
                raise NodeError(f'{self.name}: expected "<type> <name>" of fixed size, found "{line}"')
            kind, count, name, told, comment = match.groups()
            name = prefix + (told if told and told.lower() == name.lower() else name)
            n = int(count or 1)
            if kind in PRIMITIVES:
                choices = _CHOICES.search(comment or "")
                if choices and count is None and not kind.startswith("float"):
                    pairs = re.findall(r"(\w+)=(-?\d+)(?=,|$)", choices[1])
                    self.choices[name] = {key: int(value) for key, value in pairs}
                self.fields.append((name, n, count is not None))
                codes.append((PRIMITIVES[kind], n))
            elif kind.rpartition("/")[2] in sections:
                for i in range(n):
                    inner = f"{name}[{i}]." if count else name + "."
                    codes += self._walk(sections, kind.rpartition("/")[2], inner, depth + 1)
            else:
                raise NodeError(f"{self.name}: {kind} is not of fixed size or not defined")
        return codes

    def pack(self, values, order="<"):
        """The struct, little-endian unless asked otherwise. Fields that are not given are zero. Raises NodeError."""
        unknown = values.keys() - {name for name, _, _ in self.fields}
        if unknown:
            raise NodeError(f"{self.name} has no field {', '.join(sorted(unknown))}; it has "
                            f"{', '.join(name for name, _, _ in self.fields)}")
        numbers = []
        for name, n, array in self.fields:
            value = values.get(name, [0] * n if array else 0)
            if isinstance(value, str):
                value = self._numbers(name, n, array, value)
            value = list(value) if array else [value]
            if len(value) != n:
                raise NodeError(f"{self.name}.{name} takes {n} numbers, found {len(value)}")
            numbers += value
        try:
            return self._packers[order].pack(*numbers)
        except (struct.error, OverflowError) as error:
            raise NodeError(f"{self.name}: {error}") from None

    def _numbers(self, name, n, array, text):
        """Of a text, or of the name of a value."""
        if not array:
            if text not in self.choices.get(name, {}):
                raise NodeError(f"{self.name}.{name} has no value {text}; it has "
                                f"{', '.join(self.choices.get(name, [])) or 'only numbers'}")
            return self.choices[name][text]
        data = text.encode()
        if len(data) > n:
            raise NodeError(f"{self.name}.{name} takes {n} bytes of text, found {len(data)}")
        return data.ljust(n, b"\0")

    def unpack(self, payload):
        """A dict, from a payload: CDR header and struct."""
        if len(payload) != self.size + 4 or payload[0] or payload[1] > 1 or payload[2:4] != b"\0\0":
            raise NodeError(f"a {self.name} of {len(payload)} bytes, expected a CDR header and {self.size}")
        numbers = self._packers["<" if payload[1] else ">"].unpack_from(payload, 4)
        values, at = {}, 0
        for name, n, array in self.fields:
            values[name] = list(numbers[at:at + n]) if array else numbers[at]
            at += n
        for name, choices in self.choices.items():
            values[name] = Choice(values[name], choices)
        return values


# ---- frames

class _Writer:
    """Numbers at multiples of their size, from the start of the body."""

    def __init__(self, order="<"):
        self.body, self.order = bytearray(), order

    def number(self, code, x):
        self.body += bytes(-len(self.body) % struct.calcsize(code))
        self.body += struct.pack(self.order + code, x)

    def bytes(self, data):
        self.number("I", len(data))
        self.body += data

    def text(self, text):
        self.bytes(text.encode())

    def schema(self, schema):
        self.text(schema.name)
        self.text(schema.text)
        self.number("I", schema.size)
        self.number("Q", schema.hash)

    def frame(self, kind, number):
        return struct.pack(self.order + "4sBBHIIII", b"FLCS", self.order == "<", VERSION, KINDS.index(kind) + 1,
                           len(self.body), zlib.crc32(self.body), number, 0) + self.body


class _Reader:
    """A frame is read whole or refused, with the byte and the reason."""

    def __init__(self, frame):
        if len(frame) > LARGEST:
            raise NodeError(f"a frame of {len(frame)} bytes; {LARGEST} are the most")
        if len(frame) < 24 or frame[:4] != b"FLCS":
            raise NodeError("this is no frame of a co-simulation")
        if frame[4] > 1:
            raise NodeError(f"there is no byte order {frame[4]}")
        if frame[5] != VERSION:
            raise NodeError(f"version {frame[5]} of the format, while this program speaks version {VERSION}")
        self.order = "<" if frame[4] else ">"
        kind, size, crc, self.request, zero = struct.unpack_from(self.order + "HIIII", frame, 6)
        self.body, self.at = frame[24:], 0
        if size != len(self.body):
            raise NodeError(f"a body of {len(self.body)} bytes, while the header says {size}")
        if crc != zlib.crc32(self.body):
            raise NodeError("the checksum of the body is wrong")
        if zero:
            raise NodeError("bytes 20 to 23 of the header are not zero")
        if not 1 <= kind <= len(KINDS):
            raise NodeError(f"there is no frame of kind {kind}")
        self.kind = KINDS[kind - 1]

    @classmethod
    def of(cls, snapshot):
        """Reads what a _Writer of this file has in its body."""
        self = cls.__new__(cls)
        self.kind, self.order, self.body, self.at = "snapshot", "<", snapshot, 0
        return self

    def number(self, code):
        size = struct.calcsize(code)
        while self.at % size:
            if self._take(1) != b"\0":
                self._fail("a gap is not zero")
        return struct.unpack(self.order + code, self._take(size))[0]

    def bytes(self, most=LARGEST):
        n = self.number("I")
        if n > most:
            self._fail(f"a length of {n}; {most} is the most")
        return self._take(n)

    def text(self, most=1 << 20):
        data = self.bytes(most)
        if b"\0" in data:
            self._fail("a text holds a zero byte")
        try:
            return data.decode()
        except UnicodeDecodeError:
            self._fail("a text is not UTF-8")

    def name(self):
        return self.text(255)

    def schema(self):
        name, text = self.name(), self.text()
        self.number("I")
        self.number("Q")
        return name, text

    def list(self, item, least):
        """Of what `item` reads, each of which takes so many bytes at least."""
        n = self.number("I")
        if n > 65536:
            self._fail(f"a list of {n} items; 65536 are the most")
        if n > (len(self.body) - self.at) // least:
            self._fail(f"a list of {n} items does not fit into what is left")
        return [item() for _ in range(n)]

    def channels(self):
        return self.list(lambda: (self.number("I"), self.name(), self.schema()), 28)

    def record(self):
        """(from when on it is seen, channel, count, payload)"""
        return self.number("q"), self.number("I"), self.number("I"), self.bytes()

    def records(self):
        return self.list(self.record, 20)

    def end(self):
        if self.at != len(self.body):
            self._fail(f"{len(self.body) - self.at} bytes are left over")

    def _take(self, n):
        left = len(self.body) - self.at
        if n > left:
            self._fail(f"it ends here, {n - left} bytes too early")
        self.at += n
        return self.body[self.at - n:self.at]

    def _fail(self, why):
        raise NodeError(f"{self.kind}: byte {self.at} of the body: {why}")


# ---- the node

class Node:
    """One program's part in a run.

    simulation, name, address: None: what FLEDGE_SIMULATION, FLEDGE_NODE and FLEDGE_ADDRESS say
    keys: a folder or file of `./fledge keys`, for a controller that asks for them; None: FLEDGE_KEYS
    every, offset: [ns] it steps at offset + k every
    patience: [s] for the controller to be there
    """

    def __init__(self, simulation=None, name=None, address=None, *, every, offset=0, patience=60,
                 keys=None):
        simulation = _given("simulation", simulation, "FLEDGE_SIMULATION")
        name = _given("name", name, "FLEDGE_NODE")
        address = _given("address", address, "FLEDGE_ADDRESS")
        self.simulation, self.name, self.address = simulation, name, address
        self._keys = _read_keys(keys or os.environ.get("FLEDGE_KEYS"), name)
        if every <= 0 or offset < 0:
            raise NodeError(f"every has to be > 0 ns and offset >= 0 ns; found {every} and {offset}")
        self.every, self.offset, self.patience = every, offset, patience
        self.seed = self.end = None  #: of the run, once it has begun
        self.reason = None           #: of its end; "" at the regular one
        self._wants = {}     # topic -> (latency, optional, Schema)
        self._writes = {}    # topic -> [Schema, initial value]
        self._channels = {}  # channel -> topic, of what is read
        self._seen = {}      # topic -> payload, as last seen
        self._values = {}    # topic -> dict of it, once somebody has looked
        self._counts = {}    # channel -> messages, read or written
        self._offers = {}    # topic -> channel, of what is written
        self._latest = {}    # topic -> (time, count, dict), as last written; from a snapshot, bytes
        self._sequence = {}  # topic -> of its head
        self._coming = []    # records that no instant has seen
        self._now = -1       # the instant of the last step
        self._leaving = False
        self._step = self._save = self._restore = None

    def reads(self, topic, latency="same_instant", optional=False, name="", text=""):
        """Read a topic. Without a definition, it is as its writer says."""
        if latency not in LATENCIES:
            raise NodeError(f"there is no latency {latency}; there are {', '.join(LATENCIES)}")
        self._wants[topic] = (LATENCIES[latency], optional, Schema(name, text))

    def writes(self, topic, name="", text="", initial=None):
        """Write a topic, which holds `initial` before the first step; all zero unless it is given.
        Without a definition, it is as its reader says."""
        self._writes[topic] = [Schema(name, text), dict(initial or {})]

    def step(self, function):
        """The function that is called with each instant [ns]."""
        self._step = function
        return function

    def __getitem__(self, topic):
        """What was read last, a dict; None where nobody writes an optional topic."""
        if topic not in self._wants:
            raise NodeError(f"{self.name} does not read {topic}; it reads {', '.join(self._wants) or 'nothing'}")
        if topic not in self._values and topic in self._seen:
            self._values[topic] = self._wants[topic][2].unpack(self._seen[topic])
        return self._values.get(topic)

    def __setitem__(self, topic, values):
        """Write a message, now."""
        if topic not in self._writes:
            raise NodeError(f"{self.name} does not write {topic}; it writes {', '.join(self._writes) or 'nothing'}")
        self._sequence[topic] = self._sequence.get(topic, 0) + 1
        self._latest[topic] = (self._now, self._sequence[topic], dict(values))
        if topic in self._offers:
            self._written[topic] = self._packed(topic)

    def saves(self, function):
        """The function that returns, as bytes, all that another program of this name needs to go on from
        here. With restores(), one that was lost is started again without all its steps from the beginning."""
        self._save = function
        return function

    def restores(self, function):
        """The function that takes what saves() returned, before the first step of the other program."""
        self._restore = function
        return function

    def leave(self):
        """Take no further part in the run: what this step writes is the last. run() returns then."""
        self._leaving = True

    def _packed(self, topic):
        """The message as it was last written, with a head where it begins with one."""
        schema, initial = self._writes[topic]
        if topic not in self._latest:
            return schema.pack(initial)
        t, sequence, values = self._latest[topic]
        if isinstance(values, bytes):
            return values
        if schema.fields and schema.fields[0][0] == "head.t":
            values = {"head.t": t, "head.quality": 3, "head.sequence": sequence} | values
        return schema.pack(values)

    def run(self):
        """Take part in a run, to its end. Returns its reason, "" at the regular one. Raises NodeError,
        and what the step raises."""
        with zmq.Context() as context:
            address = self._greet(context)
            with context.socket(zmq.PAIR) as link:
                _set_up(link, 1000, self._keys)
                monitor = link.get_monitor_socket(zmq.EVENT_DISCONNECTED)
                try:
                    link.connect(address)
                    link.send(self._hello())
                    self._serve(link, monitor)
                finally:
                    link.disable_monitor()
                    monitor.close(0)
        return self.reason

    def _hello(self):
        return _hello(self.simulation, self.name, role=0)

    def _greet(self, context):
        r = _greet(context, self.address, self._hello(), self.name, self.patience, self._keys)
        if r.kind != "Welcome":
            raise NodeError(f"the controller answers a Hello with {r.kind}")
        address = r.text()
        r.text(), r.number("Q")  # shared memory, which is not for Python
        r.end()
        return _reachable(address, self.address)

    def _serve(self, link, monitor):
        poller = zmq.Poller()
        poller.register(link, zmq.POLLIN)
        poller.register(monitor, zmq.POLLIN)
        patience = 1000 * self.patience  # for the first request
        while self.reason is None:
            ready = dict(poller.poll(patience))
            if not ready:
                raise NodeError("the controller let this program in, but asks nothing of it")
            if link not in ready:
                raise NodeError("the controller is gone")
            frame, patience, number, w = link.recv_multipart(), None, 0, _Writer()
            try:
                if len(frame) != 1:
                    raise NodeError(f"a frame is one part, not {len(frame)}")
                r = _Reader(frame[0])
                number = r.request
                answer = getattr(self, "_on_" + r.kind, None)
                if not answer:
                    raise NodeError(f"the controller sent {r.kind}, which is no request")
                kind = answer(r, w)
            except BaseException as error:
                w = _Writer()
                w.text(f"{type(error).__name__}: {error}".replace("\0", ""))
                link.send(w.frame("Failed", number))
                raise
            link.send(w.frame(kind, r.request))

    def _on_Initialize(self, r, w):
        self.seed, self.end, start = r.number("Q"), r.number("q"), r.number("q")
        r.text(), r.text()
        snapshot = r.bytes()
        r.end()
        if self._step is None:
            raise NodeError("there is no step function")
        self._next = self.offset
        if start >= self.offset:  # in the place of one that was lost
            self._next += ((start - self.offset) // self.every + 1) * self.every
        if snapshot:
            self._go_on_from(_Reader.of(snapshot))
        w.number("I", 1)
        w.number("q", self.every)
        w.number("q", self.offset)
        w.number("B", 0)  # it writes at its instants only
        w.number("B", bool(self._save and self._restore))
        return "Initialized"

    def _on_ProvideDesired(self, r, w):
        r.end()
        w.number("I", len(self._wants))
        for topic, (latency, optional, schema) in self._wants.items():
            w.text(topic)
            w.number("B", latency)
            w.number("B", optional)
            w.schema(schema)
        return "Desired"

    def _on_Match(self, r, w):
        asked = [channel for channel in r.channels() if channel[1] in self._writes]
        r.end()
        w.number("I", len(asked))
        self._offers = {}
        for channel, topic, (name, text) in asked:
            self._offers[topic] = channel
            if not self._writes[topic][0].text:
                self._writes[topic][0] = Schema(name, text)
            w.number("I", channel)
            w.schema(self._writes[topic][0])
            w.bytes(b"\0\1\0\0" + self._packed(topic))
        return "Matched"

    def _on_Start(self, r, w):
        self._channels, self._counts, self._coming = {}, {}, []
        for channel, topic, (name, text) in r.channels():
            self._channels[channel] = topic
            latency, optional, _ = self._wants[topic]
            self._wants[topic] = (latency, optional, Schema(name, text))
        r.end()
        return "Ready"

    def _on_Tick(self, r, w):
        until = r.number("q")
        records = r.records()
        r.end()
        for t, channel, count, payload in records:
            self._count(channel, count)
            self._coming.append((t, channel, payload))
        self._coming.sort(key=lambda record: record[0])
        out, begun = [], time.perf_counter_ns()
        while self._next <= until:
            self._now = self._next
            while self._coming and self._coming[0][0] <= self._now:
                _, channel, payload = self._coming.pop(0)
                topic = self._channels[channel]
                self._seen[topic] = payload
                self._values.pop(topic, None)
            self._written = {}
            self._step(self._now)
            for topic, message in self._written.items():
                channel = self._offers[topic]
                self._counts[channel] = self._counts.get(channel, 0) + 1
                out.append((self._now, channel, self._counts[channel], b"\0\1\0\0" + message))
            self._next += self.every
            if self._leaving:
                until = self._now
        w.number("q", until)
        w.number("q", time.perf_counter_ns() - begun)
        w.number("B", self._leaving)
        w.number("I", len(out))
        for t, channel, count, payload in out:
            w.number("q", t)
            w.number("I", channel)
            w.number("I", count)
            w.bytes(payload)
        return "Tock"

    def _on_Save(self, r, w):
        r.number("q")
        r.end()
        snapshot = b""  # it cannot
        if self._save and self._restore and all(self._writes[topic][0].text for topic in self._latest):
            snapshot = self._snapshot()
        w.bytes(snapshot)
        return "Saved"

    def _snapshot(self):
        w = _Writer()
        w.number("I", len(self._seen))
        for topic, payload in self._seen.items():
            w.text(topic)
            w.bytes(payload)
        w.number("I", len(self._latest))
        for topic, (t, sequence, _) in self._latest.items():
            w.text(topic)
            w.number("q", t)
            w.number("I", sequence)
            w.bytes(self._packed(topic))
        w.bytes(self._save())
        return bytes(w.body)

    def _go_on_from(self, r):
        if not self._restore:
            raise NodeError("there is a snapshot to go on from, but no restores()")
        self._seen = dict(r.list(lambda: (r.text(), r.bytes()), 8))
        for topic, t, sequence, message in r.list(lambda: (r.text(), r.number("q"), r.number("I"), r.bytes()), 20):
            self._latest[topic] = t, sequence, message
            self._sequence[topic] = sequence
        self._restore(r.bytes())
        r.end()

    def _on_Finish(self, r, w):
        self.reason = r.text()
        r.end()
        return "Finished"

    def _count(self, channel, count):
        if channel not in self._channels or count != self._counts.get(channel, 0) + 1:
            raise NodeError(f"message {count} on channel {channel} is not the next one")
        self._counts[channel] = count


class Seen(dict):
    """A message as it was written: a dict, with .topic, .node, .t [ns] (-1 before the first step), .count (on
    its topic; 0: what it held at the beginning) and .missed (messages between the one seen before and this)."""

    def __init__(self, topic, node, t, count, missed, values):
        super().__init__(values)
        self.topic, self.node, self.t, self.count, self.missed = topic, node, t, count, missed


class Observer:
    """A program that steps with nobody. It comes and goes as it likes, sees what nodes write, and may write what
    nodes read and the controller's configuration says comes from it. The run never waits for it: what
    it does not take in time it misses, and is told how much.

    simulation, name, address, keys: as of a Node
    patience: [s] for the controller to be there, and the nodes to have met

    It is for one thread, but write() may be called by others. Close it, or use `with`.
    """

    def __init__(self, simulation=None, name=None, address=None, *, patience=60, keys=None):
        self.simulation = _given("simulation", simulation, "FLEDGE_SIMULATION")
        self.name = _given("name", name, "FLEDGE_NODE")
        self.address = _given("address", address, "FLEDGE_ADDRESS")
        self.patience = patience
        self.topics = {}    #: topic -> Schema, of all that there are
        self.missed = 0     #: messages, of all topics
        self.reason = None  #: of the end of the run, once it is over; "" at the regular one
        self.t = 0          #: [ns] of the newest message
        self._keys = _read_keys(keys or os.environ.get("FLEDGE_KEYS"), self.name)
        self._seen = {}     # topic -> (count, t) of the last message
        self._counts = {}   # topic -> messages written
        self._lock = threading.Lock()
        self._written = None
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.SUB)
        self._handshake = _Handshake(self._socket, self._keys)
        try:
            self._attach()
            _set_up(self._socket, 0, self._keys)
            self._socket.subscribe("finish")
            self._socket.connect(self._backend)
        except BaseException:
            self.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if not self._context.closed:
            self._handshake.close()
            self._socket.close(0)
            if self._written:
                self._written.close()
            self._context.term()

    def subscribe(self, *topics):
        """See all topics that begin like one of these; "": all. Of each the last comes at once."""
        for topic in topics:
            self._socket.subscribe(topic)

    def next(self, timeout=None):
        """The next message, a Seen. None if none comes in time [s], or the run is over. Raises NodeError if the
        controller is gone."""
        end = None if timeout is None else time.monotonic() + timeout
        while self.reason is None:
            rest = 0.1 if end is None else max(0, min(0.1, end - time.monotonic()))
            if _wait(self._socket, self._handshake, rest, f"the broker at {self._backend}"):
                seen = self._read(self._socket.recv_multipart())
                if seen is not None:
                    return seen
            elif self._handshake.lost and time.monotonic() - self._handshake.lost > 2:
                raise NodeError("the controller is gone")  # one that was stopped for long would be let in again
            elif end is not None and time.monotonic() >= end:
                break
        return None

    def __iter__(self):
        while self.reason is None:
            seen = self.next()
            if seen is not None:
                yield seen

    def write(self, topic, values):
        """Write a message. Where it begins with a Fledge head, that is filled in unless it is given."""
        with self._lock:
            schema = self._schema(topic)
            count = self._counts.get(topic, 0) + 1
            if schema.fields and schema.fields[0][0] == "head.t":
                values = {"head.t": self.t, "head.quality": 3, "head.sequence": count} | values
            w = _Writer()
            w.number("q", 0)
            w.number("I", 0)
            w.number("I", count)
            w.bytes(b"\0\1\0\0" + schema.pack(values))
            w.text(self.name)
            if not self._written:
                self._prepare_writing()
            if not self._written.poll(1000 * self.patience, zmq.POLLOUT):
                raise NodeError(f"the broker at {self._frontend} takes no more")
            self._written.send_multipart([topic.encode(), w.frame("Published", 0)])
            self._counts[topic] = count

    def _attach(self):
        r = _greet(self._context, self.address, _hello(self.simulation, self.name, role=1), self.name, self.patience,
                   self._keys)
        if r.kind != "Attached":
            raise NodeError(f"the controller answers an asynchronous program with {r.kind}")
        self._frontend, self._backend = (_reachable(r.text(), self.address) for _ in range(2))
        for _, topic, (name, text) in r.channels():
            if topic not in self.topics or self.topics[topic].text != text:
                self.topics[topic] = Schema(name, text)
        r.end()

    def _schema(self, topic):
        if topic not in self.topics:
            self._attach()  # nodes may have joined
        if topic not in self.topics:
            raise NodeError(f"there is no topic {topic}; there are {', '.join(self.topics) or 'none'}")
        return self.topics[topic]

    def _read(self, parts):
        """A Seen; None for what has been seen already, and for the end."""
        if len(parts) != 2:
            raise NodeError("the broker sends a message that is not of two parts")
        topic, r = parts[0].decode(), _Reader(parts[1])
        if r.kind == "Finish":
            self.reason = r.text()
            self._socket.unsubscribe("finish")  # which says that it has come
            return None
        if r.kind != "Published":
            raise NodeError(f"the broker sends {r.kind}")
        t, _, count, payload = r.record()
        node = r.name()
        r.end()
        before, at = self._seen.get(topic, (None, None))
        if (before, at) == (count, t):
            return None  # it came again for another, who subscribed
        self._seen[topic] = (count, t)
        missed = 0 if before is None else max(0, count - before - 1 if count > before else count - 1)
        self.missed += missed
        self.t = max(self.t, t)
        with self._lock:
            schema = self._schema(topic)
        return Seen(topic, node, t, count, missed, schema.unpack(payload))

    def _prepare_writing(self):
        """What is sent before the broker has said that it listens would be lost."""
        socket = self._context.socket(zmq.XPUB)
        _set_up(socket, 1000, self._keys)
        socket.xpub_nodrop = True
        handshake = _Handshake(socket, self._keys)
        try:
            socket.connect(self._frontend)
            if not _wait(socket, handshake, self.patience, f"the broker at {self._frontend}"):
                raise NodeError(f"no broker listens at {self._frontend}")
            socket.recv()
        except BaseException:
            handshake.close()
            socket.close(0)
            raise
        handshake.close()
        self._written = socket


def _given(what, value, variable):
    value = value or os.environ.get(variable)
    if not value:
        raise NodeError(f"a node needs its {what}, given here or by {variable}")
    return value


def _read_keys(place, name):
    """(public, secret, the controller's public), by the folder's rules in cosim/keys.h; None without a place."""
    if not place:
        return None
    place = pathlib.Path(place)
    secret = place
    if place.is_dir():
        secret = place / f"{name}.secret"
        others = [path for path in sorted(place.glob("*.secret")) if path.name != "controller.secret"]
        if "/" in name or not secret.exists():
            if len(others) != 1:
                raise NodeError(f"{place} holds no {name}.secret" + (
                    f" but several others; say which by FLEDGE_KEYS={others[0]}" if others else
                    f"; ./fledge keys new {name} makes a pair of keys"))
            secret = others[0]
    if not secret.exists():
        raise NodeError(f"{secret}: there are no keys; ./fledge keys new {name} makes a pair")
    if secret.stat().st_mode & 0o77:
        raise NodeError(f"{secret}: others may read this secret key; chmod 600 keeps it yours, and if they might "
                        "have, make a new one")
    try:
        controller = zmq.auth.load_certificate(secret.with_name("controller.public"))[0]
        own = zmq.auth.load_certificate(secret)
    except (OSError, ValueError) as error:
        raise NodeError(f"keys: {error}") from None
    if not own[1] or any(len(key) != 40 for key in (*own, controller)):
        raise NodeError(f"{secret} or {secret.with_name('controller.public')} is no file of a key")
    return *own, controller


class _Handshake:
    """Watches a socket that connects: libzmq itself would try for ever, and tell nobody why."""

    def __init__(self, socket, keys):
        self.socket, self.keys, self.made, self.lost, self._broken_off = socket, keys, False, None, 0
        self.monitor = socket.get_monitor_socket(
            zmq.EVENT_DISCONNECTED | zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_HANDSHAKE_FAILED_AUTH
            | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL)

    def look(self, where):
        """Raises NodeError if this program is not let in there."""
        while self.monitor.poll(0):
            kind, value = struct.unpack("=HI", self.monitor.recv_multipart()[0])
            why = self._refusal(kind, value)
            if why:
                raise NodeError(f"{where} does not let this program in: {why}")

    def _refusal(self, kind, value):
        if kind == zmq.EVENT_HANDSHAKE_SUCCEEDED:
            self.made, self.lost, self._broken_off = True, None, 0
        elif kind == zmq.EVENT_DISCONNECTED:
            if self.made:
                self.made, self.lost = False, time.monotonic()
        elif kind == zmq.EVENT_HANDSHAKE_FAILED_AUTH:
            return "it does not know this key: ./fledge keys allow, where the controller runs, lets it in"
        elif kind == zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL and value == zmq.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH:
            return ("it uses no keys, and this program does" if self.keys else
                    "it asks for keys, and this program has none: give it some by FLEDGE_KEYS "
                    "(./fledge keys new makes them)")
        else:
            self._broken_off += 1
            if self._broken_off >= 5:  # it may have been killed just now; again and again it is something else
                return ("what listens there breaks off when it sees these keys: controller.public here is not that "
                        "of this controller, or it uses no keys" if self.keys else
                        "what listens there breaks off: it is no controller, or it asks for keys")
        return None

    def close(self):
        self.socket.disable_monitor()
        self.monitor.close(0)


def _wait(socket, handshake, patience, where):
    """Whether something came to the socket in time [s]. Raises NodeError if this program is not let in."""
    poller = zmq.Poller()
    poller.register(socket, zmq.POLLIN)
    poller.register(handshake.monitor, zmq.POLLIN)
    end = time.monotonic() + patience
    while True:
        ready = dict(poller.poll(max(0, 1000 * (end - time.monotonic()))))
        if socket in ready or not ready:
            return bool(ready)
        handshake.look(where)


def _hello(simulation, name, role):
    w = _Writer()
    w.number("B", VERSION)
    w.number("B", VERSION)
    w.number("B", role)
    w.number("B", 0)  # without shared memory
    w.text(simulation)
    w.text(name)
    return w.frame("Hello", 1)


def _greet(context, address, hello, name, patience, keys):
    """The controller's answer, as a reader."""
    with context.socket(zmq.DEALER) as lobby:
        _set_up(lobby, 0, keys)
        handshake = _Handshake(lobby, keys)
        try:
            lobby.connect(address)
            lobby.send(hello)
            if not _wait(lobby, handshake, patience, f"the controller at {address}"):
                raise NodeError(f"no controller answers at {address}" if not handshake.made else
                                f"the controller at {address} has no answer: not all nodes are there")
            r = _Reader(lobby.recv())
        finally:
            handshake.close()
    if r.kind == "Refused":
        raise NodeError(f"the controller refuses {name}: {r.text()}")
    return r


def _reachable(address, controller):
    """A controller that listens everywhere does not know by which name it is reached."""
    if address.startswith("tcp://0.0.0.0:"):
        return controller.rpartition(":")[0] + ":" + address.rpartition(":")[2]
    return address


def _set_up(socket, linger, keys):
    socket.linger = linger
    if keys:
        socket.curve_publickey, socket.curve_secretkey, socket.curve_serverkey = keys
    socket.maxmsgsize = LARGEST
    socket.heartbeat_ivl = 1000
    socket.heartbeat_timeout = 5000
