# SPDX-License-Identifier: Apache-2.0
"""`fledge up` from outside: real programs around the real controller."""
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from fledge.up.testing import BUILT, Mark, up, write_pair

pytestmark = pytest.mark.skipif(not (BUILT / "fledge_guard").exists() or not (BUILT / "fledge_controller").exists(),
                                reason="the controller is not built")


@pytest.fixture
def mark():
    """All that a test starts has ended when it has."""
    one = Mark()
    yield one
    left = one.gone()
    one.kill()
    assert not left


def logs(folder, name="pair"):
    return {path.stem: path.read_text() for path in (folder / "runs" / name / "log").iterdir()}


def test_two_programs_fly_to_the_end(mark, tmp_path):
    done = up(write_pair(tmp_path), mark=mark)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.startswith("pair: 2 nodes, 2 s\n")
    assert re.search(r"\nmass +finished +2\.00 s .*\nspring +finished +2\.00 s ", done.stdout)
    assert re.search(r"\n  flown    2 s in [\d.]+ s, [\d.]+ times real time\n", done.stdout)
    assert done.stdout.endswith("  logs     runs/pair/log\n")
    said = logs(tmp_path)
    assert said["mass"].splitlines()[0] == "the mass is at 1.0" and len(said["mass"].splitlines()) == 3
    assert sorted(said) == ["all", "controller", "mass", "spring"]
    assert re.search(r"^ +\d+\.\d{3} spring     \| the spring is there$", said["all"], re.M)


def test_over_tcp_and_with_a_record_of_the_exchange(mark, tmp_path):
    done = up(write_pair(tmp_path, until=0.5), "--tcp", "--exchange", "--out", "here", mark=mark)
    assert done.returncode == 0, done.stderr
    assert "listening at tcp://127.0.0.1:" in (tmp_path / "here/log/controller.log").read_text()
    assert re.search(r"  record   here/exchange.mcap \([\d.]+ kB\)", done.stdout)


def test_options_win_over_the_file(mark, tmp_path):
    done = up(write_pair(tmp_path, until=100), "--until", "500ms", mark=mark)
    assert done.returncode == 0 and done.stdout.startswith("pair: 2 nodes, 0.5 s\n")


def test_who_is_slow_is_seen(mark, tmp_path):
    done = up(write_pair(tmp_path, until=0.5, mass='env = { NAP = "0.004" }'), mark=mark)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\nmass .* slowest\n", done.stdout)
    row = re.search(r"\nspring +finished .* ([\d.]+) s +([\d.]+) s +([\d.]+) s", done.stdout)
    assert float(row[3]) > 0.18     # it waited for 51 naps


def test_mistakes_are_told_before_anything_starts(mark, tmp_path):
    file = write_pair(tmp_path, spring='on_los = "hold"')
    done = up(file, mark=mark)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == (f"fledge: up: the simulation cannot be started\n{file}:11: only known keys count; there is "
                           "`on_los`; did you mean `on_loss`?\n")
    assert not (tmp_path / "runs").exists()
    done = up(tmp_path / "nothing.toml", mark=mark)
    assert done.returncode == 2 and done.stderr == f"fledge: up: there is no file {tmp_path / 'nothing.toml'}\n"
    file = write_pair(tmp_path)
    assert up(file, "--check", mark=mark).stdout == f"{file}: nothing is wrong with it: 2 nodes, 2 s\n"
    assert not (tmp_path / "runs").exists()
    file.write_text(file.read_text().replace("until", "#"))
    done = up(file, mark=mark)
    assert done.returncode == 2 and "how long? write until = SECONDS, or give --until" in done.stderr


def test_a_program_that_fails_is_shown_with_its_last_lines(mark, tmp_path):
    done = up(write_pair(tmp_path, spring='env = { BREAKS_AT = "1" }'), mark=mark)
    assert done.returncode == 1
    assert "spring ended with exit code 1; the end of its log:\n" in done.stdout
    assert "  | ValueError: the spring breaks\n" in done.stdout
    assert "\nmass " not in done.stdout.partition("logs  ")[2], "mass did nothing wrong"
    assert done.stderr == ("fledge: pair ended early: spring: it failed: ValueError: the spring breaks "
                           "(it had reached 0.99 s)\n")


def test_one_that_fails_at_once_ends_the_run_at_once(mark, tmp_path):
    file = write_pair(tmp_path)
    (tmp_path / "spring.py").write_text("import nothing_of_that_name")
    begun = time.monotonic()
    done = up(file, mark=mark)
    assert done.returncode == 1 and time.monotonic() - begun < 30
    assert done.stderr == "fledge: pair ended early: spring ended with exit code 1 before it took part\n"
    assert "  | ModuleNotFoundError: No module named 'nothing_of_that_name'\n" in done.stdout


def test_one_that_fails_after_the_end_is_not_overlooked(mark, tmp_path):
    file = write_pair(tmp_path, until=0.2)
    with open(tmp_path / "spring.py", "a") as program:
        program.write("sys.exit('the orbit is wrong')\n")
    done = up(file, mark=mark)
    assert done.returncode == 1
    assert done.stderr == "fledge: pair came to its end, but spring failed\n"
    assert "spring ended with exit code 1; the end of its log:\n" in done.stdout
    assert "  | the orbit is wrong\n" in done.stdout


def test_asynchronous_programs_end_with_the_run(mark, tmp_path):
    file = write_pair(tmp_path, until=0.5)
    with open(file, "a") as text:
        text.write('\n[[asynchronous]]\nname = "viewer"\ncommand = ["sh", "-c", "echo sees $FLEDGE_NODE; sleep 600"]\n')
    done = up(file, mark=mark)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("pair: 2 nodes and 1 asynchronous program, 0.5 s\n")
    assert logs(tmp_path)["viewer"] == "sees viewer\n"


def test_one_line_per_host(mark, tmp_path):
    """A shell takes the place of ssh: it reads the same text from the same place."""
    there = tmp_path / "there"
    there.mkdir()
    host = f'host = "me@127.0.0.1"\nlauncher = ["sh", "-c"]\ndirectory = "{there}"\nfledge = "{{fledge}}"'
    root = BUILT.parents[2]
    preset = BUILT.parent.name
    file = write_pair(tmp_path, until=0.5, top="unencrypted = true", spring=host.format(fledge=root))
    (there / "spring.py").write_text((tmp_path / "spring.py").read_text())
    (tmp_path / "spring.py").unlink()
    done = up(file, mark=mark, env={"FLEDGE_PRESET": preset})
    assert done.returncode == 0, done.stderr + done.stdout
    assert "listening at tcp://127.0.0.1:" in logs(tmp_path)["controller"]


def test_a_folder_is_one_runs_at_a_time(mark, tmp_path):
    file = write_pair(tmp_path, until=1e6)
    first = subprocess.Popen([sys.executable, "-m", "fledge.cli", "up", str(file)], cwd=tmp_path, env=mark.env,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "runs/pair/log/controller.log").exists():
        time.sleep(0.02)
    second = up(file, mark=mark)
    assert second.returncode == 2
    assert second.stderr == ("fledge: up: runs/pair is in use by another run; end that, or give another folder by "
                             "--out\n")
    first.send_signal(signal.SIGTERM)
    _, errors = first.communicate(timeout=30)
    assert (first.returncode, errors) == (143, "fledge: pair ended early: the user ended it\n")


def test_help_names_what_there_is():
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "up", "--help"], capture_output=True, text=True,
                          env=os.environ)
    assert done.returncode == 0 and "example: ./fledge up spring.toml" in done.stdout
