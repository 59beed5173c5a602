# SPDX-License-Identifier: Apache-2.0
"""Exported apps, compiled and linked with the pocket cFE into one program, and the folder that it runs in."""

import functools
import subprocess
import tempfile
from pathlib import Path

from fledge.targets.cfs.export.around import app_list, pocket_sources, startup, wrappers
from fledge.disk import ROOT, write_files

FLAGS = ["-std=c99", "-pedantic", "-Wall", "-Wstrict-prototypes", "-Wwrite-strings", "-Wpointer-arith", "-Werror",
         "-fno-common"]
EXACT = ["-ffp-contract=off", "-fno-math-errno"]


def build(apps, folder, compiler="gcc", options=("-O2",), loaded=False):
    """Compile (App, its folder) pairs, and link them into folder/core, or, loaded, into files of their own; tables,
    start-up script and files go to folder/cf. Returns the program. Raises CalledProcessError with what the compiler
    says."""
    folder = Path(folder)
    objects = folder / "objects"
    (folder / "cf").mkdir(parents=True, exist_ok=True)
    (folder / "ram").mkdir(exist_ok=True)
    linked = []
    for app, source in apps:
        compilation = compiled(app, source, objects / app.name, compiler, [*options, *(["-fPIC"] if loaded else [])])
        if loaded:
            run(compiler, *options, "-shared", *compilation, "-lm", "-o", folder / f"cf/{app.name}.so")
        else:
            linked += compilation
        for table in sorted(Path(source, "cf").glob("*.tbl")):
            (folder / "cf" / table.name).write_bytes(table.read_bytes())
    (folder / "cf/cfe_es_startup.scr").write_text("".join(startup(app) for app, _ in apps) + "!\n")
    listed = objects / "apps.c"
    listed.write_text(app_list([] if loaded else [app for app, _ in apps]))
    run(compiler, *FLAGS, *options, *included(), "-c", listed, "-o", objects / "apps.o")
    program = folder / "core"
    run(compiler, *options, *(["-rdynamic"] if loaded else []), *linked, objects / "apps.o",
        *pocket(compiler, tuple(o for o in options if not o.startswith("-D"))), "-lpthread", "-lm", "-o", program)
    return program


def compiled(app, source, objects, compiler="gcc", options=("-O2",)):
    """The object files of an app, by the flags that a cFS tree imposes."""
    objects.mkdir(parents=True, exist_ok=True)
    files = sorted(Path(source, "fsw/src").rglob("*.c"))
    paths = [objects / (str(file.relative_to(Path(source, "fsw/src"))).replace("/", "_") + ".o") for file in files]
    in_folder(files, paths, compiler, [*FLAGS, *EXACT, *options, *included(), *own(app, source, objects)])
    return paths


def own(app, source, folder):
    """The options for the headers of an app, as its build in a tree finds them."""
    write_files(wrappers(app), folder / "inc")
    return ["-I", source, "-I", folder / "inc", "-I", Path(source, "fsw/inc"), "-I", Path(source, "fsw/src")]


def in_folder(files, objects, compiler, options):
    """Compile many files by two compilers side by side."""
    jobs: list[subprocess.Popen] = []
    try:
        for file, to in zip(files, objects):
            if len(jobs) == 2:
                finish(jobs.pop(0))
            jobs.append(subprocess.Popen(list(map(str, [compiler, *options, "-c", file, "-o", to])),
                                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))
        while jobs:
            finish(jobs.pop(0))
    finally:
        for job in jobs:
            job.kill()
            job.wait()


def finish(job):
    output, _ = job.communicate()
    if job.returncode:
        raise subprocess.CalledProcessError(job.returncode, job.args, output)


def run(*command):
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def included():
    return ["-I", ROOT, "-I", ROOT / "targets/cfs/inc"]


@functools.cache
def pocket(compiler="gcc", options=("-O2",)):
    """The objects of the pocket cFE and its host, compiled once."""
    folder = tempfile.TemporaryDirectory()
    alive.append(folder)
    files = pocket_sources()
    objects = [Path(folder.name, file.stem + ".o") for file in files]
    in_folder(files, objects, compiler, [*FLAGS, *options, *included()])
    return objects


alive: list = []
