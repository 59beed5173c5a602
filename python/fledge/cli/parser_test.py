# SPDX-License-Identifier: Apache-2.0
"""What the command line answers to words that no command knows."""
import argparse

import pytest

from fledge import cli
from fledge.cli import capabilities


@pytest.mark.parametrize("words, message, usage", [
    (["montecarlo", "nadir_spin", "--campagn", "release"],
     "fledge montecarlo: unrecognized arguments: --campagn release; did you mean '--campaign'?", "fledge montecarlo"),
    (["falsify", "sun_safe", "SUN-1", "faults"], "fledge falsify: unrecognized arguments: faults", "fledge falsify"),
    (["run", "nadir_spin", "--Seed=3"],
     "fledge run: unrecognized arguments: --Seed=3; did you mean '--seed'?", "fledge run"),
    (["ground", "serve", "room.toml", "--port", "1"], "fledge ground serve: unrecognized arguments: --port",
     "fledge ground serve"),
    (["keys", "new", "k", "--xyzzy"], "fledge keys new: unrecognized arguments: --xyzzy", "fledge keys new"),
])
def test_an_unknown_argument_is_refused_by_its_own_command(capsys, words, message, usage):
    with pytest.raises(SystemExit) as end:
        cli.parsed(words)
    first, second = capsys.readouterr().err.splitlines()[:2]
    assert end.value.code == 2 and first.startswith(message) and second.startswith(f"usage: {usage} [")


def test_the_same_thing_has_one_name_in_all_commands():
    """A campaign is --campaign, how many fly at a time is --jobs; neither is a position."""
    commands, = (action for action in cli.parser()._actions if isinstance(action, argparse._SubParsersAction))
    for name, parser in commands.choices.items():
        places = [action.dest for action in parser._actions if not action.option_strings]
        assert "campaign" not in places and not {"--threads", "--workers"} & set(parser._option_string_actions), name
    for name in ("montecarlo", "sweep", "falsify", "versions"):
        assert {"--campaign", "--jobs"} <= set(commands.choices[name]._option_string_actions)
    for name in ("faults", "verify", "flips", "profile"):
        assert "--jobs" in commands.choices[name]._option_string_actions


def test_each_capability_adds_its_commands_and_readers():
    assert {"packets", "up", "montecarlo"} <= {module.__name__.rpartition(".")[2] for module in capabilities.modules()}
    assert capabilities.readers().keys() == {"", "asynchronous", "craft", "dispersions.py", "faults.py", "node"}
