# SPDX-License-Identifier: Apache-2.0
"""The pages that show, in a real browser (console_test.mjs), at a spacecraft whose packets this test sends."""
import math
import socket
import struct
import threading
from pathlib import Path
from xml.sax.saxutils import escape

import pytest

from fledge.ground.console.testing.console import browse, checks, served

SCRIPT = Path(__file__).with_suffix(".mjs")
EVERY = 0.05        # [s] between packets
EVIL = "<img src=x onerror=alert(1)>\u202e"
BIG = 2**64 - 2**40     # beyond what a double holds exactly

FIELDS = [("version_to_apid", "U16"), ("sequence", "U16"), ("length", "U16")]
DATABASE = f"""<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="U16" signed="false"><IntegerDataEncoding sizeInBits="16"/></IntegerParameterType>
<IntegerParameterType name="U64" signed="false" sizeInBits="64"><IntegerDataEncoding sizeInBits="64"/>
</IntegerParameterType>
<FloatParameterType name="Volt"><UnitSet><Unit>{escape("<b>V</b>")}</Unit></UnitSet>
<FloatDataEncoding sizeInBits="32"/><DefaultAlarm><StaticAlarmRanges>
<WarningRange minInclusive="-0.5" maxInclusive="0.5"/><CriticalRange minInclusive="-0.9" maxInclusive="0.9"/>
</StaticAlarmRanges></DefaultAlarm></FloatParameterType>
<EnumeratedParameterType name="Mode"><IntegerDataEncoding sizeInBits="8"/><EnumerationList>
<Enumeration value="0" label="SAFE"/><Enumeration value="1" label="{escape("<b>POINT</b>")}"/></EnumerationList>
</EnumeratedParameterType>
<StringParameterType name="Text"><StringDataEncoding><SizeInBits><Fixed><FixedValue>256</FixedValue></Fixed>
</SizeInBits></StringDataEncoding></StringParameterType>
</ParameterTypeSet><ParameterSet>
{"".join(f'<Parameter name="{name}" parameterTypeRef="{kind}"/>' for name, kind in FIELDS)}
<Parameter name="voltage" parameterTypeRef="Volt" shortDescription="{escape(EVIL)}"/>
<Parameter name="big" parameterTypeRef="U64"/><Parameter name="mode" parameterTypeRef="Mode"/>
<Parameter name="said" parameterTypeRef="Text"/>
</ParameterSet><ContainerSet>
<SequenceContainer name="Packet" abstract="true"><EntryList>
{"".join(f'<ParameterRefEntry parameterRef="{name}"/>' for name, _ in FIELDS)}</EntryList></SequenceContainer>
<SequenceContainer name="Power"><EntryList>
{"".join(f'<ParameterRefEntry parameterRef="{name}"/>' for name in ("voltage", "big", "mode", "said"))}</EntryList>
<BaseContainer containerRef="Packet"><RestrictionCriteria>
<Comparison parameterRef="version_to_apid" value="1"/></RestrictionCriteria></BaseContainer></SequenceContainer>
</ContainerSet></TelemetryMetaData></SpaceSystem>"""


def packet(count):
    """A packet of the database; every 50th has an APID that it does not know."""
    voltage = 0.7 + 0.15 * math.sin(count * EVERY)     # beyond its limits
    body = struct.pack(">fQB", voltage, BIG + count, count // 20 % 2) + EVIL.encode().ljust(32, b"\x07")[:32]
    return struct.pack(">HHH", 7 if count % 50 == 49 else 1, 0xC000 | count & 0x3FFF, len(body) - 1) + body


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """The error of each check in the browser, "" without one."""
    folder, port, over = tmp_path_factory.mktemp("room"), free_port(), threading.Event()
    (folder / "craft.xml").write_text(DATABASE, encoding="utf-8")
    (folder / "ground.toml").write_text(
        f'port = 0\nfolder = "runs"\n[[craft]]\nname = "one"\ndatabase = ["craft.xml"]\n'
        f'link = "udp://127.0.0.1:{free_port()}?listen={port}"\n')

    def fly():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            count = 0
            while not over.wait(EVERY):
                link.sendto(packet(count), ("127.0.0.1", port))
                count += 1

    craft = threading.Thread(target=fly)
    with served(folder / "ground.toml") as address:
        craft.start()
        try:
            return browse(SCRIPT, address, folder)
        finally:
            over.set()
            craft.join()


@pytest.mark.long("a browser on a room and a mission: 45 s")
@pytest.mark.parametrize("check", checks(SCRIPT))
def test_in_the_browser(errors, check):
    assert errors[check] == "", errors[check]
