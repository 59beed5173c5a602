# SPDX-License-Identifier: Apache-2.0
"""The database, against a second reader of XTCE in Python. FLEDGE_CASES=100000 decodes so many random packets, and
FLEDGE_XTCE=FOLDER reads all files of XTCE there and prints a table of those that are read, and why not."""
import os
import re
from pathlib import Path

import pytest

from fledge import SetupError, _ground
from fledge.ground import Database
from fledge.ground.testing.databases import Random, same
from fledge.ground.testing.second import Second

CASES = int(os.environ.get("FLEDGE_CASES", 1500))


def written(tmp_path, text, name="s.xml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_second_reader_decodes_random_packets_of_random_databases_to_the_same_values(tmp_path):
    rows = whole = 0
    for seed in range(CASES // 50):
        database = Random(seed)
        path = str(written(tmp_path, database.text))
        both = [_ground.Database.read([(path, "")], plans) for plans in (True, False)]
        second = Second(database.text)
        for _ in range(50):
            packet = database.packet()
            container, expected = second.decode(packet, "Root")
            for reader in both:
                decoded = reader.decode(packet, "Root")
                place = f"seed {seed}, packet {packet.hex()}"
                assert (decoded.container or "/S/None") == f"/S/{container}", f"{place}: {decoded.reason}"
                assert second.whole == (not decoded.reason), f"{place}: {decoded.reason}"
                assert len(decoded.rows) == len(expected), f"{place}: {decoded.reason}\n{decoded.rows}\n{expected}"
                for row, wanted in zip(decoded.rows, expected):
                    assert row[0] == wanted[0], place
                    assert wanted[1] is None or same(row[1], wanted[1]), f"{place}: {row}, not {wanted}"
                    assert same(row[2], wanted[2]), f"{place}: {row}, not {wanted}"
            rows += len(expected)
            whole += not decoded.reason
    assert rows > 3 * CASES and whole > CASES / 4


def known(value):
    """Whether all parts of a value are known, and exactly: a whole number beyond 2^53 is rounded where it is real."""
    parts = value.values() if isinstance(value, dict) else ()
    return value is not None and not (isinstance(value, float) and abs(value) > 2**53) and all(map(known, parts))


def test_a_second_reader_encodes_random_commands_to_the_same_bytes_which_are_decoded_again(tmp_path):
    done = again = 0
    for seed in range(CASES // 5):
        database = Random(seed)
        read = Database.load(written(tmp_path, database.text))
        second = Second(database.text)
        given = database.given(second)
        try:
            expected = second.encode("K", given)
        except (KeyError, OverflowError, ValueError, TypeError):    # a calibrated number that does not fit
            with pytest.raises(SetupError):
                read.encode("K", **given)
            continue
        try:
            encoded = read.encode("K", **given)
        except SetupError as reason:
            assert re.search("too few for|no raw number", str(reason)), f"seed {seed}: {reason}"
            continue
        assert encoded.hex() == expected.hex(), f"seed {seed}: {given}"
        done += 1
        packet = read.decode_command(encoded)
        assert (packet.command, packet.reason, (packet.bits + 7) // 8) == ("/S/K", "", len(encoded)), f"seed {seed}"
        values = packet.arguments | packet.header
        assert values.keys() == given.keys(), f"seed {seed}"
        if known(values):       # its calibrators have inverses
            assert read.encode("K", **values) == encoded, f"seed {seed}: {values}, not {given}"
            again += 1
        for _ in range(3):      # of other bytes, no more than a reason
            other = read.decode_command(database.packet())
            assert other.command in (None, "/S/K") and (other.command is None) == (other.reason != "")
    assert done > CASES / 20 and again > CASES / 60


def test_values_are_dicts_and_lists(tmp_path):
    text = """<SpaceSystem name='S'><TelemetryMetaData><ParameterTypeSet>
      <IntegerParameterType name='u8'><UnitSet><Unit>V</Unit></UnitSet><IntegerDataEncoding/></IntegerParameterType>
      <ArrayParameterType name='r' arrayTypeRef='u8'><DimensionList><Size><FixedValue>2</FixedValue></Size>
      </DimensionList></ArrayParameterType><AggregateParameterType name='g'><MemberList><Member name='x' typeRef='u8'/>
      <Member name='y' typeRef='r'/></MemberList></AggregateParameterType>
      <ArrayParameterType name='q' arrayTypeRef='g'><DimensionList><Size><FixedValue>2</FixedValue></Size>
      </DimensionList></ArrayParameterType></ParameterTypeSet><ParameterSet><Parameter name='a' parameterTypeRef='u8'/>
      <Parameter name='b' parameterTypeRef='q'/></ParameterSet><ContainerSet><SequenceContainer name='P'><EntryList>
      <ParameterRefEntry parameterRef='a'/><ParameterRefEntry parameterRef='b'/></EntryList></SequenceContainer>
      </ContainerSet></TelemetryMetaData></SpaceSystem>"""
    database = Database.load(written(tmp_path, text))
    packet = database.decode(bytes(range(1, 8)))
    assert packet.values == {"a": 1, "b": [{"x": 2, "y": [3, 4]}, {"x": 5, "y": [6, 7]}]}
    assert (packet.container, packet.reason, packet.bits) == ("/S/P", "", 56)
    assert [name for name, _, _ in packet.rows][-1] == "b[1].y[1]"
    assert database.units("a") == ["V"] and database.parameters == ["/S/a", "/S/b"]
    short = database.decode(b"\1\2")
    assert short.values == {"a": 1, "b": [{"x": 2}]} and short.reason == "the packet ends within b"
    with pytest.raises(SetupError, match="the database has no container Q"):
        database.decode(b"", root="Q")


def test_an_error_names_file_and_line(tmp_path):
    path = written(tmp_path, "<SpaceSystem name='S'>\n<Bogus/></SpaceSystem>")
    with pytest.raises(SetupError, match=re.escape(f"{path}:2: <Bogus> is not known in <SpaceSystem>")):
        Database.load(path)


@pytest.mark.skipif("FLEDGE_XTCE" not in os.environ, reason="FLEDGE_XTCE=FOLDER names files of XTCE")
def test_a_folder_of_files_is_read():
    """A file is read alone, or with those of its folder whose space systems it names."""
    folder = Path(os.environ["FLEDGE_XTCE"])
    system = re.compile(r"<(?:\w+:)?SpaceSystem\b[^>]*?\bname=\"([^\"]+)\"")
    files = {path: match[1] for path in sorted(folder.rglob("*.xml")) if (match := system.search(path.read_text()))}
    for path in files:
        together = [path]
        while True:
            try:
                Database.load(*together)
                reason = ""
            except SetupError as error:
                reason = str(error).replace(f"{folder}/", "")
            named = re.search("there is no [a-z]+ /([^/]+)/", reason)
            beside = [other for other, name in files.items() if other.parent == path.parent and other not in together
                      and named and name == named[1]]
            if not beside:
                break
            together.append(min(beside, key=lambda path: path.stem.lower() != files[path].lower()))
        how = "refused" if reason else "read" if len(together) == 1 else f"read with {len(together) - 1} more"
        print(f"{how:16} {path.relative_to(folder)}" + (f"\n{'':17}{reason}" if reason else ""))
    assert files


def array_type(name, element, last):
    return f"""<ArrayParameterType name="{name}" arrayTypeRef="{element}"><DimensionList><Dimension><StartingIndex>
        <FixedValue>0</FixedValue></StartingIndex><EndingIndex>{last}</EndingIndex></Dimension></DimensionList>
        </ArrayParameterType>"""


def test_an_array_without_elements_is_there_and_a_parameter_that_comes_again_is_the_last_one(tmp_path):
    """Also within members and elements; in a container with fixed places, too; one element again is no second one."""
    of_n = '<DynamicValue><ParameterInstanceRef parameterRef="n"/><LinearAdjustment intercept="-1"/></DynamicValue>'
    types = """<IntegerParameterType name="u8"><IntegerDataEncoding/></IntegerParameterType>
        <AggregateParameterType name="g"><MemberList><Member name="v" typeRef="u8"/><Member name="l" typeRef="some"/>
        </MemberList></AggregateParameterType>""" + array_type("some", "u8", of_n) + array_type(
            "none", "u8", "<FixedValue>-1</FixedValue>") + array_type("two", "some", "<FixedValue>1</FixedValue>") + \
        array_type("one", "g0", "<FixedValue>0</FixedValue>") + """<AggregateParameterType name="g0"><MemberList>
        <Member name="z" typeRef="none"/><Member name="v" typeRef="u8"/></MemberList></AggregateParameterType>"""
    names = {"id": "u8", "n": "u8", "a": "some", "g": "g", "t": "two", "z": "none", "o": "one"}
    entries = {"Vary": ["n", "a", "g", "t", "n", "a"], "Fixed": ["z", "o", "o"]}
    parameters = "".join(f'<Parameter name="{name}" parameterTypeRef="{kind}"/>' for name, kind in names.items())
    text = f"""<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet>{types}</ParameterTypeSet>
        <ParameterSet>{parameters}</ParameterSet>
        <ContainerSet><SequenceContainer name="P" abstract="true"><EntryList><ParameterRefEntry parameterRef="id"/>
        </EntryList></SequenceContainer>""" + "".join(
        f"""<SequenceContainer name="{name}"><EntryList>{"".join(f'<ParameterRefEntry parameterRef="{entry}"/>'
            for entry in all_)}</EntryList><BaseContainer containerRef="P"><RestrictionCriteria><Comparison
            parameterRef="id" value="{i}"/></RestrictionCriteria></BaseContainer></SequenceContainer>"""
        for i, (name, all_) in enumerate(entries.items())) + "</ContainerSet></TelemetryMetaData></SpaceSystem>"
    path = str(written(tmp_path, text))
    for plans in (True, False):
        read = _ground.Database.read([(path, "")], plans)
        for packet, values in [
                ([0, 0, 7, 0], {"id": 0, "n": 0, "a": [], "g": {"v": 7, "l": []}, "t": [[], []]}),
                ([0, 1, 5, 7, 6, 8, 9, 0], {"id": 0, "n": 0, "a": [], "g": {"v": 7, "l": [6]}, "t": [[8], [9]]}),
                ([0, 0, 7, 2, 3, 4], {"id": 0, "n": 2, "a": [3, 4], "g": {"v": 7, "l": []}, "t": [[], []]}),
                ([0, 1, 5, 7, 6, 8, 9, 1, 4], {"id": 0, "n": 1, "a": [4], "g": {"v": 7, "l": [6]}, "t": [[8], [9]]}),
                ([1, 5, 6], {"id": 1, "z": [], "o": [{"z": [], "v": 6}]})]:
            decoded = read.decode(bytes(packet))
            assert (decoded.values, decoded.raw, decoded.reason) == (values, values, ""), (plans, packet)


def test_a_command_has_its_arrays_without_elements_back(tmp_path):
    text = """<SpaceSystem name="S"><CommandMetaData><ArgumentTypeSet><IntegerArgumentType name="u8">
        <IntegerDataEncoding/></IntegerArgumentType>""" + array_type("some", "u8", """<DynamicValue>
        <ArgumentInstanceRef argumentRef="n"/><LinearAdjustment intercept="-1"/></DynamicValue>""").replace(
        "Parameter", "Argument") + """</ArgumentTypeSet><MetaCommandSet><MetaCommand name="C"><ArgumentList>
        <Argument name="n" argumentTypeRef="u8"/><Argument name="a" argumentTypeRef="some"/></ArgumentList>
        <CommandContainer name="CC"><EntryList><ArgumentRefEntry argumentRef="n"/><ArgumentRefEntry argumentRef="a"/>
        </EntryList></CommandContainer></MetaCommand></MetaCommandSet></CommandMetaData></SpaceSystem>"""
    craft = Database.load(written(tmp_path, text))
    for given in ({"n": 0, "a": []}, {"n": 2, "a": [3, 4]}):
        packet = craft.encode("C", **given)
        assert packet == bytes([given["n"], *given["a"]])
        assert craft.decode_command(packet).arguments == given
