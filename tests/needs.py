# SPDX-License-Identifier: Apache-2.0
"""Which of Debian's packages a test needs: without one it is skipped, with "not installed: PACKAGE, ..." as the reason.
The tests end with the sum of that by package, and with `./fledge test --complete` each such skip is a failure.
"""
from __future__ import annotations

import importlib.util
import re
import shutil
from pathlib import Path
from types import ModuleType

import pytest

from fledge.targets import TARGETS

NOT_INSTALLED = "not installed: "
# What shows that a package is there: a program, a module of Python, or a file; else a program of its name.
SHOWN_BY = {
    "binutils-sparc64-linux-gnu": "sparc64-linux-gnu-objdump", "casacore-data-jpl-de405":
    "/usr/share/casacore/data/ephemerides/DE405", "clang-19": "clang-19|clang-18", "csmith": "csmith",
    "frama-c-base": "frama-c", "gcc-aarch64-linux-gnu": "aarch64-linux-gnu-gcc",
    "gcc-arm-none-eabi": "arm-none-eabi-gcc", "gcc-riscv64-unknown-elf": "riscv64-unknown-elf-gcc",
    "gcc-sparc64-linux-gnu": "sparc64-linux-gnu-gcc", "graphviz": "dot", "libxml2-utils": "xmllint",
    "llvm-19": "llvm-cov-19|llvm-cov-18", "nodejs": "node", "openssh-server": "/usr/sbin/sshd",
    "postgresql": "/usr/share/postgresql-common", "python3-ipykernel": "ipykernel", "python3-myst-parser": "myst_parser",
    "python3-pil": "PIL", "python3-sphinx": "sphinx", "qemu-system-misc": "qemu-system-riscv32",
    "qemu-user": "qemu-sparc64|qemu-aarch64"}


def lacking(*packages: str) -> list[str]:
    """Those of the packages that are not installed."""
    def is_there(name: str) -> bool:
        module = name.removeprefix("python3-") if name.startswith("python3-") else ""
        for shown in SHOWN_BY.get(name, module or name).split("|"):
            if shown.startswith("/"):
                found = Path(shown).exists()
            else:
                found = bool(importlib.util.find_spec(shown) if name.startswith("python3-") else shutil.which(shown))
            if found:
                return True
        return False

    return [name for name in packages if not is_there(name)]


def reason(*packages: str) -> str:
    """Why a test that needs these packages is skipped; "" if they are installed."""
    names = lacking(*packages)
    return NOT_INSTALLED + ", ".join(names) if names else ""


def reason_on(*targets: str) -> str:
    """Why a test that flies on these targets, or compiles for them, is skipped; "" if it can run."""
    used = {other.name: other for name in targets for other in TARGETS[name].with_used()}
    names = [package for target in used.values() if not all(map(shutil.which, target.needs))
             for package in re.findall(r"^[^#|\s]+", (TARGETS.folders[target.name] / "packages.txt").read_text(
                 encoding="utf-8"), re.M)]
    if names:
        return NOT_INSTALLED + ", ".join(dict.fromkeys(names))
    return "; ".join(f"{name} needs {' and '.join(missing)}" for name in targets if (missing := TARGETS[name].missing()))


def needs(*packages: str) -> pytest.MarkDecorator:
    """The mark of a test that needs these packages."""
    why = reason(*packages)
    return pytest.mark.skipif(bool(why), reason=why)


def flies_on(*targets: str) -> pytest.MarkDecorator:
    """The mark of a test that flies on these targets, or compiles for them."""
    why = reason_on(*targets)
    return pytest.mark.skipif(bool(why), reason=why)


def skip_without(*packages: str) -> None:
    """Skip the test, or the module of tests, that runs."""
    if why := reason(*packages):
        pytest.skip(why, allow_module_level=True)


def skip_unless_on(*targets: str) -> None:
    """Skip the test, or the module of tests, that runs, where not all of these targets can fly."""
    if why := reason_on(*targets):
        pytest.skip(why, allow_module_level=True)


def module(name: str) -> ModuleType:
    """The module of Debian's package python3-NAME, or one of its parts (jplephem.spk); skips without it."""
    package = f"python3-{name.partition('.')[0].lower()}"
    skip_without(package)
    return importlib.import_module(name)
