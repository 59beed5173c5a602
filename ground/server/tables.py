# SPDX-License-Identifier: Apache-2.0
"""Tables: the parameters of flight's modules, as they were last read."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from fledge.commands import Block, Field, encoded, values
from fledge.errors import SetupError, did_you_mean
from fledge.ground.server.commanding import Hazardous

if TYPE_CHECKING:
    from fledge.ground.scripts.craft import Sent
    from fledge.ground.server.commanding import Commanding
    from fledge.ground.server.link import Connection
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.stages import Command


class Tables:
    """blocks: of the modules. `rows` is for all threads, the rest for the spacecraft's own."""

    def __init__(self, blocks: Sequence[Block], connection: Connection, commanding: Commanding,
                 reporter: Reporter) -> None:
        self._blocks, self._connection, self._commanding = blocks, connection, commanding
        self._clock, self._reporter = reporter.clock, reporter
        self._read: dict[str, tuple[bytes, str]] = {}       # the block, big-endian, and when

    def rows(self) -> list[dict[str, Any]]:
        """All tables."""
        return [self._shown(block) for block in self._blocks]

    def _shown(self, block: Block) -> dict[str, Any]:
        data, when = self._read.get(block.path, (None, None))
        return {"name": block.path, "meaning": block.type,
                "fields": [_field(f) for f in block.fields if not f.name.startswith("spare")],
                "values": values(block.fields, data) if data is not None else None, "read_ns": when}

    def read(self, user: str, name: str) -> Command:
        """Ask for the values on board: the row of the command. Raises SetupError."""
        craft, block = self._connection.reach(), self._block(name)

        def done(sent: Sent) -> None:
            if len(sent.data) == block.size:
                self._keep(block, sent.data)

        return self._commanding.release(user, "read", {"module": name}, craft.packets("read", name), done)

    def write(self, user: str, name: str, given: dict[str, Any], confirmed: bool) -> Command:
        """Change values on board, by stage and commit. Raises Hazardous, if the write of one is; SetupError."""
        craft, block = self._connection.reach(), self._block(name)
        if name not in self._read:
            raise SetupError(f"read {name} first: what is not changed stays as it is on board")
        whole = bytearray(self._read[name][0])
        fields = {field.name: field for field in block.fields}
        for key, value in given.items():
            if key not in fields:
                raise SetupError(f"{name} has no parameter '{key}'{did_you_mean(key, list(fields))}")
            try:
                whole[fields[key].offset:fields[key].offset + fields[key].size] = encoded(fields[key], value)
            except (TypeError, AttributeError) as error:
                raise SetupError(f"{name}.{key}: {error}") from None
        process, _, module = name.partition(".")
        why = self._commanding.hazard_of(*(f"{process}.write.{module}.{key}" for key in given))
        if why and not confirmed:
            raise Hazardous(why, f"load {name}")
        data = bytes(whole)
        return self._commanding.release(user, "load", {"module": name, **given}, craft.packets("load", name, data),
                                        lambda _: self._keep(block, data))

    def _keep(self, block: Block, data: bytes) -> None:
        self._read[block.path] = data, str(self._clock.now)
        self._reporter.publish("table", self._shown(block))

    def _block(self, name: str) -> Block:
        blocks = {block.path: block for block in self._blocks}
        if name not in blocks:
            raise SetupError(f"{self._reporter.name} has no table '{name}'{did_you_mean(name, list(blocks))}")
        return blocks[name]


def _field(field: Field) -> dict[str, Any]:
    return {"name": field.name, "type": field.type, "unit": "" if field.unit == "-" else field.unit,
            "shape": field.shape, "meaning": field.meaning, "enumerators": field.enumerators, "rule": field.rule,
            "fields": [_field(f) for f in field.fields]}
