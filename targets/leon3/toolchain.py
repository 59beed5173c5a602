# SPDX-License-Identifier: Apache-2.0
"""The toolchain of the LEON3 target: Debian's SPARC compiler, and newlib, the C library, from Debian's package of its
source. The library is built once, in build/leon3 (of an installed Fledge: in ~/.cache), and again when a part of it has
changed."""
from __future__ import annotations

import hashlib
import shutil
import subprocess
import tarfile
from fnmatch import fnmatch
from functools import lru_cache
from pathlib import Path

from fledge.errors import Failure
from fledge.disk import write_files
from fledge.targets.build import OF_OTHERS, once, run_ninja

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Iterator

COMPILER, SIZE = "sparc64-linux-gnu-gcc", "sparc64-linux-gnu-size"
NEWLIB = Path("/usr/src/newlib")

# The compiler is one for Linux, of 64 bits: it makes SPARC V8 for a board, without the names of Linux, and without what
# Ubuntu switches on, for which glibc is needed.
MACHINE = ["-m32", "-mcpu=leon3", "-mno-v8plus", "-mhard-float", "-mlong-double-64", "-fno-pic", "-fno-pie",
           "-fno-stack-protector", "-U_FORTIFY_SOURCE", "-U__linux__", "-U__linux", "-Ulinux", "-U__gnu_linux__",
           "-U__unix__", "-U__unix", "-Uunix"]

# What newlib's configuration would find out, besides its version.
CONFIGURATION = """\
#define _WANT_IO_C99_FORMATS 1
#define _WANT_IO_LONG_LONG 1
#define _HAVE_LONG_DOUBLE 1
#define _LDBL_EQ_DBL 1
#define _HAVE_CC_INHIBIT_LOOP_TO_LIBCALL 1
#define _MB_LEN_MAX 1
#define _ATEXIT_DYNAMIC_ALLOC 1
#define _FVWRITE_IN_STREAMIO 1
#define _FSEEK_OPTIMIZATION 1
#define _UNBUF_STREAM_OPT 1
"""
FOLDERS = ["libc/ctype", "libc/errno", "libc/locale", "libc/misc", "libc/reent", "libc/search", "libc/signal",
           "libc/stdio", "libc/stdlib", "libc/string", "libc/time", "libm/common", "libm/math"]
PRINT = ["", "-DINTEGER_ONLY", "-DSTRING_ONLY", "-DINTEGER_ONLY -DSTRING_ONLY"]
ALLOCATE = [f"-DINTERNAL_NEWLIB -DDEFINE_{name}" for name in
            ("MALLOC", "FREE", "REALLOC", "CALLOC", "CFREE", "MALLINFO", "MALLOC_USABLE_SIZE", "MALLOPT",
             "MALLOC_STATS", "MEMALIGN", "VALLOC", "PVALLOC")]
# Objects of one source in newlib 3, of Debian 12. In newlib 4 each has a source of its own, as svfprintf.c, which
# includes the common one.
SEVERAL = {"vfprintf": PRINT, "vfscanf": PRINT, "mallocr": ALLOCATE}
# Variants, a source that others include, and what does not compile without an operating system.
LEFT_OUT = ("nano-*", "_mallocr", "gettzinfo")


@lru_cache
def library() -> Path:
    """The folder of the library, in which newlib's source is, too. It is built if it is not there."""
    archives, compiler = sorted(NEWLIB.glob("newlib-*.tar.xz")), shutil.which(COMPILER)
    if not archives or not compiler:
        raise Failure(f"{COMPILER if archives else f'the source of newlib, in {NEWLIB},'} is not installed; "
                      "./fledge setup --on leon3 installs it")
    versions = [(file.name, file.stat().st_size, file.stat().st_mtime_ns)
                for file in (archives[-1], Path(compiler).resolve())]
    recipe = hashlib.sha256(Path(__file__).read_bytes() + repr(versions).encode()).hexdigest()
    with once("leon3", recipe, "the C library for LEON3") as (folder, missing):
        if missing:
            _build(archives[-1], folder)
    return folder


def headers() -> list[str]:
    """The flags for the headers of the library and of the compiler, in place of Linux's."""
    return _headers(library())


def link(script: Path, **symbols: int) -> list[str | Path]:
    """The flags that link a program by a linker script, in which these symbols have values."""
    return ["-nostdlib", "-static", "-no-pie", "-T", script, "-Wl,--build-id=none", "-Wl,--no-warn-rwx-segments",
            *(f"-Wl,--defsym={name}={value:#x}" for name, value in symbols.items()), library() / "libc.a"]


def _headers(folder: Path) -> list[str]:
    own = subprocess.run([COMPILER, "-print-file-name=include"], capture_output=True, text=True, check=True)
    return ["-nostdinc", "-isystem", str(folder / "include"), "-isystem", str(folder / "source/libc/include"),
            "-isystem", own.stdout.strip()]


def _build(archive: Path, folder: Path) -> None:
    source = folder / "source"
    for old in (source, folder / "o"):
        shutil.rmtree(old, ignore_errors=True)
    with tarfile.open(archive) as packed:
        for member in packed:
            _, _, member.name = member.name.partition("/newlib/")       # newlib-VERSION/newlib/libc/...
            if member.isreg() and member.name.startswith(("libc/", "libm/")):
                packed.extract(member, source, set_attrs=False)
    version = archive.name.removeprefix("newlib-").split(".")[:3]       # newlib-4.4.0.20231231.tar.xz
    named = [f'#define _NEWLIB_VERSION "{".".join(version)}"', *(
        f"#define __NEWLIB_{part} {number}" for part, number in zip(("_", "MINOR__", "PATCHLEVEL__"), version))]
    write_files({"include/newlib.h": "\n".join(named) + "\n" + CONFIGURATION,
                 "include/_newlib_version.h": "#include <newlib.h>\n"}, folder)
    words = " ".join([*MACHINE, *_headers(folder), "-O2", *OF_OTHERS, "-ffunction-sections",
                      "-fdata-sections", "-fno-builtin", "-D_COMPILING_NEWLIB", "-D_LIBC", f"-I{source}/libm/common"])
    cached = "ccache " if shutil.which("ccache") else ""
    members = list(_objects(source))
    write_files({"build.ninja": "\n".join([
        "builddir = .", "rule cc", f"  command = {cached}{COMPILER} {words} $definitions -c $in -o $out",
        "  description = $out", "rule ar", "  command = rm -f $out && ar rcs $out @$out.list",
        "  rspfile = $out.list", "  rspfile_content = $in",
        *(f"build {name}: cc {file}\n  definitions = {text}" for name, file, text in members),
        f"build libc.a: ar {' '.join(name for name, _, _ in members)}", ""])}, folder)
    run_ninja(folder, "libc.a")


def _objects(source: Path) -> Iterator[tuple[str, Path, str]]:
    """(name, source, definitions) of each object of the library."""
    several = {} if (source / "libc/stdio/svfprintf.c").exists() else SEVERAL
    for part in FOLDERS:
        for file in sorted((source / part).glob("*.c")):
            if not any(fnmatch(file.stem, pattern) for pattern in LEFT_OUT):
                for i, definitions in enumerate(several.get(file.stem, [""])):
                    yield f"o/{part.replace('/', '_')}_{file.stem}{i or ''}.o", file, definitions
    yield "o/setjmp.o", source / "libc/machine/sparc/setjmp.S", ""
