# SPDX-License-Identifier: Apache-2.0
"""The folders of runs: of one run at a time, kept under a name, and honest about runs that did not end."""

import os
import subprocess
import sys
import textwrap
from argparse import Namespace
from pathlib import Path

import matplotlib.pyplot
import pytest

import fledge
from fledge import Archive, RunError, cli, scene
from fledge.archive import mcap
from fledge.cli.judge import reported
from fledge.cli.runs import alone, find_run, folder_of
from fledge.errors import Failure
from fledge.disk import Part, create
from tests.circles import long_after
from tests.waiting import wait_for

ENVIRONMENT = {**os.environ, "PYTHONPATH": ":".join(p for p in sys.path if p)}
FLIGHT = """
    "A body that looks down."
    from fledge import flight as fsw

    def build(f, every=1.0):
        f.guidance = fsw.HillPointing()
        f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 0.5])
        f.connect(f.guidance.reference >> f.tracking.reference)
        f.task("gnc", every=every, run=[f.guidance, f.tracking])
"""
WORLD = """
    from fledge import Orbit, world

    def build(w, f):
        w.craft = world.Spacecraft(I_B=3, gravity=[world.EARTH], orbit=Orbit(world.EARTH, altitude=500e3))
        w.nav = world.Navigation()
        w.connect(w.craft.state >> w.nav.truth, w.nav.orbit >> f.guidance.orbit, w.nav.attitude >> f.tracking.attitude)
        w.task("dynamics", every=1, run=[w.craft, w.nav])
"""
SCENARIOS = '''
    import time
    from pathlib import Path

    def short(sim):
        """A minute."""
        log = sim.record(sim.flight.tracking.error)
        sim.run(60)
        log.plot("error.sigma_BR", name="error")

    def figures(sim):
        """Figures by hand."""
        import matplotlib
        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        log = sim.record(sim.flight.tracking.error)
        sim.run(60)
        for title in ("one", "another"):
            log.plot("error.sigma_BR", name="error", title=title)
        plt.figure()
        plt.plot(log.time, log["error.sigma_BR"])
        plt.figure(num="by hand/2")
        plt.plot([1, 2])
        assert sim.time > 100, "too early"

    def estimate(sim):
        """By navigation."""
        sim.record(sim.world.nav.attitude)
        sim.run(60)

    def nothing(sim):
        """Without a record."""
        sim.run(60)

    def waiting(sim):
        """As long as the file `wait` is there."""
        sim.record(sim.flight.tracking, sim.world.craft)
        sim.run(4000)
        Path("flown").touch()
        while Path("wait").exists():
            time.sleep(0.01)
        sim.run(60)
'''


@pytest.fixture
def here(tmp_path, monkeypatch):
    folder = tmp_path / "missions" / "looker"
    folder.mkdir(parents=True)
    for name, text in (("flight", FLIGHT), ("world", WORLD), ("scenarios", SCENARIOS)):
        (folder / f"{name}.py").write_text(textwrap.dedent(text))
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Waiting:
    """A run in a program of its own that has flown 4000 s, and waits."""

    def __init__(self, here, *arguments):
        self.file = here / "wait"
        self.file.touch()
        (here / "flown").unlink(missing_ok=True)
        self.process = subprocess.Popen([sys.executable, "-m", "fledge.cli", "run", "looker", "waiting", *arguments],
                                        env=ENVIRONMENT, cwd=here, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        text=True)
        wait_for((here / "flown").exists, self.process)

    def end(self):
        self.file.unlink()
        printed = self.process.communicate()[0]
        return self.process.returncode, printed

    def kill(self):
        self.process.kill()
        self.process.communicate()
        self.file.unlink()


def test_two_runs_into_one_folder_never_mix(here, capsys):
    assert cli.main(["run", "looker", "waiting", "--out", "alone"]) == 0
    first = Waiting(here)
    capsys.readouterr()
    assert cli.main(["run", "looker", "short", "--out", "runs/looker/waiting"]) == 2
    assert ("fledge: another fledge command writes into runs/looker/waiting now; wait until it has ended, or give "
            "another folder with --out, or a name with --as") in capsys.readouterr().err
    code, printed = first.end()
    assert code == 0 and "ended" in printed
    assert (here / "runs/looker/waiting/run.mcap").read_bytes() == (here / "alone/run.mcap").read_bytes()
    assert cli.main(["run", "looker", "waiting"]) == 0     # the folder is free again


def test_a_run_has_what_its_view_needs_and_no_more(here):
    assert cli.main(["run", "looker", "short"]) == 0
    record = Archive("runs/looker/short/run.mcap")
    assert list(record.topics) == ["/flight/tracking/error", "/world/craft/state"]
    assert record.time("error").tolist() == record.time("state").tolist()
    sim = fledge.load("looker")
    log = sim.record(sim.flight.tracking.error, sim.world.craft.state)
    sim.run(60)
    assert [record.raw[topic].tobytes() for topic in ("error", "state")] == [
        log.raw[topic].tobytes() for topic in ("error", "state")]
    assert len(scene.of(record).crafts[0].turning.time) > 1
    assert cli.main(["run", "looker", "estimate"]) == 0
    assert list(Archive("runs/looker/estimate/run.mcap").topics) == ["/world/nav/attitude"]
    assert cli.main(["run", "looker", "nothing"]) == 0
    assert Archive("runs/looker/nothing/run.mcap").time("state").tolist() == list(range(61))


def test_two_simulations_in_one_program_do_not_write_one_file(here):
    first, second = fledge.load("looker"), fledge.load("looker")
    for sim in (first, second):
        sim.record(sim.flight.tracking.error)
        sim.archive(here / "run.mcap")
    first.run(10)
    with pytest.raises(RunError, match="cannot write .*run.mcap: another run writes .*run.mcap.part now; let it end"):
        second.run(10)
    second.close_archive()
    first.run(10)
    first.close_archive()
    assert Archive(here / "run.mcap").time("error")[-1] == 20


@pytest.mark.parametrize("command", long_after(1, [
    ["plot", "looker", "error.sigma_BR"], ["convert", "looker", "--csv"], ["convert", "looker", "--about"],
    ["compare", "looker", "looker"]], "another command"))
def test_a_run_that_was_killed_is_no_secret(here, capsys, command):
    lost = Waiting(here)
    lost.kill()
    capsys.readouterr()
    assert cli.main(command) == 2
    part = "runs/looker/waiting/run.mcap.part"
    complaint = capsys.readouterr().err
    assert f"there is no whole record 'looker'; a run that has not ended left {part}, with the data up to t = 4000 s" \
        in complaint        # all of the run before it waits
    assert cli.main(["run", "looker", "waiting"]) == 0     # in place of the lost one
    assert not (here / part).exists()
    Waiting(here).kill()
    capsys.readouterr()
    assert cli.main(command) == 0
    complaint = capsys.readouterr().err
    assert (f"runs/looker/waiting/run.mcap is not of the last run: a run that has not ended left {part}, with the data "
            "up to t = ") in complaint
    assert cli.main(["convert", part, "--about"]) == 0     # named, it is read
    assert "damaged or cut off" in capsys.readouterr().err


def test_a_killed_run_of_another_scenario_is_no_secret_either(here, capsys):
    assert cli.main(["run", "looker", "short"]) == 0
    Waiting(here).kill()
    capsys.readouterr()
    for name, replaced in (("looker", True), ("looker/short", False), ("runs/looker", True)):
        assert cli.main(["convert", name, "--about"]) == 0
        message = "run.mcap is not of the last run: a run that has not ended left runs/looker/waiting/run.mcap.part" \
            in capsys.readouterr().err
        assert message == replaced, name


def test_pages_are_of_the_run_whose_record_lies_beside_them_and_older_ones_are_kept(here, capsys):
    assert cli.main(["run", "looker", "short", "--report"]) == 0
    report = here / "runs/looker/short/report.html"
    page = report.read_text()
    (report.parent / "view.html").write_text("of the first run")
    capsys.readouterr()
    assert cli.main(["run", "looker", "short"]) == 0
    assert not report.exists() and not (report.parent / "view.html").exists()
    assert (report.parent / "earlier-report.html").read_text() == page
    assert (report.parent / "earlier-view.html").read_text() == "of the first run"
    output = capsys.readouterr().out
    for name in ("view.html", "report.html"):
        assert f"  earlier  runs/looker/short/earlier-{name}: {name} of the run before\n" in output
    assert cli.main(["run", "looker", "short", "--report"]) == 0
    assert "  earlier  " not in capsys.readouterr().out and report.exists()


def test_a_run_without_a_record_says_that_the_older_one_is_not_its_own(here, capsys):
    assert cli.main(["run", "looker", "short"]) == 0
    text = (here / "missions/looker/scenarios.py").read_text()
    recorded = "log = sim.record(sim.flight.tracking.error)\n    sim.run(60)"
    assert recorded in text
    (here / "missions/looker/scenarios.py").write_text(text.replace(recorded, "return", 1))
    capsys.readouterr()
    assert cli.main(["run", "looker", "short"]) == 1
    assert "  record   none; runs/looker/short/run.mcap is of an earlier run\n" in capsys.readouterr().out


def test_no_link_is_followed(here):
    other = here / "other"
    other.write_text("precious")
    folder = here / "runs/looker/short"
    folder.mkdir(parents=True)
    for name in ("run.mcap", "error.png", "report.html"):
        (folder / name).symlink_to(other)
    assert cli.main(["run", "looker", "short", "--report"]) == 0
    assert Archive(folder / "run.mcap").complete and not (folder / "run.mcap").is_symlink()
    (folder / "run.mcap.part").symlink_to(other)
    assert cli.main(["run", "looker", "short"]) == 1
    (folder / "run.mcap.part").unlink()
    (folder / "error.png.part").symlink_to(other)
    assert cli.main(["run", "looker", "short"]) == 1
    assert other.read_text() == "precious"


def test_figures_of_pyplot_are_saved_with_the_run_even_if_it_fails(here, capsys):
    matplotlib.pyplot.close("all")      # those of other tests count, too
    assert cli.main(["run", "looker", "figures", "--report"]) == 1
    folder = here / "runs/looker/figures"
    names = ["by hand_2.png", "error-2.png", "error.png", "figure-1.png"]
    assert sorted(p.name for p in folder.glob("*.png")) == names
    printed = capsys.readouterr().out
    page = (folder / "report.html").read_text()
    for name in names:
        assert f"  plot     runs/looker/figures/{name}" in printed
        assert f'alt="figure {name[:-4]}"' in page
    assert (folder / "error.png").read_bytes() != (folder / "error-2.png").read_bytes()
    from matplotlib import pyplot

    assert not pyplot.get_fignums()             # a second run in this program has none of them
    opened = pyplot.figure("before the run").number
    assert cli.main(["run", "looker", "figures", "--out", "again"]) == 1
    assert sorted(p.name for p in (here / "again").glob("*.png")) == [n.replace("-1", "-2") for n in names]
    assert pyplot.get_fignums() == [opened]
    assert cli.main(["run", "looker", "figures", "--no-plots", "--out", "none"]) == 1
    assert not list((here / "none").glob("*.png"))
    pyplot.close("all")


# --- names -----------------------------------------------------------------------------------------

@pytest.mark.long("flies several runs with their plots")
def test_a_run_is_kept_under_its_name(here, capsys):
    assert cli.main(["run", "looker", "short", "--as", "every second"]) == 0
    assert cli.main(["run", "looker", "short", "--as", "fast", "--set", "every=0.5", "--report"]) == 0
    assert "runs/kept/fast/error.png" in capsys.readouterr().out
    assert cli.main(["compare", "every second", "fast"]) == 1
    assert "a  runs/kept/every second/run.mcap\nb  runs/kept/fast/run.mcap\n" in capsys.readouterr().out
    assert cli.main(["plot", "fast", "error.sigma_BR"]) == 0 and cli.main(["convert", "fast", "--hdf5"]) == 0
    assert cli.main(["convert", "fast", "--csv", "--quaternions", "--out", "tables"]) == 0
    assert "beta_BR[3] [-]" in Path("tables/flight.tracking.error.csv").read_text()
    assert cli.main(["convert", "fast", "--hdf5", "--quaternions"]) == 2
    assert sorted(p.name for p in (here / "runs/kept/fast").iterdir()) == [
        "error.png", "error_sigma_BR.png", "report.html", "run.h5", "run.mcap", "summary.json"]
    assert "run looker short --as fast --replace --set every=0.5" in (here / "runs/kept/fast/report.html").read_text()
    capsys.readouterr()
    assert cli.main(["list"]) == 0
    listed = capsys.readouterr().out
    assert listed.index("kept runs") < listed.index("  every second") < listed.index("  fast")
    assert "looker, short, passed" in listed


def test_the_name_of_a_mission_is_that_of_its_newest_run(here, capsys):
    records = [Path("runs/looker", name) for name in ("fly/leon3.mcap", "short/run.mcap", "figures/run.mcap")]
    for age, record in enumerate(records):
        record.parent.mkdir(parents=True, exist_ok=True)
        record.touch()
        os.utime(record, (1000 - age, 1000 - age))
    assert find_run("looker") == find_run("runs/looker") == records[1]
    assert "runs/looker/short/run.mcap is the newest run of looker; runs/looker has 3 " in capsys.readouterr().err
    os.utime(records[2])
    assert find_run("looker") == records[2]
    records[0].with_name("desktop.mcap").touch()
    with pytest.raises(Failure, match="several records in runs/looker/fly; name one of "):
        find_run("runs/looker/fly")


def test_a_name_is_taken_once_unless_it_is_replaced(here, capsys):
    assert cli.main(["run", "looker", "short", "--as", "mine"]) == 0
    before = (here / "runs/kept/mine/run.mcap").read_bytes()
    assert cli.main(["run", "looker", "short", "--as", "mine", "--seed", "4"]) == 2
    assert "--as mine: runs/kept/mine has a run of this name already; choose another" in capsys.readouterr().err
    assert (here / "runs/kept/mine/run.mcap").read_bytes() == before
    assert cli.main(["run", "looker", "short", "--as", "mine", "--seed", "4", "--replace"]) == 0
    assert Archive(here / "runs/kept/mine/run.mcap").metadata["run"]["seed"] == "4"
    waiting = Waiting(here, "--as", "other")
    assert cli.main(["run", "looker", "short", "--as", "other", "--replace"]) == 2
    assert "another fledge command writes into runs/kept/other now" in capsys.readouterr().err
    waiting.kill()
    assert cli.main(["run", "looker", "short", "--as", "other"]) == 2      # what is left of it is not lost either
    capsys.readouterr()
    assert cli.main(["list"]) == 0
    assert "looker, waiting, has not ended" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "a\\b", "-a", ".a", " a", "a\n", "a\x1b[1m", "x" * 101,
                                  "a\udcff"])
def test_what_cannot_be_a_name(here, name):
    with pytest.raises(Failure, match="expected a name of up to 100 bytes"):
        folder_of(name)
    assert not (here / "runs").exists()


def test_a_name_means_one_thing(here, capsys):
    assert cli.main(["run", "looker", "short", "--as", "looker"]) == 2
    assert "a mission has this name" in capsys.readouterr().err
    for arguments, text in ((["--as", "a", "--out", "b"], "a name with --as, or a folder"),
                            (["--replace"], "is for --as")):
        assert cli.main(["run", "looker", "short", *arguments]) == 2
        assert text in capsys.readouterr().err
    assert folder_of("größer als 1") == folder_of("größer als 1", replace=True)


# --- folders and files -----------------------------------------------------------------------------

def test_a_folder_is_free_again_when_its_program_ends(here):
    folder = here / "a" / "b"
    with alone(folder):
        with pytest.raises(Failure, match="another fledge command writes into .*/a/b now; .* with --out"):
            with alone(folder):
                pass
    with alone(folder):
        (folder / "file").touch()
    assert (folder / "file").exists()
    with alone(here / "c" / "d"):
        pass
    assert not (here / "c").exists()        # nothing came of it


def test_a_report_of_a_scenario_that_cannot_begin_leaves_no_folder(here, monkeypatch):
    sim = fledge.load("looker")
    monkeypatch.setitem(sim.mission.scenarios, "short", lambda sim: 1 / 0)
    with pytest.raises(Failure, match="looker, short: .*division by zero"):
        reported(Namespace(debug=False), sim, "short", "on linux", here / "linux_run")
    assert not (here / "linux_run").exists()


@pytest.mark.parametrize("command", [["montecarlo", "nadir_spin", "--runs", "1"], ["up", "nadir_spin", "--until", "1s"],
                                     ["montecarlo", "nadir_spin", "--only", "0"], ["run", "nadir_spin"],
                                     ["fly", "nadir_spin", "--on", "desktop", "--for", "1s"]])
def test_every_command_that_writes_a_run_needs_its_folder_alone(here, capsys, command):
    with alone(here / "one"):
        assert cli.main([*command, "--out", "one"]) in (1, 2)
        complaint = capsys.readouterr().err
        assert "another fledge command writes into one now" in complaint or "one is in use by another run" in complaint
        assert not list((here / "one").iterdir())


def test_two_exports_never_mix(here, capsys):
    assert cli.main(["export", "c", "looker", "--out", "c"]) == 0
    before = {path.name: path.read_bytes() for path in (here / "c").iterdir()}
    lock = create(here / "c" / "looker.c.part")
    assert cli.main(["export", "c", "looker", "--out", "c"]) == 2
    assert "looker.c.part: another program writes it now" in capsys.readouterr().err
    os.close(lock)
    (here / "c" / "looker.c.part").unlink()
    assert {path.name: path.read_bytes() for path in (here / "c").iterdir()} == before
    (here / "c" / "looker.c.part").symlink_to(here / "missions/looker/flight.py")
    assert cli.main(["export", "c", "looker", "--out", "c"]) == 2
    assert (here / "missions/looker/flight.py").read_text().startswith("\n\"A body")
    (here / "c" / "looker.c.part").unlink()


def test_one_program_at_a_time_writes_a_file(here):
    with Part(here / "a.txt") as part:
        with pytest.raises(OSError, match="cannot be written: another program writes it now"):
            with Part(here / "a.txt"):
                pass
        part.write_text("whole")
    assert (here / "a.txt").read_text() == "whole" and not list(here.glob("*.part"))


def test_a_part_that_was_left_is_replaced_not_emptied(here):
    left = here / "a.txt.part"
    left.write_text("lost")
    os.link(left, here / "kept")
    with Part(here / "a.txt") as part:
        part.write_text("new")
    assert (here / "a.txt").read_text() == "new" and (here / "kept").read_text() == "lost"
    left.symlink_to(here / "kept")
    with pytest.raises(OSError, match="cannot be written: a.txt.part is a symbolic link"):
        with Part(here / "a.txt"):
            pass
    assert (here / "kept").read_text() == "lost" and (here / "a.txt").read_text() == "new"


def test_the_metadata_of_a_file_are_read_without_its_messages(here):
    assert cli.main(["run", "looker", "short"]) == 0
    path = here / "runs/looker/short/run.mcap"
    assert mcap.metadata(path) == Archive(path).metadata
    (here / "cut").write_bytes(path.read_bytes()[:200])
    assert mcap.metadata(here / "cut") == {}


def test_a_new_folder_of_a_run_is_its_owners(tmp_path):
    there = tmp_path / "there"
    there.mkdir(mode=0o755)
    with alone(there / "runs/one"):
        (there / "runs/one/record").touch()
        assert [path.stat().st_mode & 0o777 for path in (there, there / "runs", there / "runs/one")] == [
            0o755, 0o700, 0o700]
