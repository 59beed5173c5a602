# SPDX-License-Identifier: Apache-2.0
"""`pip install .`: builds Fledge with CMake, and packs what `cmake --install` writes into a wheel (PEP 517).

It needs the Debian packages of cmake/packages.txt [run], and no network. The wheel unpacks below the prefix of the
Python that pip belongs to; lib/pythonX.Y/site-packages holds fledge.pth alone.
"""

import base64
import hashlib
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


def build_wheel(folder, config_settings=None, metadata_directory=None):
    """Write the wheel into a folder; returns its name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    init = (ROOT / "python/fledge/__init__.py").read_text(encoding="utf-8")
    version = re.search(r'^__version__ = "(.*)"', init, re.M)[1]
    name = f"{project['name']}-{version}"
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{sysconfig.get_platform().replace('-', '_')}"
    info = f"{name}.dist-info"
    metadata = ["Metadata-Version: 2.1", f"Name: {project['name']}", f"Version: {version}",
                f"Summary: {project['description']}", f"Requires-Python: {project['requires-python']}",
                *(f"Requires-Dist: {package}" for package in project["dependencies"]), ""]

    with tempfile.TemporaryDirectory() as prefix, zipfile.ZipFile(Path(folder) / f"{name}-{tag}.whl", "w",
                                                                  zipfile.ZIP_DEFLATED) as wheel:
        install(prefix)
        record = []

        def add(path, content, mode=0o644):
            entry = zipfile.ZipInfo(path)
            entry.external_attr, entry.compress_type = (0o100000 | mode) << 16, zipfile.ZIP_DEFLATED
            wheel.writestr(entry, content)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append(f"{path},sha256={digest},{len(content)}\n")

        for file in sorted(path for path in Path(prefix, "lib/fledge").rglob("*") if path.is_file()):
            path = file.relative_to(prefix).as_posix()
            add(f"{name}.data/data/{path}", file.read_bytes(), file.stat().st_mode & 0o777)
        add(f"{name}.data/scripts/fledge", Path(prefix, "bin/fledge").read_bytes(), 0o755)
        add("fledge.pth", next(Path(prefix).glob("lib/python*/site-packages/fledge.pth")).read_bytes())
        add(f"{info}/METADATA", "\n".join(metadata).encode())
        add(f"{info}/WHEEL", f"Wheel-Version: 1.0\nGenerator: fledge\nRoot-Is-Purelib: false\nTag: {tag}\n".encode())
        wheel.writestr(f"{info}/RECORD", "".join(record) + f"{info}/RECORD,,\n")
    return f"{name}-{tag}.whl"


def install(prefix):
    """Build the preset `release` and install it below a prefix. CMake's own messages go to pip."""
    def cmake(*arguments):
        subprocess.run(["cmake", *arguments], cwd=ROOT, check=True)

    cache = ROOT / "build/release/CMakeCache.txt"
    if not cache.exists() or f"CMAKE_HOME_DIRECTORY:INTERNAL={ROOT}\n" not in cache.read_text(encoding="utf-8"):
        shutil.rmtree(cache.parent, ignore_errors=True)     # of a copied tree: it would build the other one
        cmake("--preset", "release", "-DBUILD_TESTING=OFF")
    cmake("--build", "--preset", "release", "--target", "all")
    cmake("--install", "build/release", "--prefix", prefix)
