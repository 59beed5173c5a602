# SPDX-License-Identifier: Apache-2.0
"""An installed Fledge needs nothing of this tree: not for flights, exports and projects, and not in a virtual
environment; nor do its packages."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from pathlib import Path

import pytest

import fledge
from fledge.scene import bundle
from tests.needs import needs, skip_without
from tests.tree import ROOT

sys.path.insert(0, str(ROOT / "cmake"))
import fledge_deb  # noqa: E402
import fledge_wheel  # noqa: E402

PRESET = os.environ.get("FLEDGE_PRESET", "release")

# The environment of a shell outside this tree.
CLEAN = {"PATH": "/usr/bin:/bin", "HOME": "/nonexistent", "LANG": "C.UTF-8"}


def run(*command, cwd, code=0, **environment):
    """The output of a command; it must end with the exit code."""
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
    assert "flown    10 s" in run(command, "run", "cubesat", "--for", "10s", cwd=tmp_path)     # with WMM2025
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


@pytest.mark.long("builds a project")
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


# --- users with read access only --------------------------------------------------------------------

@pytest.fixture
def own():
    """(a folder, the start of a command that runs as a user): the user can write only into this folder."""
    folder = Path(tempfile.mkdtemp(prefix="fledge-"))
    user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.getuid() == 0 else []
    if user:
        os.chown(folder, 65534, 65534)
    here = folder / "Größe 1/a folder"
    here.mkdir(parents=True)
    if user:
        for path in (here, here.parent):
            os.chown(path, 65534, 65534)
    yield here, user
    shutil.rmtree(folder)


def state(tree):
    return {path: path.lstat().st_mtime_ns for path in sorted(tree.rglob("*"))}


def uses(fledge_, cwd, user=()):
    """Work as a user that has only this command; all files are written into the current folder."""
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
        output = do("run", "nadir_spin", "--for", "10s", cwd="/", code=2)
        assert output == "fledge: this user may not write or read /runs\n"
    (output,) = do("new", "mission", "scan", code=2).splitlines()
    assert output.startswith("fledge: new mission: there is no project here"), output


@pytest.mark.long("copies the installed tree for another user")
def test_a_user_with_read_access_flies(prefix, own):
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
    skip_without("python3-venv")
    folder = tmp_path_factory.mktemp("environment") / "venv"
    subprocess.run(["/usr/bin/python3", "-m", "venv", "--system-site-packages", folder], check=True)
    return folder


@pytest.mark.parametrize("home, anew", [("{}", False), ("/another/place", True), (None, True)])
def test_pip_builds_a_copied_tree_anew(tmp_path, monkeypatch, home, anew):
    commands = []
    monkeypatch.setattr(fledge_wheel, "ROOT", tmp_path)
    monkeypatch.setattr(fledge_wheel.subprocess, "run", lambda command, **_: commands.append(command))
    if home:
        (tmp_path / "build/release").mkdir(parents=True)
        (tmp_path / "build/release/old.o").touch()
        (tmp_path / "build/release/CMakeCache.txt").write_text(
            f"CMAKE_HOME_DIRECTORY:INTERNAL={home.format(tmp_path)}\n")
    fledge_wheel.install(tmp_path / "prefix")
    assert (commands[0] == ["cmake", "--preset", "release", "-DBUILD_TESTING=OFF"]) == anew
    assert (tmp_path / "build/release/old.o").exists() != anew


@pytest.mark.long("pip builds and installs the package")
def test_pip_installs_it_without_a_network(environment, tmp_path):
    subprocess.run([environment / "bin/pip", "install", "--quiet", "--no-index", ROOT], check=True)
    program = "import fledge; print(fledge.__file__, fledge.load('nadir_spin').name)"
    assert run(environment / "bin/python3", "-c", program, cwd=tmp_path) == \
        f"{environment}/lib/fledge/python/fledge/__init__.py nadir_spin\n"
    assert "nadir_spin" in run(environment / "bin/fledge", "list", cwd=tmp_path)
    run(environment / "bin/pip", "uninstall", "--yes", "fledge", cwd=tmp_path)
    assert not (environment / "bin/fledge").exists()
    assert [path for path in (environment / "lib/fledge").rglob("*") if path.suffix not in {"", ".pyc"}] == []


@pytest.mark.long("pip builds and installs the package")
def test_the_launcher_keeps_an_active_environment(environment, tmp_path):
    active = {**os.environ, "VIRTUAL_ENV": str(environment), "PATH": f"{environment}/bin:{os.environ['PATH']}"}
    program = "import sys, fledge; fledge.load('nadir_spin'); print(sys.prefix)"
    done = subprocess.run([ROOT / "fledge", "exec", "python3", "-c", program], env=active, cwd=tmp_path,
                          capture_output=True, text=True, check=True)
    assert done.stdout == f"{environment}\n"


# --- packages ---------------------------------------------------------------------------------------

VIEWER = "lib/fledge/python/fledge/scene/view/view.js"


@pytest.fixture(scope="module")
def wheel(prefix, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    fledge_wheel.compile_python(prefix / "lib/fledge")
    return folder / fledge_wheel.pack(prefix, folder)


@pytest.fixture(scope="module")
def deb(prefix, tmp_path_factory):
    folder = tmp_path_factory.mktemp("deb")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DPKG_DEB_COMPRESSOR_TYPE", "none")
        return folder / fledge_deb.pack(prefix, folder)


def test_a_package_that_is_not_finished_leaves_no_file(tmp_path, monkeypatch):
    prefix, folder, begun = tmp_path / "prefix", tmp_path / "packages", []
    for name in ("bin/fledge", "share/bash-completion/x", "share/zsh/site-functions/_fledge", "lib/fledge/x",
                 "lib/python3/dist-packages/fledge.pth",
                 f"lib/fledge/python/_core{sysconfig.get_config_var('EXT_SUFFIX')}"):
        (prefix / name).parent.mkdir(parents=True, exist_ok=True)
        (prefix / name).touch()
    folder.mkdir()

    def ends(command, **_):
        begun.extend(path.suffix for path in folder.iterdir())
        raise subprocess.CalledProcessError(2, command)

    monkeypatch.setattr(fledge_deb, "depends", lambda _: [])
    monkeypatch.setattr(fledge_deb, "_output", lambda *_: "all")
    monkeypatch.setattr(fledge_wheel, "requirements", lambda _: [])
    monkeypatch.setattr(fledge_wheel, "libraries", ends)
    monkeypatch.setattr(subprocess, "run", ends)
    for pack in (fledge_wheel.pack, fledge_deb.pack):
        with pytest.raises(subprocess.CalledProcessError):
            pack(prefix, folder)
        assert list(folder.iterdir()) == []
    assert begun == [".part", ".part"]


@pytest.mark.long("pip makes the wheel")
def test_the_wheel_brings_its_shared_libraries(wheel, tmp_path):
    python = "cp{0.major}{0.minor}".format(sys.version_info)
    assert wheel.name.startswith(f"fledge-{fledge.__version__}-{python}-{python}-linux_")
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(tmp_path)
    data = tmp_path / f"fledge-{fledge.__version__}.data/data"
    brought = {path.name for path in (data / "lib/fledge/lib").glob("*.so.*")}
    assert {"libzmq.so.5", "liberfa.so.1"} <= brought and not brought & {"libc.so.6", "libm.so.6", "libstdc++.so.6"}
    libraries = fledge_wheel.libraries(data / "lib/fledge")
    assert {name for name, file in libraries.items() if data in file.resolve().parents} == brought
    assert all(fledge_wheel.OF_THE_SYSTEM.fullmatch(name) for name in libraries.keys() - brought)
    metadata = (tmp_path / f"fledge-{fledge.__version__}.dist-info/METADATA").read_text()
    assert "\nRequires-Dist: numpy" in metadata and "\nRequires-Python: >=3.11\n" in metadata
    assert (data / VIEWER).exists() == bundle.is_built()
    assert list((data / "lib/fledge/python/fledge/cli/__pycache__").glob("*.pyc"))


@pytest.mark.long("pip makes and installs the wheel")
@needs("python3-venv")
def test_pip_installs_the_wheel_and_refuses_one_of_another_python(wheel, tmp_path):
    subprocess.run(["/usr/bin/python3", "-m", "venv", "--system-site-packages", tmp_path / "venv"], check=True)
    pip = [tmp_path / "venv/bin/pip", "install", "--quiet", "--no-index"]
    other = wheel.with_name(wheel.name.replace("-cp3", "-cp2"))
    shutil.copyfile(wheel, other)
    done = subprocess.run([*pip, other], capture_output=True, text=True)
    assert done.returncode and f"{other.name} is not a supported wheel on this platform" in done.stderr
    other.unlink()
    subprocess.run([*pip, wheel], check=True)
    program = tmp_path / "venv/bin/fledge"
    assert "flown    10 s" in run(program, "run", "nadir_spin", "--for", "10s", cwd=tmp_path)
    assert run(program, "exec", "python3", "-c", "import sys; print(sys.prefix)", cwd=tmp_path) == f"{tmp_path}/venv\n"


@pytest.mark.skipif(not shutil.which("dpkg-deb"), reason="this is no Debian")
def test_the_deb_flies_and_needs_no_compiler(deb, tmp_path):
    control = dict(line.split(": ", 1) for line in subprocess.run(
        ["dpkg-deb", "--field", deb], check=True, capture_output=True, text=True).stdout.splitlines() if line[0] != " ")
    needed = control["Depends"].split(", ")
    major, minor = sys.version_info[:2]
    assert needed[:2] == [f"python3 (>= {major}.{minor})", f"python3 (<< {major}.{minor + 1})"]
    assert {"libc6", "libzmq5", "python3-numpy", "casacore-data-jpl-de405"} <= set(needed)
    assert not [package for package in needed if package.endswith("-dev") or package in ("g++", "cmake", "ninja-build")]
    assert "python3-aiohttp" in control["Recommends"] and "g++, cmake, " in control["Suggests"]
    assert control["Version"].startswith(f"{fledge.__version__}+") and int(control["Installed-Size"]) > 10_000

    subprocess.run(["dpkg-deb", "--extract", deb, tmp_path / "root"], check=True)
    usr = tmp_path / "root/usr"
    assert "flown    10 s" in run(usr / "bin/fledge", "run", "nadir_spin", "--for", "10s", cwd=tmp_path)
    program = "import site, sys; site.addsitedir(sys.argv[1]); import fledge; print(fledge.load('nadir_spin').name)"
    assert run("/usr/bin/python3", "-c", program, usr / "lib/python3/dist-packages", cwd=tmp_path) == "nadir_spin\n"
    assert (usr / VIEWER).exists() == bundle.is_built()
    subprocess.run(["dpkg-deb", "--control", deb, tmp_path / "control"], check=True)
    subprocess.run(["md5sum", "--quiet", "--check", tmp_path / "control/md5sums"], cwd=tmp_path / "root", check=True)


def test_a_compiler_is_for_code_alone(prefix, tmp_path):
    """Without one, a project of missions flies and is tested; what needs one says which package has it."""
    tools = tmp_path / "bin"
    tools.mkdir()
    for path in Path("/usr/bin").iterdir():
        if path.name not in ("gcc", "g++", "cc", "ninja", "cmake", "ctest", "dpkg-query"):
            (tools / path.name).symlink_to(path)
    (tools / "dpkg-query").write_text("#!/bin/sh\necho 'installed python3-pytest, '\n")     # and no other package
    (tools / "dpkg-query").chmod(0o755)

    def fledge_(*arguments, code=0):
        return run(prefix / "bin/fledge", *arguments, cwd=tmp_path, code=code, PATH=str(tools))

    def lines(*arguments):
        return [line for line in fledge_(*arguments, code=1).splitlines() if "apt-get" in line]

    assert lines("fly", "nadir_spin", "--for", "10s", "--on", "linux") == [
        "  linux: fly: linux needs gcc and ninja, not installed here; as root, run: apt-get install g++ ninja-build"]
    project = ["--project", "sat"]
    fledge_("new", "project", "sat")
    fledge_(*project, "new", "mission", "scan", "--from", "nadir_spin")
    assert "flown    10 s" in fledge_(*project, "run", "scan", "--for", "10s")
    assert fledge_(*project, "test").splitlines()[-1] == "1 passed, 0 failed, 0 skipped"
    fledge_(*project, "new", "module", "Own")
    for command in (["run", "scan"], ["ground", "serve", "room.toml"]):
        (line,) = lines(*project, *command)
        assert line == (f"fledge: {command[0]}: packages are missing; as root, run: apt-get install "
                        + " ".join(package.partition(" |")[0] for package in fledge_deb.listed("project")))


# --- beside another Fledge, and another Python ------------------------------------------------------

def test_only_a_checkout_makes_packages(prefix, tmp_path):
    assert run(prefix / "bin/fledge", "package", cwd=tmp_path, code=1) == \
        "fledge: package: this Fledge is installed; a checkout makes packages\n"


def test_it_says_that_it_is_not_the_checkout_around_it(prefix):
    done = subprocess.run([prefix / "bin/fledge", "exec", "true"], cwd=ROOT / "missions", env=CLEAN, text=True,
                          capture_output=True)
    assert done.stderr == (f"fledge: this is the Fledge in {prefix}/lib/fledge, not the checkout around this folder; "
                           f"for that, {ROOT}/fledge\n")


def test_it_is_not_mixed_with_another_one(prefix, tmp_path):
    done = subprocess.run(["/usr/bin/python3", "-c", "import fledge; fledge._core"], text=True, capture_output=True,
                          env={**CLEAN, "PYTHONPATH": f"{ROOT}/python:{prefix}/lib/fledge/python"}, cwd=tmp_path)
    assert done.stderr.splitlines()[-1].startswith(
        f"ImportError: Fledge is that of {ROOT}/python, and its extension that of another one, {prefix}/lib/fledge/py")


def test_another_python_is_refused_in_one_line(prefix, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(prefix, copy)
    ours = sysconfig.get_config_var("EXT_SUFFIX")
    (extension,) = copy.glob("lib/fledge/python/_core.*.so")
    extension.rename(extension.with_name("_core.cpython-399-mips-linux-gnu.so"))
    expected = (f"the Fledge in {copy}/lib/fledge/python is for cpython-399-mips-linux-gnu, this Python is "
                f"{ours[1:-3]}: install a package that was made on such a system\n")
    assert run(copy / "bin/fledge", "run", "nadir_spin", cwd=tmp_path, code=1) == f"fledge: {expected}"
    printed = run("/usr/bin/python3", "-c", "import fledge", cwd=tmp_path, code=1,
                  PYTHONPATH=str(copy / "lib/fledge/python"))
    assert printed.endswith(f"ImportError: {expected}")
