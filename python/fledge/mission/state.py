# SPDX-License-Identifier: Apache-2.0
"""The state of a simulation as numbers with names, and what becomes of it: for linearize() and trim()."""
from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fledge import _core
from fledge.errors import RunError, SetupError, did_you_mean, listed
from fledge.mission.field_path import FieldPath, port
from fledge.mission.wiring import Node, Wiring
from fledge.records.series import element_names

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

# (name, field, the names and shapes of which it is made, offset)
Leaf = tuple[str, _core.Field, tuple[tuple[str, tuple[int, ...]], ...], int]
Paths: TypeAlias = "str | Iterable[str]"
FLOOR = 1e-2    # the size of a number whose array is zero, for steps of differences


@dataclass(eq=False)
class Number:
    """A number that can be changed, and read.

    places: [bytes] where a snapshot has it, once or more; incoming: (input, place in its message) of what comes to
    readers in its place; size: its magnitude, or that of its array
    """
    name: str
    unit: str
    places: list[int] = field(default_factory=list)
    incoming: list[tuple[Any, int]] = field(default_factory=list)
    size: float = 0.0
    value: float = 0.0


class State:
    """A clone of a simulation at its present state, which it takes again and again. The simulation stays as it is.

    Raises SetupError if the simulation has not run yet, unless it is `fresh`: then what is changed are parameters, and
    the state is that of the first instant.
    """

    def __init__(self, simulation: Simulation, what: str, fresh: bool = False) -> None:
        if simulation.kernel.now < 0 and not fresh:
            raise SetupError(f"{what}: {simulation.name} has not run, so it is in no state yet; sim.step() runs the "
                             "first instant")
        if fresh:
            simulation.prepare()
        self.what, self.fresh = what, fresh
        self.simulation = simulation.clone()
        self.core = self.simulation.kernel
        self.base = np.frombuffer(self.core.snapshot(), np.uint8).copy()
        self.blocks = {(kind, path): (at, size) for kind, path, at, size in self.core.state_blocks()}
        self.wiring = Wiring(self.simulation)
        self.nodes = self.wiring.nodes
        self.order = {p.name: i for i, p in enumerate(self.simulation.processes)}
        self.differential = [self._differential(*row) for row in self.core.differential_states()]
        self._rates = {f"{path}.{name}": self.blocks["model", host][0] + rate
                       for host, path, name, _, _, rate in self.core.differential_states()}
        self.integrated = {host for host, *_ in self.core.differential_states()}
        self.integrated |= {node.path for node in self.nodes.values() if node.host in self.integrated}

    # --- names ---

    def _differential(self, host: str, path: str, name: str, unit: str, at: int, _rate: int) -> Number:
        return Number(f"{path}.{name}", unit, [self.blocks["model", host][0] + at])

    def states(self, path: str) -> list[Number]:
        """The differential states of that name, one or all of an array; [] if there are none."""
        return [number for number in self.differential if path in (number.name, number.name.partition("[")[0])]

    def field(self, path: str) -> FieldPath:
        """The numbers of 64 bits that a path names. Raises SetupError if there are none."""
        try:
            found = FieldPath(self.simulation, path)
        except SetupError as error:
            raise SetupError(f"{self.what}: {error}") from None
        if found.field.type != "f64":
            raise SetupError(f"{self.what}: {path} is {found.field.ctype}; expected numbers of the type double")
        return found

    def places(self, field: FieldPath) -> list[int]:
        """[bytes] where a snapshot has the elements of a field."""
        start = self.blocks["instance", _core.path(field.owner)][0]
        return [start + _core.Operand(field.holder, field.field, e, "element").offset for e in field.elements]

    def inputs(self, path: str) -> list[Number]:
        """The numbers that a path names as inputs: of an input or of all readers of an output, in place of what comes
        there, or of parameters."""
        field = self.field(path)
        owner = _core.path(field.owner)
        places = self.places(field)
        if field.group == "par":
            if field.field.initial and not self.fresh:
                raise SetupError(f"{self.what}: {path} is an initial value, which has no effect any more")
            return [Number(n, field.field.unit, [at]) for n, at in zip(field.names(), places)]
        if field.group not in ("in", "out"):
            raise SetupError(f"{self.what}: {path} is no input: expected a parameter, or a field of an input or output")
        at_port = ".".join(path.split(".")[:3])
        readers = [target for source, target, *_ in self.simulation.wires if source == at_port] if (
            field.group == "out") else [at_port]
        if not readers:
            raise SetupError(f"{self.what}: nothing reads {at_port}")
        numbers = [Number(n, field.field.unit) for n in field.names()]
        block = self.blocks["instance", owner][0] + _offset(port(self.simulation, at_port))
        for target in readers:
            view = port(self.simulation, target)
            start = self.blocks["instance", target.rpartition(".")[0]][0] + _offset(view)
            for number, at in zip(numbers, places):
                number.places.append(start + at - block)
                number.incoming.append((view, at - block))
        return numbers

    def outputs(self, path: str) -> list[Number]:
        """The numbers that a path names as outputs."""
        field = self.field(path)
        if field.group not in ("out", "mem"):
            raise SetupError(f"{self.what}: {path} is no output: expected a field of one, or of a module's memory")
        return [Number(n, field.field.unit, [at]) for n, at in zip(field.names(), self.places(field))]

    def memory(self, node: Node) -> Iterator[Number]:
        """The numbers of 64 bits that an instance carries from instant to instant in its interface."""
        start = self.blocks["instance", node.path][0]
        for name, field_, parts, offset in _leaves(node):
            if field_.type == "f64":
                for i, element in enumerate(element_names(parts)):
                    yield Number(f"{node.path}.{element}", field_.unit, [start + offset + 8 * i])

    def held(self) -> Iterator[Number]:
        """The numbers that wires with latency hold."""
        for (kind, path), (start, _) in self.blocks.items():
            if kind == "held":
                for name, field_, parts, offset in flat(_core.struct(port(self.simulation, path)), (), 0):
                    if field_.type == "f64":
                        for i, element in enumerate(element_names(parts)):
                            yield Number(f"{path}.{element} (late)", field_.unit, [start + offset + 8 * i])

    def steps(self, node: Node) -> list[tuple[str, int, int]]:
        """(name, place, size) of what an instance carries that moves by steps: whole numbers, enumerations."""
        start = self.blocks["instance", node.path][0]
        return [(f"{node.path}.{name}", start + offset, field_.size) for name, field_, _, offset in _leaves(node)
                if field_.type != "f64" and not name.endswith(("head.t", "head.sequence"))]

    # --- values ---

    def read(self, data: Any, places: Sequence[int]) -> Any:
        """The doubles at places of a snapshot."""
        if not len(places):
            return np.zeros(0)
        index = np.asarray(places)[:, None] + np.arange(8)
        return data[index].view(np.float64)[:, 0]

    def measure(self, numbers: Sequence[Number], data: Any = None) -> None:
        """Note values and sizes: the largest magnitude within an array."""
        values = self.read(self.base if data is None else data, [number.places[0] for number in numbers])
        arrays: dict[str, float] = {}
        for number, value in zip(numbers, values):
            number.value = float(value)
            whole = number.name.partition("[")[0]
            arrays[whole] = max(arrays.get(whole, 0.0), abs(number.value))
        for number in numbers:
            number.size = arrays[number.name.partition("[")[0]] or FLOOR

    def put(self, data: Any, number: Number, value: float) -> None:
        """Write a number into a snapshot."""
        raw = np.frombuffer(np.float64(value).tobytes(), np.uint8)
        for at in number.places:
            data[at:at + 8] = raw

    def written(self, number: Number) -> None:
        """See to it that the messages of an input count: one that was never written, and to which nothing comes, is
        good from now on. Raises SetupError if something comes, but was not written yet."""
        for (view, place), at in zip(number.incoming, number.places):
            comes = any(target == _core.path(view) for _, target, *_ in self.simulation.wires)
            process = self.core.process(_core.path(view).partition(".")[0])
            head = process.incoming(view)[:16]
            if not any(head[8:12]):
                if comes:
                    raise SetupError(f"{self.what}: nothing was written to {_core.path(view)} yet, so {number.name} "
                                     "has no effect; run on until it was")
                start = at - place
                self.base[start:start + 16] = np.frombuffer(
                    np.array([max(self.core.now, 0)], "=i8").tobytes() + np.array([3, 1], "=u4").tobytes(), np.uint8)

    def take(self, data: Any, begin: bool = False) -> None:
        """Put the clone into this state. Fresh: let it begin with these parameters, and run the first instant."""
        self.core.restore(data.tobytes(), edited=True)
        if self.fresh and begin:
            self.core.reset()
            self.core.step(1)

    def snapshot(self) -> Any:
        return np.frombuffer(self.core.snapshot(), np.uint8)

    def arrive(self) -> None:
        """Give the inputs of integrated models what comes to them next, as their next update will see it."""
        for _, target, *_ in self.simulation.wires:
            owner = target.rpartition(".")[0]
            if owner in self.integrated:
                view = port(self.simulation, target)
                raw = self.core.process(owner.partition(".")[0]).incoming(view)
                at = self.blocks["instance", owner][0] + _offset(view)
                self.base[at:at + len(raw)] = np.frombuffer(raw, np.uint8)

    def rates(self, numbers: Sequence[Number]) -> list[int]:
        """[bytes] where a snapshot has the derivatives of differential states."""
        return [self._rates[number.name] for number in numbers]

    def failed(self, number: Number, value: float, error: RunError) -> SetupError:
        return SetupError(f"{self.what}: with {number.name} = {value:.9g}: {error}")

    def no_state(self) -> SetupError:
        return SetupError(f"{self.what}: no model of {self.simulation.name} integrates differential equations; a "
                          "world.Spacecraft does. Of flight alone, linearize with discrete=True")

    def unknown(self, path: str, what: str) -> SetupError:
        known = list(dict.fromkeys(number.name.partition("[")[0] for number in self.differential))
        return SetupError(f"{self.what}: there is no {what} {path}{did_you_mean(path, known)} there are "
                          + listed(known))

    # --- time and order ---

    def position(self, path: str) -> tuple:
        """When an instance runs among those of an instant."""
        return (self.order[path.partition(".")[0]], *(self.nodes[path].slot or (1 << 30,)))

    def acts_late(self, target: str) -> bool:
        """Whether what an input reads acts from one instant to the next: it was written after its reader had run; or
        nothing writes it, and its reader is a model."""
        owner = target.rpartition(".")[0]
        for source, reader, latency, *_ in self.simulation.wires:
            if reader == target:
                return bool(latency) or self.position(source.rpartition(".")[0]) >= self.position(owner)
        return isinstance(self.nodes[owner].instance, _core.Model)


def paths_of(paths: Paths, what: str, example: str) -> list[str]:
    """One path, or several. Raises SetupError if there is something else among them."""
    several = [paths] if isinstance(paths, str) else list(paths or ())
    for path in several:
        if not isinstance(path, str):
            raise SetupError(f"{what}: expected paths, as in '{example}'; found {path!r:.80}")
    return several


def _offset(view: _core.Message) -> int:
    """[bytes] of an input or output in its module's memory."""
    field = _core.field(view)
    assert field is not None
    return field.offset


def _leaves(node: Node) -> list[Leaf]:
    """The leaves of an instance's outputs and memory, with their offsets."""
    return [leaf for group in ("out", "mem") for leaf in flat(_core.struct(node.instance), (group,), 0)]


def flat(struct: _core.Struct, groups: tuple[str, ...], offset: int) -> Iterator[Leaf]:
    """(name, Field, parts, offset) of each leaf; of rows of structs, one each."""
    for member in struct.fields:
        if member.spare or groups and member.group not in groups:
            continue
        if member.type != "struct":
            yield member.name, member, ((member.name, member.shape),), offset + member.offset
            continue
        for row in range(max(member.shape, default=1)):
            start = member.name + (f"[{row}]" if member.shape else "")
            for name, leaf, parts, at in flat(member.struct, (), offset + member.offset + row * member.struct.size):
                yield f"{start}.{name}", leaf, ((start, ()), *parts), at
