# SPDX-License-Identifier: Apache-2.0
"""Flights of FMUs by the importer in C (fly.c), for tests.

    plan = Plan()
    world, flight = plan.fmu("world.fmu", folder), plan.fmu("flight.fmu", folder)
    plan.wire(world, references[...], flight, references[...])
    plan.hash(flight, ...)
    flown = plan.fly(folder, steps=600, step=0.5)
"""
from __future__ import annotations

import functools
import platform
import subprocess
import tempfile
import xml.etree.ElementTree as xml
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from fledge import objects
from fledge.elements import ELEMENTS
from fmi.testing.oscillator import FLAGS, ROOT

OFFSET, PRIME, MASK = 0xcbf29ce484222325, 0x100000001b3, 2**64 - 1


class Place(NamedTuple):
    """A variable, as fly.c has it; its type is that of Fledge: f64, ..., enum, char."""
    reference: int
    type: str
    n: int = 1


class Flown(NamedTuple):
    hashes: list[int]               # of all until each communication point
    values: dict[int, list[str]]    # what was to be shown, and the ticks of clocks, by reference


class Failed(Exception):
    """The importer's last lines."""


def places(layout: Any) -> dict[str, Place]:
    """Of all variables of a Layout (fledge.export.fmu.variables)."""
    return {v.name: Place(v.reference, v.type, v.n) for v in layout.variables}


def content(sim: Any, layout: Any, *roles: str) -> bytes:
    """The bytes of the variables of all messages with these roles, in a simulation now."""
    found = b""
    for message in layout.messages:
        if message.role in roles:
            process, instance, port = message.path.split(".")
            memory = objects.memory(getattr(sim.process(process).instances[instance], port))
            for v in layout.variables[message.first:message.first + message.n]:
                at = v.offset - message.offset
                found += memory[at:at + v.n * ELEMENTS[v.type].size]
    return found


def of(layout: Any, *roles: str) -> list[Place]:
    """The variables of which content() has the bytes."""
    return [Place(v.reference, v.type, v.n) for message in layout.messages if message.role in roles
            for v in layout.variables[message.first:message.first + message.n]]


def hashes(points: Iterable[bytes]) -> list[int]:
    """Those that fly.c prints, of the bytes at each communication point."""
    hash, found = OFFSET, []
    for point in points:
        for byte in point:
            hash = (hash ^ byte) * PRIME & MASK
        found.append(hash)
    return found


@functools.cache
def importer(compiler: str = "gcc") -> Path:
    """The program of fly.c, compiled once in a run of tests."""
    path = Path(tempfile.mkdtemp(prefix="fly-")) / "fly"
    subprocess.run([compiler, *FLAGS, "-pedantic", "-Wconversion", "-Wstrict-prototypes", "-o", path,
                    *(ROOT / "fmi/testing" / name for name in ("fly.c", "importer.c")), "-ldl"], check=True)
    return path


@dataclass
class Plan:
    """The lines of a plan."""
    lines: list[str] = field(default_factory=list)
    fmus: int = 0
    feeds: bytes = b""

    def fmu(self, path: Path, folder: Path, *, events: bool = False, machine: str = platform.machine()) -> int:
        """Unpack an .fmu into a new folder, and let it fly. Returns its place."""
        where = Path(tempfile.mkdtemp(dir=folder, prefix=f"{path.stem}-"))
        with zipfile.ZipFile(path) as archive:
            archive.extractall(where)
        root = xml.parse(where / "modelDescription.xml").getroot()
        version = 2 if root.attrib["fmiVersion"].startswith("2") else 3
        kind = root.find("CoSimulation")
        assert kind is not None
        system = f"{machine}-linux" if version == 3 or machine != "x86_64" else "linux64"
        library = where / "binaries" / system / f"{kind.attrib['modelIdentifier']}.so"
        token = root.attrib["guid" if version == 2 else "instantiationToken"]
        resources = str(where / "resources") + ("/" if version == 3 else "")
        self.lines.append(f"fmu {version} {int(events)} {path.stem}{self.fmus} {library} {token} {resources}")
        self.fmus += 1
        return self.fmus - 1

    def set(self, fmu: int, place: Place, values: Sequence[Any], at: int = -1) -> None:
        """Set it before the step AT; -1: before initialization, 0: in its mode."""
        self.lines.append(f"at {at} {_row(fmu, place)} " + " ".join(
            repr(float(v)) if not isinstance(v, str) else v or '""' for v in values))

    def wire(self, fmu: int, place: Place, to: int, other: Place) -> None:
        self.lines.append(f"wire {_row(fmu, place)} {to} {other.reference}")

    def feed(self, fmu: int, places: Iterable[Place], points: Iterable[bytes]) -> None:
        """points: the bytes of all these places, one behind the other, before each step from 0 on."""
        self.lines += [f"feed {_row(fmu, place)}" for place in places]
        self.feeds = b"".join(points)

    def hash(self, fmu: int, places: Iterable[Place]) -> None:
        self.lines += [f"hash {_row(fmu, place)}" for place in places]

    def show(self, fmu: int, places: Iterable[Place]) -> None:
        """Give the last values."""
        self.lines += [f"show {_row(fmu, place)}" for place in places]

    def clock(self, fmu: int, reference: int) -> None:
        self.lines.append(f"clock {fmu} {reference}")

    def fly(self, folder: Path, steps: int, step: float, *, sets: int = 1, states: int = 0, seed: int = 1,
            program: Sequence[str | Path] = (), env: dict[str, str] | None = None) -> Flown:
        """Fly so many steps [s]. program: what starts the importer, instead of it alone. Raises Failed."""
        (folder / "feeds").write_bytes(self.feeds)
        extra = [f"steps {steps} {step!r}", f"sets {sets}", f"states {states} {seed}", f"feeds {folder / 'feeds'}"]
        (folder / "plan").write_text("\n".join(self.lines + extra) + "\n", encoding="utf-8")
        done = subprocess.run([*(program or [importer()]), folder / "plan"], capture_output=True, text=True, env=env,
                              timeout=300)
        if done.returncode:
            raise Failed(f"exit code {done.returncode}: " + "\n".join(done.stderr.splitlines()[-5:]))
        rows = [line.split() for line in done.stdout.splitlines()]
        return Flown([int(row[1], 16) for row in rows[:steps + 1]],
                     {int(row[0]): row[1:] for row in rows[steps + 1:]})


def _row(fmu: int, place: Place) -> str:
    return f"{fmu} {place.reference} {place.type} {place.n}"
