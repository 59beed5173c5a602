# SPDX-License-Identifier: Apache-2.0
"""Which packets are hazardous: by what they command, and by what they store and write."""
from types import SimpleNamespace

import numpy as np
import pytest

import fledge
from fledge.commands import Code, Packets
from fledge.export.run_test import FLIGHT, WORLD
from fledge.export.xtce_test import written
from fledge.ground.server.commanding import Commanding

STORED = """
    f.stored = fsw.StoredCommands()
    f.task("stored", every=1 * s, run=[f.stored])
"""
HAZARDS = """
[commands."flight.write.control.P"]
hazardous = "the loop may oscillate"
[commands."flight.write.stored"]
hazardous = "the store is another one"
[commands."flight.reset_flight"]
hazardous = "flight begins again"
"""


@pytest.fixture
def mission(tmp_path):
    """(Commanding with hazards, maker of its packets)"""
    folder = tmp_path / "plays"
    folder.mkdir()
    for name, text in (("flight.py", FLIGHT + STORED), ("world.py", WORLD), ("ground.toml", HAZARDS)):
        (folder / name).write_text(text)
    sim = fledge.load(folder)
    (tmp_path / "plays.xml").write_text(written(sim))
    dictionary = sim.flight.commands.dictionary
    telemetry = SimpleNamespace(database=fledge.ground.Database.load(tmp_path / "plays.xml"))
    clock, settings = SimpleNamespace(now=0, simulated=True), SimpleNamespace(header="cfs", light_time=0.0)
    reporter = SimpleNamespace(name="plays", clock=clock, all=lambda kind, is_open: [])
    connection = SimpleNamespace(link=None, craft=None, silent="the link is down")
    return Commanding(settings, dictionary, False, connection, telemetry, None, reporter), Packets(dictionary)


def test_a_packet_is_hazardous_by_what_it_commands_writes_and_stores(mission):
    commanding, ours = mission
    identity = np.eye(3).tolist()
    fields = {field.name: field for field in ours.dictionary.block("flight.control")[1].fields}
    row, = ours.write_bytes("flight.control", {fields["P"].offset + 24: bytes(24)})
    both, = ours.write("flight.control", K=2, P=identity)
    late, = ours.write("flight.stored", late=2.0)
    loop, again = "the loop may oscillate", "flight begins again"
    for packet, why in (
            (ours.mode("rest"), ""), (ours.noop(), ""), (ours.reset(), again),
            (ours.write("flight.control", K=2)[0], ""),
            (ours.write("flight.control", P=identity)[0], loop), (both, loop), (row, loop),
            (late, "the store is another one"), (ours.store(1, 0, 0, ours.mode("rest")), ""),
            (ours.store(1, 0, 0, ours.reset()), again), (ours.store(1, 0, 0, ours.store(2, 0, 0, ours.reset())), again),
            (ours.store(1, 0, 0, row), loop),
            (ours.store(1, 0, 0, ours.reset()[:2] + bytes(4) + ours.reset()[6:]), again),
            (ours.packet(Code.RESET_FLIGHT, version=1), ""),
            (ours.packet(Code.WRITE, row[10:], version=1), ""), (ours.packet(Code.STORE, b"\x0F" * 40), "")):
        assert commanding.hazard(packet) == why, packet.hex()
        # The server writes sequence and length itself.
        assert commanding.hazard(packet[:2] + bytes(4) + packet[6:]) == why, packet.hex()
    assert commanding.hazard_of("flight.noop", "flight.reset_flight") == again
