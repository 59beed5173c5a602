# SPDX-License-Identifier: Apache-2.0
"""An installed Fledge needs nothing of this tree: not for flights, exports and projects, and not in a virtual
environment."""

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import fledge
from tests.tree import ROOT

PRESET = os.environ.get("FLEDGE_PRESET", "release")

# What a shell has that knows nothing of this tree.
CLEAN = {"PATH": "/usr/bin:/bin", "HOME": "/nonexistent", "LANG": "C.UTF-8"}


def run(*command, cwd, code=0, **environment):
    """What a command prints; it must end with the exit code."""
    done = subprocess.run(command, cwd=cwd, env={**CLEAN, **environment}, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT)
    assert done.returncode == code, done.stdout
    assert str(ROOT) not in done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """The prefix of `cmake --install`, moved after the install."""
    folder = tmp_path_factory.mktemp("install")
    subprocess.run(["cmake", "--install", f"build/{PRESET}", "--prefix", folder / "there"], cwd=ROOT, check=True,
                   stdout=subprocess.DEVNULL)
    return (folder / "there").rename(folder / "prefix")


def test_its_command_flies_a_mission(prefix, tmp_path):
    command = prefix / "bin/fledge"
    assert run(command, "--version", cwd=tmp_path) == f"fledge {fledge.__version__}\n"
    assert "flown    10 s" in run(command, "run", "nadir_spin", "--for", "10s", cwd=tmp_path)
    assert run(command, "exec", "python3", "-c", "import fledge; print(fledge.__file__)", cwd=tmp_path) == \
        f"{prefix}/lib/fledge/python/fledge/__init__.py\n"


def test_the_shells_find_its_completion(prefix, tmp_path):
    script = ('source "$1/share/bash-completion/completions/fledge"; cmp "$1/share/zsh/site-functions/_fledge" "$_"; '
              'COMP_LINE="$1/bin/fledge run nadir_s" COMP_POINT=99 _fledge; echo "${COMPREPLY[@]}"')
    assert run("bash", "-c", script, "bash", prefix, cwd=tmp_path) == "nadir_spin\n"


def test_a_python_of_its_prefix_imports_it(prefix, tmp_path):
    packages = prefix / "lib/python{0.major}.{0.minor}/site-packages".format(sys.version_info)
    program = ("import site, sys; site.addsitedir(sys.argv[1]); import fledge, fledge.emulator, fledge.prototype; "
               "print(fledge.emulator.Board.__name__)")
    assert run("/usr/bin/python3", "-c", program, packages, cwd=tmp_path) == "Board\n"


def test_it_has_the_flight_computer(prefix, tmp_path):
    emulator = prefix / "lib/fledge/emulator"
    (tmp_path / "text.elf").write_text("no program", encoding="utf-8")
    printed = run(emulator / "tools/fledge_leon3", emulator / "boards/leon3.toml", "text.elf", cwd=tmp_path, code=1)
    assert printed.startswith("fledge_leon3: text.elf: is not an ELF file, nor has it S-records; ")


def test_its_exported_c_compiles(prefix, tmp_path):
    run(prefix / "bin/fledge", "export", "c", "nadir_spin", "--out", "c", cwd=tmp_path)
    sources = sorted(map(str, (tmp_path / "c").rglob("*.c")))
    assert sources
    for source in sources:
        run("gcc", "-std=c99", "-c", "-I", "c", "-I", prefix / "lib/fledge", source, "-o", f"{source}.o", cwd=tmp_path)


def test_its_library_is_imported_from_its_folder(prefix, tmp_path):
    program = "import fledge; sim = fledge.load('nadir_spin'); sim.run(1); print(sim.time)"
    printed = run("/usr/bin/python3", "-c", program, cwd=tmp_path, PYTHONPATH=str(prefix / "lib/fledge/python"))
    assert float(printed) == 1


def test_a_project_is_built_with_it(prefix, tmp_path):
    command = prefix / "bin/fledge"
    run(command, "new", "project", "own", cwd=tmp_path)
    run(command, "--project", "own", "new", "module", "SunSlew", cwd=tmp_path)
    assert "SunSlew" in run(command, "--project", "own", "list", "--ports", cwd=tmp_path)
    run("cmake", "-S", "own", "-B", "by_hand", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}", "-DBUILD_TESTING=OFF",
        cwd=tmp_path)


def test_it_has_nothing_of_the_tests_and_no_path_of_this_tree(prefix):
    files = [path for path in (prefix / "lib/fledge").rglob("*") if path.is_file()]
    tests = [path for path in files if path.match("*_test.*") and "templates" not in path.parts]
    assert tests == []
    text = [path for path in files if path.suffix in {".cmake", ".py", ".pth", ".h", ".toml"}]
    assert [path for path in text if str(ROOT) in path.read_text(encoding="utf-8")] == []


# --- users who may only read ------------------------------------------------------------------------

@pytest.fixture
def own():
    """A folder of a user who may write nowhere else; the start of a command line that this user gives."""
    folder = Path(tempfile.mkdtemp(prefix="fledge-"))
    user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.getuid() == 0 else []
    if user:
        os.chown(folder, 65534, 65534)
    here = folder / "Größe 1/a folder"
    here.mkdir(parents=True)
    if user:
        for one in (here, here.parent):
            os.chown(one, 65534, 65534)
    yield here, user
    shutil.rmtree(folder)


def state(tree):
    return {path: path.lstat().st_mtime_ns for path in sorted(tree.rglob("*"))}


def uses(fledge_, cwd, user=()):
    """What a user does who has only this command: everything goes into the folder where the user stands."""
    link = cwd / "link"
    link.symlink_to(fledge_)
    (cwd / "random.py").write_text("1 / 0")     # no module of Python's

    def do(*arguments, code=0, cwd=cwd):
        return run(*user, link, *arguments, cwd=cwd, code=code, HOME=str(cwd))

    assert "flown    10 s" in do("run", "nadir_spin", "--for", "10s")
    assert (cwd / "runs/nadir_spin/free/run.mcap").exists()
    assert "nadir_spin" in do("list")
    assert "error_sigma_BR.png" in do("plot", "nadir_spin", "error.sigma_BR")
    assert "wiring.svg" in do("show", "nadir_spin")
    do("run", "nadir_spin", "--for", "10s", "--out", "my runs/ö")
    assert "identical" in do("compare", "nadir_spin", "my runs/ö")
    do("convert", "my runs/ö", "--csv", "--out", "tables")
    assert list((cwd / "tables").glob("*.csv"))
    do("montecarlo", "nadir_spin", "--runs", "2", "--out", "campaign")
    do("export", "c", "nadir_spin", "--out", "c")
    assert "none" in do("fly", "nadir_spin", "--for", "10s", "--on", "linux")
    do("new", "project", "sat")
    do("--project", "sat", "new", "module", "SunSlew")
    assert "SunSlew" in do("--project", "sat", "list")
    if user or os.getuid():
        said = do("run", "nadir_spin", "--for", "10s", cwd="/", code=2)
        assert said == "fledge: this user may not write or read /runs\n"
    (said,) = do("new", "mission", "scan", code=2).splitlines()
    assert said.startswith("fledge: new mission: there is no project here"), said


def test_a_user_who_may_only_read_it_flies(prefix, own):
    """The installation is as it was, also where other users run it."""
    folder, user = own
    shared = folder.parent.with_name(folder.parent.parent.name + "-prefix")
    shutil.copytree(prefix, shared, symlinks=True)
    try:
        subprocess.run(["chmod", "-R", "a-w,a+rX", shared], check=True)
        before = state(shared)
        uses(shared / "bin/fledge", folder, user)
        assert state(shared) == before
    finally:
        subprocess.run(["chmod", "-R", "u+w", shared], check=True)
        shutil.rmtree(shared)


def test_a_built_tree_that_cannot_be_written_flies(tmp_path):
    """It is mounted so that not even its owner writes."""
    inner = ("mount --bind \"$1\" \"$1\" && mount -o remount,bind,ro \"$1\" && cd \"$2\" && shift 2 && exec \"$@\"")
    enter = ["unshare", "--mount", *([] if os.getuid() == 0 else ["--map-root-user"]), "sh", "-c", inner, "sh", ROOT]
    if subprocess.run([*enter, tmp_path, "true"], capture_output=True).returncode:
        pytest.skip("this machine lets the user mount nothing")
    subprocess.run([ROOT / "fledge", "setup"], env={**os.environ, "FLEDGE_PRESET": PRESET}, check=True)
    done = subprocess.run([*enter, tmp_path, ROOT / "fledge", "--preset", PRESET, "run", "nadir_spin", "--for", "10s"],
                          capture_output=True, text=True)
    assert "flown    10 s" in done.stdout, done.stderr
    done = subprocess.run([*enter, tmp_path, ROOT / "fledge", "--preset", "never_built", "list"], capture_output=True,
                          text=True)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1 and f"fledge: {ROOT} must be built, and this user may not write into" in line


# --- pip, and virtual environments ------------------------------------------------------------------

@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """A virtual environment made from Debian's Python."""
    folder = tmp_path_factory.mktemp("environment") / "venv"
    subprocess.run(["/usr/bin/python3", "-m", "venv", "--system-site-packages", folder], check=True)
    return folder


@pytest.mark.parametrize("home, anew", [("{}", False), ("/another/place", True), (None, True)])
def test_pip_builds_a_copied_tree_anew(tmp_path, monkeypatch, home, anew):
    spec = importlib.util.spec_from_file_location("fledge_wheel", ROOT / "cmake/fledge_wheel.py")
    wheel = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(wheel)
    commands = []
    monkeypatch.setattr(wheel, "ROOT", tmp_path)
    monkeypatch.setattr(wheel.subprocess, "run", lambda command, **_: commands.append(command))
    if home:
        (tmp_path / "build/release").mkdir(parents=True)
        (tmp_path / "build/release/old.o").touch()
        (tmp_path / "build/release/CMakeCache.txt").write_text(
            f"CMAKE_HOME_DIRECTORY:INTERNAL={home.format(tmp_path)}\n")
    wheel.install(tmp_path / "prefix")
    assert (commands[0] == ["cmake", "--preset", "release", "-DBUILD_TESTING=OFF"]) == anew
    assert (tmp_path / "build/release/old.o").exists() != anew


def test_pip_installs_it_without_a_network(environment, tmp_path):
    subprocess.run([environment / "bin/pip", "install", "--quiet", "--no-index", ROOT], check=True)
    program = "import fledge; print(fledge.__file__, fledge.load('nadir_spin').name)"
    assert run(environment / "bin/python3", "-c", program, cwd=tmp_path) == \
        f"{environment}/lib/fledge/python/fledge/__init__.py nadir_spin\n"
    assert "nadir_spin" in run(environment / "bin/fledge", "list", cwd=tmp_path)
    run(environment / "bin/pip", "uninstall", "--yes", "fledge", cwd=tmp_path)
    assert not (environment / "bin/fledge").exists()
    assert [path for path in (environment / "lib/fledge").rglob("*") if path.suffix not in {"", ".pyc"}] == []


def test_the_launcher_keeps_an_active_environment(environment, tmp_path):
    active = {**os.environ, "VIRTUAL_ENV": str(environment), "PATH": f"{environment}/bin:{os.environ['PATH']}"}
    program = "import sys, fledge; fledge.load('nadir_spin'); print(sys.prefix)"
    done = subprocess.run([ROOT / "fledge", "exec", "python3", "-c", program], env=active, cwd=tmp_path,
                          capture_output=True, text=True, check=True)
    assert done.stdout == f"{environment}\n"
