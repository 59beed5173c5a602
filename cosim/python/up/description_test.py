# SPDX-License-Identifier: Apache-2.0
"""The keys of a SIM.toml, and the messages about its mistakes."""
import os
import socket
import sys

import pytest

from fledge.cosim import keys
from fledge.cosim.up.description import SimError, busy, is_local, read
from fledge.targets import TARGETS

GOOD = """
simulation = "duo"
until = 60
seed = 7
pace = 2.5

[[node]]
name = "mass"
command = ["python3", "mass.py", "{address}"]
env = { LEVEL = "2" }

[[node]]
name = "spring"
command = ["./spring", "--fast"]
on_loss = "restart"
restarts = 5
reply = 0.5

[[asynchronous]]
name = "viewer"
command = ["sh", "-c", "exit"]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "mass.py").write_text("")
    (tmp_path / "spring").write_text("")
    (tmp_path / "spring").chmod(0o755)
    return tmp_path


def write(folder, text):
    file = folder / "sim.toml"
    file.write_text(text)
    return file


def complaints(folder, text):
    """(line, complaint) of each, with the folder's path as FOLDER."""
    file = write(folder, text)
    with pytest.raises(SimError) as error:
        read(file)
    found = []
    for line in str(error.value).split("\n"):
        assert line.startswith(f"{file}:"), line
        number, _, what = line.removeprefix(f"{file}:").partition(": ")
        found.append((int(number), what.replace(str(folder), "FOLDER")))
    return found


def test_a_good_file(folder):
    plan = read(write(folder, GOOD))
    assert (plan.simulation, plan.until, plan.seed, plan.pace) == ("duo", 60.0, 7, 2.5)
    mass, spring, viewer = plan.programs
    assert mass.command == ["python3", "mass.py", "{address}"] and mass.env == {"LEVEL": "2"}
    assert mass.directory == str(folder) and mass.on_loss == "abort" and mass.restarts == 0
    assert (spring.on_loss, spring.restarts, spring.reply) == ("restart", 5, 0.5)
    assert viewer.asynchronous and plan.nodes == [mass, spring]
    assert plan.listening().startswith("ipc://@fledge-duo-") and plan.listening() != plan.listening()


def test_what_is_left_out_has_a_default(folder):
    plan = read(write(folder, '[[node]]\nname = "mass"\ncommand = ["python3", "mass.py"]\non_loss = "restart"'))
    assert (plan.simulation, plan.until, plan.seed, plan.pace, plan.join, plan.reply) == ("sim", None, 0, 0, 60, 60)
    assert (plan.greet, plan.any_user) == (30, False)
    assert plan.programs[0].restarts == 3


def test_a_mission_whose_processes_are_nodes(folder):
    plan = read(write(folder, """
mission = "formation"
scenario = "sensed"
parameters = { deputies = 2 }
[[node]]
process = "deputy2"
on_loss = "drop"
killed = 30
[[node]]
name = "chief"
by_hand = true
[[node]]
name = "mass"
command = ["python3", "mass.py"]
"""))
    assert [p.name for p in plan.programs] == [
        "chief_world", "deputy1_world", "deputy2_world", "chief_guidance", "deputy1", "deputy2", "chief", "mass"]
    assert plan.until == 6600 and plan.programs[5].killed == 30 and plan.programs[5].on_loss == "drop"
    assert {(p.mission, p.scenario, p.parameters["deputies"])
            for p in plan.programs[:6]} == {("formation", "sensed", 2)}
    assert [p.name for p in plan.programs if p.flies] == ["chief_guidance", "deputy1", "deputy2"]
    assert plan.programs[6].mission is None
    plan = read(write(folder, 'mission = "formation"\nuntil = 7'), scenario="sensed")
    assert plan.until == 7 and {p.scenario for p in plan.programs} == {"sensed"}


NADIR = """
[[node]]
name = "a_world"
mission = "nadir_spin"
process = "world"
prefix = "a"
[[node]]
name = "a_flight"
mission = "nadir_spin"
process = "flight"
prefix = "a"
[[node]]
name = "world"
mission = "nadir_spin"
[[node]]
name = "flight"
mission = "nadir_spin"
"""


def test_two_missions_stay_apart_by_a_prefix_or_by_other_names(folder):
    plan = read(write(folder, NADIR))
    assert [p.named("/world/nav/orbit") for p in plan.nodes] == ["/a/world/nav/orbit"] * 2 + ["/world/nav/orbit"] * 2
    plan = read(write(folder, NADIR + 'topics = { "/world/nav/orbit" = "/a/world/nav/orbit" }'))
    assert plan.nodes[3].named("/world/nav/orbit") == "/a/world/nav/orbit"     # it reads that of the other mission


@pytest.mark.parametrize("old, new, line, complaint", [
    ('prefix = "a"', 'prefix = "/a"', 6, "`prefix` is of letters, digits, `_`, `-` and `.`; it is \"/a\"; write for "
     "example prefix = \"a\": /world/x of the node is /a/world/x in the run"),
    ('prefix = "a"', 'prefix = "a"\ntopics = { "/world/nav/orbt" = "/x" }', 7, "`topics` renames what the process "
     "reads or writes; world has no /world/nav/orbt; did you mean /world/nav/orbit?"),
    ('prefix = "a"', 'topics = { "/world/nav/orbit" = 3 }', 6, "`topics` renames topics; \"/world/nav/orbit\" is 3; "
     'write for example topics = { "/world/nav/orbit" = "/other/orbit" }'),
    ('prefix = "a"', 'prefix = "a"\ntopics = { "/world/nav/orbit" = "/world/nav/orbit" }', 7, "a topic has one writer; "
     "a_world and world both write /world/nav/orbit; give one of them another prefix, or this topic another name"),
    ('prefix = "a"', 'prefix = "a"\ntopics = { "/world/nav/orbit" = "/x", "/world/nav/attitude" = "/x" }', 7,
     "topics stay apart; two of them become /x; choose another name"),
    ('prefix = "a"', 'prefix = "a"\ntopics = { "/world/nav/orbit" = "/a/world/nav/attitude" }', 7,
     "topics stay apart; /world/nav/orbit and /world/nav/attitude of world both become /a/world/nav/attitude; choose "
     "another name"),
    ('process = "flight"\nprefix = "a"', 'process = "world"\nprefix = "a"', 11, "a topic has one writer; a_world and "
     "a_flight both write /a/world/wheels/speeds; give one of them another prefix, or this topic another name"),
])
def test_a_map_that_joins_topics_is_refused(folder, old, new, line, complaint):
    assert old in NADIR
    assert complaints(folder, NADIR.replace(old, new, 1)) == [(line, complaint)]


NODE = '[[node]]\nname = "mass"\ncommand = ["python3", "mass.py"]\n'


@pytest.mark.parametrize("text, line, complaint", [
    ("", 1, "a simulation has nodes; there is none; write [[node]] with a name and a command, or a mission"),
    ("until = 5\n" + NODE + 'on_lost = "hold"\n', 5, "only known keys count; there is `on_lost`; did you mean "
     "`on_loss`?"),
    ("unitl = 5\n" + NODE, 1, "only known keys count; there is `unitl`; did you mean `until`?"),
    (NODE + NODE, 5, "names differ; `mass` stands in line 2 too; rename one"),
    (NODE + '[[asynchronous]]\nname = "mass"\ncommand = ["sh"]', 5, "names differ; `mass` stands in line 2 too; "
     "rename one"),
    ('[[node]]\nname = "a/b"\ncommand = ["sh"]', 2, "a name is of letters, digits, `_`, `-` and `.`, and not "
     '`controller`, `all` or `exchange`; it is "a/b"; it also names the program\'s log'),
    ('[[node]]\ncommand = ["sh"]', 1, "`name` must be given; it is not there; give a text"),
    ("until = -1\n" + NODE, 1, "`until` is seconds, from 0 to 1e9; it is -1; write a number such as 60 or 0.5"),
    ("until = inf\n" + NODE, 1, "`until` is seconds, from 0 to 1e9; it is Infinity; write a number such as 60 "
     "or 0.5"),
    ("pace = -1\n" + NODE, 1, "`pace` is simulated seconds per second, from 0 to 1e9; it is -1; write a number "
     "such as 60 "
     "or 0.5"),
    (NODE + "reply = -0.1", 4, "`reply` is seconds, from 0 to 1e9; it is -0.1; write a number such as 60 or 0.5"),
    ("seed = 1.5\n" + NODE, 1, "`seed` is a whole number; it is 1.5; write a whole number"),
    ('[[node]]\nname = "a"', 1, "a program is a `mission` with its `process`, an `fmu`, a `command`, or started "
     "`by_hand`; of a there "
     'is neither; write one, for example command = ["python3", "model.py"]'),
    ('[[node]]\nname = "a"\ncommand = "python3 mass.py"', 3, "`command` is a list of texts, the program first; it is "
     '"python3 mass.py"; write for example ["python3", "model.py"]'),
    ('[[node]]\nname = "a"\ncommand = ["./sprong"]', 3, "the program can be found; there is no FOLDER/sprong; "
     "build it, "
     "or write the path relative to `directory`"),
    ('[[node]]\nname = "a"\ncommand = ["./mass.py"]', 3, "the program can be started; FOLDER/mass.py is not "
     "executable; "
     'chmod +x it, or write what runs it before: ["python3", "./mass.py"]'),
    ('[[node]]\nname = "a"\ncommand = ["pyhton3", "mass.py"]', 3, "the program can be found; pyhton3 is not on "
     "the PATH; did "
     "you mean python3?"),
    ('[[node]]\nname = "a"\ncommand = ["python3", "moss.py"]', 3, "the program can be found; there is no "
     "FOLDER/moss.py; it "
     "is relative to `directory`"),
    ('[[node]]\nname = "a"\ncommand = ["sh", "{adress}"]', 3, "only known words in braces are filled in; there is "
     "{adress}; did you mean {address}?"),
    (NODE + 'directory = "nowhere"', 4, "a program starts in a folder; there is no FOLDER/nowhere; it is "
     "relative to the "
     "file's"),
    (NODE + "env = { LEVEL = 2 }", 4, "`env` holds texts by the names of variables; LEVEL is 2; write for "
     "example env = "
     '{ LEVEL = "2" }'),
    (NODE + 'on_loss = "ignore"', 4, '`on_loss` must say which; it is "ignore"; choose "abort", "pause", '
     '"hold", "drop", '
     '"restart"'),
    (NODE + "restarts = 2", 4, '`restarts` is of on_loss = "restart"; mass has "abort"; leave it out, or write '
     'on_loss = '
     '"restart"'),
    (NODE + '[[asynchronous]]\nname = "viewer"\ncommand = ["sh"]\non_loss = "hold"', 7, "no node waits for an "
     'asynchronous program; viewer has "hold"; write on_loss = "restart", or leave it out: the run goes on without it'),
    (NODE + 'process = "world"', 4, "`process` is of a `mission`; mass has none; leave it out"),
    (NODE + "joins = 1.5", 4, "some node is there at the start; all join later; leave `joins` out of one"),
    ("until = 5\n" + NODE + NODE.replace("mass", "late", 1) + "joins = 5", 8, "a node joins before the end; "
     "late joins at "
     "5 s, the run ends at 5 s; choose an earlier time"),
    (NODE + 'joins = "soon"', 4, '`joins` is the simulated seconds after which it takes part, or "when it '
     'comes", from 0 to '
     '1e9; it is "soon"; write a number such as 60 or 0.5'),
    ('address = "ipc:///tmp/x"\n' + NODE, 1, "an address is an abstract name of this machine, or a TCP port; a "
     "file of that "
     'name would stay behind; write "ipc://@name", "tcp://127.0.0.1:7000", or "tcp://192.0.2.1:*" for any free port'),
    ('transport = "udp"\n' + NODE, 1, '`transport` must say which; it is "udp"; choose "ipc", "tcp"'),
    (NODE + 'launcher = "ip netns exec left"', 1, "in a network namespace nodes need an address that it "
     "reaches; there is "
     'no `address`; write address = "tcp://ADDRESS:*", that of this side'),
    ('address = "tcp://192.0.2.1:7000"\n' + NODE, 1, "the controller can listen there; tcp://192.0.2.1:7000: it "
     "is not an "
     "address of this machine; choose another port, or `*` for any that is free"),
    (NODE + 'host = "me@127.0.0.1"', 4, 'what leaves the machine is encrypted; there are no `keys`; make them '
     'with ./fledge '
     'keys new and write keys = "FOLDER"; or, in a network that you trust, unencrypted = true'),
    ('keys = "secret"\n' + NODE, 1, "`keys` is a folder made by ./fledge keys; there is no FOLDER/secret; make "
     "it, or give "
     "the right one"),
    ('[[node]]\nname = "world"\nmission = "nadir_spun"', 3, "the mission can be loaded; there is no mission "
     "'nadir_spun'"),
    ('[[node]]\nname = "world"\nmission = "nadir_spin"\nprocess = "flihgt"', 4, "the process is one of the "
     "mission's; "
     "nadir_spin has no `flihgt`; did you mean `flight`?"),
    (NODE + 'writes = ["/mass/state"]', 4, "only known keys count; there is `writes`; choose name, mission"),
    ('watch = "/mass/state"\n' + NODE, 1, '`watch` is a list of topics; it is "/mass/state"; write for example '
     '["/ground/command"]'),
    ('mission = "formatoin"', 1, "the mission can be loaded; there is no mission 'formatoin'"),
    ('mission = "formation"\nscenario = "seen"', 1, "the mission can be loaded; the mission formation has no scenario "
     "'seen'"),
    ('parameters = { deputies = 2 }\n' + NODE, 1, "`parameters` is of a `mission`; there is none; write mission = "
     '"NAME"'),
    ('mission = "formation"\n[[node]]\nprocess = "deputi"', 3, "the process is one of the mission's; formation has no "
     "`deputi`; did you mean `deputy`?"),
    ("until = 5\n" + NODE + "killed = 5", 5,
     "`killed` is a time at which a program that `fledge up` starts takes part; "
     "mass is to be killed at 5 s; choose a time after it joins and before the end"),
    ('[[node]]\nname = "a"\nby_hand = true\nkilled = 5', 4, "`killed` is a time at which a program that `fledge up` "
     "starts takes part; a is to be killed at 5 s, but is started by hand; choose"),
    (NODE + NODE.replace("mass", "late", 1) + "joins = 5\nkilled = 4", 8, "`killed` is a time at which a program that "
     "`fledge up` starts takes part; late is to be killed at 4 s; choose"),
    ('node = 3', 1, "`node` is an array of tables; it is 3; write [[node]]"),
])
def test_mistakes_are_reported_with_their_line(folder, text, line, complaint):
    found = complaints(folder, text)
    assert any(number == line and what.startswith(complaint) for number, what in found), found
    netns = "netns" in text or "address" in text    # other complaints may follow from it
    assert len(found) == 1 or netns


def test_all_mistakes_are_reported_at_once_in_the_order_of_lines(folder):
    found = complaints(folder, 'until = -1\nsede = 3\n[[node]]\nname = "a"\ncommand = ["nothing-of-that-name"]\n'
                               'on_loss = "x"\n[[node]]\nname = "a"\nby_hand = 1\n')
    assert [line for line, _ in found] == [1, 2, 5, 6, 8, 9]


def test_what_is_no_toml(folder):
    (found,) = complaints(folder, 'until = 5\n[[node]\nname = "a"\n')
    assert found[0] == 2 and found[1].startswith("the file must be TOML; ")
    (folder / "sim.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(SimError, match="sim.toml:1: the file must be TOML; it is no text in UTF-8"):
        read(folder / "sim.toml")


@pytest.mark.parametrize("text, complaint", [
    ("x = " + "[" * 20_000 + "]" * 20_000, ":1: the file must be TOML; its arrays or tables are nested too deeply"),
    (".".join(["a"] * 2_000) + " = 1", ":1: a key has at most 32 parts"),
    ("until = " + "9" * 5000, ":1: the file must be TOML; Exceeds the limit"),
    ('[[node]]\nname = "a"\ncommand = ["true", "a\\u0000b"]',
     ':3: no text holds the character U+0000; it is "a\\u0000b"'),
    ('[[node]]\nname = "a"\ncommand = ["true"]\ndirectory = "a\\u0000"', ":4: no text holds the character U+0000; "),
    ('[[node]]\nname = "a"\ncommand = ["true"]\nenv = { A = "\\u0000" }', ":4: no text holds the character U+0000; "),
    ('watch = ["/a\\u001b[2J"]', ':1: `watch` is a list of topics; it is ["/a\\u001b[2J"]'),
    ('simulation = "a\\u009b2J"', ":1: a simulation's name is of letters, digits"),
])
def test_a_text_that_no_program_takes_is_a_mistake_with_its_line(folder, text, complaint):
    with pytest.raises(SimError) as error:
        read(write(folder, text))
    assert complaint in str(error.value)


def test_an_address_in_use(folder):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        assert busy(address) == "another program listens there already"
        (found,) = complaints(folder, f'address = "{address}"\n' + NODE)
        assert found == (1, f"the controller can listen there; {address}: another program listens there already; "
                         "choose another "
                            "port, or `*` for any that is free")
    assert busy(address) == ""
    with socket.socket(socket.AF_UNIX) as taken:
        taken.bind(f"\0fledge-taken-{os.getpid()}")
        assert busy(f"ipc://@fledge-taken-{os.getpid()}") == "another program listens there already"
    assert busy(f"ipc://@fledge-taken-{os.getpid()}") == ""
    assert busy("tcp://127.0.0.1:70000") == "ports go up to 65535"
    assert busy("tcp://127.0.0.1:*") == busy("tcp://*:*") == busy("tcp://lo:7000") == ""


@pytest.mark.parametrize("host, local", [
    ("127.0.0.1", True), ("127.3.2.1", True), ("localhost", True), ("[::1]", True), ("[::ffff:127.0.0.1]", True),
    ("127.example.org", False), ("[::ffff:192.0.2.1]", False), ("[2001:db8::1]", False), ("*", False)])
def test_the_addresses_of_this_machine_alone_are_those_of_ipv4_and_ipv6(host, local):
    assert is_local(f"tcp://{host}:7000") == is_local(f"tcp://{host}:*") == local


def test_what_stays_on_this_machine_needs_no_keys(folder):
    for address in ("tcp://[::1]:*", "tcp://localhost:*", "tcp://127.0.0.1:*", "ipc://@name"):
        assert not read(write(folder, f'address = "{address}"\n' + NODE)).beyond


def test_a_host_needs_keys_or_trust(folder):
    text = NODE + 'host = "me@127.0.0.1"\n'
    plan = read(write(folder, "unencrypted = true\n" + text))
    assert plan.beyond and plan.listening() == "tcp://127.0.0.1:*"
    (folder / "keys").mkdir()
    assert complaints(folder, 'keys = "keys"\n' + text) == [
        (1, "the controller has keys of its own; there is no FOLDER/keys/controller.secret; ./fledge keys new "
            "controller --keys FOLDER/keys makes them"),
        (3, "a node is let in by its key; no key in FOLDER/keys/allowed is for mass; ./fledge keys allow KEY --as mass "
            "--keys FOLDER/keys lets it in")]
    keys.new(folder / "keys", ["controller", "lab"])
    keys.allow(folder / "keys", ["lab"], ["mass", "spring"])
    plan = read(write(folder, 'keys = "keys"\n' + text))
    assert plan.keys == str(folder / "keys")


def test_a_launcher_may_be_a_text_or_a_list(folder):
    plan = read(write(folder, NODE + 'launcher = "nice -n 5"\n'))
    assert plan.programs[0].launcher == ["nice", "-n", "5"] and not plan.beyond
    assert read(write(folder, NODE + 'launcher = ["nice"]\n')).programs[0].launcher == ["nice"]
    found = complaints(folder, NODE + 'launcher = "no-such-launcher"\n')
    assert found == [(3 + 1, "the launcher can be found; there is no no-such-launcher; install it, or write its "
                      "path")]


def test_the_interpreter_may_be_given_whole(folder):
    assert read(write(folder, NODE.replace("python3", sys.executable))).programs[0].command[0] == sys.executable


def test_the_server_of_a_control_room_commands_the_processes_of_its_file(tmp_path):
    (tmp_path / "room.toml").write_text('[[craft]]\nmission = "nadir_spin"\nlink = "cosim:flight"\n'
                                        '[[craft]]\nmission = "nadir_spin"\nname = "other"\nlink = "listen://1"\n')
    text = ('until = 1\n[[node]]\nmission = "nadir_spin"\nprocess = "world"\n[[node]]\nmission = "nadir_spin"\n'
            'process = "flight"\n[[asynchronous]]\nname = "ground"\nserve = "{}"\n')
    (tmp_path / "sim.toml").write_text(text.format("room.toml"))
    plan = read(tmp_path / "sim.toml")
    ground = plan.programs[-1]
    assert ground.writes == ["/flight/commands"] and ground.steers and plan.watch == ["/flight/telemetry"]
    for file, why in (("none.toml", "`serve` is the file of a control room"), ("sim.toml", "has a link cosim:PROCESS")):
        (tmp_path / "sim.toml").write_text(text.format(file))
        with pytest.raises(SimError, match=why):
            read(tmp_path / "sim.toml")


def test_two_asynchronous_programs_do_not_write_one_topic(folder):
    text = NODE + "".join(f'[[asynchronous]]\nname = "{name}"\ncommand = ["sh"]\n' for name in ("ground", "room"))
    two = 'writes = ["{}"]\n'
    assert complaints(folder, text + two.format("/ground/command")) == [
        (10, "a topic has one writer; ground and room both write /ground/command; let room write another topic, or "
         "give ground the topics that it writes")]
    text = text.replace('[[asynchronous]]\nname = "room"', two.format("/up") + '[[asynchronous]]\nname = "room"')
    assert complaints(folder, text + two.format("/up")) == [
        (11, "a topic has one writer; ground and room both write /up; let one of them write `writes = []`, or another "
         "topic")]
    read(write(folder, text + two.format("/ground/command")))


def test_boards_of_a_target_are_files_or_folders_of_them(folder):
    text = ('until = 1\n[[node]]\nmission = "nadir_spin"\nprocess = "world"\n[[node]]\nmission = "nadir_spin"\n'
            'process = "flight"\ntarget = "linux"\nboard = ["boards", "own.toml"]\n')
    (folder / "boards").mkdir()
    where = "is relative to the file's folder"
    rule = "the files of boards are there, or folders with files *.toml; there is no FOLDER/"
    with pytest.raises(SimError) as error:
        read(write(folder, text), TARGETS)
    assert str(error.value).replace(str(folder), "FOLDER").splitlines() == [
        f"FOLDER/sim.toml:9: {rule}{name}; it {where}" for name in ("boards", "own.toml")]
    for name in ("boards/a.toml", "own.toml"):
        (folder / name).write_text("")
    assert read(write(folder, text), TARGETS).nodes[1].board == [str(folder / "boards"), str(folder / "own.toml")]
