# SPDX-License-Identifier: Apache-2.0
"""A mission that flies by this machine's clock, and takes commands: its program, and the relay (targets/linux/relay.c)
that has the outside's end of its registers."""
from __future__ import annotations

import contextlib
import queue
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.commands import Dictionary, Kind, Packets, Report, Telemetry, Text, decoded
from fledge.errors import Failure
from fledge.export import dictionary
from fledge.targets import build
from fledge.targets.micropython import toolchain

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from fledge.targets.job import Part
    from fledge.targets.target import Target

SOURCES = ["targets/linux/relay.c", "targets/mission_io.c", "targets/mission_host.c", "registers/clock.c",
           "registers/message.c", "registers/shared_file.c", "record/mcap.c", "record/mcap_crc.c"]
PATIENCE = 10.0     # [s] beyond the longest time between two instants of flight


class Console:
    """Within a `with`, flight lives. Its answers are printed."""

    def __init__(self, part: Part, target: Target) -> None:
        self.dictionary: Dictionary = dictionary(part.mission)
        self.packets = Packets(self.dictionary)
        self.timeout = PATIENCE + max(task.period for task in part.mission.tasks) / 1e9
        self.program = target.build(part)
        self.relay = build.program(part.folder / "relay", "relay", [
            *part.table_sources(), *(build.ROOT / name for name in SOURCES)], part.includes())
        self.received: queue.Queue[Telemetry | None] = queue.Queue()
        self.started: list[subprocess.Popen[Any]] = []

    def __enter__(self) -> Console:
        self.folder = tempfile.TemporaryDirectory()
        registers = Path(self.folder.name) / "registers"
        self.outside = subprocess.Popen([self.relay.resolve(), registers], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self.flight = subprocess.Popen([self.program.resolve(), "--clock", "--priority", "0", registers],
                                       stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()
        self._meet()
        return self

    def _meet(self) -> None:
        """Wait until flight answers. It forgets what came before it began."""
        end = time.monotonic() + self.timeout
        while time.monotonic() < end and self.lives():
            self._send([self.packets.noop()])
            with contextlib.suppress(queue.Empty):
                if self.received.get(timeout=0.2):
                    return
        self.__exit__()
        raise Failure(f"{self.program} has not begun to fly", 1)

    def __exit__(self, *_: Any) -> None:
        assert self.outside.stdin
        with contextlib.suppress(BrokenPipeError):
            self.outside.stdin.close()      # ends the run
        try:
            self.flight.wait(self.timeout)
        except subprocess.TimeoutExpired:
            self.flight.kill()
        self.outside.wait(self.timeout)
        self.listener.join()
        self.folder.cleanup()

    def lives(self) -> bool:
        return self.flight.poll() is None and self.outside.poll() is None

    def _listen(self) -> None:
        assert self.outside.stdout
        for line in self.outside.stdout:
            self.received.put(decoded(self.dictionary, bytes.fromhex(line)))
        self.received.put(None)

    # --- what a person asks for ---

    def evaluate(self, text: str, turns: int) -> None:
        """Let flight evaluate a text, and print its answer."""
        packet = self.packets.evaluate(text, turns)
        self._ask([packet], lambda text: isinstance(text, Text) and text.kind in (Kind.RESULT, Kind.ERROR))

    def run(self, file: Path, turns: int) -> None:
        """Send a procedure, start it, and print that it has begun, or why not."""
        self._ask(self.packets.procedure(toolchain.compile_mpy(file, file.name), turns), _executed)

    def stop(self) -> None:
        """Stop the procedure."""
        self._ask([self.packets.stop()], _executed)

    def _ask(self, packets: Sequence[bytes], is_answer: Callable[[Any], bool]) -> None:
        """Send packets, and print what comes until the answer to the last, or a refusal."""
        sequence = self.packets.sequence - 1 & 0x3FFF
        self._send(packets)
        while True:
            try:
                telemetry = self.received.get(timeout=self.timeout)
            except queue.Empty:
                raise Failure(f"flight has not answered for {self.timeout:g} s") from None
            if telemetry is None:
                raise Failure("flight has ended", 1)
            content = telemetry.content
            _show(content)
            if getattr(content, "sequence", None) == sequence and (is_answer(content) or _refused(content)):
                return

    def _send(self, packets: Sequence[bytes]) -> None:
        with contextlib.suppress(BrokenPipeError):      # the relay has ended: what is heard ends, too
            assert self.outside.stdin
            self.outside.stdin.write("".join(f"{packet.hex()}\n" for packet in packets))
            self.outside.stdin.flush()


def _executed(report: Any) -> bool:
    return isinstance(report, Report) and report.executed


def _refused(report: Any) -> bool:
    """A text that fails has its own words."""
    return isinstance(report, Report) and not report.good and not report.executed


def _show(content: Any) -> None:
    if isinstance(content, Report):
        if not content.good and content.reason.name != "FAILED":
            print(f"refused: {content.reason.name.lower().replace('_', ' ')}")
    elif isinstance(content, Text) and content.kind == Kind.RESULT:
        print(content.text, end="")
    elif isinstance(content, Text) and content.kind in (Kind.ERROR, Kind.PRINTED):
        print(content.text)
    elif isinstance(content, Text):
        words = content.kind.name.lower().replace("_", " ")
        print(f"{content.t / 1e9:g} s: {words}{': ' if content.text else ''}{content.text}")
