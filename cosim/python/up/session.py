# SPDX-License-Identifier: Apache-2.0
"""A run: the session starts, watches and ends the controller and all programs."""
from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import re
import resource
import select
import signal
import socket
import sys
import time
from dataclasses import dataclass, field
from typing import Any
from pathlib import Path

from fledge.cosim.steering import STATE
from fledge.cosim.up import rewind
from fledge.cosim.up.description import SSH, WHEN_IT_COMES, Plan, Program
from fledge.cosim.up.logs import Logs
from fledge.cosim.up.processes import Process, adopt_strays, end_strays, in_words
from fledge.cosim.up.table import Lines, Progress, Row
from fledge.disk import ROOT, make
from fledge.interruption import handled
from fledge.serial_line import is_line

_LOOK = 0.1         # [s]
_FINISH = 12.0      # [s] for the controller to end a run
_LEAVE = 10.0       # [s] for programs to end by themselves after the run
_GIVE_UP = 15.0     # [s] for guards to kill the others
# [s] for a program to end by itself when its node is lost, or when it is asynchronous. A program whose node has
# reported its own failure does not hang, and has _LEAVE.
_HUNG = 1.0
# [s] for a complete observer to notice that the controller was killed, and to take the rest from its record
_FROM_RECORD = 4.0
_SILENT = 3.0       # [s] without a report of the controller, after which the session decides alone
_BUSY = 2.0         # [s] after which the table shows an unanswered request
_FILES_PER_PROGRAM, _OTHER_FILES = 3, 100    # its log and standard input, one more while it starts; our own
_LAST_LINES = 12    # of the log of a program that failed


class StartError(Exception):
    """The reason why a run cannot start."""


@dataclass
class Outcome:
    """How a run ended. `reason` is "" at the regular end; failed: (program, how it ended)."""
    reason: str
    progress: Progress
    failed: list[tuple[str, str]] = field(default_factory=list)
    signal: int | None = None
    rewind: float | None = None     # [s] a program that steers wants the run to go on from there


@dataclass
class _Running:
    """A program and its processes, one after the other."""
    program: Program
    process: Process | None = None
    started: int = 0            # times
    state: str = "absent"       # as the controller sees it
    lost_at: float | None = None
    failed: bool = False        # its node has reported its own failure
    killed: bool = False        # as the file says
    missed: bool = False        # and the controller has noticed it
    ending: bool = False        # the session has requested its end
    dead: str = ""              # how its last process ended; "" while it lives
    died: tuple[int, float] = (0, 0.0)  # the number of reports of the controller by then, and the time
    handled: bool = True        # the session has reacted to its last end
    again_at: float | None = None
    steering: socket.socket | None = None   # of a program that may pause the run


class Session:
    """folder: for logs and records; view: shows the progress; built: the folder of the controller and the guard;
    past: of the run from which this one goes on."""

    def __init__(self, plan: Plan, folder: Path, view: Lines, built: Path, past: rewind.Past | None = None):
        self.plan, self.folder, self.view, self.past = plan, folder, view, past
        self._controller_program, self._guard = str(built / "fledge_controller"), str(built / "fledge_guard")
        self._running = {p.name: _Running(p) for p in plan.programs}
        self.progress = Progress(plan.simulation, plan.until or 0.0, rows=[
            Row(p.name, "by hand" if p.by_hand else "starting", takes_part=not p.asynchronous) for p in plan.programs])
        self._status = b""
        self._reports = 0                   # of the controller on all nodes
        self._address = ""
        self._ended: str | None = None      # the reason, once the controller has given it
        self._without_reason = False        # it ended without one
        self._stop_requested_at: float | None = None
        self._signals = 0
        self._signal: int | None = None
        self._failed: dict[str, str] = {}
        self._rewind: float | None = None
        self._refused = ""
        self._kills = sorted({p.killed for p in plan.nodes if p.killed is not None})    # [s] that are to come

    # ---- the run

    def run(self) -> Outcome:
        """Raises StartError if the run cannot start."""
        make(self.folder, 0o700)
        lock = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise StartError(f"{self.folder} is in use by another run; end that, or give another folder by --out") \
                    from None
            for old in [*self.records(), *self.remains(), *(self.folder / rewind.FOLDER).glob("*.snapshots*"),
                        *self.folder.glob(rewind.NOTE)]:
                old.unlink()
            if self.plan.recorded:
                rewind.write_note(self.plan, self.folder, self.past)
            if self.past:
                self.past.take_records(self.folder)
            self.logs = Logs(self.folder / "log", max(len(name) for name in [*self._running, "controller"]))
            adopt_strays()
            make_room(len(self._running))
            with handled((signal.SIGINT, signal.SIGTERM, signal.SIGHUP), lambda number, _: self._interrupt(number)):
                return self._run()
        finally:
            os.close(lock)

    def _run(self) -> Outcome:
        self._ours, theirs = socket.socketpair()
        self._ours.setblocking(False)
        try:
            with theirs:
                handed = [theirs.fileno(), *([self.past.file.fileno()] if self.past else [])]
                self._controller = self._start("controller", self._controller_command(*handed), pass_fds=handed)
            while not self._over():
                self._poll()
            for row in self.progress.rows:      # by the last report, which may have come since
                self._describe(row)
            self.progress.phase = "ended"
            self._leave()
        finally:
            self._end_all()
            self.logs.close()
            self._ours.close()
        self._find_failed()
        return Outcome(self._ended or "", self.progress, list(self._failed.items()), self._signal,
                       self._rewind if not self._signals else None)

    def _poll(self) -> None:
        """Read the reports of the controller and the logs, look after the programs, and show the progress."""
        select.select([self._ours, *(r.steering for r in self._running.values() if r.steering)], [], [], _LOOK)
        self._receive()
        for r in self._running.values():
            self._steered(r)
        self._check_processes()
        new = self.logs.gather()
        self.view.logged(new, max(map(len, self._running)))
        for name, line in new:
            if name in self._running and self._running[name].program.serve and " is at http" in line:
                self.view.happens(f"  {line.partition(' (')[0].strip()}")     # where the user finds the control room
        for row in self.progress.rows:
            self._describe(row)
        self.view.goes(self.progress, self.logs.recent)

    def _over(self) -> bool:
        """Whether the controller has ended, or the session must end it."""
        late = self._stop_requested_at is not None and time.monotonic() - self._stop_requested_at > _FINISH
        if self._signals > 1 or late:
            self._ended = self._ended or ("interrupted twice, so all was ended at once" if self._signals > 1 else
                                          "the controller did not come to an end")
            return True
        if self._ended is None and self._controller.poll():
            self._receive()
            if self._ended is None:
                self._without_reason = True
                last = self.logs.last("controller", 1)
                if (self._controller.code or 0) < 128 and last:
                    self._ended = last[-1].removeprefix("fledge_controller: ")
                else:
                    self._ended = f"the controller {in_words(self._controller.code)}"
                    self._failed["controller"] = in_words(self._controller.code)
        return self._ended is not None

    def _leave(self) -> None:
        """Let nodes end by themselves; end asynchronous programs, and nodes that never joined."""
        begun = time.monotonic()
        latest = begun + self.plan.reply
        for r in self._running.values():
            if r.process and r.state == "absent" and not r.program.asynchronous:
                self._end(r)    # the controller cannot tell it
        while (spent := time.monotonic() - begun) < _LEAVE and self._signals < 2 and any(
                r.process and not r.process.poll() for r in self._running.values()):
            if not self._controller.poll() and time.monotonic() < latest:   # complete observers read to the end
                begun = time.monotonic()
            for r in self._running.values():
                if r.program.asynchronous and r.process and not r.ending and spent > (
                        _FROM_RECORD if self._without_reason and r.program.complete else _HUNG):
                    self._end(r)
            select.select([], [], [], 0.02)
            self._check_exits()
        for r in self._running.values():
            if r.process and not r.process.poll():
                if not r.program.asynchronous and not r.ending:
                    self._failed[r.program.name] = f"did not end within {_LEAVE:g} s of the run, and was ended"
                self._end(r)
        self._check_exits()
        self.logs.gather()

    def _end_all(self) -> None:
        """End all processes."""
        processes = [r.process for r in self._running.values() if r.process]
        if getattr(self, "_controller", None):
            processes.append(self._controller)
        for process in processes:
            process.end()
        until = time.monotonic() + _GIVE_UP
        while not all([process.poll() for process in processes]) and time.monotonic() < until:
            time.sleep(0.02)
        while end_strays({process.pid for process in processes if process.code is None}) \
                and time.monotonic() < until:
            time.sleep(0.02)
        end_strays(set())

    def stop(self, why: str) -> None:
        """Ask the controller to end the run."""
        if self._stop_requested_at is None:
            self._stop_requested_at = time.monotonic()
            try:
                self._ours.send(f"stop {' '.join(why.split())}\n".encode())
            except OSError:
                pass    # it has ended

    def _interrupt(self, number: int) -> None:
        self._signals += 1
        self._signal = self._signal or number
        if self._signals == 1 and getattr(self, "_ours", None):
            self.stop("the user ended it")

    def _steered(self, r: _Running) -> None:
        """Do what a program that steers the run asks for: pause, go, until SECONDS, pace X, rewind SECONDS."""
        if r.steering is None:
            return
        try:
            line = r.steering.recv(100)
        except BlockingIOError:
            return
        except OSError:
            line = b""
        if not line:
            r.steering.close()
            r.steering = None
        elif re.fullmatch(rb"pause|pace [0-9.e+-]+", line):
            self._ours.send(line + b"\n")
        elif go := re.fullmatch(rb"go|until ([0-9.e+-]+)", line):
            self._go(float(go[1]) if go[1] else None)
        elif back := re.fullmatch(rb"rewind ([0-9.e+-]+)", line):
            self._go_back(r.program.name, float(back[1]))

    def _go(self, until: float | None = None) -> None:
        """Let the run go on, to a time [s], and no further than to where a program is to be killed."""
        stops = [t for t in (until, *self._kills[:1]) if t is not None]
        self._ours.send(f"until {min(stops)!r}\n".encode() if stops else b"go\n")

    def _kill(self, report: dict) -> None:
        """Where all nodes have reached the time, and none is further, kill the programs that are to be lost there. The
        run goes on when the controller has noticed."""
        if not (self._kills and report.get("paused") and math.isclose(report.get("until", -1), self._kills[0],
                                                                      rel_tol=1e-8)):
            return
        due = [r for r in self._running.values() if r.program.killed == self._kills[0]]
        for r in due:
            if r.process and not r.killed:
                self.view.happens(f"  {r.program.name} is killed at {self._kills[0]:g} s, as the file says")
                r.killed = r.ending = True
                os.kill(r.process.pid, signal.SIGKILL)
        if all(r.missed or r.state not in ("running", "joining", "greeted") for r in due):
            self._kills.pop(0)
            self._go()

    def _go_back(self, name: str, t: float) -> None:
        if not self.plan.recorded:
            why = "the file has no keep_every"
        elif not 0 <= t <= self.progress.t:
            why = f"the run is at {self.progress.t:g} s"
        else:   # else the run would end, and no other one begin
            others = rewind.changed_since(self.plan, rewind.recorded(self.folder)[1])
            why = ", and ".join(f"{other} has changed since the run began" for other in others)
        if why:
            self._refused = f"it does not go back to {t:g} s: {why}"
            self.view.happens(f"  {name} asks for the instant {t:g} s, but {why}")
        elif self._stop_requested_at is None:
            self._rewind = t
            self.stop(f"{name} lets it go back to {t:g} s")

    # ---- programs

    def _controller_command(self, status: int, past: int | None = None) -> list[str]:
        plan = self.plan
        command = [self._controller_program, "--simulation", plan.simulation, "--until", repr(plan.until),
                   "--seed", str(plan.seed), "--address", plan.listening(), "--join", repr(plan.join),
                   "--greet", repr(plan.greet), "--reply", repr(plan.reply), "--status", str(status)]
        command += (["--pace", repr(plan.pace)] if plan.pace else [])
        command += ["--steered"] * any(p.steers or p.killed is not None for p in plan.programs)
        command += ["--record", str(self.folder.resolve() / "exchange.mcap")] * plan.recorded
        if plan.keep_every:
            command += ["--snapshots", str(self.folder.resolve() / rewind.FOLDER), "--keep-every",
                        repr(plan.keep_every)]
        command += ["--past", f"/dev/fd/{past}"] * (past is not None)
        if plan.keys:
            command += ["--keys", plan.keys]
        elif plan.beyond and plan.unencrypted:
            command.append("--unencrypted-beyond-machine")
        command += ["--any-user"] * plan.any_user
        for topic in plan.watch:
            command += ["--watch", topic]
        for p in plan.programs:
            if p.asynchronous:
                complete = "".join([f",complete={p.observers}", *(f",hears={see}" for see in p.sees)]) * p.complete
                command += ["--asynchronous", ":".join(filter(None, [p.name + complete, ",".join(p.writes)]))]
        for p in plan.nodes:
            joins = "any" if p.joins == WHEN_IT_COMES else repr(p.joins)
            command += ["--node", ",".join([
                f"{p.name}:{p.on_loss}", *([f"joins={joins}"] if p.joins is not None else []
                                           ), *(["rejoins"] if p.rejoins else []),
                *([f"save={p.save_every!r}"] if p.save_every else []), *
                ([f"reply={p.reply!r}"] if p.reply is not None else []),
                *([f"prefix={p.prefix}"] if p.prefix else []),
                *(f"topic={ours}>{of_run}" for ours, of_run in p.topics.items())])]
        return command

    def _start(self, name: str, command: list[str], guard: Any = None, **options: Any) -> Process:
        with self.logs.open(name) as log:
            try:
                return Process(command, guard or self._guard, log, **options)
            except OSError as error:
                raise StartError(f"cannot start {name}: {error.filename or command[0]}: {error.strerror}") from None

    def _start_program(self, r: _Running) -> None:
        p = r.program
        r.started += 1
        r.dead, r.handled, r.ending, r.lost_at, r.failed, r.again_at = "", False, False, None, False, None
        theirs = {**self._variables(p), "PYTHONUNBUFFERED": "1", **p.env}
        if p.host:
            fledge = p.fledge or str(ROOT)
            guard = f"{fledge}/build/{os.environ.get('FLEDGE_PRESET', 'release')}/cosim/fledge_guard"
            launcher = [word.replace("{host}", p.host) for word in p.launcher or SSH]
            r.process = self._start(p.name, self._command(p, [f"{fledge}/fledge"]), guard, launcher=launcher,
                                    remote=(p.directory, {"PYTHONPATH": f"{fledge}/cosim/bindings/python", **theirs}))
            return
        handed: list[int] = []
        if p.asynchronous:
            theirs["FLEDGE_EXCHANGE"] = str(self.folder.resolve() / "exchange.mcap") if self.plan.recorded else ""
        if p.steers:
            r.steering, other = socket.socketpair(type=socket.SOCK_SEQPACKET)
            r.steering.setblocking(False)
            handed = [other.fileno()]
            theirs["FLEDGE_STEERING"] = str(handed[0])
        path = os.pathsep.join([str(ROOT / "cosim/bindings/python"), *filter(None, [os.environ.get("PYTHONPATH")])])
        r.process = self._start(p.name, self._command(p, [sys.executable, "-P", "-m", "fledge.cli"]),
                                launcher=p.launcher or (), directory=p.directory if not p.mission else None,
                                env={**os.environ, "PYTHONPATH": path, **theirs}, pass_fds=handed)
        if p.steers:
            other.close()

    def _command(self, p: Program, fledge: list[str]) -> list[str]:
        folder = str(self.folder.resolve())
        if p.command:
            values = {"simulation": self.plan.simulation, "node": p.name, "address": self._address,
                      "seed": str(self.plan.seed), "until": repr(self.plan.until), "record": folder}
            places = "{(" + "|".join(values) + ")}"
            return [re.sub(places, lambda found: values[str(found[1])], word) for word in p.command]
        if p.link:
            return [*fledge, "link", str(p.process), p.link, *(["--radio", p.radio] if p.radio else [])]
        if p.serve:
            return [*fledge, "ground", "serve", p.serve]
        record = f"runs/{self.plan.simulation}" if p.host else folder
        given = [*(word for name, value in p.parameters.items() for word in ("--set", f"{name}={value!r}")),
                 *["--free"] * p.free]
        if p.target:
            boards = [word for file in p.board for word in ("--board", f"{p.process}={file}")]
            line = [*(["--elf", p.elf] if p.elf else []), *(["--pace", f"{self.plan.pace:g}"] if self.plan.pace and
                                                            is_line(p.target) else [])]
            return [*fledge, "fly", str(p.mission), *filter(None, [p.scenario]), "--on", f"{p.process}={p.target}",
                    *line, *given, *boards, "--out", f"{record}/{p.name}", "--join", self._address]
        if p.fmu:
            given += ["--update-limit", f"{p.step_timeout:g}s"]
        if p.fmu and not p.mission:
            given += [word for port, topic in p.reads.items() for word in ("--read", f"{port}={topic}")]
            for name, message in p.messages.items():
                fields = [f"{field}={variable}" for field, variable in message.items() if field != "type"]
                given += ["--message", name, message["type"], *fields]
            return [*fledge, "node", p.fmu, p.name, "--name", p.name, "--every", f"{p.every!r}s", "--latency",
                    p.latency, *given, *["--record", record] * self.plan.record]
        given += ["--fmu", p.fmu] if p.fmu else []
        return [*fledge, "node", str(p.mission), str(p.process), *filter(None, [p.scenario]), "--name", p.name, *given,
                *(["--outputs", f"{record}/{p.name}.mcap"] if self.plan.report and p.flies else
                  ["--record", record] * self.plan.record)]

    def _by_hand(self, r: _Running) -> str:
        """The variables for a program that the user starts, as a shell takes them."""
        return " ".join(f"{name}={value}" for name, value in self._variables(r.program).items())

    def _variables(self, p: Program) -> dict[str, str]:
        """The environment in which a program finds the simulation."""
        keys = p.keys or self.plan.keys
        return {"FLEDGE_SIMULATION": self.plan.simulation, "FLEDGE_NODE": p.name, "FLEDGE_ADDRESS": self._address,
                **({"FLEDGE_KEYS": keys} if keys else {}),
                **({"FLEDGE_ANY_USER": "1"} if self.plan.any_user else {})}

    def _end(self, r: _Running) -> None:
        r.ending = True
        if r.process:
            r.process.end()

    # ---- the reports of the controller

    def _receive(self) -> None:
        while True:
            try:
                data = self._ours.recv(65536)
            except OSError:
                return
            if not data:
                return
            *whole, self._status = (self._status + data).split(b"\n")
            for line in whole:
                self._handle(json.loads(line))

    def _handle(self, report: dict) -> None:
        if "listening" in report:
            self._address = report["listening"]
            if self._kills:
                self._go()
            if not self._signals:
                for r in self._running.values():
                    if r.program.by_hand:
                        self.view.happens(f"  start {r.program.name} with {self._by_hand(r)}")
                    else:
                        self._start_program(r)
        if "report" in report:
            self.view.happens("  " + report["report"])
            for name, r in self._running.items():
                r.failed |= report["report"].startswith(f"{name}: it failed: ")
                r.missed |= r.killed and report["report"].startswith(f"{name}: ")
        if "phase" in report:
            self.progress.phase = report["phase"]
        if "nodes" in report:
            self._reports += 1
            self.progress.t = report["t"]
            for r in self._running.values():
                if r.steering:      # a slow reader skips states
                    with contextlib.suppress(OSError):
                        r.steering.send(json.dumps(
                            {key: report.get(key) for key in STATE} | {
                                "rewinds": self.plan.recorded, "past": self.past.t if self.past else 0.0,
                                "refused": self._refused}).encode())
            self.progress.overruns, self.progress.worst = report.get("overruns"), report.get("worst", 0.0)
            rows = {row.name: row for row in self.progress.rows}
            for node in report["nodes"]:
                row, r = rows[node["name"]], self._running[node["name"]]
                for key in ("t", "ticks", "compute", "transport", "wait", "pending"):
                    setattr(row, key, node[key])
                if node["state"] == "lost" and r.state != "lost":
                    r.lost_at = time.monotonic()
                r.state = node["state"]
            self._kill(report)
            self.progress.wall = max(row.compute + row.transport + row.wait + row.pending for row in rows.values())
        if "ended" in report:
            self._ended = report["ended"]

    # ---- the ends of programs

    def _check_processes(self) -> None:
        now = time.monotonic()
        self._check_exits()
        for r in self._running.values():
            if not r.process:
                continue
            p = r.program
            if not r.dead and r.state == "lost" and r.lost_at and not r.ending and p.on_loss != "pause" \
                    and now - r.lost_at > (_LEAVE if r.failed else _HUNG):
                self._end(r)    # it hangs, or does not know that its node is lost
            # The controller decides what the end of a program means; its report arrives later than the end.
            known = r.dead and (self._reports >= r.died[0] + 2 or now - r.died[1] > _SILENT)
            if known and not r.handled and self._ended is None and self._stop_requested_at is None:
                self._lost(r, now)
            if r.again_at and now >= r.again_at and self._ended is None and self._stop_requested_at is None:
                self.logs.say(p.name, f"started again ({r.started} of {p.restarts})")
                self._start_program(r)

    def _check_exits(self) -> None:
        strays = False
        for r in self._running.values():
            if r.process and not r.dead and r.process.poll():
                r.dead, r.died = in_words(r.process.code), (self._reports, time.monotonic())
                strays = strays or r.process.code == 128 + signal.SIGKILL
        if strays:
            end_strays({r.process.pid for r in self._running.values() if r.process and r.process.code is None}
                       | {self._controller.pid})

    def _lost(self, r: _Running, now: float) -> None:
        """A program has ended during the run."""
        p, name = r.program, r.program.name
        r.handled = True
        if p.asynchronous and (p.on_loss != "restart" or r.started > p.restarts or not (r.process and r.process.code)):
            if p.complete:
                with contextlib.suppress(OSError):      # the controller has ended, too
                    self._ours.send(f"without {name}\n".encode())
            if r.process and r.process.code:
                self.view.happens(f"  {name}, an asynchronous program, {r.dead}; the run goes on without it")
            return
        if r.state in ("absent", "greeted", "joining") and p.on_loss != "restart":
            self._failed[name] = r.dead
            if p.joins == WHEN_IT_COMES:
                self.view.happens(f"  {name} {r.dead} before it took part")
            elif r.state == "absent" or (p.joins is None and p.on_loss == "abort"):
                self.stop(f"{name} {r.dead} before it took part")
            return
        if p.on_loss == "pause" and r.state not in ("finished", "left"):
            self.view.happens(f"  {name} {r.dead}; to go on, start it again with {self._by_hand(r)}")
        if p.on_loss != "restart" or r.state in ("finished", "left"):
            return
        if r.started > p.restarts:
            self._failed[name] = r.dead
            times = f"had been started again {p.restarts} times" if p.restarts != 1 else "had been started again once"
            self.stop(f"{name} {r.dead}, and {times}")
        else:
            self.view.happens(f"  {name} {r.dead}; it is started again ({r.started} of {p.restarts})")
            r.again_at = now + min(0.1 * r.started, 2.0)

    def _find_failed(self) -> None:
        """Find the programs that failed by themselves, not because the run ended."""
        reason = self._ended or ""
        for name, r in self._running.items():
            if not r.process or r.program.asynchronous or name in self._failed or r.ending:
                continue
            if r.process.code and (not reason or r.state == "lost" or reason.startswith(f"{name}: ")):
                self._failed[name] = in_words(r.process.code)

    def _describe(self, row: Row) -> None:
        """Fill in the state of a node for the table."""
        r = self._running[row.name]
        p = r.program
        row.bad = False
        if r.again_at:
            row.state, row.bad = f"restart {r.started} of {p.restarts}", True
        elif p.asynchronous:
            row.state = r.dead.removeprefix("was ") or ("runs" if r.process else "starting")
        elif r.dead and r.state not in ("finished", "left"):
            row.state = r.dead.removeprefix("was ").replace("ended with exit code", "exit code")
            row.bad = True
        elif r.state == "absent":
            row.state = "by hand" if p.by_hand else "starting" if p.joins is None else \
                WHEN_IT_COMES if p.joins == WHEN_IT_COMES else f"joins at {p.joins:g} s"
        elif r.state == "running" and row.pending > _BUSY:
            row.state, row.bad = f"busy {row.pending:.0f} s", True
        else:
            row.state, row.bad = r.state, r.state == "lost"

    def records(self) -> list[Path]:
        """The records of this run, or of an earlier one."""
        return self._files(r"\.mcap")

    def remains(self) -> list[Path]:
        """The unfinished records of programs that were lost, and did not go on."""
        return self._files(r"\.mcap\.(part|lost)")

    def _files(self, ending: str) -> list[Path]:
        names = {name: i for i, name in enumerate([*self._running, "exchange"])}
        records = [(names[match[1]], file) for file in sorted(self.folder.glob("*.mcap*"))
                   if (match := re.fullmatch(rf"(.*?)(-\d+)?{ending}", file.name)) and match[1] in names]
        return [file for _, file in sorted(records)]

    def last_lines(self, name: str) -> list[str]:
        return self.logs.last(name, _LAST_LINES)


def make_room(programs: int) -> None:
    """Let this program have the open files that so many programs need. Raises StartError if the system allows fewer."""
    needed = _FILES_PER_PROGRAM * programs + _OTHER_FILES
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < needed:
        raise StartError(f"{programs} programs need {needed} open files; this system allows {hard} (ulimit -Hn; nofile "
                         "in /etc/security/limits.conf raises it)")
    if soft != resource.RLIM_INFINITY and soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
