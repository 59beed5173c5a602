# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest

import fledge
from fledge import export
from fledge.ground.server.displays import displays
from fledge.export import packets
from fledge.disk import ROOT

NAMES = ["craft.attitude.sigma[0]", "craft.attitude.sigma[1]", "craft.attitude.sigmas", "craft.battery", "<b>odd</b>"]
SLOTS = [{"slot": 10 + i, "name": name} for i, name in enumerate(NAMES)]
FORMS = [{"name": "craft.write.K", "arguments": [{"name": "K"}]}, {"name": "craft.noop", "arguments": []}]


def read(folder: Path, text: str):
    (folder / "one.toml").write_text(text)
    display, = displays([folder], SLOTS, FORMS)
    return display


def test_a_field_is_a_row_for_each_element(tmp_path):
    display = read(tmp_path, 'title = "A"\n[[panel]]\nvalues = ["craft.attitude.sigma", "<b>odd</b>"]\n'
                   '[[panel]]\nplot = [{ name = "craft.attitude.sigma", label = "error", digits = 3 }]\n'
                   "wide = true\n")
    values, plot = display["panels"]
    assert display["title"] == "A" and not display["problems"]
    assert [(i["slot"], i["label"]) for i in values["items"]] == [(10, NAMES[0]), (11, NAMES[1]), (14, "<b>odd</b>")]
    assert [(i["slot"], i["label"], i["digits"]) for i in plot["items"]] == [(10, "error[0]", 3), (11, "error[1]", 3)]
    assert plot["wide"] and plot["minutes"] == 10 and plot["kind"] == "plot"


def test_unknown_names_say_why_and_the_rest_works(tmp_path):
    display = read(tmp_path, '[[panel]]\nvalues = [\n  "craft.battery",\n  "craft.batery",\n]\n'
                   '[[panel]]\ncommands = ["craft.noop", "craft.nop",\n'
                   '    { command = "craft.write.K", arguments = { K = 3, L = 4 } }]\n')
    known, unknown = display["panels"][0]["items"]
    assert known["slot"] == 13
    assert unknown["problem"].endswith(
        "one.toml:4: there is no parameter 'craft.batery'; did you mean 'craft.battery'?")
    good, wrong, argument = display["panels"][1]["items"]
    assert "problem" not in good
    assert wrong["problem"].endswith("one.toml:7: there is no command 'craft.nop'; did you mean 'craft.noop'?")
    assert argument["problem"].endswith("one.toml:8: craft.write.K has no argument 'L'")


@pytest.mark.parametrize("text, problem", [
    ("title = ", "one.toml:1: the file must be TOML"),
    ("title = 3\n", "one.toml:1: `title` is a text; it is 3"),
    ("[[panel]]\ntitle = 'none'\n", "one.toml:1: a panel has one of values, large, plot, commands; it has none"),
    ("[[panel]]\nplot = ['craft.battery']\nvalues = []\n", "it has values, plot"),
    ("[[panel]]\nvalues = 'craft.battery'\n", "one.toml:2: `values` is an array"),
    ("[[panel]]\nvalues = [3]\n", "one.toml:2: `values` has names and tables; there is 3"),
    ("[[panel]]\nplot = []\nminutes = -1\n", "one.toml:3: `minutes` is > 0"),
    ("[[panel]]\nvalues = []\ntitel = 'x'\n",
     "one.toml:3: only known keys count; there is `titel`; did you mean `title`?"),
    ("[[panel]]\nvalues = [{ name = 'craft.battery', digits = 99 }]\n", "`digits` is from 0 to 17; it is 99"),
    ("panel = 3\n", "one.toml:1: `panel` is an array of tables"),
    ("[[panel]]\ncommands = [{ command = 'craft.noop', arguments = 3 }]\n", "`arguments` is a table")])
def test_mistakes_of_a_file_have_its_line(tmp_path, text, problem):
    assert problem in "\n".join(read(tmp_path, text)["problems"])


def test_a_file_that_is_no_text_leaves_the_others(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe")
    (tmp_path / "b.toml").write_text("[[panel]]\nvalues = ['craft.battery']\n")
    bad, good = displays([tmp_path, tmp_path / "none"], SLOTS, FORMS)
    assert "no text in UTF-8" in bad["problems"][0] and good["panels"][0]["items"][0]["slot"] == 13


def test_the_first_folder_that_has_a_name_counts(tmp_path):
    for folder in ("own", "mission"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "one.toml").write_text(f"title = '{folder}'\n")
    assert [display["title"] for display in displays([tmp_path / "own", tmp_path / "mission"], [], [])] == ["own"]


def test_the_displays_of_missions_name_what_they_have():
    folders = list(ROOT.glob("missions/*/displays"))
    assert folders
    for folder in folders:
        bases = [packets.database(flight) for flight in export.read_all(fledge.load(folder.parent.name))]
        slots = [{"slot": 0, "name": f"{packet.path}.{item.name}"}
                 for base in bases for packet in base.packets for item in packet.items]
        forms = [{"name": command.path, "arguments": [{"name": item.name} for item in command.items]}
                 for base in bases for command in base.commands if not command.abstract]
        for display in displays([folder], slots, forms):
            items = [item for panel in display["panels"] for item in panel["items"]]
            assert items and display["problems"] == [] and not [item for item in items if "problem" in item]
