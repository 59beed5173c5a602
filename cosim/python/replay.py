# SPDX-License-Identifier: Apache-2.0
"""One node of a co-simulation again, alone, with the record of the messages of the others.

    exchange = Exchange("runs/nadir_spin/exchange.mcap")    # as the controller records it
    again = replay(exchange, "flight", ["./fledge", "node", "nadir_spin", "flight"])
    again.differences                                       # [] if it wrote the same again

The record gives the same messages at the same times, so the node has the same inputs at the same instants. A user
searches a fault in one program, with a debugger if necessary, while the rest of the simulation is a file.
"""
from __future__ import annotations

import os
import subprocess
from collections import namedtuple
from collections.abc import Callable
from pathlib import Path

from fledge import _cosim
from fledge.archive import Archive, ArchiveError
from fledge.archive.compare import compare
from fledge.errors import SetupError

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    # (name, type, definition, initial message, times [ns], messages)
    Topic = tuple[str, str, str, bytes, list[int], bytes]

__all__ = ["Exchange", "Replayed", "replay"]

Member = namedtuple("Member", "name present rates any_time reads prefix topics")
Member.__doc__ = """A node of the recorded run, or an asynchronous program, which has no rates.

present: it took part from the start; rates: (period, offset) [ns]; reads: topic -> latency; prefix, topics: its own
names of topics, as in a SIM.toml.
"""

Replayed = namedtuple("Replayed", "record topics until messages differences outcome")
Replayed.__doc__ = """The result.

record: path of the archive of all messages; topics: what the node writes; until: the last instant
compared [ns]; messages: how many were compared; differences: as compare() gives them, "a" the record, "b" now;
outcome: why the run ended early, "" if it did not.
"""


class Exchange:
    """The record of the messages between nodes. Raises ArchiveError if it is no such record, or is damaged before the
    first message.

    simulation, seed, end: of the run, end in [ns]
    nodes: name -> Member
    known: the last instant up to which all is known [ns]: the end, or less where the run ended early,
        nodes joined or left, or the file is damaged
    limited: why `known` is not the end; "" if it is
    changes: the times at which nodes joined or left [ns]
    """

    def __init__(self, path: Path | str) -> None:
        self.archive = Archive(path)
        metadata = self.archive.metadata.get("exchange")
        if metadata is None:
            raise ArchiveError(f"{path}: no record of an exchange: it lacks the metadata that a controller writes "
                               "(fledge_controller --record, fledge up)")
        try:
            self.simulation, self.seed, self.end = metadata["simulation"], int(metadata["seed"]), int(metadata["end"])
            self.nodes = {name: self._member(name, metadata) for name in metadata["nodes"].split()}
        except (KeyError, ValueError) as error:
            raise ArchiveError(f"{path}: the record of the exchange is damaged: {error}") from None
        try:
            self.changes = [int(name.rpartition(" ")[2]) for name in self.archive.metadata
                            if name.startswith("exchange after ")]
            self.known, self.limited = self._known()
        except ValueError as error:
            raise ArchiveError(f"{path}: the record of the exchange is damaged: {error}") from None

    @staticmethod
    def _member(name: str, metadata: dict[str, str]) -> Member:
        rates = [tuple(map(int, line.split("+"))) for line in metadata[f"{name}.rates"].split()]
        reads = {}
        for line in metadata[f"{name}.reads"].splitlines():
            topic, latency, *_ = line.split()
            reads[topic] = latency
        any_time = metadata[f"{name}.any_time"] == "1" or not rates
        topics = dict(line.split() for line in metadata.get(f"{name}.topics", "").splitlines())
        return Member(name, metadata[f"{name}.present"] == "1", rates, any_time, reads,
                      metadata.get(f"{name}.prefix", ""), topics)

    def written_by(self, node: str) -> list[str]:
        """The topics that a node wrote, and others read."""
        return [c.topic for c in self.archive.topics.values() if c.metadata.get("writer") == node]

    def _known(self) -> tuple[int, str]:
        limits = [(self.end, "")]
        limits += [(t, f"nodes joined or left at {t / 1e9:g} s") for t in self.changes]
        end = self.archive.metadata.get("end", {})
        reason = end.get("reason")
        if reason or not self.archive.complete or reason is None:
            why = f"the run ended early: {reason}" if reason else self.archive.problem or "the record has no end"
            last = [int(self.archive.time_ns(c.topic)[-1]) if c.count else -1 for c in self.archive.topics.values()]
            limits.append((int(end.get("settled", min(last, default=-1))), why))
        return min(limits)

    def part(self, node: str, until: int) -> tuple[str, list[tuple[int, int]], bool, list[Topic]]:
        """The messages of a node up to an instant, as _cosim.Replay takes them."""
        topics = []
        for name in self.written_by(node):
            channel = self.archive.topics[name]
            times = self.archive.time_ns(name)
            chosen = times <= until
            topics.append((name, channel.schema.rpartition("/")[2], channel.schema_text,
                           bytes.fromhex(channel.metadata["initial"]), times[chosen].tolist(),
                           self.archive[name][chosen].tobytes()))
        member = self.nodes[node]
        return node, member.rates, member.any_time, topics


def replay(exchange: Exchange, node: str, command: list[str] | None = None, *, out: Path | str,
           until: int | None = None, address: str | None = None, keys: Path | str | None = None, timeout: float = 60.0,
           reply: float = 60.0,
           listening: Callable[[str], None] | None = None) -> Replayed:
    """Run one node with the record of the others. Returns a Replayed.

    exchange: an Exchange; node: a name of it
    command: what to start, a list; it finds FLEDGE_SIMULATION, FLEDGE_NODE and FLEDGE_ADDRESS, and is ended
        with the run. None: the user starts it
    out: the archive to write; until: the last instant [ns], at most exchange.known
    address: where the node connects; default: an abstract socket of this machine
    timeout: how long to wait for the node, reply: for each of its replies [s], 0: for ever
    listening: a function of the address, called once the node can connect
    Raises SetupError for what cannot be replayed, OSError if the command cannot be started.
    """
    if node not in exchange.nodes:
        raise SetupError(f"{exchange.archive.path}: no node {node} took part; there are "
                         f"{', '.join(exchange.nodes)}")
    topics = exchange.written_by(node)
    if not topics:
        raise SetupError(f"{exchange.archive.path}: {node} wrote nothing that others read, so there is nothing "
                         "to compare")
    last: int = exchange.known if until is None else min(until, exchange.known)
    if last < 0:
        raise SetupError(f"{exchange.archive.path}: nothing can be replayed: {exchange.limited}")
    if not exchange.nodes[node].rates and not exchange.nodes[node].present:
        raise SetupError(f"{exchange.archive.path}: {node} did not step with the others, so it cannot be "
                         "replayed")
    others = [exchange.part(other, last) for other, member in exchange.nodes.items()
              if other != node and (member.present or exchange.written_by(other))]
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    Path(out).unlink(missing_ok=True)  # of an earlier replay: if this one fails at once, it is not its record
    core = _cosim.Replay(exchange.simulation, node, exchange.seed, last, others, topics, str(out),
                         address or f"ipc://@fledge-replay-{os.getpid()}", str(keys or ""), float(timeout),
                         float(reply), exchange.nodes[node].prefix, exchange.nodes[node].topics)
    if listening:
        listening(core.address)
    if command is None:
        outcome = core.run(None)
    else:
        outcome = _with(command, core, {"FLEDGE_SIMULATION": exchange.simulation, "FLEDGE_NODE": node,
                                        "FLEDGE_ADDRESS": core.address})
    record = Path(out)
    if not record.is_file():
        return Replayed(None, topics, last, 0, [], outcome or "there was no message")
    again = Archive(record)

    def compared(times: NDArray[Any]) -> NDArray[Any]:
        return times <= last

    messages = sum(int(compared(exchange.archive.time_ns(topic)).sum()) for topic in topics)
    return Replayed(record, topics, last, messages, compare(exchange.archive, again, topics, times=compared), outcome)


def _with(command: list[str], core: _cosim.Replay, variables: dict[str, str]) -> str:
    """Start a command, run beside it, and end it."""
    process = subprocess.Popen(command, env=os.environ | variables)
    ended = []

    def go_on() -> bool:
        # Its last messages may arrive after it has ended, so the run continues for a moment.
        ended.append(process.poll() is not None)
        return ended[-20:].count(True) < 20

    try:
        outcome = core.run(go_on)
        if outcome and process.poll() is not None and process.returncode:
            outcome = f"{command[0]} ended with exit code {process.returncode}"
        return outcome
    finally:
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
