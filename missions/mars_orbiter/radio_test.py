# SPDX-License-Identifier: Apache-2.0
"""The orbiter by radio: one script, in one simulation and in a co-simulation whose world is on another machine."""
import json
import os
import sys
from pathlib import Path

import pytest

from fledge import cli, world
from fledge.archive import Archive
from tests.needs import flies_on, skip_unless_on

HERE = Path(__file__).resolve().parent
GROUND = """
[[node]]
name = "ground"
command = ["{python}", "-m", "fledge.cli", "ground", "run", "{script}", "--yes", "--out", "there", "--to",
           "cosim:flight?radio=world.radio&every=0.5", "--mission", "mars_orbiter"]
"""


def entries(folder):
    return [json.loads(line) for line in (folder / "script.jsonl").read_text().splitlines()][1:]


@flies_on("leon3")
def test_the_file_of_all_programs_is_right():
    assert cli.main(["up", "--check", str(HERE / "up.toml")]) == 0


@pytest.mark.long("flies a contact in real programs: 150 s")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it")
@pytest.mark.parametrize("target", ["linux"])
def test_contact_from_goldstone(target, tmp_path, monkeypatch, capfd):
    """up.toml with a script in place of the console, and the world on another machine, by a shell in place of ssh."""
    skip_unless_on(target)
    monkeypatch.chdir(tmp_path)
    text = (HERE / "up.toml").read_text().partition("[[asynchronous]]")[0].replace("leon3", target)
    text = text.replace("pace  = 50", 'unencrypted = true\njoin = 300').replace("86400", "9000")
    there = f'host = "me@127.0.0.1"\nlauncher = ["sh", "-c"]\nfledge = "{HERE.parents[1]}"\n'
    text = text.replace('process = "world"\n', 'process = "world"\n' + there)
    script = HERE / "contact.py"
    (tmp_path / "up.toml").write_text(text + GROUND.format(python=sys.executable, script=script))
    assert cli.main(["up", "up.toml"]) == 0, capfd.readouterr()
    assert cli.main(["ground", "run", str(script), "--to", "mars_orbiter", "--radio", "world.radio", "--yes", "--out",
                     "here"]) == 0
    found = entries(tmp_path / "here")
    assert entries(tmp_path / "there") == found

    # Before the pass all is lost; then a report comes back after twice the light time, and a file each way is whole.
    record = Archive(tmp_path / "runs/up/exchange.mcap")
    t, state = record.time("/world/radio/up"), record["radio.up.state"]
    locked = state == world.RadioState.LOCKED
    rises = t[locked].min()
    light = record["radio.up.light_time"][t > rises].mean()
    assert 1300 < rises - light < 1400 and locked[t > rises].all()     # when the station sends what arrives then
    assert record["radio.up_traffic.lost"].max() == 1
    there_and_back = next(row["values"]["there and back [s]"] for row in found if row["kind"] == "value")
    assert 636 < light < 640 and 2 * light < there_and_back < 2 * light + 3
    assert (tmp_path / "back_plan.txt").read_bytes() == (tmp_path / "plan.txt").read_bytes()
