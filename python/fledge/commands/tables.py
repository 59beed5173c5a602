# SPDX-License-Identifier: Apache-2.0
"""The files of tables: the parameters of a module, as flight loads and writes them (flight/services/files.h)."""
from __future__ import annotations

import binascii
import struct as packing
from typing import Any

from fledge.commands.dictionary import Dictionary
from fledge.commands.fields import encoded, place_of, values
from fledge.errors import SetupError, listed

TABLE = ">4sHHIHxx"                      # the header of a table's file: magic, version, module, size, CRC
TABLE_MAGIC = b"FLTB"


def table(dictionary: Dictionary, module: str, block: bytes | None = None, **values: Any) -> bytes:
    """The file of a table for Packets.load_table(): the parameters of a module. values: those that differ from the
    big-endian block; without a block, all of them."""
    place, owner = dictionary.block(module)
    if block is None:
        missing = [f.name for f in owner.fields if f.name not in values and not f.name.startswith("spare")]
        if missing:
            raise SetupError(f"a table has all parameters of {module}: give {listed(missing)} too, or a block")
    elif len(block) != owner.size:
        raise SetupError(f"{module} has {owner.size} bytes of parameters; found {len(block)}")
    whole = bytearray(block or owner.size)
    for name, value in values.items():
        field = place_of(owner.fields, [f.name for f in owner.fields], name, "parameter", module)[1]
        whole[field.offset:field.offset + field.size] = encoded(field, value)
    return packing.pack(TABLE, TABLE_MAGIC, dictionary.version, place, len(whole),
                        binascii.crc_hqx(whole, 0xFFFF)) + whole


def read_table(dictionary: Dictionary, file: bytes) -> tuple[str, dict[str, Any]]:
    """(module, its parameters) of such a file, as Packets.dump_table() has it written. Raises SetupError."""
    head, block = file[:packing.calcsize(TABLE)], file[packing.calcsize(TABLE):]
    magic, version, place, size, crc = packing.unpack(TABLE, head.ljust(packing.calcsize(TABLE), b"\0"))
    if (magic, size, crc) != (TABLE_MAGIC, len(block), binascii.crc_hqx(block, 0xFFFF)):
        raise SetupError(f"the {len(file)} bytes are no table, or not a whole one")
    if version != dictionary.version or place >= len(dictionary.blocks) or size != dictionary.blocks[place].size:
        raise SetupError(f"the table is for version {version:#06x} of a dictionary; that of {dictionary.name} is "
                         f"{dictionary.version:#06x}")
    return dictionary.blocks[place].path, values(dictionary.blocks[place].fields, block)


def checked(data: bytes) -> tuple[int, int]:
    """(size [bytes], CRC-16-CCITT of the big-endian block) in the report of Code.CHECK."""
    size, crc = packing.unpack(">IH", data)
    return size, crc
