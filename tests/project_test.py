# SPDX-License-Identifier: Apache-2.0
"""`fledge new` and `fledge --project`: a new project builds, passes its tests and flies, outside this
tree and without a change of it; an impossible request ends with a message."""

import os
import re
import shutil
import subprocess
import tomllib
from types import SimpleNamespace

import pytest

from fledge import SetupError, cli, folders, load, new, objects
from introspect.model import Struct
from tests.circles import long_after
from tests.needs import flies_on, needs, section
from tests.tree import ROOT, files


def fledge(*arguments, cwd, code=0):
    """The output of `./fledge ARGUMENTS`, which must end with the exit code."""
    environment = {name: value for name, value in os.environ.items() if name != "FLEDGE_PROJECT"}
    # Fledge, not the sanitizer, reports names that exist twice.
    environment["ASAN_OPTIONS"] = environment.get("ASAN_OPTIONS", "") + ":detect_odr_violation=0"
    done = subprocess.run([ROOT / "fledge", *arguments], cwd=cwd, env=environment, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == code, done.stdout
    return done.stdout


def replace(path, old, new_):
    text = path.read_text()
    assert text.count(old) == 1, f"{old!r} is {text.count(old)} times in {path}"
    path.write_text(text.replace(old, new_))


# Air of the project's own, as world/dynamics/drag.h feels it.
AIR = {
    "thin_air.h": """
#ifndef WORLD_THIN_AIR_H
#define WORLD_THIN_AIR_H
#include "world/msg/craft.h"
#include "world/msg/environment.h"

/** Air that becomes thinner by a factor e per scale height. */
typedef struct ThinAir {
    struct {
        CraftState truth;
    } in;
    struct {
        AirState air;
    } out;
    struct {
        double density;      ///< [kg/m^3] required, > 0: at 400 km
        double scale_height; ///< [m] required, > 0: of the density
    } par;
} ThinAir;
#endif
""",
    "thin_air_model.h": """
#pragma once
#include "world/environment/air_model.h"
#include "world/thin_air.h"

namespace big_bird {
class ThinAirModel final : public fledge::world::AirModel {
public:
    explicit ThinAirModel(ThinAir &interface) : AirModel(interface.in.truth, interface.out.air), par_(interface.par) {}
    bool has_temperature() const override { return false; }

private:
    State air(const Place &place) const override;
    Wind wind(const Place &) const override { return {}; }

    const decltype(ThinAir::par) &par_;
};
} // namespace big_bird
""",
    "thin_air_model.cpp": """
#include "world/thin_air_model.h"

fledge::world::AirModel::State big_bird::ThinAirModel::air(const Place &place) const
{
    State state;
    state.density = par_.density * fm_exp((400e3 - place.altitude) / par_.scale_height);
    return state;
}
""",
    "thin_air_model_test.cpp": """
#include "world/thin_air_model.h"
#include <gtest/gtest.h>

TEST(ThinAir, DoesNotKnowItsTemperature)
{
    ThinAir interface = {};
    EXPECT_FALSE(big_bird::ThinAirModel(interface).has_temperature());
}
"""}


# --- one project, with one of each -----------------------------------------------------------------

@pytest.mark.long("builds a project that fails")
def test_what_fails_to_build_is_shown_without_the_build(tmp_path):
    """A user sees the place and the reason first, for each kind of mistake. Folders have any names."""
    sat = tmp_path / "Größe 1/sat"
    sat.parent.mkdir()
    fledge("new", "project", "sat", cwd=sat.parent)
    fledge("new", "module", "Spin", "--kind", "determination", cwd=sat)
    fledge("new", "model", "Leak", cwd=sat)

    def shown(file, old, new_):
        before = (sat / file).read_text()
        replace(sat / file, old, new_)
        output = fledge("list", cwd=sat, code=1).splitlines()
        (sat / file).write_text(before)
        start = next(i for i, line in enumerate(output) if line.startswith("fledge: the build failed; the whole log"))
        assert len(output) - start < 12 and not any("FAILED" in line or "/usr/bin" in line for line in output)
        return " ".join(output[start + 1:start + 3])

    assert re.match(rf"{sat}/flight/spin.h:\d+: a number has a unit; `T` has none",
                    shown("flight/spin.h", "///< [s] ", "/// "))
    assert re.match(rf"{sat}/flight/spin.c:\d+:\d+: error: expected .;. before",
                    shown("flight/spin.c", "memset(&m->out, 0, sizeof m->out);", "memset(&m->out, 0, sizeof m->out)"))
    assert re.match(rf"{sat}/flight/spin.c:12: spin_reset calls sin of libm, whose last bits differ between machines; "
                    "use fm_sin of flight/math/elementary.h; C that never flies stands below NOT_FLOWN",
                    shown("flight/spin.c", "    memset(&m->mem, 0, sizeof m->mem);",
                          "    double sin(double);\n    m->mem.omega_BN_B.v[0] = sin(m->par.T);"))
    (sat / "note.c").write_text("#include <stdio.h>\nvoid note(void)\n{\n    puts(\"x\");\n}\n")
    assert re.match(rf"{sat}/note.c:4: note refers to puts, which is neither flight code nor in flight/math",
                    shown("CMakeLists.txt", "    WORLD\n", "    EXISTING\n        note.c\n    WORLD\n"))
    replace(sat / "CMakeLists.txt", "    WORLD\n", "    NOT_FLOWN\n        note.c\n    WORLD\n")
    fledge("list", cwd=sat)
    assert re.match(rf"{sat}/world/leak_model.cpp:\d+:\d+: error: .nothing. ",
                    shown("world/leak_model.cpp", "namespace sat {", "namespace sat {\nint x = nothing;"))
    assert re.match("CMake Error at CMakeLists.txt:8: +Parse error",
                    shown("CMakeLists.txt", "        world/leak\n)", "        world/leak\n"))


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A project with a module, three models, and a mission that flies them."""
    place = tmp_path_factory.mktemp("own")
    fledge("new", "project", "big-bird", cwd=place)
    for words in (["module", "navigation/RateSmoother", "--kind", "determination"], ["model", "GasLeak"],
                  ["model", "RateMeter", "--kind", "sensing"], ["mission", "FirstScan"]):
        fledge("--project", "big-bird", "new", *words, cwd=place)
    for name, text in AIR.items():
        (place / "big-bird/world" / name).write_text(text)
    replace(place / "big-bird/CMakeLists.txt", "    WORLD\n", "    WORLD\n        world/thin_air\n")
    mission = place / "big-bird/missions/first_scan"
    replace(mission / "flight.py", "    f.motor    = ", "    f.smoother = fsw.RateSmoother(T=1 * s)\n    f.motor    = ")
    replace(mission / "flight.py", "        f.guidance.reference >> ",
            "        f.smoother.attitude >> f.tracking.attitude,\n        f.guidance.reference >> ")
    replace(mission / "flight.py", "run=[f.guidance,", "run=[f.smoother, f.guidance,")
    replace(mission / "world.py", "    w.nav    = ", "    w.leak   = world.GasLeak(damping=1e-4 * N * m * s)\n"
            "    w.meter  = world.RateMeter(noise=1e-4 * rad / s)\n"
            "    w.air    = world.ThinAir(body=world.EARTH, density=3e-12 * kg / m**3, scale_height=50 * km)\n"
            "    w.drag   = world.Drag(air=w.air, Cd=2.2, area=1 * m**2)\n"
            "    w.craft.parts, w.craft.mass = [w.drag], 100 * kg\n"
            "    w.nav    = ")
    replace(mission / "world.py", "        # what flight sees\n",
            "        w.craft.state >> [w.leak.truth, w.meter.truth, w.air.truth],\n"
            "        w.leak.load >> w.craft.external,\n")
    replace(mission / "world.py", ">> f.tracking.attitude", ">> f.smoother.measured")
    replace(mission / "world.py", "[w.craft, w.nav]", "[w.craft, w.leak, w.meter, w.air, w.nav]")
    return place / "big-bird"


@pytest.mark.long("builds and tests a project: 20 s")
def test_its_tests_pass(own):
    output = fledge("--project", own, "test", cwd=own)
    assert output.splitlines()[-1] == "7 passed, 0 failed, 0 skipped"
    assert fledge("--project", own, "test", "-k", "RateSmoother", cwd=own).splitlines()[-1].startswith("2 passed")


def test_its_mission_flies_with_its_module_and_its_model(own):
    output = fledge("--project", own, "run", "first_scan", cwd=own)
    assert "passed" in output and (own / "runs/first_scan/acquire/run.mcap").exists()
    output = fledge("--project", own, "list", "--ports", cwd=own)
    for expected in ("first_scan", "nadir_spin", "RateSmoother", ">> attitude      NavAttitude", "GasLeak"):
        assert expected in output


@pytest.mark.long("builds and flies on a target")
def test_it_flies_on_a_target_too(own):
    """Its module is compiled from its source, beside Fledge's; its model stays in the world."""
    output = fledge("--project", own, "fly", "first_scan", "--for", "60s", "--on", "linux,cfs", cwd=own)
    rows = {line.split()[0]: line.split() for line in output.splitlines() if line.startswith("  ")}
    for target in ("linux", "cfs"):
        assert rows[target][1:4] == ["121", rows["desktop"][2], "none"]


SCRIPT = """
import math

import fledge
from fledge import SetupError, flight as fsw, world

sim = fledge.load("first_scan", seed=3)
sim.run(30)
there, clone = sim.snapshot(), sim.clone()
sim.run(60)
clone.run(60)
assert clone.snapshot() == sim.snapshot() != there
sim.restore(there)
sim.run(60)
assert clone.snapshot() == sim.snapshot()
assert abs(sim.world.leak.load.torque_B).max() > 0
air, drag = sim.world.air, sim.world.drag
assert air.body.mu == world.EARTH.mu and air.sky is None
wind = [a - b for a, b in zip(air.air.v_AN_N, sim.world.craft.state.v_BN_N)]
pressure = 0.5 * 3e-12 * math.exp((400e3 - air.air.altitude) / 50e3) * sum(x * x for x in wind)
assert abs(math.dist(drag.load.force_B, (0, 0, 0)) / (2.2 * pressure) - 1) < 1e-3
assert "RateSmoother" in dir(fsw) and "RateSmoother" not in dir(world) and "GasLeak" not in dir(fsw)
try:
    fsw.RateSmoother(T=-1)
except SetupError as error:
    print(error)
"""


def test_its_objects_are_like_ours(own):
    """Snapshots and clones hold a model's own memory, and parameters are checked by the header."""
    output = fledge("--project", own, "exec", "/usr/bin/python3", "-c", SCRIPT, cwd=own)
    assert output.splitlines()[-1] == "RateSmoother.T must be > 0 s, found -1 s"
    stubs = own / "build" / os.environ.get("FLEDGE_PRESET", "release") / "stubs"
    assert "class RateSmoother(Module):" in (stubs / "_project_flight.pyi").read_text()
    assert "class GasLeak(Model):" in (stubs / "_project_world.pyi").read_text()


@pytest.mark.long("mypy reads the types of all of Fledge: a minute")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="editors read the release build")
@needs("mypy")
def test_an_editor_finds_the_types_of_its_modules(own):
    """Checkers read pyproject.toml, as `fledge new project` wrote it: mypy as an editor runs it, for one file."""
    def checked():
        done = subprocess.run(["/usr/bin/mypy", "--cache-dir", own / "build/.mypy_cache", flight, mission / "study.py"],
                              cwd=own, capture_output=True, text=True)
        return [line for line in done.stdout.splitlines() if ": error:" in line or "Revealed type" in line]

    mission = own / "missions/first_scan"
    flight = mission / "flight.py"
    (mission / "study.py").write_text(
        "import fledge\nfrom fledge import flight as fsw, world\nfrom fledge.units import s\n"
        "reveal_type(fsw.RateSmoother(T=1 * s).attitude)\nreveal_type(world.GasLeak)\n"
        "reveal_type(fledge.load('first_scan'))\n")
    kinds = ["_fledge_flight.NavAttitude", "_project_world.GasLeak", "fledge.mission.simulation.Simulation"]
    lines = checked()
    assert [kind in line for kind, line in zip(kinds, lines)] == [True, True, True] and len(lines) == 3
    replace(flight, "fsw.RateSmoother(T=", "fsw.RateSmoother(Tau=")
    (error,) = [line for line in checked() if "error" in line]
    assert 'missions/first_scan/flight.py' in error and 'Unexpected keyword argument "Tau" for "RateSmoother"' in error
    replace(flight, "fsw.RateSmoother(Tau=", "fsw.RateSmoother(T=")
    (mission / "study.py").unlink()
    assert (own / "build/release/compile_commands.json").exists()       # for .clangd


@pytest.mark.long("Sphinx writes the documents of a project")
@needs(*section("docs"))
def test_its_documents_have_its_modules_and_models(own):
    pages = own / "build/docs/html"
    output = fledge("docs", cwd=own)      # a long command shows its progress
    assert output.endswith(f"fledge: open {pages}/index.html\n") and "WARNING" not in output
    assert "build/docs/reference/index.html" in (pages / "index.html").read_text()
    modules = (pages / "build/docs/reference/big_bird-modules.html").read_text()
    assert 'id="ratesmoother"' in modules and "time constant" in modules
    assert 'href="flight-messages.html#c-navattitude"' in modules
    (own / "docs").mkdir()
    (own / "README.md").write_text("# Big bird\n\nIt scans: [how](docs/how.md), [what](nowhere.md).\n")
    (own / "docs/how.md").write_text("# How\n")
    assert "README.md:3: WARNING: 'myst' reference target not found: nowhere.md" in fledge("docs", cwd=own)
    assert 'url=README.html' in (pages / "index.html").read_text()
    assert 'href="docs/how.html"' in (pages / "README.html").read_text()


def test_by_hand_it_is_a_cmake_package(own, tmp_path):
    build = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release")
    subprocess.run(["cmake", "-S", own, "-B", tmp_path, "-G", "Ninja", f"-DFledge_DIR={build}",
                    "-DBUILD_TESTING=OFF"], check=True, capture_output=True)
    flags = (tmp_path / "build.ninja").read_text()
    assert "-ffp-contract=off" in flags and "-O" in flags


def test_nothing_was_built_into_this_tree(own):
    assert not any("rate_smoother" in str(path) for path in files())


# --- kinds of modules and models -------------------------------------------------------------------

KINDS = [(what, kind) for what, kinds in tomllib.loads((new.TEMPLATES / "kinds.toml").read_text()).items()
         for kind in kinds]


@pytest.mark.long("builds and tests a project: a minute")
def test_each_kind_builds_without_a_warning_and_passes_its_test(tmp_path):
    fledge("new", "project", "kinds", cwd=tmp_path)
    for what, kind in KINDS:
        new_of_kind(what, kind, tmp_path / "kinds")
    assert re.match(r"1[4-9] passed, 0 failed, 0 skipped$", fledge("test", cwd=tmp_path / "kinds").splitlines()[-1])


def new_of_kind(what, kind, project):
    """Its files, for a name that has the kind in it."""
    return getattr(new, what)(f"Sun{kind.title()}{what.title()}", project, kind=kind)[0][:-1]


@pytest.mark.parametrize("what, kind", KINDS)
def test_what_each_kind_begins_with_is_formatted_and_compiles(what, kind, tmp_path):
    new.project(tmp_path / "sat")
    for file in new_of_kind(what, kind, tmp_path / "sat"):
        text = file.read_text()
        assert "$" not in text
        formatted = subprocess.run(["clang-format", f"--style=file:{ROOT}/.clang-format", file], check=True, text=True,
                                   capture_output=True).stdout
        assert formatted == text, file.name
        if file.suffix == ".c":
            subprocess.run(["cc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-I", ROOT,
                            "-I", tmp_path / "sat", file], check=True)


def test_a_kind_is_that_of_its_folder_and_bare_elsewhere(tmp_path):
    new.project(tmp_path)
    for name, message in (("guidance/One", "AttReference"), ("rate/control/Two", "BodyTorque"), ("Three", "GyroRate")):
        file = new.module(name, tmp_path)[0][0]
        assert f"        {message} " in file.read_text()
    assert "GyroRate rate;" in new.module("guidance/Four", tmp_path, kind="bare")[0][0].read_text()
    assert "GyroRate rate;" in new.model("sensing/Five", tmp_path)[0][0].read_text()
    with pytest.raises(new.NewError, match="there is no model of the kind guidance; there are bare, sensing"):
        new.model("Six", tmp_path, kind="guidance")


def test_options_that_do_not_fit_are_refused(tmp_path, capsys):
    new.project(tmp_path)
    for words, complaint in [(["mission", "one", "--bare"], "new: --kind and --bare are for a module or model"),
                             (["project", "one", "--from", "cubesat"], "--from is for a module, model or mission")]:
        assert cli.main(["new", *words, "--project", str(tmp_path)]) == 2
        assert complaint in capsys.readouterr().err
    for words in (["--bare", "--kind", "control"], ["--kind", "guidanse"], ["--bare", "--from", "a.py:B"]):
        with pytest.raises(SystemExit):
            cli.main(["new", "module", "One", *words])


# --- a mission of another's ------------------------------------------------------------------------

MISSIONS = dict.fromkeys(["cubesat", "asterisk_scan", "formation", *(
    name for name, folder in folders.missions().items() if folder.parent == ROOT / "missions")])


@pytest.mark.parametrize("name", long_after(3, MISSIONS, "flies each mission: 15 s"))
def test_a_copy_of_a_mission_flies_with_the_same_bits(name, tmp_path):
    """By its files alone, and those of the missions that it imports from: no file speaks of the old name as its own."""
    new.project(tmp_path)
    new.mission(f"{name}_2", tmp_path, name)
    folder, flown = tmp_path / "missions" / f"{name}_2", []
    for source in (name, folder):
        sim = load(source)
        sim.run(2)
        flown.append(sim.snapshot())
    assert flown[0] == flown[1] and sim.name == f"{name}_2"
    assert {path.name.replace(f"{name}_2", name) for path in folder.rglob("*") if path.is_file()} == {
        path.name for path in (ROOT / "missions" / name).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.name != "README.md"}
    for file in folder.rglob("*.toml"):
        assert f'"{name}"' not in file.read_text() and f"missions/{name}/" not in file.read_text()
    for file in folder.rglob("*_test.py"):
        assert not re.search(rf'load\("{name}"|"fly", "{name}"|missions[./]{name}\b', file.read_text())


@pytest.mark.long("builds a project and flies on targets")
@flies_on("leon3")
def test_a_copy_of_the_cubesat_flies_on_a_target_and_passes_its_tests(tmp_path):
    fledge("new", "project", "sat", cwd=tmp_path)
    fledge("new", "mission", "my_cube", "--from", "cubesat", cwd=tmp_path / "sat")
    output = fledge("fly", "my_cube", "imaging", "--on", "linux,leon3", "--for", "60s", cwd=tmp_path / "sat")
    assert "passed   desktop, linux, leon3" in output
    output = fledge("test", cwd=tmp_path / "sat")
    assert " deselected" in output and re.search(r"^1\d passed, 0 failed, 0 skipped$", output, re.M)


def test_files_that_a_mission_shares_are_found_from_its_copy(tmp_path):
    """In the same project by the same path, in another by a longer one. Data need not be text."""
    for project in ("one", "two"):
        new.project(tmp_path / project)
    first = tmp_path / "one/missions/first"
    new.mission("first", tmp_path / "one")
    (first / "table.bin").write_bytes(b"\xff\x00")
    (first.parent / "field.csv").write_text("1\n")
    (first / "sky.py").write_text("FIELD = '../field.csv'\nRUNS = '../../runs/first'\n")
    for source, project in (("first", "one"), (str(first), "two")):
        (first / "first_test.py").unlink(missing_ok=True)       # then it gets one that flies all scenarios
        new.mission("second", tmp_path / project, source)
        second = tmp_path / project / "missions/second"
        text = (second / "sky.py").read_text()
        assert (second / re.search("FIELD = '(.*)'", text)[1]).read_text() == "1\n"
        assert ("'../field.csv'" in text) == (project == "one") and "RUNS = '../../runs/second'" in text
        assert (second / "table.bin").read_bytes() == b"\xff\x00" and (second / "second_test.py").exists()


@pytest.mark.parametrize("name, source, answer", [
    ("mine", "cubsat", "--from cubsat: there is no such mission; did you mean 'cubesat'\\? there are .*nadir_spin"),
    ("mine", ".", "--from .: a mission is a folder with a flight.py or a mission.py"),
    ("there", "cubesat", "missions/there is there already"),
    ("nadir_spin", "cubesat", "missions/nadir_spin has this name, and would be hidden; choose another name"),
    ("nadir_spin", None, "missions/nadir_spin has this name"),
    ("mine", "OTHER/missions/flies", r"flies: it flies Own of the project .*other; first copy flight/own.\*"),
    ("mine", "OTHER/missions/joins", "joins: it imports from the mission flies beside it; copy that first"),
    ("mine", "OTHER/missions/broken", "missions/broken/flight.py, line 1: "),
])
def test_a_mission_that_could_not_fly_is_not_copied(name, source, answer, tmp_path):
    other = tmp_path / "other"
    for project in (other, tmp_path / "here"):
        new.project(project)
    new.module("Own", other)
    new.mission("there", tmp_path / "here")
    for mission, text in (("flies", "def build(f):\n    f.own = fsw.Own()\n"), ("broken", "def build(f:\n"),
                          ("joins", "from .flies.flight import build\n")):
        new.mission(mission, other)
        (other / "missions" / mission / "flight.py").write_text(text)
    before = sorted(files(tmp_path))
    with pytest.raises(new.NewError, match=answer):
        new.mission(name, tmp_path / "here", source and source.replace("OTHER", str(other)))
    assert sorted(files(tmp_path)) == before
    assert new.mission("again", other, str(other / "missions/flies"))[0]


# --- refused requests ------------------------------------------------------------------------------

@pytest.mark.long("configures a project several times")
def test_names_that_are_ours_and_sources_that_are_not_there(tmp_path):
    fledge("new", "project", "bad", cwd=tmp_path)
    for name in ("One", "Two"):
        fledge("--project", "bad", "new", "module", name, cwd=tmp_path)
    for path in (tmp_path / "bad/flight").glob("*_test.cpp"):       # a module need not have a test
        assert ", 0 failed, " in fledge("--project", "bad", "test", "-k", path.stem, cwd=tmp_path)
        path.unlink()
    fledge("--project", "bad", "list", cwd=tmp_path)
    cmake = tmp_path / "bad/CMakeLists.txt"
    replace(cmake, "        flight/two\n", "")
    output = fledge("--project", "bad", "list", cwd=tmp_path, code=1)
    assert re.search(r"failed; the whole log is .*\n/.*/bad/flight/two.h:10: CMake compiles every module; it does not "
                     r"compile flight/two.c; add flight/two below FLIGHT in fledge_project\(\) of CMakeLists.txt",
                     output)

    (tmp_path / "bad/flight/two.c").unlink()
    output = fledge("--project", "bad", "list", cwd=tmp_path, code=2)
    assert re.search(r"cannot load the library .*libbad.so: .*undefined symbol: two_\w+; do its sources", output)

    for path in (tmp_path / "bad/flight").glob("two*"):
        path.unlink()
    replace(cmake, "        flight/one\n", "")
    output = fledge("--project", "bad", "exec", "/usr/bin/python3", "-c", "from fledge.flight import One", cwd=tmp_path,
                    code=1)
    assert output.splitlines()[-1].endswith(
        f"SetupError: there is no One: flight/one.h exists, but {cmake} does not list it: "
        "add flight/one below FLIGHT in fledge_project()")
    replace(cmake, "    FLIGHT\n", "    FLIGHT\n        flight/one\n        flight/won\n")
    words = fledge("--project", "bad", "list", cwd=tmp_path, code=1).split()
    assert "CMakeLists.txt lists flight/won.c in fledge_project(), and there is no such file" in " ".join(words)
    replace(cmake, "        flight/won\n", "")

    for path in (tmp_path / "bad/flight").glob("one*"):
        path.write_text(path.read_text().replace("one_", "hill_pointing_").replace("One", "HillPointing"))
    output = fledge("--project", "bad", "list", cwd=tmp_path, code=2)
    assert ("the library bad declares HillPointing, and so does flight/guidance/hill_pointing.h of Fledge: "
            "rename it") in output


def test_a_project_that_is_none(tmp_path):
    assert "there is no project in nowhere" in fledge("--project", "nowhere", "list", cwd=tmp_path, code=1)
    output = fledge("--project", tmp_path, "list", cwd=tmp_path, code=1)
    assert f"(no CMakeLists.txt); './fledge new project {tmp_path}' makes one" in output


def test_a_library_of_other_models_is_refused(tmp_path):
    (tmp_path / "old.c").write_text("""
        #include "sim/table.h"
        const FledgeLibrary fledge_library_old = {FLEDGE_TABLE_VERSION, "old", 0, 0};
        const struct { uint32_t version, n; const void *types; } fledge_models_old = {99, 0, 0};
        """)
    subprocess.run(["gcc", "-shared", "-fPIC", "-I", ROOT, "-o", tmp_path / "old.so", tmp_path / "old.c"], check=True)
    with pytest.raises(SetupError, match="old was built for version 99 of the models, this is version 3"):
        objects.load_library(str(tmp_path / "old.so"), "old")


@pytest.mark.parametrize("kind, name, answer", [
    ("module", "sun_slew", "a module's name is CamelCase, of letters and digits, such as SunSlew; found"),
    ("module", "Sun Slew", "a module's name is CamelCase"),
    ("module", "Class", "'class' is a keyword of C or C\\+\\+"),
    ("module", "Lambda", "'lambda' is a keyword of Python"),
    ("module", "MrpFeedback", "MrpFeedback is declared in .*flight/control/mrp_feedback.h already"),
    ("module", "MRPFeedback", "MrpFeedback is declared in"),
    ("module", "Here", "Here is declared in .*flight/here.h already"),
    ("module", "Guidance/SunSlew", "folders in flight/ are in small letters; found 'Guidance'"),
    ("model", "CraftState", "CraftState is declared in .*world/msg/craft.h already"),
    ("model", "Here", "Here is declared in"),
    ("mission", "import", "'import' is a keyword of Python"),
    ("mission", "3x", "a mission's name is of small letters, digits and _, such as first_light; found '3x'"),
    ("mission", "there", "missions/there is there already"),
])
def test_names_are_checked_before_anything_is_written(tmp_path, kind, name, answer):
    new.project(tmp_path / "here")
    new.module("Here", tmp_path / "here")
    new.mission("There", tmp_path / "here")
    before = {path: (tmp_path / path).read_bytes() for path in files(tmp_path)}
    with pytest.raises(new.NewError, match=answer):
        getattr(new, kind)(name, tmp_path / "here")
    assert before == {path: (tmp_path / path).read_bytes() for path in files(tmp_path)}


@pytest.mark.parametrize("folder, answer", [
    ("world", "the name world is Fledge's or CMake's own"),
    ("fledge-mine", "the name fledge_mine is Fledge's or CMake's own"),
    ("new", "'new' is a keyword of C or C\\+\\+"),
    ("2nd", "a project's folder is named with letters, digits, _ and -; found '2nd'"),
    ("there", "CMakeLists.txt is there already, and stays as it is"),
])
def test_projects_are_checked_too(tmp_path, folder, answer):
    new.project(tmp_path / "there")
    with pytest.raises(new.NewError, match=answer):
        new.project(tmp_path / folder)


@pytest.mark.parametrize("bad", '"#;\\\n')
def test_a_path_in_which_cmake_builds_nothing_is_refused(tmp_path, bad):
    place = tmp_path / f"a{bad}b"
    with pytest.raises(new.NewError, match=re.escape(f"CMake builds nothing in a path with {bad!r}; choose another")):
        new.project(place / "sat")
    new.project(tmp_path / "sat")
    place.mkdir()
    (tmp_path / "sat").rename(place / "sat")
    output = fledge("list", cwd=place / "sat", code=1)
    assert f"CMake builds nothing in a path with {bad!r}; move it to another folder\n" in output
    assert not (place / "sat/build").exists()


def test_files_are_never_overwritten_and_a_list_that_is_not_found_is_reported(tmp_path):
    new.project(tmp_path / "p")
    (tmp_path / "p/flight/spin.c").write_text("mine\n")
    cmake = tmp_path / "p/CMakeLists.txt"
    cmake.write_bytes(cmake.read_bytes() + b"# gr\xfcn\n")     # in any encoding
    new.module("Other", tmp_path / "p")
    assert b"flight/other" in cmake.read_bytes() and cmake.read_bytes().endswith(b"# gr\xfcn\n")
    cmake.write_bytes(cmake.read_bytes().replace(b"\xfc", b"ue"))
    with pytest.raises(new.NewError, match="flight/spin.c is there already, and stays as it is"):
        new.module("Spin", tmp_path / "p")
    assert (tmp_path / "p/flight/spin.c").read_text() == "mine\n" and not (tmp_path / "p/flight/spin.h").exists()

    replace(tmp_path / "p/CMakeLists.txt", "    FLIGHT\n", "")
    with pytest.raises(new.NewError, match="cannot find a line FLIGHT in fledge_project.., for flight/turn"):
        new.module("Turn", tmp_path / "p")
    with pytest.raises(new.NewError, match="there is no .*CMakeLists.txt; './fledge new project' makes one"):
        new.module("Turn", tmp_path / "nowhere")


# --- Fledge's own ----------------------------------------------------------------------------------

def added(before, after):
    """The lines that are new; all others must be there, in their order."""
    new_lines, rest = [], iter(after.splitlines())
    for line in before.splitlines():
        for other in rest:
            if other == line:
                break
            new_lines.append(other)
        else:
            raise AssertionError(f"lost: {line}")
    return new_lines + list(rest)


def test_within_fledge_lines_go_where_their_neighbours_are(tmp_path, monkeypatch):
    for file in ("CMakeLists.txt", "flight/CMakeLists.txt", "world/CMakeLists.txt"):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    monkeypatch.setattr(new, "FLEDGE", tmp_path)
    with pytest.raises(new.NewError, match="there is no project here; '.*fledge new project NAME' makes one"):
        new.module("guidance/SunSlew")
    monkeypatch.chdir(tmp_path / "flight")
    before = (tmp_path / "flight/CMakeLists.txt").read_text()
    new.module("guidance/SunSlew")
    new.module("payload/Shutter")
    after = (tmp_path / "flight/CMakeLists.txt").read_text()
    assert added(before, after) == ["flight_module(guidance/sun_slew)", "flight_module(payload/shutter)"]
    assert re.search(r"flight_module\(guidance/\w+\)\nflight_module\(guidance/sun_slew\)\n", after)
    header = (tmp_path / "flight/guidance/sun_slew.h").read_text()
    assert "#ifndef FLIGHT_GUIDANCE_SUN_SLEW_H" in header and "void sun_slew_update(SunSlew *m, Tick t);" in header

    before = (tmp_path / "world/CMakeLists.txt").read_text()
    new.model("GasLeak")
    assert added(before, (tmp_path / "world/CMakeLists.txt").read_text()) == [
        "    dynamics/gas_leak_model.cpp",
        "fledge_add_test(world_dynamics_gas_leak_test",
        "    SOURCES dynamics/gas_leak_model_test.cpp LIBRARIES fledge::world)"]
    assert "namespace fledge::world {" in (tmp_path / "world/dynamics/gas_leak_model.cpp").read_text()


def test_it_says_how_to_go_on_from_where_the_user_stands(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(ROOT))
    assert new.project(tmp_path / "p")[1].endswith(f"elsewhere, fledge --project {tmp_path}/p COMMAND")
    assert new.mission("Scan", tmp_path / "p")[1] == "Fly it: fledge run scan"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert new.module("Spin", tmp_path / "p")[1].endswith(f"Its test: {ROOT}/fledge test -k Spin")


@pytest.mark.parametrize("name", ["MrpFeedback", "J2Gravity", "HTTPServer", "X", "SPKFile2", "A1b2C3"])
def test_functions_are_named_as_the_reader_wants_them(name):
    assert new.snake(name) == Struct.snake_name.fget(SimpleNamespace(name=name))
