# SPDX-License-Identifier: Apache-2.0
"""An FMU of a system: its libraries are compiled, or are there already; all goes into an archive.

The token, by which an importer finds out whether library and description belong together, is a hash of both.
"""
from __future__ import annotations

import hashlib
import platform as machine
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field as with_default, replace
from pathlib import Path

from fledge.disk import ROOT, build_folder, write_files
from fledge.errors import Failure
from fledge.export.fmu.archive import Content, content_of, write_archive
from fledge.export.fmu.description import LANGUAGES, Facts, build_description, description, terminals
from fledge.export.fmu.variables import Layout
from fledge.export.read import INCLUDE
from fledge.targets.build import program

VERSIONS = {"3": "3.0", "2": "2.0"}
PLATFORMS = ("x86_64", "aarch64")
# The folders of their libraries, by FMI 2.0. It has no name for others than x86_64; they have those of FMI 3.0.
FOLDERS2 = {"x86_64": "linux64"}
# What an importer needs to get the same bits from the sources.
OPTIONS = "-O2 -DNDEBUG -fPIC -fvisibility=hidden -ffp-contract=off -fno-math-errno"
# The functions of the standard.
FUNCTIONS = [f"fmi/fmu/{name}.c" for name in ("fmi2", "fmi3", "fmu", "saved", "values")]


@dataclass
class System:
    """What an FMU is made of: C to compile, or libraries that read their mission from the resources."""
    facts: Facts
    layout: Layout
    code: Callable[[str], Mapping[str, str]] | None = None      # the token -> file name -> text
    sources: Mapping[str, Path] = with_default(default_factory=dict)    # name under the folder sources -> file
    roots: Sequence[Path] = (ROOT,)     # where the headers are that the C includes
    resources: Mapping[str, Content] = with_default(default_factory=dict)
    #: platform -> the library, and what must lie beside it; raises Failure
    libraries: Callable[[str], Sequence[Path]] | None = None


def export(system: System, path: Path, version: str = "3", platforms: Sequence[str] = (), sources: bool = False
           ) -> Path:
    """Write an FMU. version: "3" or "2" of FMI; platforms: of PLATFORMS, none: this machine's; sources: put all C into
    it, so that an importer can compile it for any other. Raises Failure."""
    platforms = platforms or [machine.machine()]
    for each in platforms:
        if each not in PLATFORMS:
            raise Failure(f"export fmu: the platforms are {' and '.join(PLATFORMS)}; found {each}")
    if sources and not system.code and not system.sources:
        raise Failure(f"export fmu: the FMU of {system.facts.name} has no sources in C; leave out --sources")
    identifier, number = system.facts.identifier, VERSIONS[version]
    libraries = {each: system.libraries(each) for each in platforms} if system.libraries else {}
    code, whole = {}, dict[str, Content](system.sources)
    if system.code:
        code = dict(system.code(""))
        whole |= closure([*system.sources.values()], code, system.roots)
    token = _token(system, {**whole, **code}, libraries)
    if system.code:
        whole |= (code := dict(system.code(token)))
    facts = replace(system.facts, sources=_compiled(whole) if sources else [])
    files: dict[str, Content] = {"modelDescription.xml": description(facts, system.layout, number, token)}
    if version == "3" and (text := terminals(system.layout)):
        files["terminalsAndIcons/terminalsAndIcons.xml"] = text
    if sources:
        files |= {f"sources/{name}": content for name, content in whole.items()}
        if version == "3":
            files["sources/buildDescription.xml"] = build_description(facts, OPTIONS)
    files |= {f"resources/{name}": content for name, content in system.resources.items()}
    if system.libraries:
        files["resources/token.txt"] = token
    with tempfile.TemporaryDirectory(prefix="fledge-fmu-") as folder:
        for each in platforms:
            place = f"binaries/{FOLDERS2.get(each, f'{each}-linux') if version == '2' else f'{each}-linux'}"
            built, *beside = libraries.get(each) or [compiled(system, code, each, Path(folder, each))]
            files |= {f"{place}/{identifier}.so": built, **{f"{place}/{other.name}": other for other in beside}}
        return write_archive(path, files)


def compiled(system: System, code: Mapping[str, str], platform: str, folder: Path) -> Path:
    """The shared library of a system in C, in a folder of its own."""
    own = [path for path in write_files(code, folder) if path.suffix == ".c"]
    return program(folder, f"{system.facts.identifier}.so", [*own, *system.sources.values()], [folder, *system.roots],
                   compiler_for(platform), ["-O2", "-fPIC", "-fvisibility=hidden"],
                   ["-shared", "-s", "-static-libgcc", "-Wl,--no-undefined"], entry="fmi3DoStep")


def prebuilt(name: str, platform: str) -> Path:
    """A library of Fledge's own build, in C++: beside the extension; of another platform in build/PLATFORM/python.
    Raises Failure."""
    native, ours = platform == machine.machine(), build_folder()
    path = (ours if native else ours.with_name(platform)) / "python" / name
    if not path.is_file():
        how = "./fledge setup builds it" if native else f"cmake/{platform}.cmake says how to build it"
        raise Failure(f"export fmu: {path} is not there; {how}")
    return path


def compiler_for(platform: str) -> str:
    """The compiler of C for one of PLATFORMS. Raises Failure."""
    native = platform == machine.machine()
    compiler = "gcc" if native else f"{platform}-linux-gnu-gcc"
    if not shutil.which(compiler):
        raise Failure(f"export fmu: {compiler} is not installed; sudo apt install "
                      + ("gcc" if native else f"gcc-{platform.replace('_', '-')}-linux-gnu"))
    return compiler


def closure(sources: Sequence[Path], code: Mapping[str, str], roots: Sequence[Path]) -> dict[str, Path]:
    """All files that C needs, by their names under a root: the sources, and the headers that they include."""
    found: dict[str, Path] = {}

    def add(path: Path) -> None:
        name = next(path.relative_to(root).as_posix() for root in roots if path.is_relative_to(root))
        if name not in found:
            found[name] = path
            look(path.read_text("utf-8"), path.parent)

    def look(text: str, folder: Path | None) -> None:
        for stem in INCLUDE.findall(text):
            places = [*([folder] if folder else []), *roots]
            path = next((file for place in places if (file := place / f"{stem}.h").is_file()), None)
            if path:
                add(path.resolve())

    for path in sources:
        add(path)
    for text in code.values():
        look(text, None)
    return found


def _compiled(whole: Mapping[str, Content]) -> list[str]:
    return sorted(name for name in whole if name.endswith(tuple(LANGUAGES)))


def _token(system: System, sources: Mapping[str, Content], libraries: Mapping[str, Sequence[Path]]) -> str:
    facts = replace(system.facts, sources=[])
    whole = hashlib.sha256(description(facts, system.layout, "3.0", "").encode())
    files = {**sources, **system.resources, **{f"{place} {path.name}": path for place, paths in libraries.items()
                                               for path in paths}}
    for name in sorted(files):
        whole.update(f"{name}\0".encode() + hashlib.sha256(content_of(files[name])).digest())
    return whole.hexdigest()[:32]
