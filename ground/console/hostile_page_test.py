# SPDX-License-Identifier: Apache-2.0
"""Two spacecraft that differ in their texts alone, in a real browser (hostile_page_test.mjs): no hostile text becomes
an element or a script, or changes the order of letters."""
import json
import socket
import struct
from pathlib import Path
from urllib.request import urlopen
from xml.sax.saxutils import quoteattr

import pytest

from fledge.ground.console.console_test import free_port
from fledge.ground.console.testing.console import browse, checks, served
from tests.waiting import wait_for

SCRIPT = Path(__file__).with_suffix(".mjs")
TEXTS = {"name": "v", "unit": "mA", "about": "about it", "label": "POINT", "box": "Power", "command": "DO",
         "argument": "how", "choice": "now", "title": "Board", "said": "hello"}
EVIL = {key: evil for key, evil in zip(TEXTS, [
    "v<img src=x onerror=pwned=1>", "</td><script>pwned=1</script>",
    "<img src=x onerror=pwned=1>\u202e" + "x" * 1_000_000,
    "'\"><svg onload=pwned=1>\u2066\u200b", "Power<iframe srcdoc='<svg onload=parent&#46;pwned=1>'>",
    "DO<a href=javascript:pwned=1>", "how\" autofocus onfocus=\"pwned=1", "now<option selected>",
    "javascript:pwned=1//<b>", "=1+1<style>*{display:none}</style>\x1b[2J\x07\ud800\u202e"], strict=True)}


def database(of):
    q = {key: quoteattr(text) for key, text in of.items()}
    return f"""<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>
<IntegerParameterType name="U16"><IntegerDataEncoding sizeInBits="16"/></IntegerParameterType>
<FloatParameterType name="F"><UnitSet><Unit description={q["about"]}>{q["unit"][1:-1]}</Unit></UnitSet>
<FloatDataEncoding sizeInBits="32"/><DefaultAlarm><StaticAlarmRanges><CriticalRange maxInclusive="0.5"/>
</StaticAlarmRanges></DefaultAlarm></FloatParameterType>
<EnumeratedParameterType name="E"><IntegerDataEncoding sizeInBits="8"/><EnumerationList>
<Enumeration value="1" label={q["label"]}/></EnumerationList></EnumeratedParameterType>
<StringParameterType name="T"><StringDataEncoding><SizeInBits><Fixed><FixedValue>512</FixedValue></Fixed></SizeInBits>
</StringDataEncoding></StringParameterType></ParameterTypeSet><ParameterSet>
<Parameter name="id" parameterTypeRef="U16"/><Parameter name="count" parameterTypeRef="U16"/>
<Parameter name="size" parameterTypeRef="U16"/>
<Parameter name={q["name"]} parameterTypeRef="F" shortDescription={q["about"]}/>
<Parameter name="mode" parameterTypeRef="E"/><Parameter name="said" parameterTypeRef="T"/></ParameterSet><ContainerSet>
<SequenceContainer name="P" abstract="true"><EntryList><ParameterRefEntry parameterRef="id"/>
<ParameterRefEntry parameterRef="count"/><ParameterRefEntry parameterRef="size"/></EntryList></SequenceContainer>
<SequenceContainer name={q["box"]} shortDescription={q["about"]}><EntryList>
<ParameterRefEntry parameterRef={q["name"]}/><ParameterRefEntry parameterRef="mode"/>
<ParameterRefEntry parameterRef="said"/></EntryList><BaseContainer containerRef="P"><RestrictionCriteria>
<Comparison parameterRef="id" value="1"/></RestrictionCriteria></BaseContainer></SequenceContainer>
</ContainerSet></TelemetryMetaData><CommandMetaData><ArgumentTypeSet><EnumeratedArgumentType name="A">
<IntegerDataEncoding sizeInBits="8"/><EnumerationList><Enumeration value="1" label={q["choice"]}/></EnumerationList>
</EnumeratedArgumentType></ArgumentTypeSet><MetaCommandSet>
<MetaCommand name={q["command"]} shortDescription={q["about"]}><ArgumentList>
<Argument name={q["argument"]} argumentTypeRef="A" shortDescription={q["about"]}/></ArgumentList>
<CommandContainer name="c"><EntryList><ArgumentRefEntry argumentRef={q["argument"]}/></EntryList></CommandContainer>
</MetaCommand></MetaCommandSet></CommandMetaData></SpaceSystem>"""


def packets(of):
    text = of["said"].encode("utf-8", "surrogatepass")[:64].ljust(64, b"\0")
    for count in range(20):
        body = struct.pack(">fB", count / 10, 1) + text
        yield struct.pack(">HHH", 1 if count % 5 else 7, 0xC000 | count, len(body) - 1) + body


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    folder = tmp_path_factory.mktemp("twins")
    ports, tables = {}, ""
    (folder / "displays").mkdir()
    for name, of in (("plain", TEXTS), ("evil", EVIL)):
        ports[name] = free_port()
        (folder / f"{name}.xml").write_text(database(of), encoding="utf-8")
        tables += f'[[craft]]\nname = "{name}"\ndatabase = ["{name}.xml"]\nheader = "none"\n' \
                  f'link = "udp://127.0.0.1:{free_port()}?listen={ports[name]}"\n'
        (folder / f"displays/{name}.toml").write_text(
            f"title = {json.dumps(of['title'])}\n[[panel]]\ntitle = {json.dumps(of['title'])}\nvalues = [{{name = "
            f"{json.dumps(of['name'])}, label = {json.dumps(of['label'])}}}]\n", encoding="utf-8")
    (folder / "ground.toml").write_text(f'port = 0\nfolder = "runs"\n{tables}')
    (folder / "texts.json").write_text(json.dumps({"plain": TEXTS, "evil": EVIL}))
    with served(folder / "ground.toml") as address, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        def crafts():
            with urlopen(f"{address}/api/crafts") as response:
                return json.load(response)

        wait_for(lambda: all(craft["link"]["up"] for craft in crafts()))
        for n, both in enumerate(zip(packets(TEXTS), packets(EVIL)), 1):
            for port, packet in zip(ports.values(), both):
                link.sendto(packet, ("127.0.0.1", port))
            wait_for(lambda: all(craft["packets"] >= n for craft in crafts()))
        return browse(SCRIPT, address, folder)


@pytest.mark.long("a browser on eleven pages of two spacecraft: a minute")
@pytest.mark.parametrize("check", checks(SCRIPT))
def test_in_the_browser(errors, check):
    assert errors[check] == "", errors[check]
