# SPDX-License-Identifier: Apache-2.0
"""`pip install .`: builds Fledge with CMake, and packs what `cmake --install` writes into a wheel (PEP 517).

It needs the Debian packages of cmake/packages.txt [project] and [build], and no network. The wheel unpacks below the
prefix of the Python that pip belongs to; lib/pythonX.Y/site-packages holds fledge.pth alone. lib/fledge/lib has copies
of the shared libraries that a system need not have: all but those of the compiler, which every system has.
"""

import base64
import compileall
import hashlib
import py_compile
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python"))
from fledge import __version__ as VERSION, disk  # noqa: E402

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# Every system with Python has them; two in one process would not work together.
OF_THE_SYSTEM = re.compile(r"(linux-vdso|ld-linux.*|lib(c|m|dl|rt|pthread|resolv|stdc\+\+|gcc_s))\.so\.\d+")


def build_wheel(folder: str, config_settings: object = None, metadata_directory: object = None) -> str:
    """Write the wheel into a folder; returns its name."""
    with tempfile.TemporaryDirectory() as prefix:
        install(prefix)
        return pack(Path(prefix), folder)


def pack(prefix: Path, folder: str | Path) -> str:
    """Write the wheel of what is installed below a prefix into a folder; returns its name."""
    home = prefix / "lib/fledge"
    if not (home / f"python/_core{sysconfig.get_config_var('EXT_SUFFIX')}").exists():
        sys.exit(f"fledge: it is built for the Python of the system, not for {sys.executable}: "
                 "use the pip of an environment that /usr/bin/python3 has made")
    name = f"{PROJECT['name']}-{VERSION}"
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{sysconfig.get_platform().replace('-', '_')}"
    info = f"{name}.dist-info"
    metadata = ["Metadata-Version: 2.1", f"Name: {PROJECT['name']}", f"Version: {VERSION}",
                f"Summary: {PROJECT['description']}", f"Requires-Python: {PROJECT['requires-python']}",
                *(f"Requires-Dist: {package}" for package in requirements(home)), ""]

    target = Path(folder, f"{name}-{tag}.whl")
    with disk.Part(target) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as wheel:
        record: list[str] = []

        def add(path: str, content: bytes, mode: int = 0o644) -> None:
            entry = zipfile.ZipInfo(path)
            entry.external_attr, entry.compress_type = (0o100000 | mode) << 16, zipfile.ZIP_DEFLATED
            wheel.writestr(entry, content)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append(f"{path},sha256={digest},{len(content)}\n")

        for file in sorted(path for top in (home, prefix / "share") for path in top.rglob("*") if path.is_file()):
            add(f"{name}.data/data/{file.relative_to(prefix)}", file.read_bytes(), file.stat().st_mode & 0o777)
        for soname, file in sorted(libraries(home).items()):
            if not OF_THE_SYSTEM.fullmatch(soname):
                add(f"{name}.data/data/lib/fledge/lib/{soname}", file.read_bytes())
        add(f"{name}.data/scripts/fledge", (prefix / "bin/fledge").read_bytes(), 0o755)
        add("fledge.pth", next(prefix.glob("lib/python*/site-packages/fledge.pth")).read_bytes())
        add(f"{info}/METADATA", "\n".join(metadata).encode())
        add(f"{info}/WHEEL", f"Wheel-Version: 1.0\nGenerator: fledge\nRoot-Is-Purelib: false\nTag: {tag}\n".encode())
        wheel.writestr(f"{info}/RECORD", "".join(record) + f"{info}/RECORD,,\n")
    return target.name


def requirements(home: Path) -> list[str]:
    """What pip must find. An extension that numpy 1 has compiled is not loaded by numpy 2."""
    numpy, = re.findall(r"^NUMPY = '(\d+)", (home / "python/_core_build.py").read_text(encoding="utf-8"), re.M)
    return [f"{dependency}<2" if dependency == "numpy" and numpy == "1" else dependency
            for dependency in PROJECT["dependencies"]]


def programs(home: Path) -> list[Path]:
    """The extensions, programs and shared libraries of an installed Fledge."""
    return [path for place in ("lib/*.so", "python/_*.so", "cosim/*", "emulator/tools/*")
            for path in sorted(home.glob(place)) if path.is_file() and path.read_bytes()[:4] == b"\x7fELF"]


def libraries(home: Path, direct: bool = False) -> dict[str, Path]:
    """Name -> file of each shared library that they load; direct: without those that others load."""
    def output(*command: str) -> str:
        return subprocess.run([*command, *programs(home)], check=True, capture_output=True, text=True).stdout

    paths = {name: Path(file) for name, file in re.findall(r"(\S+) => (/\S+)", output("ldd"))}
    wanted = set(re.findall(r"\(NEEDED\).*\[(.*)\]", output("readelf", "--dynamic"))) if direct else set(paths)
    return {name: file for name, file in paths.items() if name in wanted}


def compile_python(home: Path) -> None:
    """Without it, users without write access would compile at each start. What is edited later is compiled anew."""
    for part in ("python", "targets"):
        compileall.compile_dir(home / part, quiet=2, force=True, stripdir=home, rx=re.compile("/templates/"),
                               invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)


def install(prefix: str) -> None:
    """Build the preset `release` and install it below a prefix. CMake's own messages go to pip."""
    def cmake(*arguments: str) -> None:
        subprocess.run(["cmake", *arguments], cwd=ROOT, check=True)

    cache = ROOT / "build/release/CMakeCache.txt"
    if not cache.exists() or f"CMAKE_HOME_DIRECTORY:INTERNAL={ROOT}\n" not in cache.read_text(encoding="utf-8"):
        shutil.rmtree(cache.parent, ignore_errors=True)     # of a copied tree: it would build the other one
        cmake("--preset", "release", "-DBUILD_TESTING=OFF")
    cmake("--build", "--preset", "release", "--target", "all")
    cmake("--install", "build/release", "--prefix", prefix)
    compile_python(Path(prefix, "lib/fledge"))
