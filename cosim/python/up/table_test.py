# SPDX-License-Identifier: Apache-2.0
"""The table of a run, as lines of text."""
import io

from fledge.cosim.up import table
from fledge.cosim.up.logs import Logs, shown
from fledge.cosim.up.table import Lines, Progress, Row, Screen, Watch, between, cut, headline, lines, slowest


def at(wall, t, ticks, compute, transport, **row):
    """A run of two nodes, of which the first works and the second waits for it."""
    rows = [Row("mass", "running", t, ticks, compute, transport, wall - compute - transport, **row),
            Row("spring", "running", t, ticks, 0.0, transport, wall - transport)]
    return Progress("duo", 60.0, "running", wall, t, rows)


def test_rates_are_taken_between_two_times():
    rates, speed = between(at(2.0, 4.0, 400, 1.0, 0.2), at(4.0, 10.0, 1000, 2.5, 0.4))
    assert speed == 3.0
    assert rates[0].ticks == 300 and rates[0].t == 3.0
    assert [round(x, 12) for x in rates[0].shares()] == [0.75, 0.1, 0.15]
    assert [round(x, 12) for x in rates[1].shares()] == [0.0, 0.1, 0.9]
    assert slowest(rates) == "mass"


def test_the_slowest_is_the_one_that_waits_least_and_needs_another():
    rates, _ = table.whole(at(10.0, 1.0, 100, 1.0, 8.0))
    assert slowest(rates) == "mass"
    assert slowest(rates[:1]) is None
    assert slowest([Row("a"), Row("b")]) is None
    viewer = Row("viewer", compute=5.0, takes_part=False)
    assert slowest(rates + [viewer]) == "mass"


def test_only_lately_counts():
    watch, now = Watch(), at(0.0, 0.0, 0, 0.0, 0.0)
    for k in range(101):    # 100 s of computing, then all wait
        now.wall, now.rows[0].ticks, now.rows[0].compute = 0.1 * k, k, 0.1 * k
        now.rows[0].wait = 0.0
        watch.take(now)     # the same object every time, as a session has it
    for _ in range(30):
        now.wall += 0.1
        now.rows[0].wait += 0.1
        rates, _ = watch.take(now)
    assert rates[0].ticks == 0 and rates[0].shares() == (0.0, 0.0, 1.0)


def test_a_run_that_waits_for_days_takes_no_memory():
    watch = Watch()
    for wall in (0.0, 3.0):
        now = at(wall, 1.0, 10, 0.1, 0.1)
        for _ in range(1000):   # the wall time stands still while nodes are missing
            watch.take(now)
        assert len(watch._past) == 1


def test_the_table():
    rates, _ = between(at(2.0, 4.0, 400, 1.0, 0.2), at(4.0, 10.0, 1000, 2.5, 0.4))
    assert lines(at(4.0, 10.0, 1000, 2.5, 0.4), rates, 120) == [
        "node    state         time    ticks/s    speed   compute  transport      wait",
        "mass    running    10.00 s        300       3x       75%        10%       15%  ############==..  slowest",
        "spring  running    10.00 s        300       3x        0%        10%       90%  ==..............",
        f"{'# compute  = transport  . wait':>95}"]


def test_the_last_table_has_the_whole_times():
    now = at(4.0, 10.0, 1000, 2.5, 0.4)
    now.rows[0].state = "finished"
    text = lines(now, table.whole(now)[0], 120, final=True)
    assert text[1].split() == "mass finished 10.00 s 250 2.5x 2.5 s 400 ms 1.1 s ##########==.... slowest".split()


def test_it_fits_the_terminal():
    now = at(4.0, 3700.0, 1000, 2.5, 0.4)
    rates, speed = table.whole(now)
    for width in range(20, 140):
        for colour in (False, True):
            for line in [*lines(now, rates, width, colour=colour), headline(now, speed, width)]:
                assert len(shown(line)) <= max(width, len("spring  running  slowest")), (width, line)
    assert "compute" in lines(now, rates, 60)[0] and "time" not in lines(now, rates, 60)[0]


def test_of_many_nodes_the_busy_and_the_bad_are_shown():
    rows = [Row(f"n{k}", "running", 1.0, 10, compute=k / 100, wait=1.0) for k in range(100)]
    rows[3].state, rows[3].bad = "lost", True
    now = Progress("many", 60.0, "running", 1.0, 1.0, rows)
    text = lines(now, table.whole(now)[0], 100, most=6)
    assert [line.split()[0] for line in text[1:7]] == ["n3", "n96", "n97", "n98", "n99", "and"]
    assert text[6] == "and 95 more, which wait more"


def test_one_that_has_not_begun_has_no_numbers():
    now = Progress("duo", 60.0, rows=[Row("mass"), Row("viewer", "runs", takes_part=False)])
    assert lines(now, table.whole(now)[0], 120)[1:] == ["mass    starting", "viewer  runs"]
    assert headline(now, 0.0, 80) == "duo  starting  0.00 s of 60 s  [............................]   0%"


def test_a_screen_draws_over_itself_and_keeps_what_happened():
    out = io.StringIO()
    screen = Screen(out)
    now = at(1.0, 1.0, 100, 0.5, 0.1)
    screen.goes(now, [("mass", "a line\x1b[2J of\x07 mass")])
    screen.happens("spring was killed")
    screen._written = 0.0
    screen.goes(now, [])
    screen.ends(now)
    screen.close()
    text = out.getvalue()
    assert text.startswith("\x1b[?25l") and text.endswith("\x1b[?25h")
    assert "mass   | a line of\u27e807\u27e9 mass\x1b[K\n" in text
    height = text.split("\x1b[J")[0].count("\n")
    assert f"\x1b[{height}A\r\x1b[Jspring was killed\n" in text
    assert text.count("\x1b[?25l") == 1


def test_without_a_terminal_there_are_lines(monkeypatch):
    monkeypatch.setattr(table, "_QUIET", 0.0)
    out = io.StringIO()
    view = Lines(out, show_logs=True)
    view.goes(at(2.0, 4.0, 400, 1.0, 0.2), [])
    now = at(4.0, 10.0, 1000, 2.5, 0.4)
    now.rows[1].state, now.rows[1].bad = "lost", True
    view.goes(now, [])
    view.logged([("mass", "hello"), ("spring", "\x1b[1mdear\r")], 6)
    assert out.getvalue().split("\n") == [
        "  4.00 s of 60 s",
        "  10.00 s of 60 s, 3x real time, slowest mass: 75% computing, 10% on the way; spring lost",
        "mass   | hello", "spring | dear", ""]


def test_logs_are_gathered_line_by_line(tmp_path):
    (tmp_path / "old.log").write_text("of a run before")
    logs = Logs(tmp_path, 6)
    mass, spring = logs.open("mass"), logs.open("spring")
    mass.write(b"one\ntwo\nthr")
    spring.write(b"\xff and\n")
    assert logs.gather() == [("mass", "one"), ("mass", "two"), ("spring", "\ufffd and")]
    assert logs.gather() == []
    mass.write(b"ee\n\n")
    spring.write(b"no end")
    assert logs.gather() == [("mass", "three"), ("mass", "")]
    logs.say("mass", "started again")
    logs.open("mass").write(b"four\n")
    logs.close()
    text = [line[10:] for line in (tmp_path / "all.log").read_text().splitlines()]
    assert text == ["mass   | one", "mass   | two", "spring | \ufffd and", "mass   | three", "mass   | ",
                    "mass   | --- started again", "mass   | four", "spring | no end"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["all.log", "mass.log", "spring.log"]
    assert logs.last("mass", 2) == ["--- started again", "four"] and logs.last("none", 3) == []


def test_control_characters_are_not_shown():
    assert shown("a\x1b[31mred\x1b[0m\tb\x07") == "ared    b\u27e807\u27e9"
    assert shown("10%\r20%\r100%") == "100%" and shown("done\r") == "done"
    assert shown("\x1b]0;title\x07text") == "text"
    assert shown("\x9b2Jone\u202eowt\u2028\x85\ud800") == \
        "\u27e89B\u27e92Jone\u27e8202E\u27e9owt\u27e82028\u27e9\u27e885\u27e9\u27e8D800\u27e9"


def test_an_event_does_not_drive_the_terminal():
    out = io.StringIO()
    Lines(out).happens("  mass: it failed: \x1b[2J\x1b]0;title\x07a\rb\x9bc\nsecond line")
    assert out.getvalue() == "  mass: it failed: \u27e81B\u27e9[2J\u27e81B\u27e9]0;title\u27e807\u27e9" \
        "a\u27e80D\u27e9b\u27e89B\u27e9c\nsecond line\n"


def test_a_line_of_wide_characters_takes_one_line_of_the_terminal():
    assert cut("abcdef", 4) == "abcd" and cut("abc", 4) == "abc"
    assert cut("\u885b\u661f\u885b", 5) == "\u885b\u661f"       # two columns each
    assert cut("e\u0301e\u0301e", 2) == "e\u0301e\u0301"         # accents take none


def test_the_table_keeps_little_of_a_long_line(tmp_path):
    logs = Logs(tmp_path, 4)
    logs.open("mass").write(b"x" * 3_000_000 + b"\n")
    while not logs.gather():
        pass
    logs.close()
    assert max(len(line) for _, line in logs.recent) == 1000
