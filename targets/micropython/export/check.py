# SPDX-License-Identifier: Apache-2.0
"""What a script composed on the target, beside what it composed on the desktop.

The program prints it with --describe (targets/micropython/executive.h has the form); the same lines are made here of
the desktop's live objects.
"""
from __future__ import annotations

import struct as packing
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from fledge import objects
from fledge.export.c_condition import locate
from fledge.objects.script import script

if TYPE_CHECKING:
    from fledge import _core
    from fledge.export.read import Mission
    from fledge.mission.process import Flight

# What the lines of each kind say of their first word, in words.
LISTED = {"task": "the task", "runs": "in the task", "mode": "the mode", "activates": "in the mode",
          "follows": "what precedes the mode", "guards": "the condition of the mode",
          "start": "the mode to begin in:", "event": "the event", "looks": "the mode of the event",
          "enters": "what enters the event", "arms": "what arms the event", "disarms": "what disarms the event",
          "sets": "what sets the event", "when": "the condition of the event", "until": "what arms again the event",
          "reset": "what resets the computer:"}


def first_difference(mission: Mission, flight: Flight, lines: Iterable[str]) -> str:
    """How what the target describes differs from the desktop's process of that mission, which has not run; "" if it
    does not."""
    rest = list(lines)
    return next(_differences(mission, flight, rest), "")


def _differences(mission: Mission, flight: Flight, lines: list[str]) -> Iterator[str]:
    theirs: dict[str, list[str]] = {}
    for line in lines:
        kind, _, rest = line.partition(" ")
        theirs.setdefault(kind, []).append(rest)

    modules = {f"{name} {objects.struct(module).name}": module for name, module in flight.instances.items()}
    for name in modules.keys() - set(theirs.get("module", [])):
        yield f"the script there makes no {name.replace(' ', ', a ')}"
    for name in theirs.get("module", []):
        if name not in modules:
            yield f"the script there makes {name.replace(' ', ', a ')}, and here not"
    outside = [end for message in mission.inputs for end in message.ends]   # what comes there may be there already
    memory = {name: bytearray(objects.struct(module).size) for name, module in flight.instances.items()}
    for line in theirs.get("bytes", []):
        name, offset, raw = line.split()
        at = int(offset)
        memory[name][at:at + len(raw) // 2] = bytes.fromhex(raw)
    for name, module in flight.instances.items():
        here, there = bytearray(objects.memory(module)), memory[name]
        for field in objects.struct(module).fields:
            if f"{flight.name}.{name}.{field.name}" in outside and field.group == "in":
                for each in (here, there):
                    each[field.offset:field.offset + field.size] = bytes(field.size)
        yield from _in_memory(f"{flight.name}.{name}", module, here, there)

    ours = expected(mission, flight)
    for name in sorted(set(ours["python"]) ^ set(theirs.get("python", []))):
        yield f"the update of {name} is Python only {'here' if name in ours['python'] else 'there'}"
    for line in sorted(set(ours["wire"]) ^ set(theirs.get("wire", []))):
        start, end, age, *choice = line.split()
        yield (f"the wire {start} >> {end}" + (f", {' '.join(choice)}," if choice else "")
               + (f", stale after {int(age) / 1e9:g} s," if int(age) else "")
               + f" is only {'here' if line in ours['wire'] else 'there'}")
    theirs["sets"] = [bytes_ for line in theirs.get("sets", []) for bytes_ in _bytewise(*line.rsplit(" ", 2))]
    for kind, what in LISTED.items():
        for ours_is, theirs_is in zip_longest(ours[kind], theirs.get(kind, [])):
            if ours_is != theirs_is:
                yield f"{what} {ours_is or theirs_is}: " + (
                    f"there it is {theirs_is}" if ours_is and theirs_is else
                    "it is only here" if ours_is else "it is only there")


def _bytewise(event: str, place: str, raw: str) -> Iterator[str]:
    """A line of each byte: programs split what an event sets as they like."""
    module, _, offset = place.partition("+")
    for i, byte in enumerate(bytes.fromhex(raw)):
        yield f"{event} {module}+{int(offset) + i} {byte:02x}"


def _in_memory(path: str, instance: Any, here: bytearray, there: bytearray) -> Iterator[str]:
    for at, (a, b) in enumerate(zip(here, there)):
        if a != b:
            expression, field, _ = locate(objects.struct(instance), at, path)
            width = max(1, field.size // max(1, _count(field.shape)))
            start = at - (at - _start(objects.struct(instance), at)) % width
            yield (f"{expression} has other bits: here {here[start:start + width].hex()}, there "
                   f"{there[start:start + width].hex()}")
            return


def _count(shape: Iterable[int]) -> int:
    n = 1
    for part in shape:
        n *= part
    return n


def _start(struct: _core.Struct, offset: int) -> int:
    """Where the innermost field that has this byte begins."""
    field = next(f for f in struct.fields if f.offset <= offset < f.offset + f.size)
    if field.type != "struct":
        return field.offset
    row, inner = divmod(offset - field.offset, field.struct.size)
    return field.offset + row * field.struct.size + _start(field.struct, inner)


def expected(mission: Mission, flight: Flight) -> dict[str, list[str]]:
    """The lines that the target should print, by kind."""
    lines: dict[str, list[str]] = {kind: [] for kind in ("python", "wire", *LISTED)}
    titles = {module.name: module.path.partition(".")[2] for module in mission.modules}

    def end(place: str) -> str:
        """tracking.out.error -> tracking.error, as the script calls it"""
        name, _, port = place.split(".")
        return f"{titles[name]}.{port}"

    for wires in (*mission.wires.values(), *mission.published.values()):
        for i, w in enumerate(wires):
            before = sum(wire.target == w.target for wire in wires[:i])
            if not w.source.startswith("in."):
                lines["wire"].append(f"{end(w.source)} {end(w.target)} {w.stale_after}"
                                     + (f" {w.choice} {before}" if w.choice else ""))
    lines["python"] = [name for name, module in flight.instances.items() if script(module)]
    for task in sorted(flight.tasks, key=lambda task: -task.priority):
        lines["task"].append(f"{task.name} {task.period} {task.offset} {task.priority}")
        lines["runs"] += [f"{task.name} {name}" for name in task.run]
    for name, tasks in flight.modes:
        lines["mode"].append(name)
        lines["activates"] += [f"{name} {task}" for task in tasks]
    for name, guard in flight.guards.items():
        lines["follows"] += [f"{name} {mode}" for mode in guard.after]
        lines["guards"] += [f"{name} {part}" for part in parts(
            guard.condition.steps if guard.condition is not None else [])]
    lines["start"] = [flight.active_mode] if flight.active_mode else []
    for event in flight.events.values():
        lines["event"].append(f"{event.name} {event.hold} {event.count} {int(event.once)} {int(event.starts_armed)}")
        lines["looks"] += [f"{event.name} {name}" for name in event.modes]
        lines["enters"] += ([f"{event.name} {event.mode}"] if event.mode else [])
        for name, on in event.arms:
            lines["arms" if on else "disarms"].append(f"{event.name} {name}")
        for path, offset, raw in event.settings:
            lines["sets"] += _bytewise(event.name, f"{path.partition('.')[2]}+{offset}", raw.hex())
        lines["when"] += [f"{event.name} {part}" for part in parts(event.condition.steps)]
        lines["until"] += [f"{event.name} {part}" for part in parts(
            event.until.steps if event.until is not None else [])]
    if flight.reset:
        path, down = flight.reset
        _, name, port = path.split(".")
        field = next(f for f in objects.struct(flight.instances[name]).fields if f.name == port and f.group == "in")
        lines["reset"].append(f"{name}+{field.offset} {down}")
    return lines


def parts(steps: Iterable[Any]) -> Iterator[str]:
    for step in steps:
        yield step if isinstance(step, str) else " ".join((operand(step[0]), step[1], operand(step[2])))


def operand(field: Any) -> str:
    if field.constant is None:
        return f"{field.path.partition('.')[2]}+{field.offset}:{field.measure}"
    if isinstance(field.constant, int):
        return str(field.constant)
    return f"0x{packing.unpack('<Q', packing.pack('<d', field.constant))[0]:016x}"
