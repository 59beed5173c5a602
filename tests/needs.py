# SPDX-License-Identifier: Apache-2.0
"""Which of Debian's packages a test needs: without one it is skipped, with "not installed: PACKAGE, ..." as the reason.
The tests in Python end with the sum of that by package, and with `./fledge test --complete` they fail if there is any.
"""
from __future__ import annotations

import importlib.util
import os
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

import pytest

from fledge.launcher.packages import listed
from fledge.targets import TARGETS

NOT_INSTALLED = "not installed: "
# What shows that a package is there: a program, a module of Python (of python3-*), or a file; of alternatives, "a|b".
# Another package is shown by the program, or the module, of its name.
SHOWN_BY = {
    "casacore-data-jpl-de405": "/usr/share/casacore/data/ephemerides/DE405",
    "clang-19": "clang-19|clang-18",
    "debian-archive-keyring": "/usr/share/keyrings/debian-archive-keyring.gpg",
    "frama-c-base": "frama-c",
    "furo": "/usr/lib/python3/dist-packages/furo",
    "gcc-aarch64-linux-gnu": "aarch64-linux-gnu-gcc",
    "gcc-arm-none-eabi": "arm-none-eabi-gcc",
    "gcc-riscv64-unknown-elf": "riscv64-unknown-elf-gcc",
    "gcc-sparc64-linux-gnu": "sparc64-linux-gnu-gcc",
    "graphviz": "dot",
    "iproute2": "ip",
    "libc6-dev-arm64-cross": "/usr/aarch64-linux-gnu/include/stdio.h",
    "libc6-dev-sparc64-cross": "/usr/sparc64-linux-gnu/include/stdio.h",
    "libclang-common-19-dev": "/usr/lib/llvm-19/lib/clang/19/include|/usr/lib/llvm-18/lib/clang/18/include",
    "libclang-rt-19-dev": "/usr/lib/llvm-19/lib/clang/19/lib|/usr/lib/llvm-18/lib/clang/18/lib",
    "libclang1-19": "/usr/lib/llvm-19/lib/libclang-19.so.1|/usr/lib/llvm-18/lib/libclang-18.so.1",
    "libcsmith-dev": "/usr/include/csmith",
    "libxml2-utils": "xmllint",
    "llvm-19": "llvm-cov-19|llvm-cov-18",
    "newlib-source": "/usr/src/newlib",
    "nodejs": "node",
    "openssh-client": "ssh",
    "openssh-server": "/usr/sbin/sshd",
    "picolibc-arm-none-eabi": "/usr/lib/picolibc/arm-none-eabi",
    "picolibc-riscv64-unknown-elf": "/usr/lib/picolibc/riscv64-unknown-elf",
    "postgresql": "/usr/lib/postgresql",
    "python3-myst-parser": "myst_parser",
    "python3-pil": "PIL",
    "python3-venv": "ensurepip",
    "qemu-system-misc": "qemu-system-riscv64",
    "qemu-user": "qemu-aarch64",
}


def lacking(*packages: str) -> list[str]:
    """Those of the packages that are not installed."""
    def is_there(name: str) -> bool:
        of_python = name.startswith("python3-")
        for shown in SHOWN_BY.get(name, name.removeprefix("python3-")).split("|"):
            if Path(shown).exists() if shown.startswith("/") else (
                    importlib.util.find_spec(shown) if of_python else shutil.which(shown)):
                return True
        return False

    return [name for name in packages if not is_there(name)]


def section(purpose: str) -> list[str]:
    """The packages of a section of cmake/packages.txt, of a part of the package, or of a target's folder."""
    return [line.partition(" | ")[0] for line in listed(purpose)]


def reason(*packages: str) -> str:
    """Why a test that needs these packages is skipped; "" if they are installed."""
    names = lacking(*packages)
    return NOT_INSTALLED + ", ".join(names) if names else ""


def reason_on(*targets: str, needs: Iterable[str] = ()) -> str:
    """Why a test that flies on these targets, or compiles for them, is skipped; "" if it can run. needs: packages that
    it needs besides."""
    folders = [TARGETS.folders[part.name] for name in targets for part in TARGETS[name].with_used()]
    return reason(*dict.fromkeys(name for folder in folders if (folder / "packages.txt").is_file()
                                 for name in section(str(folder))), *needs) or "; ".join(
        f"{name} needs {' and '.join(missing)}" for name in targets if (missing := TARGETS[name].missing()))


def skipped(*reasons: str) -> pytest.MarkDecorator:
    """The mark of a test that is skipped for the first of these reasons, of which "" is none."""
    why = next(filter(None, reasons), "")
    return pytest.mark.skipif(bool(why), reason=why)


def needs(*packages: str) -> pytest.MarkDecorator:
    """The mark of a test that needs these packages."""
    return skipped(reason(*packages))


def flies_on(*targets: str, needs: Iterable[str] = ()) -> pytest.MarkDecorator:
    """The mark of a test that flies on these targets, or compiles for them, and needs these packages."""
    return skipped(reason_on(*targets, needs=needs))


def _skip(why: str) -> None:
    """Skip the test, or the module of tests, that runs, unless the reason is "". pytest-xdist takes equal reports of
    modules for one: the reason names the file."""
    if why:
        frame = sys._getframe(1)
        while frame.f_back and frame.f_code.co_filename == __file__:
            frame = frame.f_back
        pytest.skip(f"{os.path.relpath(frame.f_code.co_filename)}: {why}", allow_module_level=True)


def skip_without(*packages: str) -> None:
    """Skip the test, or the module of tests, that runs."""
    _skip(reason(*packages))


def skip_unless_on(*targets: str) -> None:
    """Skip the test, or the module of tests, that runs, where not all of these targets can fly."""
    _skip(reason_on(*targets))


def module(name: str, *packages: str) -> ModuleType:
    """The module of these packages, or else of python3-NAME, or one of its parts (jplephem.spk); skips without them."""
    skip_without(*packages or [f"python3-{name.partition('.')[0].lower()}"])
    return importlib.import_module(name)
