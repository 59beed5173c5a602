# SPDX-License-Identifier: Apache-2.0
"""The examples of the documents in docs/ work: their files are written, their commands run.

In a document,

    ```c file=PATH       is a file to be written,
    ```diff file=PATH    a change of one, with - and + lines, and blank-led ones that stay,
    ```console           `$ command`s, run in one shell after the other; `(gdb) ` lines are what a
                         command reads; the other lines must stand in what it prints, in this order,
                         where ... stands for anything
    ```sh                for the reader only.
"""

import ast
import inspect
import os
import re
import subprocess
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

import fledge
from fledge import attitude, flight as fsw, flight_math, world
from fledge.scene.testing.node import not_built
from tests.needs import flies_on, module, needs, section, skipped
from tests.tree import ROOT

pytestmark = pytest.mark.spread
BLOCK = re.compile(r"^```(\w+)(?: file=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PROMPT = "(gdb) "


class Shell:
    """Commands one after the other; the folder and the environment stay as each leaves them."""

    def __init__(self, folder):
        self.state = folder / ".state"
        environment = {name: value for name, value in os.environ.items() if name != "FLEDGE_PROJECT"}
        environment["PATH"] = f"{ROOT}:{environment['PATH']}"
        environment["FLEDGE"] = str(ROOT)
        self.environment = environment
        self.state.write_text(f"cd {folder}\n")

    def run(self, command, typed=""):
        """(output, exit code)"""
        script = (f"source {self.state}\n{command}\nstatus=$?\n"
                  f"{{ declare -px; printf 'cd %q\\n' \"$PWD\"; }} > {self.state}\nexit $status\n")
        done = subprocess.run(["bash", "-c", script], input=typed, text=True, env=self.environment,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        return done.stdout, done.returncode

    def here(self):
        return self.run("pwd")[0].strip()


def commands(text):
    """(command, lines that it reads, lines that it must print) of a console block."""
    steps = []
    for line in text.splitlines():
        if line.startswith("$ "):
            steps.append((line[2:], [], []))
        elif line.startswith(PROMPT):
            steps[-1][1].append(line[len(PROMPT):])
        else:
            steps[-1][2].append(line.strip())
    return steps


def missing(expected, printed):
    """The first line of `expected` that is not in its place in the output, or None."""
    lines = iter(printed.splitlines())
    for wanted in expected:
        pattern = ".*".join(re.escape(part.strip()) for part in wanted.split("..."))
        if not any(re.search(pattern, line) for line in lines):
            return wanted
    return None


def change(text, diff):
    """A text after the change of a diff block, whose old lines it must hold once."""
    lines = diff.splitlines(keepends=True)
    old = "".join(line[1:] for line in lines if line[0] in " -")
    new = "".join(line[1:] for line in lines if line[0] in " +")
    assert text.count(old) == 1, f"is there {text.count(old)} times:\n{old}"
    return text.replace(old, new)


def follow(document, shell):
    """Run the examples of a document."""
    done = 0
    for kind, file, text in BLOCK.findall((ROOT / "docs" / document).read_text(encoding="utf-8")):
        if file:
            path = os.path.join(shell.here(), file)
            if kind == "diff":
                with open(path, encoding="utf-8") as there:
                    text = change(there.read(), text)
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "w", encoding="utf-8") as there:
                there.write(text)
        elif kind == "console":
            for command, typed, expected in commands(text):
                printed, status = shell.run(command, "".join(f"{line}\n" for line in typed))
                assert status == 0, f"$ {command}\n{printed}"
                absent = missing(expected, printed)
                assert absent is None, f"$ {command}\n{printed}\n--- has no line, in its place: {absent}"
                done += 1
    return done


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


@skipped(not_built())
def test_the_python_of_the_readme_runs_from_top_to_bottom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for kind, file, text in BLOCK.findall(text_of("README.md")):
        if kind == "python" and not file:
            exec(text, names := {})
    assert names["log"]["error.sigma_BR"].shape[0] > 1000 and names["sim"].flight.control.K == 5


def test_the_readme_quotes_files_and_figures_that_are_there():
    files = [(file, text) for _, file, text in BLOCK.findall(text_of("README.md")) if file]
    assert len(files) == 3
    for file, text in files:
        assert missing([line.strip() for line in text.splitlines()], text_of(file)) is None, file
    row = re.compile(r"^\| `(\S+)` \|.*\| ([\d.]+ KiB) \| ([\d.]+ KiB) \|$", re.MULTILINE)
    figures = row.findall(text_of("README.md"))
    assert len(figures) == 4 and set(figures) <= set(row.findall(text_of("docs/targets.md")))


@pytest.mark.long("follows a part of the guide, then the tutorial; builds two projects, and flies on targets")
@flies_on("leon3")
def test_the_first_hour_leads_to_a_module_in_closed_loop(tmp_path):
    """All commands for a reader, from the clone and an empty home, but installations and Fledge's own tests."""
    shell = Shell(tmp_path)
    shell.environment["HOME"] = str(tmp_path)
    shell.run(f"cd {ROOT}")
    block = re.search(r"## A project of your own\n.*?```\n(.*?)```", text_of("docs/guide.md"), re.DOTALL)[1]
    for command in block.splitlines():
        printed, status = shell.run(command)
        assert status == 0, f"$ {command}\n{printed}"
    assert "\n  passed\n" in printed
    shell.run("cd ~")
    assert follow("tutorial.md", shell) >= 10
    assert (tmp_path / "my_sat/runs/turn/slew/slew.png").stat().st_size > 10_000


@pytest.mark.long("follows the guide, a dozen commands: 30 s")
def test_the_guide_shows_what_fledge_prints(tmp_path):
    assert follow("guide.md", Shell(tmp_path)) >= 12
    assert (tmp_path / "runs/imager/acquire/band.png").stat().st_size > 10_000


@pytest.mark.long("follows the page; flies on the emulated board: a minute")
@flies_on("leon3", needs=["npm", "valgrind"])
def test_the_cookbook_answers_what_teams_ask(tmp_path):
    assert follow("cookbook.md", Shell(tmp_path)) >= 30
    assert (tmp_path / "recipes/wiring.svg").stat().st_size > 10_000
    assert (tmp_path / "recipes/run.scene.mcap").stat().st_size > 100_000


@pytest.mark.long("follows the page")
def test_files_are_exchanged_with_others(tmp_path):
    assert follow("files.md", Shell(tmp_path)) == 3
    assert (tmp_path / "orbit.xml").stat().st_size > 1000
    assert (tmp_path / "craft.bsp").stat().st_size % 1024 == 0


@pytest.mark.long("follows the page; draws")
def test_the_loop_meets_control_theory(tmp_path):
    assert follow("linear.md", Shell(tmp_path)) == 4
    assert (tmp_path / "loop.png").stat().st_size > 10_000


@pytest.mark.long("follows the page; flies under valgrind")
@needs("valgrind")
def test_flight_is_profiled(tmp_path):
    assert follow("profiling.md", Shell(tmp_path)) == 2
    assert (tmp_path / "runs/nadir_spin/profile/profile.html").stat().st_size > 10_000


@pytest.mark.long("follows the page; a verification over scenarios")
def test_a_mission_is_verified(tmp_path):
    assert follow("verification.md", Shell(tmp_path)) == 2
    assert (tmp_path / "verification/nadir_spin/report.html").stat().st_size > 20_000


@pytest.mark.long("follows the page; a search")
def test_a_search_finds_a_run_that_fails(tmp_path):
    assert follow("falsification.md", Shell(tmp_path)) == 1
    assert "keeps_sun_1(sim)" in (tmp_path / "runs/sun_safe/falsify/SUN-1/keeps_sun_1.py").read_text()


@pytest.mark.long("follows the page; a campaign of failures")
def test_sensors_fail_as_planned_set_dispersed_and_injected(tmp_path):
    assert follow("sensors.md", Shell(tmp_path)) == 7


@pytest.mark.long("follows the page; each fault of each unit")
@flies_on("leon3", needs=["valgrind"])
def test_faults_versions_and_the_time_of_tasks(tmp_path):
    assert follow("fault-analysis.md", Shell(tmp_path)) == 5


@pytest.mark.long("follows the page; builds a project")
def test_existing_code_is_wrapped_and_flown(tmp_path):
    assert follow("existing-code.md", Shell(tmp_path)) >= 6


@pytest.mark.long("follows the page; builds for three targets")
@flies_on("leon3", "micropython")
def test_a_guidance_law_goes_from_a_class_to_c_and_to_targets(tmp_path):
    assert follow("prototypes.md", Shell(tmp_path)) >= 15


@pytest.mark.long("follows the page; builds a project and a target")
@needs("clang")
def test_a_project_has_a_target_of_its_own(tmp_path):
    assert follow("targets.md", Shell(tmp_path)) == 3


@pytest.mark.long("follows the page; builds a project, and flies on a board of its own")
@flies_on("riscv64", "cortex-m7", needs=["openocd"])
def test_a_board_of_ones_own_flies(tmp_path):
    assert follow("your-board.md", Shell(tmp_path)) == 7


@pytest.mark.long("follows the page; builds and flies under MicroPython")
@flies_on("micropython")
def test_a_mission_flies_under_micropython(tmp_path):
    assert follow("micropython.md", Shell(tmp_path)) == 4


@pytest.mark.long("follows the page; builds a project of programs")
def test_programs_are_joined_into_one_simulation(tmp_path):
    assert follow("cosim.md", Shell(tmp_path)) >= 10


@pytest.mark.long("follows the page; makes FMUs, and flies them: 6 s")
def test_missions_are_fmus_and_fmus_fly_in_missions(tmp_path):
    assert follow("fmi.md", Shell(tmp_path)) == 5


def test_a_script_of_the_ground_commands_a_mission(tmp_path):
    assert follow("ground.md", Shell(tmp_path)) >= 2


@needs("gdb")
def test_gdb_stops_in_flight_code(tmp_path):
    shell = Shell(tmp_path)
    shell.state.write_text(f"cd {ROOT}\nexport DEBUGINFOD_URLS=\n")
    assert follow("debugging.md", shell) == 2


@pytest.mark.long("follows the page; flies on the emulator under gdb")
@flies_on("leon3", needs=["gdb-multiarch", "lcov", "valgrind"])
def test_a_leon3_is_looked_into(tmp_path):
    shell = Shell(tmp_path)
    shell.environment["DEBUGINFOD_URLS"] = ""
    assert follow("leon3-debugging.md", shell) >= 12


def of_ci():
    """The commands of each file of docs/ci.md, the variables, and where the reports are."""
    files = {file: yaml.safe_load(text) for _, file, text in BLOCK.findall((ROOT / "docs/ci.md").read_text()) if file}
    github, gitlab = files[".github/workflows/test.yml"], files[".gitlab-ci.yml"]["test"]
    steps = github["jobs"]["test"]["steps"]
    return [([step["run"] for step in steps if "run" in step], github["env"], steps[-1]["with"]["path"] + "/**/*.xml"),
            (gitlab["script"], gitlab["variables"], gitlab["artifacts"]["reports"]["junit"])]


def test_both_files_for_a_ci_do_the_same():
    (github, *others), (gitlab, *of_gitlab) = of_ci()
    assert others == of_gitlab and [line for line in gitlab if not line.startswith("apt-get")] == github
    assert set(re.findall(r"\$(\w+)", github[0])) == others[0].keys()


@pytest.mark.long("clones this repository, builds and tests a project: a minute")
def test_a_ci_tests_a_project(tmp_path):
    (clone, test), variables, reports = of_ci()[0]
    shell = Shell(tmp_path)
    for command in ["fledge new project sat", "cd sat", "fledge new mission scan",
                    f"export FLEDGE={ROOT} REVISION=$(git -C {ROOT} rev-parse --short=12 HEAD)", clone,
                    'test "$(git -C ../fledge rev-parse --short=12 HEAD)" = "$REVISION"',
                    f"mv ../fledge ../clone && ln -s {ROOT} ../fledge", test]:     # which is built already
        printed, status = shell.run(command)
        assert status == 0, f"$ {command}\n{printed}"
    counts = [ElementTree.parse(file).getroot().iter("testsuite") for file in tmp_path.glob(f"sat/{reports}")]
    assert sum(int(suite.get("tests")) for suites in counts for suite in suites) == 1


def test_fragments_of_python_call_what_there_is():
    """No test runs the fragments of missions; their modules and models exist, with these parameters."""
    calls, libraries = 0, {"fsw": fsw, "world": world}
    for page in [*(ROOT / "docs").glob("*.md"), *ROOT.glob("missions/**/README.md")]:
        for kind, file, text in BLOCK.findall(page.read_text(encoding="utf-8")):
            if kind != "python" or file:
                continue
            for node in ast.walk(ast.parse(text)):
                match node:
                    case ast.Attribute(value=ast.Name(id="fsw" | "world" as library), attr=name):
                        assert hasattr(libraries[library], name), f"{page.name}: {library}.{name}"
                    case ast.Call(func=ast.Attribute(value=ast.Name(id="fsw" | "world" as library), attr=name)):
                        taken, calls = inspect.signature(getattr(libraries[library], name)).parameters, calls + 1
                        wrong = {keyword.arg for keyword in node.keywords} - {None, *taken}
                        any_word = any(parameter.kind is parameter.VAR_KEYWORD for parameter in taken.values())
                        assert any_word or not wrong, f"{page.name}: {name}({wrong})"
    assert calls > 20


def rows(page, heading):
    """The two columns of each row of the table below a heading."""
    section = (ROOT / "docs" / page).read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    return re.findall(r"^\| (.*) \| (.*) \|$", section, re.M)[1:]


def test_what_stands_beside_the_names_of_others_exists():
    named = {name for heading in ("Modules", "What Fledge lacks") for _, here in rows("from-basilisk.md", heading)
             for name in re.findall(r"`([A-Z]\w+)`", here)}
    assert len(named) > 50 and not named - {*world.TYPES, *fsw.TYPES, "Sky"}


def test_attitude_has_what_stands_beside_the_functions_of_others():
    """Each expression of the table, by scipy's attitudes, of which rates are differences."""
    scipy = module("scipy.spatial.transform").Rotation
    first, then = scipy.from_rotvec([0.4, -0.9, 0.7]), scipy.from_rotvec([-1, 0.3, 0.2])
    w, x = np.array([0.3, 0.5, -0.4]), 0.3
    C, q, b, r = first.as_matrix().T, first.as_mrp(), np.roll(first.as_quat(), 1), first.as_rotvec()
    p, c, e = then.as_mrp(), np.roll(then.as_quat(), 1), {order: first.as_euler(order) for order in ("ZYX", "ZXZ")}

    def rate(of):
        return (of(first * scipy.from_rotvec(1e-5 * w)) - of(first * scipy.from_rotvec(-1e-5 * w))) / 2e-5

    expected = {
        "MRP2C": C, "C2MRP": q, "EP2C": C, "C2EP": b, "MRP2EP": b, "EP2MRP": q, "PRV2C": C, "C2PRV": r, "PRV2MRP": q,
        "MRP2PRV": r, "euler3212C": C, "C2Euler321": e["ZYX"], "euler3132C": C, "C2Euler313": e["ZXZ"],
        "euler3212MRP": q, "MRP2Euler321": e["ZYX"], "addMRP": (first * then).as_mrp(),
        "subMRP": (then.inv() * first).as_mrp(), "addEP": np.roll((first * then).as_quat(), 1), "MRPswitch": q,
        "dEP": rate(lambda turn: np.roll(turn.as_quat(), 1)), "dMRP": rate(lambda turn: turn.as_mrp()),
        "Mi": scipy.from_rotvec([0, 0, x]).as_matrix().T, "v3Tilde": np.cross(w, np.eye(3)).T}
    found = {}
    for there, here in rows("from-basilisk.md", "Attitudes in Python"):
        for name, expression in zip(re.findall(r"`(\w+)\(", there), re.findall(r"`([^`]+\(.*?)`", here), strict=True):
            given = dict(C=C, q=-q / (q @ q) if name == "MRPswitch" else q, p=p, b=b, c=c, r=r, w=w, x=x,
                         e=e["ZXZ" if "313" in name else "ZYX"])
            found[name] = eval(expression, flight_math.FUNCTIONS | vars(attitude) | given)
    np.testing.assert_allclose(found.pop("BmatMRP") @ w / 4, expected["dMRP"], atol=1e-9)
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, atol=1e-9, err_msg=name)


def test_the_law_of_the_cookbook_is_that_of_the_module():
    """In a loop with wheels about a reference that turns, with an integral and a known torque."""
    names = {}
    exec(next(text for _, file, text in BLOCK.findall((ROOT / "docs/cookbook.md").read_text(encoding="utf-8"))
              if file.endswith("law.py")), names)
    flown = []
    for given in {}, {"update": names["law"]}:
        sim = fledge.Simulation()
        f, w = sim.flight, sim.world
        f.vehicle = fsw.VehicleConfig(I_B=np.diag([8.0, 9.0, 11.0]))
        f.wheels = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.05)
        f.turn = fsw.EulerRotation(rates=[0.02, -0.01, 0.03])
        f.base, f.error, f.motor = fsw.InertialPointing(), fsw.TrackingError(), fsw.WheelTorques()
        f.law = fsw.MrpFeedback(K=1.0, P=4.0, K_I=0.05, **given)
        w.wheels = world.ReactionWheels(axes_B=fsw.PYRAMID, J=0.05, Omega=[100, -50, 80, 20])
        w.craft = world.Spacecraft(I_B=np.diag([8.0, 9.0, 11.0]), sigma_BN=[0.2, -0.1, 0.1], parts=[w.wheels],
                                   omega_BN_B=[0.1, -0.2, 0.1])
        w.nav = world.Navigation()
        w.connect(f.base.reference >> f.turn.base, f.turn.reference >> f.error.reference, f.error.error >> f.law.error,
                  f.vehicle.vehicle >> f.law.vehicle, f.wheels.wheels >> [f.law.wheels, f.motor.wheels],
                  f.law.torque >> f.motor.torque, f.motor.command >> w.wheels.command, w.craft.state >> w.nav.truth,
                  w.nav.attitude >> f.error.attitude, w.wheels.speeds >> f.law.speeds)
        sim.feed(f.law.external, torque_B=[0.01, -0.02, 0.03])
        f.task("gnc", every=0.5, run=[f.base, f.turn, f.error, f.law, f.motor])
        w.task("dynamics", every=0.1, run=[w.craft, w.nav])
        log = sim.record(f.law.torque, f.error.error, every=0.5)
        sim.run(60)
        flown.append(np.hstack([log["torque.torque_B"], log["error.sigma_BR"]]))
    np.testing.assert_allclose(flown[1], flown[0], atol=1e-12)
    assert np.abs(flown[0]).max() > 0.1


def test_help_has_equations_and_not_their_numbers_in_a_book():
    for name, kind in {**fsw.TYPES, **world.TYPES}.items():
        assert not re.search(r"\bEqs?\.", kind.__doc__), name


@pytest.mark.long("Sphinx writes all pages: two minutes")
@needs(*section("docs"))
def test_the_pages_and_the_reference_build_without_a_warning(tmp_path):
    printed, status = Shell(tmp_path).run("fledge docs")
    assert status == 0, printed
    text = (ROOT / "build/docs/html/build/docs/reference/flight-modules.html").read_text(encoding="utf-8")
    assert "gain on the MRP error" in text
    text = (ROOT / "build/docs/html/build/docs/reference/packets-earth_imager.html").read_text(encoding="utf-8")
    assert "flight.tracking.error" in text and "flight.station.contact.visible == 1" in text


@pytest.mark.parametrize("expected, printed, absent", [
    (["a", "c"], "a\nb\nc", None),
    (["c", "a"], "a\nb\nc", "a"),
    (["a", "..."], "a", "..."),
    (["x = 2.5..."], "x = 2.531", None),
    (["a ... c"], "a\nc", "a ... c"),
])
def test_what_is_missing_is_noticed(expected, printed, absent):
    assert missing(expected, printed) == absent


def test_a_change_that_does_not_fit_is_noticed():
    assert change("a\nb\nc\n", " a\n-b\n+x\n") == "a\nx\nc\n"
    with pytest.raises(AssertionError, match="0 times"):
        change("a\nb\n", "-c\n+d\n")
