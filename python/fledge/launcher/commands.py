# SPDX-License-Identifier: Apache-2.0
"""The commands that install, build and test by themselves, and their parsers."""
from __future__ import annotations

import argparse
import os
import re
import signal
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from shutil import which

from fledge.errors import Failure
from fledge.disk import ROOT, may_write
from fledge.launcher import build
from fledge.launcher.context import PRESETS, Context, same
from fledge.launcher.packages import expanded, need, provide
from fledge.launcher.tools import failure, pass_on, run, say

LAUNCHER = Path(__file__).with_name("__main__.py")


def add(command: Callable[..., argparse.ArgumentParser]) -> None:
    """Add the subcommands, by the function of cli.parser() that adds one."""
    def own(name: str, function: Callable[[Context, argparse.Namespace], int], example: str) -> argparse.ArgumentParser:
        parser = command(name, function, example)
        parser.set_defaults(by_itself=True)
        return parser

    parser = own("setup", setup, "setup --test")
    parser.description = "Install the Debian packages that are missing, and build."
    add_argument = parser.add_argument
    add_argument("--test", action="store_true", help="what the tests need, too")
    add_argument("--develop", action="store_true", help="for those who change Fledge: ccache, pre-commit, "
                 "debootstrap, and warnings of compilers are errors from now on")
    add_argument("--on", metavar="TARGETS", help="what flights on these targets need, too, as compilers, and libraries "
                 "that are built once; './fledge fly MISSION --on TARGETS' does the same by itself")
    add_argument("--view", action="store_true", help="what shows runs in 3-D, which is built once, and Node for it, "
                 "unless there is one; './fledge view' does the same by itself")
    _add_preset(parser)

    parser = own("package", package, "package --out /tmp")
    parser.description = ("Make a wheel and, on Debian and Ubuntu, a .deb with all of Fledge, for this system, this "
                          "kind of processor and this Python: pip or apt installs them without a compiler.")
    parser.add_argument("--out", metavar="DIR", type=Path, default=ROOT / "build/packages",
                        help="where they go; default: build/packages")

    parser = own("demo", demo, "demo")
    parser.description = ("Fly the first test of the mission mars_orbiter on the desktop, and plot it; then the same "
                          "flight software on an emulated LEON3, with a page about the run.")

    parser = own("test", test, "test -k tracking")
    parser.description = ("Run the tests of C, C++ and Python, those whose names match, or all with the long ones: of "
                          "the project around this folder; within a checkout of Fledge, of Fledge itself.")
    parser.add_argument("folders", metavar="FOLDER", nargs="*", help="of Fledge: run the tests below these folders, "
                        "and say how long those of the others take")
    near = parser.add_mutually_exclusive_group()
    near.add_argument("-k", dest="pattern", metavar="PATTERN", default="",
                      help="run those whose names match, of the long ones those for which all is installed, too")
    near.add_argument("--changed", nargs="?", const="", metavar="BASE", help="run those near what differs from the "
                      "commit BASE; without BASE, from where this branch began; if nothing differs, from the last "
                      "pass of .ci/run, or the last commit but one")
    add_argument = parser.add_argument
    add_argument("--all", dest="long", action="store_const", const="all", default="none",
                 help="run the tests too that are marked long")
    add_argument("--share", dest="long", metavar="I/N", type=_share,
                 help="run the share I of N of the tests that are marked long, too")
    add_argument("--since", metavar="COMMIT", help="run those tests only that what differs from it can reach")
    add_argument("--turn", metavar="I/N", type=_share,
                 help="with --since, for CI: in C and C++ run the share I of N of the other programs, too; in Python "
                 "the near tests, and that share of the others, alone")
    add_argument("--compiled", action="store_true", help="with --since: run those of C and C++ alone")
    add_argument("--build", action="store_true", help="install and build what the tests need, and run none")
    add_argument("--complete", action="store_true", help="the tests fail where one is skipped for want of a "
                 "package, or a target's packages are missing")
    add_argument("--coverage", action="store_true", help="count by clang which conditions of flight code the tests "
                 "show to decide, and name the others; of Fledge itself, by its tests of flight in C++")
    add_argument("--strict", nargs="?", const="", metavar="FOLDER,...", help="with --coverage: fail where a condition, "
                 "of these folders, has neither decided nor a reason")
    add_argument("--table", action="store_true", help="with --coverage: print the sums of folders, and no conditions")
    add_argument("--fledge", action="store_true",
                 help="run the tests of Fledge itself, from any folder; they take long")
    _add_preset(parser)

    parser = own("docs", docs, "docs")
    parser.description = ("Build the documents, and the reference of modules, messages and Python, as HTML. In a "
                          "project: its README.md, what is in docs/ and missions/, its modules, models and messages.")

    parser = own("exec", exec_, "exec python3 my_study.py")
    parser.description = "Build, then run a command with PYTHONPATH set: a script, a notebook, a debugger."
    parser.add_argument("program", metavar="COMMAND")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, metavar="ARGUMENT")

    parser = own("completion", completion, "completion\n\nin ~/.bashrc or ~/.zshrc: eval \"$(fledge completion)\"")
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.description = ("Print what makes bash and zsh complete commands, options, missions, scenarios, runs and "
                          "targets.\nAn installed Fledge comes with it: in share/bash-completion and share/zsh of its "
                          "prefix.")


def _add_preset(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--preset", metavar="|".join(PRESETS), help="which build; as before the command")


def _share(text: str) -> str:
    if not re.fullmatch("[0-9]+/[1-9][0-9]*", text):
        raise argparse.ArgumentTypeError(f"takes I/N, such as 0/5; found '{text}'")
    return text


def setup(context: Context, options: argparse.Namespace) -> int:
    need(context, "run")
    if options.test:
        from fledge.launcher.testing import need_tests

        need_tests(context, every=True)
    if options.develop:
        need(context, "develop")
        context.develops = True
    if options.on:
        provide(context, expanded(options.on.split(",")))
    build.compile(context, ["all"], options.test)
    if options.on:
        build.prepare(context, options.on)
    if options.view:
        build.view(context)
    if options.test and not context.project:
        build.prepare(context)
        build.need_node(context)
        build.view(context, if_possible=True)
    say("ready")
    return 0


def package(context: Context, options: argparse.Namespace) -> int:
    if context.installed:
        raise Failure("package: this Fledge is installed; a checkout makes packages", 1)
    if context.preset != "release":
        raise Failure(f"package: it is of the build release; leave out --preset {context.preset}")
    context.project = None
    if not may_write(options.out, context.build):
        raise Failure(f"package: writes into {options.out} and {context.build}, where this user may not", 1)
    need(context, "run")
    build.compile(context, ["all"])
    build.view(context)
    log = context.logs / "package.log"
    if status := run(log, [sys.executable, ROOT / "cmake/fledge_deb.py", options.out.absolute()]):
        raise failure(log, "the package", status)
    for line in log.read_text(encoding="utf-8").splitlines():
        if line.startswith("fledge: "):
            print(line, file=sys.stderr)
    return 0


def demo(context: Context, options: argparse.Namespace) -> int:
    def fledge(*words: str) -> bool:
        return not pass_on([sys.executable, "-P", LAUNCHER, *words], environment={**os.environ, **context.names()})

    if not fledge("run", "mars_orbiter", "pointing"):
        return 1
    say("now the same flight software on an emulated LEON3, an hour of it")
    if not fledge("fly", "mars_orbiter", "pointing", "--on", "leon3", "--report"):
        return 1
    say("command it in a browser: ./fledge up missions/mars_orbiter/up.toml")
    return 0


def test(context: Context, options: argparse.Namespace) -> int:
    from fledge.launcher import testing

    if options.fledge:
        context.project = None
    if not context.project:
        if context.installed:
            raise Failure("test: there is no project around this folder, and an installed Fledge has no tests of its "
                          "own; go into a project's folder, or name one: fledge --project DIR test", 1)
        here = Path.cwd()
        if not options.fledge and ROOT not in (here, *here.parents):
            raise Failure("test: there is no project around this folder; go into one, or name it (fledge --project DIR "
                          "test); --fledge runs the tests of Fledge itself, which take long")
    elif options.changed is not None or options.folders:
        raise Failure(f"test: {'--changed' if options.changed is not None else 'FOLDER'} is for Fledge, not for a "
                      "project")
    if options.since and (options.pattern or options.changed is not None):
        raise Failure("test: --since chooses the tests, as -k and --changed do; give one of them")
    if options.since is None and (options.turn or options.compiled):
        raise Failure("test: --turn and --compiled are about what --since chooses; add it")
    if options.folders and (options.changed is not None or options.since or options.coverage):
        raise Failure("test: FOLDER is not for --changed, --since and --coverage")
    if (options.strict is not None or options.table) and not options.coverage:
        raise Failure("test: --strict and --table are about what --coverage counts; add it")
    return testing.Tests(context, options).run()


def docs(context: Context, options: argparse.Namespace) -> int:
    if context.installed and not context.project:
        raise Failure("docs: an installed Fledge has no documents but a project's", 1)
    need(context, "run")
    need(context, "docs")
    build.compile(context, ["desktop"])
    if not may_write(context.logs):
        raise Failure(f"docs: writes into {context.logs}, where this user may not", 1)
    tree, log = context.tree, context.logs / "docs.log"
    strict = [] if context.project else ["-W", "--keep-going"]
    # -E -a: all pages anew, for headers, docstrings and the list of pages are in none of the sources.
    if status := run(log, [sys.executable, "-P", "-m", "sphinx", "-E", "-a", *strict, "-c", ROOT / "docs",
                           "-d", tree / "build/docs/doctrees", tree, tree / "build/docs/html"],
                     environment=context.environment()):
        raise failure(log, "Sphinx", status)
    if context.project:
        for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
            if "WARNING: " in line:
                print(line, file=sys.stderr)
    say(f"open {tree}/build/docs/html/index.html")
    return 0


def completion(context: Context, options: argparse.Namespace) -> int:
    print(Path(__file__).with_name("completion.sh").read_text(encoding="utf-8"), end="")
    return 0


# --- exec ------------------------------------------------------------------------------------------

def exec_(context: Context, options: argparse.Namespace) -> int:
    program, *arguments = options.words[1:]
    need(context, "run")
    if program in ("dask-scheduler", "dask-worker"):
        need(context, "scheduler")
    # The extension is built for Debian's Python, which therefore comes first on the PATH; except for a virtual
    # environment that was made from it.
    path, active = os.environ.get("PATH", os.defpath), os.environ.get("VIRTUAL_ENV")
    if not active or not same(f"{active}/bin/python3", sys.executable):
        path = os.path.dirname(sys.executable) + os.pathsep + path
    file = which(program, path=path)
    if not file:
        raise Failure(f"exec: {_where_is(program)}", 127)
    build.compile(context, ["all"])
    return become(file, [program, *arguments], {**context.environment(), "PATH": path})


def become(file: str, words: list[str], environment: Mapping[str, str]) -> int:
    """Go on as another program: a signal to this process then reaches it."""
    sys.stdout.flush()
    for number in (signal.SIGPIPE, signal.SIGXFSZ):     # Python ignores them, and a program would inherit that
        signal.signal(number, signal.SIG_DFL)
    os.execve(file, words, environment)


def _where_is(tool: str) -> str:
    """Which Debian package has a tool that is not installed."""
    import subprocess

    if "/" in tool:
        return f"there is no program {tool}"
    name = re.sub(r"([^\w-])", r"\\\1", tool, flags=re.ASCII)
    try:
        output = subprocess.run(["apt-cache", "search", "--names-only", f"^(python3-)?{name}3?$"], text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
    except OSError:
        output = ""
    packages = sorted(line.partition(" - ")[0] for line in output.splitlines())
    if packages and packages[0]:
        return f"{tool} is not installed; as root, run: apt-get install {packages[0]}"
    return f"{tool} is not installed, and no Debian package has its name: try 'apt-file search bin/{tool}'"
