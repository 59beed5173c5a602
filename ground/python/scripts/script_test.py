# SPDX-License-Identifier: Apache-2.0
"""Scripts with steps: what a run leaves, on the desktop and on targets, and how it ends."""
import json
import os
import re
import signal
import socket
import subprocess
import sys
import textwrap
from threading import Thread

import pytest

from fledge import cli
from fledge.export.run_test import FLIGHT, WORLD
from fledge.report.report_test import Page
from tests.needs import skip_unless_on

SCRIPT = '''
from fledge.units import s


def run(craft, script):
    """Point, with <b>other</b> gains.

    The second paragraph.
    """
    with script.step("begin"):
        craft.listen(1 * s)
        craft.command("telemetry").completed(within=5 * s)
    with script.step("point & wait"):
        script.confirm("go <now>?")
        craft.command("mode", "point").completed(within=5 * s)
        seen = craft.wait(lambda t: t.mode == "point",
                          within=5 * s)
        script.value("sigma", seen.flight.tracking.error.sigma_BR)
        with script.step("gains"):
            craft.command("write", "flight.control", K=3.0, u_I_max=0.2).completed()
            script.check(lambda t: t.flight.control.torque.head.t > 0, "torque is computed", gain=3)
    script.hold(2 * s)
    try:
        craft.command("write", "flight.control", K=-1.0).completed()
    except Exception:
        script.note("value", values={"refused": "as it should"})
'''
NODE = """
simulation = "script"
until = 40
join = 300

[[node]]
mission = "./plays"
process = "world"
free = true

[[node]]
mission = "./plays"
process = "flight"
free = true
target = "{target}"

[[node]]
name = "ground"
command = ["{python}", "-m", "fledge.cli", "ground", "run", "script.py", "--yes", "--out", "there",
           "--to", "cosim:flight?every=0.1", "--mission", "./plays"]
"""


@pytest.fixture()
def place(tmp_path, monkeypatch):
    (tmp_path / "plays").mkdir()
    (tmp_path / "plays/flight.py").write_text(FLIGHT)
    (tmp_path / "plays/world.py").write_text(WORLD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def entries(folder):
    return [json.loads(line) for line in (folder / "script.jsonl").read_text().splitlines()]


def run(place, body, *options, code, says=""):
    """Run a script of this body on the desktop; (its entries, its page)."""
    (place / "script.py").write_text("from fledge.units import s\n\n\ndef run(craft, script):\n"
                                     + textwrap.indent(textwrap.dedent(body), "    "))
    assert cli.main(["ground", "run", "script.py", "--to", "./plays", "--out", "out", *options]) == code
    return entries(place / "out"), Page((place / "out/script.html").read_text(encoding="utf-8"))


def test_a_run_leaves_each_thing_that_happened(place, capsys):
    (place / "script.py").write_text(SCRIPT)
    assert cli.main(["ground", "run", "script.py", "--to", "./plays", "--out", "out", "--yes"]) == 0
    assert "passed" in capsys.readouterr().out
    log = entries(place / "out")
    assert [entry["kind"] for entry in log if entry["kind"] != "stage"] == [
        "run", "step", "command", "wait", "step ends", "step", "confirm", "command", "wait", "wait", "value", "step",
        "command", "wait", "check", "step ends", "step ends", "hold", "command", "wait", "value", "end"]
    stages = {number: [(entry["stage"], entry["good"]) for entry in log
                       if entry["kind"] == "stage" and entry["id"] == number] for number in range(1, 5)}
    assert stages == {**{i: [("accepted", True), ("executed", True)] for i in (1, 2)},
                      3: [("accepted", True)] * 2 + [("executed", True)] * 2,     # two packets
                      4: [("accepted", True), ("refused", False)]}
    wait = [entry for entry in log if entry["kind"] == "wait"][2]
    assert wait["source"] == 'seen = craft.wait(lambda t: t.mode == "point",\n                          within=5 * s)'
    assert wait["line"] == 16 and wait["values"]["housekeeping"]["mode"] == 1
    assert [entry["step"] for entry in log if entry["kind"] == "check"] == [["point & wait", "gains"]]
    assert log[-1]["outcome"] == "passed" and log[-1]["t_ns"] == max(entry.get("t_ns", 0) for entry in log)
    page = Page((place / "out/script.html").read_text(encoding="utf-8"))
    assert not {"script", "link", "iframe", "object"} & set(page.tags) and not re.search(r"https?:|url\(", page.source)
    for part in ("Point, with <b>other</b> gains.", "The second paragraph.", "passed", "go <now>?", "yes, by --yes",
                 "write flight.control.K", "K=3.0 u_I_max=0.2", "executed at", "point & wait / gains", "line 16",
                 "torque is computed", "holds", "gain 3", "the parameters would break a rule", "after 0",
                 "as it should", "./fledge ground run script.py --to ./plays"):
        assert page.says(part), part


@pytest.mark.long("flies on targets")
@pytest.mark.parametrize("target", ["linux", "cfs", "leon3"])
def test_the_page_is_the_same_on_a_target(target, place, capfd):
    """But for its head, which names the target, the date and the command."""
    skip_unless_on(target)
    (place / "script.py").write_text(SCRIPT)
    (place / "node.toml").write_text(NODE.format(target=target, python=sys.executable))
    assert cli.main(["up", "node.toml"]) == 0, capfd.readouterr()
    assert cli.main(["ground", "run", "script.py", "--to", "./plays", "--out", "here", "--yes"]) == 0
    assert entries(place / "here")[1:] == entries(place / "there")[1:]
    here, there = (
        (place / folder / "script.html").read_text().split("</header>") for folder in ("here", "there"))
    assert here[1] == there[1] and "./plays" in here[0] and "cosim:flight?every=0.1" in there[0]


@pytest.mark.parametrize("body, code, why", [
    ("script.check(1 > 2, 'one is more', one=1)", 1, "line 5: the check does not hold: one is more, one = 1"),
    ("script.check(1 > 2)", 1, "line 5: the check does not hold: script.check(1 > 2)"),
    ("craft.command('write', 'flight.control', K=-1.0).completed()", 1, "line 5: flight refused write flight.control"),
    ("craft.wait(lambda t: t.mode == 'point', within=3 * s)", 1, "line 5: no packet of housekeeping came within 3 s"),
    ("with script.step('a'):\n    1 / 0", 1, "line 6: ZeroDivisionError: division by zero"),
    ("craft.command('nop')", 1, "there is no command 'nop'"),
    ("craft.listen(1 * s)\nraise KeyboardInterrupt", 130, "interrupted")])
def test_how_it_ends_is_on_the_page(body, code, why, place, capsys):
    log, page = run(place, body, code=code)
    assert log[-1]["kind"] == "end" and why in log[-1]["why"] and why in capsys.readouterr().err
    assert log[-1]["outcome"] == ("interrupted" if code == 130 else "failed") and page.says(why)
    if code == 1:
        assert log[-2]["kind"] == "exception" and log[-2]["line"] > 4 and log[-2]["source"] in body


def test_the_operator_decides(place, monkeypatch, capsys):
    log, page = run(place, "script.confirm('go?')", code=1)
    assert "no terminal; --yes answers it" in log[-1]["why"]
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    for typed, code in (("y", 0), ("no", 1), ("", 1)):
        monkeypatch.setattr("builtins.input", lambda question, typed=typed: typed)
        log, page = run(place, "script.confirm('go?')", code=code)
        assert [entry["good"] for entry in log if entry["kind"] == "confirm"] == [code == 0]
        assert page.says("the operator said no: go?") == bool(code)


@pytest.mark.parametrize("source, says", [
    ("def run(craft, script:\n", "script.py, line 1"), ("import nothing_of_this_name\n", "No module named"),
    ("x = 1\n", "there is no function run(craft, script)"), (None, "No such file")])
def test_a_script_that_is_none_is_refused_before_anything_happens(source, says, place, capsys):
    if source:
        (place / "script.py").write_text(source)
    assert cli.main(["ground", "run", "script.py", "--to", "./plays", "--out", "out"]) == 2
    assert says in capsys.readouterr().err and not (place / "out").exists()
    (place / "script.py").write_text("def run(craft, script):\n    pass\n")
    assert cli.main(["ground", "run", "script.py", "--to", "udp://127.0.0.1:9?listen=0"]) == 2
    assert "--mission says what is there" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_real_time_leaves_the_page(place, number):
    """By UDP, with a spacecraft that does not answer; while it asks, packets are taken."""
    there = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    there.bind(("127.0.0.1", 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    (place / "script.py").write_text("from fledge.units import s\n\n\ndef run(craft, script):\n"
                                     "    script.confirm('go?')\n    craft.command('noop').completed(within=900 * s)\n")
    with subprocess.Popen([sys.executable, "-P", "-m", "fledge.cli", "ground", "run", "script.py", "--to",
                           f"udp://127.0.0.1:{there.getsockname()[1]}?listen={port}", "--mission", "./plays", "--out",
                           "out", "--yes"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        watch = Thread(target=lambda: (there.recv(100), os.kill(process.pid, number)))
        watch.start()
        try:
            out, err = process.communicate()
        finally:
            process.kill()      # where it does not heed the signal
        watch.join()
    there.close()
    assert process.returncode == 130 and "interrupted" in err, (out, err)
    assert "page     out/script.html" in out and entries(place / "out")[-1]["outcome"] == "interrupted"
    assert Page((place / "out/script.html").read_text()).says("nothing was heard of it")
