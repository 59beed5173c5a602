# SPDX-License-Identifier: Apache-2.0
"""Which process is of which program, the files that are flown, and a hash that sees each packet."""
import pytest

from bench import orbiter
from fledge.cosim.up import description
from fledge.targets import TARGETS
from tests.needs import flies_on


def test_a_process_belongs_to_a_program():
    python = ["/usr/bin/python3", "-P", "-m", "fledge.cli"]
    for command, name in (
            (["/b/fledge_guard", "--", "/b/fledge_controller", "--until", "1"], ""),
            (["/b/fledge_controller", "--until", "1"], "controller"),
            (["/b/fledge_board_node", "--", "/b/fledge_leon3", "up"], "board"),
            (["/b/fledge_leon3", "x.toml"], "emulator"),
            ([*python, "node", "mars_orbiter", "world", "--name", "world"], "world"),
            ([*python, "node", "mars_orbiter", "panel", "--name", "panel"], "panel"),
            ([*python, "fly", "mars_orbiter", "--on", "flight=leon3"], "board"),
            ([*python, "ground", "serve", "control_room.toml"], "ground"), ([*python, "up", "up.toml"], "up"),
            (["git", "describe"], "")):
        assert orbiter.part(command) == name, command


@pytest.mark.long("flies the orbiter's programs")
@flies_on("leon3")
def test_the_files_fly_as_fast_as_they_can(tmp_path):
    plan = description.read(orbiter.files(tmp_path, 8080), TARGETS, None)
    assert not plan.pace and [program.name for program in plan.programs] == ["panel", "world", "flight", "ground"]
    assert next(program for program in plan.programs if program.serve).serve == str(tmp_path / "control_room.toml")


def test_a_hash_sees_each_packet_and_where_it_ends():
    digest = orbiter.digest([b"ab", b"c"])
    assert digest == orbiter.digest([b"ab", b"c"])
    assert len({digest, orbiter.digest([b"a", b"bc"]), orbiter.digest([b"c", b"ab"]), orbiter.digest([b"ab"])}) == 4
