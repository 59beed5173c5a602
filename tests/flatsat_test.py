# SPDX-License-Identifier: Apache-2.0
"""A mission on the four boards of a flat-sat (registers/boards), through all of their snorkels: words, packets, packets
with descriptors, queues, messages, both directions, commands and telemetry."""

import shutil
import subprocess

import pytest

from fledge.archive import Archive
from fledge.targets import TARGETS
from registers.description import read
from tests.tree import ROOT

BOARDS = sorted((ROOT / "registers/boards").glob("*.toml"))


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    place = tmp_path_factory.mktemp("flatsat") / "flatsat"
    shutil.copytree(ROOT / "tests/flatsat", place)
    return place


def fly(project, out, on, boards, code=0):
    done = subprocess.run([ROOT / "fledge", "--project", project, "fly", "flatsat", "--on", on, "--out", out, "--board",
                           *boards], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == code, done.stdout
    return done.stdout


def test_every_snorkel_carries_something():
    assert len(BOARDS) == 4
    lanes = {f"{board.name}.{lane.name}": lane for board in map(read, BOARDS) for lane in board.lanes}
    assert len(lanes) == 16
    assert not [name for name, lane in lanes.items() if not lane.carries and not any(f.carries for f in lane.fields)]


def test_the_mission_flies_through_all_of_them(project, tmp_path):
    on = "linux,sparc64" if not TARGETS["sparc64"].missing() else "linux"
    said = fly(project, tmp_path, on, BOARDS)
    assert f"  passed   desktop, {on.replace(',', ', ')}\n" in said
    assert "beyond the range" not in said and "lost" not in said
    exchange = Archive(tmp_path / "linux.exchange.mcap")
    counts = {topic: channel.count for topic, channel in exchange.topics.items()}
    assert len(counts) == 13 and min(counts.values()) == 1801, counts
    for name in on.split(","):
        log = (tmp_path / f"{name}.log").read_text().splitlines()
        figures = dict(line.split()[1:] for line in log if line.startswith("flight: ") and len(line.split()) == 3)
        assert {figures[key] for key in ("refused", "corrupt", "outside_refused", "outside_corrupt", "lost", "skipped",
                                         "outside_skipped")} == {"0"}
        assert (tmp_path / f"{name}.telemetry.txt").read_text()     # of the command between the scenario's runs


def test_a_board_that_is_too_coarse_fails_the_scenario(project, tmp_path):
    coarse = tmp_path / "io_board_a.toml"
    text = BOARDS[0].read_text()
    assert BOARDS[0].name == coarse.name and text.count("scale = 0.001\n") == 1
    coarse.write_text(text.replace("scale = 0.001\n", "scale = 0.02\n"))
    said = fly(project, tmp_path / "out", "linux", [coarse, *BOARDS[1:]], code=1)
    assert "fledge: flatsat, all_units on linux: failed: " in said and "a burn had another length" in said
