# SPDX-License-Identifier: Apache-2.0
"""A Python program as a node of a co-simulation. This file is all that is needed, with pyzmq.

Example:

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

A program that takes no steps, a viewer or a ground system, reads and writes as an Observer, on a thread of its
own or within a script:

    with Observer("spin", "ground") as observer:
        observer.subscribe("/thermal/")
        for message in observer:                      # until the run is over
            print(message.topic, message.t, message["T"])
            observer.write("/ground/heater", {"on": 1})

Messages are dicts from the true names of their fields (nested ones with dots) to numbers, or lists
of numbers in memory order. A field that is an enumeration or holds a text accepts a str, and an array of numbers of a
byte accepts bytes; both may be shorter. An enumeration's value has its name as `.name`, and text() makes a str of an
array of characters.

Only one side needs to give a definition: a topic without one here takes that of the partner when the run begins,
so a node knows all messages of a mission. Where a message begins with a Fledge head, the node fills in its time,
quality and sequence unless the program gives them. Times are integers in nanoseconds.

cosim/protocol/protocol.h describes the format; names here follow it.
"""
import os
import pathlib
import re
import socket
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
CDR_LITTLE = b"\0\1\0\0"  # before a payload's struct
LARGEST = 64 << 20  # bytes of a frame
LONGEST = 10**18    # [ns] of a time
COUNTS = 1 << 32    # a count of messages begins again at 0 after so many
NAME, LINES = 255, 1 << 20  # bytes of a name, and of a reason or definition
# What drives a terminal (cosim/protocol/text.h); reasons and definitions may hold tabs and line feeds.
_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
_CONTROL_IN_LINES = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")


class NodeError(RuntimeError):
    """The controller refuses the node, is not there, or breaks the format."""


# ---- definitions

MOST_FIELDS, MOST_BYTES = 1 << 16, 1 << 24  # of a message
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
                if self.size > MOST_BYTES:
                    raise NodeError(f"{name}: the message is too large")
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
            kind, count, name, true_name, comment = match.groups()
            name = prefix + (true_name if true_name and true_name.lower() == name.lower() else name)
            n = int(count or 1)
            if len(self.fields) >= MOST_FIELDS or n > MOST_BYTES:
                raise NodeError(f"{self.name}: the message is too large")
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
        """The struct, little-endian by default. Fields that are not given are zero. Raises NodeError."""
        unknown = values.keys() - {name for name, _, _ in self.fields}
        if unknown:
            raise NodeError(f"{self.name} has no field {', '.join(sorted(unknown))}; it has "
                            f"{', '.join(name for name, _, _ in self.fields)}")
        numbers = []
        for name, n, array in self.fields:
            value = values.get(name, [0] * n if array else 0)
            if isinstance(value, (str, bytes)):
                value = self._numbers(name, n, array, value)
            value = list(value) if array else [value]
            if len(value) != n:
                raise NodeError(f"{self.name}.{name} takes {n} numbers, found {len(value)}")
            numbers += value
        try:
            return self._packers[order].pack(*numbers)
        except (struct.error, OverflowError) as error:
            raise NodeError(f"{self.name}: {error}") from None

    def with_head(self, values, t, sequence):
        """The values with those of a Fledge head, where the message begins with one; given values stay."""
        if self.fields and self.fields[0][0] == "head.t":
            return {"head.t": t, "head.quality": 3, "head.sequence": sequence} | values
        return values

    def _numbers(self, name, n, array, text):
        """The numbers for a text or bytes, or for the name of a value."""
        if not array:
            if text not in self.choices.get(name, {}):
                raise NodeError(f"{self.name}.{name} has no value {text}; it has "
                                f"{', '.join(self.choices.get(name, [])) or 'only numbers'}")
            return self.choices[name][text]
        data = text if isinstance(text, bytes) else text.encode()
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
    """Writes a body: numbers at multiples of their size, from its start."""

    def __init__(self, order="<"):
        self.body, self.order = bytearray(), order

    def number(self, code, x):
        self.body += bytes(-len(self.body) % struct.calcsize(code))
        self.body += struct.pack(self.order + code, x)

    def numbers(self, codes, *numbers):
        for code, x in zip(codes, numbers):
            self.number(code, x)

    def bytes(self, data):
        self.number("I", len(data))
        self.body += data

    def text(self, text):
        self.bytes(text.encode())

    def reason(self, text):
        """Lines for people: '?' for each character that is not allowed."""
        clean = _CONTROL_IN_LINES.sub("?", text).encode("utf-8", "replace")
        self.bytes(clean[:LINES].decode("utf-8", "ignore").encode())

    def schema(self, schema):
        self.text(schema.name)
        self.text(schema.text)
        self.numbers("IQ", schema.size, schema.hash)

    def frame(self, kind, number):
        return struct.pack(self.order + "4sBBHIIII", b"FLCS", self.order == "<", VERSION, KINDS.index(kind) + 1,
                           len(self.body), zlib.crc32(self.body), number, 0) + self.body


class _Reader:
    """Reads a frame. Raises NodeError, with the byte and the reason, if any part of it is wrong."""

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
        """A reader of a snapshot, which is the body of a _Writer."""
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

    def time(self, field, least=-1):
        """A time [ns]; -1: before the first instant."""
        t = self.number("q")
        if not least <= t <= LONGEST:
            self._fail(f"{field} is {t} ns; expected {least} to {LONGEST}")
        return t

    def name(self, field):
        return self._text(field, NAME, _CONTROL)

    def lines(self, field):
        """A reason or a definition."""
        return self._text(field, LINES, _CONTROL_IN_LINES)

    def _text(self, field, most, control):
        n = self.number("I")
        if n > most:
            self._fail(f"{field} has {n} bytes; {most} are the most")
        try:
            text = self._take(n).decode()
        except UnicodeDecodeError:
            self._fail(f"{field} is not UTF-8")
        match = control.search(text)
        if match:
            self._fail(f"{field} holds the control character U+{ord(match[0]):04X}")
        return text

    def schema(self):
        name, text = self.name("type"), self.lines("definition")
        self.number("I")
        self.number("Q")
        return name, text

    def list(self, item, least):
        """A list of what `item` reads. An item takes at least `least` bytes."""
        n = self.number("I")
        if n > 65536:
            self._fail(f"a list of {n} items; 65536 are the most")
        if n > (len(self.body) - self.at) // least:
            self._fail(f"a list of {n} items does not fit into what is left")
        return [item() for _ in range(n)]

    def channels(self):
        return self.list(lambda: (self.number("I"), self.name("topic"), self.schema()), 28)

    def record(self):
        """(time from which the node sees it, channel, count, payload)"""
        return self.time("t"), self.number("I"), self.number("I"), self.bytes()

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

class _Member:
    """A program that greets the controller: its names, the address, the keys."""

    def __init__(self, simulation, name, address, timeout, keys):
        self.simulation = _given("simulation", simulation, "FLEDGE_SIMULATION")
        self.name = _given("name", name, "FLEDGE_NODE")
        self.address = _given("address", address, "FLEDGE_ADDRESS")
        self.timeout = timeout
        self.reason = None  #: of the end of the run, once it is over; "" at the regular one
        self._keys = _read_keys(keys or os.environ.get("FLEDGE_KEYS"), self.name)

    def _hello(self):
        w = _Writer()
        w.numbers("BBBB", VERSION, VERSION, self._role, 0)  # without shared memory
        w.text(self.simulation)
        w.text(self.name)
        return w.frame("Hello", 1)

    def _greet(self, socket, expected):
        """The controller's answer, as a reader. A node keeps the socket until the controller's first request: until
        then, the loss of its connection is the program's."""
        _set_up(socket, 0, self._keys)
        handshake = _Handshake(socket, self._keys)
        try:
            socket.connect(self.address)
            end, where = time.monotonic() + self.timeout, f"the controller at {self.address}"
            if not self.address.startswith("ipc://") or handshake.connect(self.timeout, where):
                socket.send(self._hello())
            if not handshake.wait(end - time.monotonic(), where):
                raise NodeError(f"no controller answers at {self.address}" if not handshake.connected else
                                f"the controller at {self.address} has no answer: not all nodes are there")
            r = _Reader(socket.recv())
        finally:
            handshake.close()
        if r.kind == "Refused":
            raise NodeError(f"the controller refuses {self.name}: {r.lines('reason')}")
        if r.kind != expected:
            raise NodeError(f"the controller answers a Hello with {r.kind}")
        return r

    def _reachable(self, address):
        """A controller that listens on all interfaces does not know the name by which a node reaches it."""
        if address.startswith("tcp://0.0.0.0:"):
            return self.address.rpartition(":")[0] + ":" + address.rpartition(":")[2]
        return address


class _Subscription:
    """A topic that a node reads."""

    def __init__(self, latency, optional, schema, unread):
        self.latency, self.optional, self.schema = latency, optional, schema
        self.unread = unread  # payloads; None: only the last one is kept
        self.count = 0       # messages since the last matching
        self.payload = None  # of the last message
        self.values = None   # of the payload, once the program has looked


class _Publication:
    """A topic that a node writes."""

    def __init__(self, schema, initial):
        self.schema = schema
        self.message = initial          # the last one, written at t; a dict, or bytes from a snapshot
        self.t = self.sequence = 0      # in its head; sequence 0: the initial value
        self.channel, self.count = None, 0  # of the last matching; messages since then

    def packed(self):
        """The last message, with a head where it begins with one."""
        if isinstance(self.message, bytes):
            return self.message
        return self.schema.pack(self.schema.with_head(self.message, self.t, self.sequence) if self.sequence else
                                self.message)


class Node(_Member):
    """One program's part in a run.

    simulation, name, address: None: what FLEDGE_SIMULATION, FLEDGE_NODE and FLEDGE_ADDRESS say
    keys: a folder or file of `./fledge keys`, for a controller that asks for them; None: FLEDGE_KEYS
    every, offset: [ns] it steps at offset + k every
    timeout: [s] in which the controller must answer
    """

    _role = 0

    def __init__(self, simulation=None, name=None, address=None, *, every, offset=0, timeout=60, keys=None):
        super().__init__(simulation, name, address, timeout, keys)
        if every % 1 or offset % 1 or not 0 < every <= LONGEST or not 0 <= offset <= LONGEST:
            raise NodeError("every has to be a whole number of nanoseconds > 0 and offset one >= 0, both up to 31 "
                            f"years; found {every} and {offset}")
        self.every, self.offset = int(every), int(offset)
        self.seed = self.end = None  #: of the run, once it has begun
        self._subscriptions = {}     # by topic
        self._publications = {}      # by topic
        self._channels = {}          # channel -> subscription
        self._pending = []           # (t, subscription, payload) that no step has seen yet, in the order of t
        self._written = {}           # publication -> message of this step
        self._now = -1               # the instant of the last step
        self._leaving = False
        self._step = self._save = self._restore = None

    def reads(self, topic, latency="same_instant", optional=False, name="", text="", keep=False):
        """Read a topic. Without a definition, it is as its writer says. keep: unread() has all of its messages."""
        if latency not in LATENCIES:
            raise NodeError(f"there is no latency {latency}; there are {', '.join(LATENCIES)}")
        self._subscriptions[topic] = _Subscription(LATENCIES[latency], optional, Schema(name, text),
                                                   [] if keep else None)

    def schema(self, topic):
        """The Schema of a topic that this node reads or writes; without a definition here, once the run has begun."""
        return {**self._subscriptions, **self._publications}[topic].schema

    def unread(self, topic):
        """All messages of a topic that is read with keep=True, in order, since the last call: a node that steps less
        often than the topic's writer misses none."""
        subscription = self._subscriptions.get(topic)
        if subscription is None or subscription.unread is None:
            raise NodeError(f"{self.name} does not read {topic} with keep=True")
        messages, subscription.unread = subscription.unread, []
        return [subscription.schema.unpack(payload) for payload in messages]

    def writes(self, topic, name="", text="", initial=None):
        """Write a topic. `initial` is its value before the first step; fields without a value are zero. Without a
        definition, it is as its reader says."""
        self._publications[topic] = _Publication(Schema(name, text), dict(initial or {}))

    def step(self, function):
        """The node calls this function with each instant [ns]."""
        self._step = function
        return function

    def __getitem__(self, topic):
        """The last message of a topic, a dict; None where no node writes an optional topic."""
        if topic not in self._subscriptions:
            raise NodeError(f"{self.name} does not read {topic}; it reads "
                            f"{', '.join(self._subscriptions) or 'nothing'}")
        subscription = self._subscriptions[topic]
        if subscription.values is None and subscription.payload is not None:
            subscription.values = subscription.schema.unpack(subscription.payload)
        return subscription.values

    def __setitem__(self, topic, values):
        """Write a message, now."""
        if topic not in self._publications:
            raise NodeError(f"{self.name} does not write {topic}; it writes "
                            f"{', '.join(self._publications) or 'nothing'}")
        publication = self._publications[topic]
        publication.message, publication.t = dict(values), self._now
        publication.sequence = publication.sequence % (COUNTS - 1) + 1  # 0 is the initial value
        if publication.channel is not None:
            self._written[publication] = publication.packed()

    def saves(self, function):
        """The function returns, as bytes, all that the next steps depend on, besides the messages. With restores(),
        a node that was lost goes on from a snapshot; without it, from the beginning."""
        self._save = function
        return function

    def restores(self, function):
        """The function takes what saves() returned, before the first step of the program that goes on."""
        self._restore = function
        return function

    def leave(self):
        """Take no further part in the run. The node still sends what this step writes, and run() returns."""
        self._leaving = True

    def run(self):
        """Take part in a run, to its end. Returns its reason, "" at the regular one. Raises NodeError,
        and what the step raises."""
        with zmq.Context() as context, context.socket(zmq.DEALER) as greetings:
            welcome = self._greet(greetings, "Welcome")
            address = self._reachable(welcome.name("address"))
            welcome.name("shared"), welcome.number("Q")  # of shared memory, which Python does not use
            welcome.end()
            with context.socket(zmq.DEALER) as link:
                _set_up(link, 1000, self._keys)
                monitor = link.get_monitor_socket(zmq.EVENT_DISCONNECTED)
                try:
                    link.connect(address)
                    link.send(self._hello())
                    self._serve(link, monitor, greetings)
                finally:
                    link.disable_monitor()
                    monitor.close(0)
        return self.reason

    def _serve(self, link, monitor, greetings):
        poller = zmq.Poller()
        poller.register(link, zmq.POLLIN)
        poller.register(monitor, zmq.POLLIN)
        timeout = 1000 * self.timeout  # for the first request
        while self.reason is None:
            ready = dict(poller.poll(timeout))
            if not ready:
                raise NodeError("the controller let this program in, but asks nothing of it")
            if link not in ready:
                raise NodeError("the controller is gone")
            frame, timeout, number, w = link.recv_multipart(), None, 0, _Writer()
            greetings.close()  # the controller knows this program by its own connection now
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
                w.reason(f"{type(error).__name__}: {error}")
                link.send(w.frame("Failed", number))
                raise
            link.send(w.frame(kind, r.request))

    def _on_Initialize(self, r, w):
        self.seed, self.end, start = r.number("Q"), r.time("end", 0), r.time("start")
        r.name("frontend"), r.name("backend")
        snapshot = r.bytes()
        r.end()
        if self._step is None:
            raise NodeError("there is no step function")
        self._next = self.offset
        if start >= self.offset:  # in the place of a node that was lost
            self._next += ((start - self.offset) // self.every + 1) * self.every
        if snapshot:
            self._go_on_from(_Reader.of(snapshot))
        w.number("I", 1)
        w.numbers("qq", self.every, self.offset)
        w.numbers("BB", 0, bool(self._save and self._restore))  # 0: it writes at its instants only
        return "Initialized"

    def _on_ProvideDesired(self, r, w):
        r.end()
        w.number("I", len(self._subscriptions))
        for topic, subscription in self._subscriptions.items():
            w.text(topic)
            w.numbers("BB", subscription.latency, subscription.optional)
            w.schema(subscription.schema)
        return "Desired"

    def _on_Match(self, r, w):
        requested = [channel for channel in r.channels() if channel[1] in self._publications]
        r.end()
        for publication in self._publications.values():
            publication.channel = None
        w.number("I", len(requested))
        for channel, topic, (name, text) in requested:
            publication = self._publications[topic]
            publication.channel, publication.count = channel, 0
            if not publication.schema.text:
                publication.schema = Schema(name, text)
            w.number("I", channel)
            w.schema(publication.schema)
            w.bytes(CDR_LITTLE + publication.packed())
        return "Matched"

    def _on_Start(self, r, w):
        self._channels, self._pending = {}, []
        for channel, topic, (name, text) in r.channels():
            subscription = self._channels[channel] = self._subscriptions[topic]
            subscription.schema, subscription.count = Schema(name, text), 0
        r.end()
        return "Ready"

    def _on_Tick(self, r, w):
        until = r.time("until")
        records = r.records()
        r.end()
        for t, channel, count, payload in records:
            subscription = self._channels.get(channel)
            if not subscription or count != (subscription.count + 1) % COUNTS:
                raise NodeError(f"message {count} on channel {channel} is not the next one")
            subscription.count = count
            self._pending.append((t, subscription, payload))
        self._pending.sort(key=lambda record: record[0])
        out, begun = [], time.perf_counter_ns()
        while self._next <= until:
            self._now = self._next
            while self._pending and self._pending[0][0] <= self._now:
                _, subscription, subscription.payload = self._pending.pop(0)
                subscription.values = None
                if subscription.unread is not None:
                    subscription.unread.append(subscription.payload)
            self._written = {}
            self._step(self._now)
            for publication, message in self._written.items():
                publication.count = (publication.count + 1) % COUNTS
                out.append((self._now, publication.channel, publication.count, CDR_LITTLE + message))
            self._next += self.every
            if self._leaving:
                until = self._now
        w.numbers("qqB", until, time.perf_counter_ns() - begun, self._leaving)
        w.number("I", len(out))
        for *numbers, payload in out:
            w.numbers("qII", *numbers)
            w.bytes(payload)
        return "Tock"

    def _on_Save(self, r, w):
        r.time("time")
        r.end()
        snapshot = _Writer()  # empty: the node cannot make one
        written = {topic: p for topic, p in self._publications.items() if p.sequence}
        if self._save and self._restore and all(p.schema.text for p in written.values()):
            seen = {topic: sub.payload for topic, sub in self._subscriptions.items() if sub.payload is not None}
            snapshot.number("I", len(seen))
            for topic, payload in seen.items():
                snapshot.text(topic)
                snapshot.bytes(payload)
            snapshot.number("I", len(written))
            for topic, publication in written.items():
                snapshot.text(topic)
                snapshot.numbers("qI", publication.t, publication.sequence)
                snapshot.bytes(publication.packed())
            snapshot.bytes(self._save())
        w.bytes(snapshot.body)
        return "Saved"

    def _go_on_from(self, r):
        if not self._restore:
            raise NodeError("there is a snapshot to go on from, but no restores()")
        for topic, payload in r.list(lambda: (r.name("topic"), r.bytes()), 8):
            if topic in self._subscriptions:
                self._subscriptions[topic].payload = payload
        written = r.list(lambda: (r.name("topic"), r.time("t"), r.number("I"), r.bytes()), 20)
        for topic, t, sequence, message in written:
            if topic in self._publications:
                p = self._publications[topic]
                p.t, p.sequence, p.message = t, sequence, message
        self._restore(r.bytes())
        r.end()

    def _on_Finish(self, r, w):
        self.reason = r.lines("reason")
        r.end()
        return "Finished"


# ---- the observer

class Seen(dict):
    """A message as it was written: a dict, with .topic, .node, .t [ns] (-1 before the first step), .count (on
    its topic; 0: what it held at the beginning) and .missed (messages between the one seen before and this)."""

    def __init__(self, topic, node, t, count, missed, values):
        super().__init__(values)
        self.topic, self.node, self.t, self.count, self.missed = topic, node, t, count, missed


class Observer(_Member):
    """A program that takes no steps: a viewer, a ground system. It comes and goes at any time, sees what nodes write,
    and may write topics that the controller's configuration assigns to it. The run never waits for it: it
    misses the messages that it does not read in time, and counts them.

    simulation, name, address, keys: as of a Node
    timeout: [s] in which the controller must answer and all nodes must have joined

    One thread uses it, but other threads may call write(). Close it, or use `with`.
    """

    _role = 1

    def __init__(self, simulation=None, name=None, address=None, *, timeout=60, keys=None):
        super().__init__(simulation, name, address, timeout, keys)
        self.topics = {}      #: topic -> Schema, of all that there are
        self.missed = 0       #: messages, of all topics
        self.t = 0            #: [ns] of the newest message
        self.patience = 2     #: [s] after which a lost controller is gone; a stopped one that goes on connects earlier
        self._positions = {}  # topic -> (count, t) of the last message
        self._counts = {}     # topic -> messages written
        self._lock = threading.Lock()
        self._publisher = None
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
            if self._publisher:
                self._publisher.close()
            self._context.term()

    @property
    def lost(self):
        """Whether the connection to the controller is lost. What came before may still be unread."""
        return self._handshake.lost is not None

    def subscribe(self, *topics):
        """Subscribe to all topics with one of these prefixes; "": all. The last message of each comes at once."""
        for topic in topics:
            self._socket.subscribe(topic)
        self._socket.subscribe("ready")     # to the broker: it hears from here on

    def next(self, timeout=None):
        """The next message, a Seen. None if none comes in time [s], or the run is over. Raises NodeError if the
        controller is gone."""
        end = None if timeout is None else time.monotonic() + timeout
        while self.reason is None:
            rest = 0.1 if end is None else max(0, min(0.1, end - time.monotonic()))
            if self._handshake.wait(rest, f"the broker at {self._backend}"):
                seen = self._read(self._socket.recv_multipart())
                if seen is not None:
                    return seen
            elif self._handshake.lost and time.monotonic() - self._handshake.lost > self.patience:
                raise NodeError("the controller is gone")
            elif end is not None and time.monotonic() >= end:
                break
        return None

    def __iter__(self):
        while self.reason is None:
            seen = self.next()
            if seen is not None:
                yield seen

    def write(self, topic, values):
        """Write a message. Where it begins with a Fledge head, the observer fills in what the program does not give."""
        with self._lock:
            schema = self._schema(topic)
            count = (self._counts.get(topic, 0) + 1) % COUNTS
            w = _Writer()
            w.numbers("qII", 0, 0, count)
            w.bytes(CDR_LITTLE + schema.pack(schema.with_head(values, self.t, count)))
            w.text(self.name)
            if not self._publisher:
                self._prepare_writing()
            if not self._publisher.poll(1000 * self.timeout, zmq.POLLOUT):
                raise NodeError(f"the broker at {self._frontend} takes no more")
            self._publisher.send_multipart([topic.encode(), w.frame("Published", 0)])
            self._counts[topic] = count

    def _attach(self):
        with self._context.socket(zmq.DEALER) as socket:
            r = self._greet(socket, "Attached")
        self._frontend, self._backend = self._reachable(r.name("frontend")), self._reachable(r.name("backend"))
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
        """A Seen; None for a message that came before, and at the end of the run."""
        if len(parts) != 2:
            raise NodeError("the broker sends a message that is not of two parts")
        try:
            topic, r = parts[0].decode(), _Reader(parts[1])
        except UnicodeDecodeError:
            raise NodeError("the broker sends a topic whose name is not UTF-8") from None
        if _CONTROL.search(topic):
            raise NodeError("the broker sends a topic whose name holds a control character")
        if r.kind == "Finish":
            self.reason = r.lines("reason")
            self._socket.unsubscribe("finish")  # confirms to the broker that this program got it
            return None
        if r.kind != "Published":
            raise NodeError(f"the broker sends {r.kind}")
        t, _, count, payload = r.record()
        node = r.name("node")
        r.end()
        before, at = self._positions.get(topic, (None, None))
        if (before, at) == (count, t):
            return None  # the broker sent it again, because another observer subscribed
        self._positions[topic] = (count, t)
        missed = 0 if before is None else max(0, count - before - 1 if count > before else count - 1)
        self.missed += missed
        self.t = max(self.t, t)
        with self._lock:
            schema = self._schema(topic)
        return Seen(topic, node, t, count, missed, schema.unpack(payload))

    def _prepare_writing(self):
        """Wait until the broker listens: libzmq drops messages before."""
        socket = self._context.socket(zmq.XPUB)
        _set_up(socket, 1000, self._keys)
        socket.xpub_nodrop = True
        handshake = _Handshake(socket, self._keys)
        try:
            socket.connect(self._frontend)
            if not handshake.wait(self.timeout, f"the broker at {self._frontend}"):
                raise NodeError(f"no broker listens at {self._frontend}")
            socket.recv()
            self._publisher = socket
        finally:
            handshake.close()
            if not self._publisher:
                socket.close(0)


def _given(what, value, variable):
    value = value or os.environ.get(variable)
    if not value:
        raise NodeError(f"a node needs its {what}, given here or by {variable}")
    return value


def _read_keys(place, name):
    """(public, secret, the controller's public), by the rules in cosim/security/keys.h; None without a place."""
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
    """Watches a socket that connects: libzmq itself tries for ever, and does not report why it fails."""

    def __init__(self, socket, keys):
        self.socket, self.keys, self.connected, self.lost, self._broken_off = socket, keys, False, None, 0
        self.monitor = socket.get_monitor_socket(
            zmq.EVENT_CONNECTED | zmq.EVENT_DISCONNECTED | zmq.EVENT_HANDSHAKE_SUCCEEDED
            | zmq.EVENT_HANDSHAKE_FAILED_AUTH | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
            | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL)

    def _check_events(self, where):
        """Raises NodeError if this program is not let in there."""
        while self.monitor.poll(0):
            kind, value = struct.unpack("=HI", self.monitor.recv_multipart()[0])
            why = self._refusal(kind, value)
            if why:
                raise NodeError(f"{where} does not let this program in: {why}")

    def _refusal(self, kind, value):
        if kind == zmq.EVENT_HANDSHAKE_SUCCEEDED:
            self.connected, self.lost, self._broken_off = True, None, 0
        elif kind == zmq.EVENT_DISCONNECTED:
            if self.connected:
                self.connected, self.lost = False, time.monotonic()
        elif kind == zmq.EVENT_CONNECTED:
            user = None if os.environ.get("FLEDGE_ANY_USER") == "1" else _other_user(value)
            if user is not None:
                return f"it belongs to another user of this machine, number {user}; FLEDGE_ANY_USER=1 allows that"
        elif kind == zmq.EVENT_HANDSHAKE_FAILED_AUTH:
            return "it does not know this key: ./fledge keys allow, where the controller runs, lets it in"
        elif kind == zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL and value == zmq.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH:
            return ("it uses no keys, and this program does" if self.keys else
                    "it asks for keys, and this program has none: give it some by FLEDGE_KEYS "
                    "(./fledge keys new makes them)")
        else:
            self._broken_off += 1
            if self._broken_off >= 5:  # a killed controller breaks off once; one with other keys, at each attempt
                return ("what listens there breaks off when it sees these keys: controller.public here is not that "
                        "of this controller, or it uses no keys" if self.keys else
                        "what listens there breaks off: it is no controller, or it asks for keys, or is of another "
                        "user")
        return None

    def connect(self, timeout, where):
        """Whether the connection is made in time [s]. Raises NodeError if this program is not let in, or the other
        side is of another user."""
        end = time.monotonic() + timeout
        while not self.connected and self.monitor.poll(max(0, 1000 * (end - time.monotonic()))):
            self._check_events(where)
        return self.connected

    def wait(self, timeout, where):
        """Whether something came to the socket in time [s]. Raises NodeError if this program is not let in."""
        poller = zmq.Poller()
        poller.register(self.socket, zmq.POLLIN)
        poller.register(self.monitor, zmq.POLLIN)
        end = time.monotonic() + timeout
        while True:
            ready = dict(poller.poll(max(0, 1000 * (end - time.monotonic()))))
            if self.monitor in ready or not self.connected:
                self._check_events(where)  # the events of a connection come before its first message
            if self.socket in ready or not ready:
                return bool(ready)

    def close(self):
        self.socket.disable_monitor()
        self.monitor.close(0)


def _other_user(fd):
    """The user of the program at the other end of a connection, if that is another one on this machine."""
    try:
        with socket.socket(fileno=os.dup(fd)) as connection:
            if connection.family != socket.AF_UNIX:
                return None
            user = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1]
    except OSError:
        return None  # it is closed again
    return user if user != os.geteuid() else None


def _set_up(socket, linger, keys):
    socket.linger = linger
    if keys:
        socket.curve_publickey, socket.curve_secretkey, socket.curve_serverkey = keys
    socket.maxmsgsize = LARGEST
    # The kernels notice a lost machine or network, and do not take a program that computes or is stopped for lost.
    socket.tcp_keepalive, socket.tcp_keepalive_idle = 1, 2
    socket.tcp_keepalive_intvl, socket.tcp_keepalive_cnt = 1, 3
    socket.tcp_maxrt = 5000
