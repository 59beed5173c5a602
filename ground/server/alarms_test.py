# SPDX-License-Identifier: Apache-2.0
"""Alarms of a monitor, without a server."""
import struct
from types import SimpleNamespace

from fledge import _ground
from fledge.ground.server.alarms import Alarms

DATABASE = """<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>
<RelativeTimeParameterType name="duration"><Encoding scale="0.001"><IntegerDataEncoding sizeInBits="32"/></Encoding>
<DefaultAlarm><StaticAlarmRanges><WarningRange maxInclusive="1"/></StaticAlarmRanges></DefaultAlarm>
</RelativeTimeParameterType>
<FloatParameterType name="float"><FloatDataEncoding/><DefaultAlarm><StaticAlarmRanges><WarningRange maxInclusive="1"/>
</StaticAlarmRanges></DefaultAlarm></FloatParameterType>
</ParameterTypeSet><ParameterSet><Parameter name="uptime" parameterTypeRef="duration"/>
<Parameter name="speed" parameterTypeRef="float"/></ParameterSet><ContainerSet><SequenceContainer name="P"><EntryList>
<ParameterRefEntry parameterRef="uptime"/><ParameterRefEntry parameterRef="speed"/></EntryList></SequenceContainer>
</ContainerSet></TelemetryMetaData></SpaceSystem>"""


def test_the_text_of_an_alarm_is_in_the_unit_of_its_limits(tmp_path):
    (tmp_path / "s.xml").write_text(DATABASE)
    monitor = _ground.Monitor(_ground.Database.read([(str(tmp_path / "s.xml"), "")]))
    notes = monitor.take([(10**9, 0, struct.pack(">If", 2500, 2.5))])
    names = [slot["name"] for slot in monitor.slots()]
    reporter = SimpleNamespace(name="craft", clock=None, all=lambda *_, **__: [], keep=lambda *_, **__: None)
    alarms = Alarms(SimpleNamespace(monitor=monitor, slot_names=names, slot_numbers={
        name: i for i, name in enumerate(names)}), reporter)
    alarms.take([note[1:] for note in notes if note[0] == "concern"])
    assert {row["name"]: (row["value"], row["text"], row["level"]) for row in alarms.rows()} == {
        "uptime": (2_500_000_000, "2.5", "warning"), "speed": (2.5, "2.5", "warning")}
