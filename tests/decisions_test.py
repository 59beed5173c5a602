# SPDX-License-Identifier: Apache-2.0
"""`fledge verify --coverage mcdc` and `fledge test --coverage`, with the build that counts."""
import json
import os
import re
import subprocess

import pytest

from tests.needs import needs, section
from tests.tree import ROOT

pytestmark = needs(*section("decisions"))


def fledge(*arguments, cwd, code=0):
    done = subprocess.run([ROOT / "fledge", *map(str, arguments)], cwd=cwd, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, env={**os.environ, "FLEDGE_PROJECT": ""})
    assert done.returncode == code, done.stdout
    return done.stdout


def test_a_mission_names_the_conditions_that_its_scenarios_leave_and_keeps_its_bits(tmp_path):
    printed = fledge("verify", "nadir_spin", "--coverage", "mcdc", "--out", tmp_path / "counted", cwd=tmp_path)
    fledge("verify", "nadir_spin", "--out", tmp_path / "plain", cwd=tmp_path)
    results = json.loads((tmp_path / "counted/results.json").read_text())
    torques = results["decisions"]["flight/actuation/wheel_torques.c"]
    assert 0 < torques["decided"] < torques["conditions"] and "flight/navigation/quest.c" not in results["decisions"]
    assert "  decisions: " in printed and "flight/actuation/wheel_torques.c: " in printed
    page = (tmp_path / "counted/report.html").read_text()
    assert "Decisions of flight code" in page and torques["undecided"][0]["missing"] in page
    records = sorted((tmp_path / "counted/flights").rglob("*.mcap"))
    for record in records:
        other = tmp_path / "plain" / record.relative_to(tmp_path / "counted")
        assert "identical" in fledge("compare", record, other, cwd=tmp_path)
    assert records and not list(tmp_path.glob("*.profraw"))
    # What has been flown is not flown again, and counts all the same.
    again = fledge("verify", "nadir_spin", "--coverage", "mcdc", "--out", tmp_path / "counted", cwd=tmp_path)
    assert "before" in again and "flown  " not in again
    assert json.loads((tmp_path / "counted/results.json").read_text())["decisions"] == results["decisions"]


def test_a_project_has_a_condition_named_until_a_test_shows_it_or_a_reason_stands_there(tmp_path):
    folder = tmp_path / "own"
    fledge("new", "project", folder, cwd=tmp_path)
    fledge("--project", folder, "new", "module", "Calm", "--kind", "control", cwd=folder)
    source, test = folder / "flight/calm.c", folder / "flight/calm_test.cpp"
    cases = "|".join(re.findall(r"^TEST\(Calm, (\w+)\)", test.read_text(), re.M))
    test.write_text(test.read_text() + """
TEST(Calm, HasNoOutputWithoutInput)
{
    Calm module{};
    calm_reset(&module);
    calm_update(&module, Tick{});
}
""")
    assert "flight/calm.c: 5 of 6 conditions have decided, 1 left\n    line 24: quality != QUALITY_NONE: never false" \
        in fledge("--project", folder, "test", "--coverage", "-k", cases, cwd=folder)
    assert "| `flight` | 6 | 5 | 0 | 1 |" in \
        fledge("--project", folder, "test", "--coverage", "--table", "--strict", "-k", cases, cwd=folder, code=1)

    text = source.read_text()
    source.write_text(text.replace("    int computed =", "    /* undecided: for this test */\n    int computed ="))
    printed = fledge("--project", folder, "test", "--coverage", "--strict", "-k", cases, cwd=folder)
    assert "decisions: 5 of 6 conditions have decided, 1 cannot, with reason\n" in printed and " left" not in printed
    assert json.loads((folder / "build/decisions.json").read_text())["flight/calm.c"]["undecided"] == [
        {"line": 25, "column": 20, "text": "quality != QUALITY_NONE", "missing": "never false",
         "reason": "for this test"}]

    source.write_text(text)
    printed = fledge("--project", folder, "test", "--coverage", cwd=folder)
    assert "decisions: 6 of 6 conditions have decided\n" in printed and "4 passed, 0 failed" in printed

    # In flight, its library counts beside the extension; the requirements are those of other gains.
    fledge("--project", folder, "new", "mission", "calm_spin", "--from", "nadir_spin", cwd=folder)
    mission = folder / "missions/calm_spin"
    for name, old, instead in [("flight.py", "fsw.MrpFeedback(", "fsw.Calm("),
                               ("flight.py", "f.vehicle.vehicle    >> f.control.vehicle,\n", ""),
                               ("flight.py", "[f.control.wheels, ", "["),
                               ("world.py", "w.wheels.speeds >> f.control.speeds,\n", "")]:
        (mission / name).write_text((mission / name).read_text().replace(old, instead))
    fledge("--project", folder, "verify", "calm_spin", "--coverage", "mcdc", cwd=folder, code=1)
    decided = json.loads((folder / "verification/calm_spin/results.json").read_text())["decisions"]
    assert decided["flight/calm.c"]["conditions"] == 6 and "flight/actuation/wheel_torques.c" in decided


@pytest.mark.parametrize("words, answer", [
    (["verify", "nadir_spin", "--coverage", "mcdc", "--on", "leon3"],
     "--coverage mcdc counts in flights on the desktop of this machine; add it: --on desktop,leon3"),
    (["--preset", "asan", "test", "--fledge", "--coverage"], "leave out --preset asan"),
    (["test", "--fledge", "--strict"], "--strict and --table are about what --coverage counts; add it"),
    (["verify", "nadir_spin", "--coverage", "lines"], "choose from object, mcdc")])
def test_what_cannot_be_counted_is_refused_in_one_line(words, answer, tmp_path):
    assert answer in fledge(*words, cwd=tmp_path, code=2)
