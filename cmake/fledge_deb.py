# SPDX-License-Identifier: Apache-2.0
"""`./fledge package`: the wheel and, where there is dpkg-deb, the Debian package of what is built.

    python3 cmake/fledge_deb.py FOLDER

Both are for the system where they are made: the Debian package needs its Python and its shared libraries.
"""

import hashlib
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import fledge_wheel
from fledge_wheel import PROJECT, ROOT, VERSION     # and finds those of Fledge
from fledge.disk import Part
from fledge.launcher.packages import listed

SUGGESTED = ("project", "film", "scheduler", "profile")     # purposes of fledge.launcher.packages
DESCRIPTION = """ Algorithms in C, composed by Python, fly in closed loop against a simulated spacecraft. This
 package has what that needs, without a compiler; modules of one's own and flights for other
 targets need those that it suggests.
"""


def main():
    folder = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as prefix:
        fledge_wheel.install(prefix)
        packages = [fledge_wheel.pack(Path(prefix), folder)]
        if shutil.which("dpkg-deb"):
            packages.append(pack(Path(prefix), folder))
    for name in packages:
        print(f"fledge: {folder / name} ({(folder / name).stat().st_size / 1e6:.1f} MB)")
    if len(packages) == 1:
        print("fledge: there is no dpkg-deb, and hence no .deb")


def pack(prefix, folder):
    """Write the Debian package of what is installed below a prefix into a folder; returns its name."""
    system = platform.freedesktop_os_release()
    version = f"{VERSION}+{system['ID']}{system.get('VERSION_ID', '')}"     # a later system has a later version
    machine = _output("dpkg", "--print-architecture").strip()
    name = f"{PROJECT['name']}_{version}_{machine}.deb"
    with tempfile.TemporaryDirectory() as place:
        tree = Path(place, "tree")
        usr = tree / "usr"
        for part in ("bin", "lib/fledge", "share/bash-completion"):
            shutil.copytree(prefix / part, usr / part)
        site = next(prefix.glob("lib/python*/dist-packages/fledge.pth"))
        for source, target in ((site, "lib/python3/dist-packages/fledge.pth"),
                               (prefix / "share/zsh/site-functions/_fledge", "share/zsh/vendor-completions/_fledge"),
                               (ROOT / "LICENSE", f"share/doc/{PROJECT['name']}/copyright")):
            (usr / target).parent.mkdir(parents=True)
            shutil.copyfile(source, usr / target)
        files = sorted(path for path in tree.rglob("*") if path.is_file())
        control = {
            "Package": PROJECT["name"], "Version": version, "Architecture": machine,
            "Maintainer": "The authors of Fledge", "Section": "science", "Priority": "optional",
            "Installed-Size": str(sum(path.stat().st_size for path in files) // 1024),
            "Depends": ", ".join(depends(prefix / "lib/fledge")),
            "Recommends": ", ".join(listed("ground")),
            "Suggests": ", ".join(dict.fromkeys(package for section in SUGGESTED for package in listed(section))),
            "Description": PROJECT["description"]}
        meta = tree / "DEBIAN"
        meta.mkdir()
        (meta / "control").write_text("".join(f"{key}: {value}\n" for key, value in control.items()) + DESCRIPTION)
        (meta / "md5sums").write_text("".join(
            f"{hashlib.md5(path.read_bytes()).hexdigest()}  {path.relative_to(tree)}\n" for path in files))
        for path in (tree, *tree.rglob("*")):       # whatever this user's umask is
            path.chmod(0o755 if path.is_dir() or path.stat().st_mode & 0o100 else 0o644)
        with Part(Path(folder, name)) as part:
            subprocess.run(["dpkg-deb", "--root-owner-group", "--build", tree, part], check=True)
    return name


def depends(home):
    """What must be installed: this Python, the packages of the shared libraries, and what flying needs."""
    major, minor = sys.version_info[:2]
    python = [f"python3 (>= {major}.{minor})", f"python3 (<< {major}.{minor + 1})"]
    owners = {owner_of(file) for file in fledge_wheel.libraries(home, direct=True).values()}
    return [*python, *sorted(owners), *(package for package in listed("fly") if package != "python3")]


def owner_of(file):
    """The package that has a shared library. dpkg may know it below /lib or /usr/lib, which are the same folder."""
    places = {str(file), f"/usr{file}", str(file).removeprefix("/usr")}
    for line in _output("dpkg-query", "--search", f"*/{file.name}").splitlines():
        owner, _, path = line.partition(": ")
        if path in places:
            return owner.partition(":")[0]
    sys.exit(f"fledge: {file} is of no Debian package")


def _output(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    main()
