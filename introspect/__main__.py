# SPDX-License-Identifier: Apache-2.0
"""The command line: `python3 -m introspect --help`."""
from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from introspect.emit import EMITTERS
from introspect.errors import HeaderError, Problem
from introspect.files import depfile, write_if_changed
from introspect.model import Kind, Model
from introspect.reader import read
from introspect.sources import Source

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

_HELP = """\
Read C headers of modules, models and messages, and write the files that the emitters make from them.

example:
  python3 -m introspect --library flight --modules flight --library world --models world --out build

Options are read in order: --root holds for the folders after it, --library for its folders. With a
single library its place does not matter. Files are written only where their text changes."""


class _InOrder(argparse.Action):
    """Keep (option, value) pairs in the order of the command line."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, value: Any,
                 option: str | None = None) -> None:
        namespace.ordered = [*(getattr(namespace, "ordered", None) or []), (self.dest, value)]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="introspect", description=_HELP,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", action=_InOrder, metavar="DIR",
                        help="what folders and #include are relative to (default: .)")
    parser.add_argument("--library", action=_InOrder, metavar="NAME",
                        help="to which folders belong")
    parser.add_argument("--modules", action=_InOrder, metavar="DIR",
                        help="folder of flight modules and messages")
    parser.add_argument("--models", action=_InOrder, metavar="DIR",
                        help="folder of world models and messages")
    parser.add_argument("--include", action="append", default=[], metavar="DIR", type=Path,
                        help="further folder for #include, of other libraries")
    parser.add_argument("--emit", action="append", choices=EMITTERS, metavar="EMITTER",
                        help=f"what to write, of {', '.join(EMITTERS)} (default: tables, layout)")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="where to write")
    parser.add_argument("--depfile", type=Path, metavar="FILE",
                        help="write for Ninja or make on what the first file depends")
    parser.add_argument("--compiled", nargs=2, action="append", metavar=("DIR", "FILES"),
                        help="what the build compiles, relative to DIR, with ; between")
    parser.add_argument("--line", metavar="TEXT", help="how CMake compiles one more: {path}, {short} and {list}")
    parser.add_argument("--time", action="store_true", help="print how long reading took")
    parser.add_argument("-v", "--verbose", action="store_true", help="name unchanged files too")
    return parser


def _sources(ordered: list[tuple[str, str]]) -> list[Source]:
    """The folders, each with the root and library that hold where it stands."""
    libraries = [value for option, value in ordered if option == "library"]
    root, library = Path("."), libraries[0] if len(libraries) == 1 else None
    sources = []
    for option, value in ordered:
        if option == "root":
            root = Path(value)
        elif option == "library":
            library = value
        elif library is None:
            raise ValueError(f"--{option} {value}: give its --library before")
        else:
            kind = Kind.MODULE if option == "modules" else Kind.MODEL
            sources.append(Source(root, value, kind, library))
    for name in libraries:
        if not name.isidentifier():
            raise ValueError(f"--library {name}: a name is letters, digits and _")
        if not any(source.library == name for source in sources):
            raise ValueError(f"--library {name}: give it a folder, with --modules or --models")
    if not sources:
        raise ValueError("give a --library, and a folder with --modules or --models")
    return sources


def _refuse_uncompiled(model: Model, compiled: set[str], line: str) -> None:
    """Refuse a module or model whose source lies beside its header, but is not compiled."""
    endings = {Kind.MODULE: ("FLIGHT", ".c"), Kind.MODEL: ("WORLD", "_model.cpp")}
    problems = []
    for struct in model.structs.values():
        if not struct.library or not struct.kind.is_interface:
            continue
        list_, ending = endings[struct.kind]
        source = os.path.abspath(struct.path.removesuffix(".h") + ending)
        if os.path.exists(source) and source not in compiled:
            path = struct.header.removesuffix(".h")
            add = line.format(path=path, short=path.partition("/")[2], list=list_)
            problems.append(Problem(struct.path, struct.line, f"CMake compiles every {struct.kind.value}",
                                    f"it does not compile {path}{ending}", f"add {add}"))
    if problems:
        raise HeaderError(problems)


def main(arguments: list[str] | None = None) -> int:
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        sources = _sources(getattr(options, "ordered", []))
        started = time.perf_counter()
        model = read(sources, options.include)
        if options.time:
            print(f"read {len(model.structs)} structs in {len(model.files)} files in "
                  f"{1e3 * (time.perf_counter() - started):.0f} ms")
        if options.compiled:
            _refuse_uncompiled(model, {os.path.abspath(os.path.join(folder, file)) for folder, files in options.compiled
                                       for file in files.split(";")}, options.line)
        files: dict[str, str] = {}
        for name in model.library_names:
            if not model.library(name).structs:
                raise ValueError(f"library `{name}`: no module, model or message in its folders")
            for emitter in options.emit or ["tables", "layout"]:
                files |= EMITTERS[emitter](model.library(name))
        for name, text in files.items():
            if write_if_changed(options.out / name, text):
                print(f"wrote {options.out / name}")
            elif options.verbose:
                print(f"unchanged {options.out / name}")
        if options.depfile:
            # A folder's time changes when a header comes or goes.
            write_if_changed(options.depfile, depfile(options.out / next(iter(files)), [*model.files, *model.folders]))
    except (HeaderError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
