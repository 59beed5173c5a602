# SPDX-License-Identifier: Apache-2.0
"""The toolchain of the MicroPython targets: its source, which is Debian's package; the cross-compiler of scripts; and
the interpreter as libraries: for this machine and for a LEON3 board, for flight and for development. All of it is
built once, in build/micropython (of an installed Fledge: in ~/.cache), and again when a part of it has changed.
"""
from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from fledge.errors import Failure
from fledge.files import write_files
from fledge.programs import without_preload
from fledge.targets.build import COMMAND, ROOT, _escaped, _words, math_sources, once, program, run_ninja
from fledge.targets.leon3 import toolchain as leon3

PACKAGE, SUITE, VERSION = "micropython", "trixie", "1.25.0+ds-1"
ARCHIVE = f"{PACKAGE}_{VERSION.rpartition('-')[0]}.orig.tar.xz"
SHA256 = "7b25be99a502f070b2de81dafc08da7051d992325d6e67daa9045a918fffdbea"
KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")

PORT = ROOT / "targets/micropython"
PARTS = ("py/", "mpy-cross/", "extmod/", "shared/", "tools/mpy-tool.py")   # of the source; the rest is for other ports

# The representation of objects with 64 bits is made for machines of 32: corrections for others. Iteration in C counts
# for a budget, too. Decimals are exact (decimal.h). file -> (what is there once, what takes its place)
EDITS: dict[str, list[tuple[str, str]]] = {
    "py/obj.h": [("const void *lo, *hi;", "FLEDGE_ROM_OBJ"), ("{.lo = (p), .hi = NULL}", "{.lo = (p)}")],
    "py/parse.c": [("sizeof(mp_parse_node_struct_t) + sizeof(mp_obj_t));",
                    "sizeof(mp_parse_node_struct_t) + 2 * sizeof(mp_parse_node_t));")],
    "py/objint.c": [("8 * sizeof(uintptr_t) + MP_FLOAT_EXP_BIAS", "MP_SMALL_INT_BITS + 1 + MP_FLOAT_EXP_BIAS")],
    "py/runtime.c": [("mp_cstack_check(); // enumerate", "MICROPY_VM_HOOK_LOOP mp_cstack_check(); // enumerate")],
    "py/objfloat.c": [("const int precision = 16;", "const int precision = DECIMAL_SHORTEST;"),
                      ("MICROPY_FLOAT_C_FUN(pow)(lhs_val, rhs_val)", "script_pow(lhs_val, rhs_val)")],
    "py/modbuiltins.c": [("MICROPY_FLOAT_C_FUN(pow)(10, (mp_float_t)num_dig)", "script_pow(10, (mp_float_t)num_dig)")],
    "py/parsenum.c": [("dec_val = (mp_float_t)mantissa;",
                       "dec_val = decimal_read(str_val_start, (size_t)(str - str_val_start));"),
                      ("if (exp_val < SMALL_NORMAL_EXP) {", "if (0) {"),
                      ("if (exp_val < 0 && exp_val >= -EXACT_POWER_OF_10) {", "if (0) {"),
                      ("dec_val *= MICROPY_FLOAT_C_FUN(pow)(10, exp_val);", "")],
    "py/binary.c": [("void mp_binary_set_val_array(char typecode, void *p, size_t index, mp_obj_t val_in) {",
                     "void mp_binary_set_val_array(char typecode, void *p, size_t index, mp_obj_t val_in) {"
                     " script_check_fits(typecode, val_in);")],
    "tools/mpy-tool.py": [('n = struct.unpack("<I", struct.pack("<f", obj))[0]', "n = 0"),     # large floats fail there
                          ("n += 0x8004000000000000", "n = (n + 0x8004000000000000) % 2**64")],
}
LEFT_OUT = {"objint_longlong.c", "formatfloat.c"}   # longint.c and decimal.c take their places

WORDS = ["-std=gnu99", "-Os", "-fwrapv", "-ffp-contract=off", "-fno-math-errno", "-ffunction-sections",
         "-fdata-sections", "-fno-asynchronous-unwind-tables", "-DNDEBUG"]
OURS = ["-Wall", "-Wextra", "-Wno-unused-parameter"]
DECIMAL = ["-Dmp_format_float=decimal_format", "-include", "targets/micropython/decimal.h"]
SEVERAL = {"vm.c": ["-O2"],     # -Os doubles the time of a loop
           # what would cut an integer to fewer bits
           "objrange.c": ["-Dmp_obj_get_int=script_range_int"],
           **{name: ["-Dmp_obj_get_int_maybe=script_times"] for name in ("objlist.c", "objtuple.c", "objstr.c")},
           "mpprint.c": DECIMAL, "parsenum.c": DECIMAL,
           "objfloat.c": [*DECIMAL, "-Dmp_obj_get_float_maybe=units_plain_number"],    # 2.0 * deg is a quantity
           "malloc.c": ["-Dmalloc=arena_take", "-Drealloc=arena_resize", "-Dfree=arena_give",
                        "-include", "targets/micropython/arena.h"]}
SMALL_INT_BITS, LONG_INT = 47, "longlong"       # of the port


class Library(NamedTuple):
    """The interpreter for a machine."""

    archive: Path
    compiler: str
    flags: list[str]        # for C that includes MicroPython's headers

    @property
    def folder(self) -> Path:
        return self.archive.parent


@lru_cache
def library(machine: str = "host", development: bool = False) -> Library:
    """The interpreter for "host" or "leon3", with the compiler of Python or without it. It is built if it is not
    there, or if its sources have changed; other programs wait meanwhile."""
    if machine == "leon3":
        compiler, words = leon3.COMPILER, [*leon3.MACHINE, *leon3.headers()]
    else:
        compiler, words = "gcc", ["-fno-pie", "-fno-stack-protector"]
    name = f"{machine}-{'development' if development else 'flight'}"
    source = _source()
    recipe = _recipe(Path(__file__), Path(shutil.which(compiler) or _missing(compiler)),
                     *_all(PORT), *_all(ROOT / "flight"), *(ROOT / "targets").glob("*.h"))
    with once(f"micropython/{name}", recipe, f"MicroPython for {name}") as (folder, missing):
        flags = [*words, f"-DFLEDGE_COMPILER={int(development)}",
                 "-DMP_CONFIGFILE=<targets/micropython/mpconfigport.h>", f"-I{ROOT}", f"-I{source}", f"-I{folder}"]
        if missing:
            core = [path for path in sorted((source / "py").glob("*.c")) if path.name not in LEFT_OUT]
            port = sorted(PORT.glob("*.c"))
            _headers(folder, source, [compiler, *WORDS, *flags], [*core, *port])
            _ninja(folder, "libmicropython.a", compiler, [*WORDS, *flags],
                   [*((path, ["-w", *SEVERAL.get(path.name, [])]) for path in core), *((path, OURS) for path in port)])
    return Library(folder / "libmicropython.a", compiler, flags)


@lru_cache
def cross_compiler() -> Path:
    """mpy-cross, which makes bytecode of Python."""
    source = _source()
    recipe = _recipe(Path(__file__), Path(shutil.which("gcc") or _missing("gcc")), PORT / "decimal.c",
                     PORT / "decimal.h")
    with once("micropython/cross", recipe, "MicroPython's compiler") as (folder, missing):
        if missing:
            core = [path for path in sorted((source / "py").glob("*.c")) if path.name != "formatfloat.c"]
            others = [source / "mpy-cross/main.c", source / "mpy-cross/gccollect.c",
                      source / "shared/runtime/gchelper_generic.c", PORT / "decimal.c"]
            words = ["-std=gnu99", "-O1", "-w", *DECIMAL, "-Dscript_pow=pow", "-Dscript_check_fits(a,b)=",
                     f"-I{source}/mpy-cross", f"-I{source}", f"-I{folder}", f"-I{ROOT}"]
            _headers(folder, source, ["gcc", *words], core)
            _ninja(folder, "mpy-cross", "gcc", words, [(path, []) for path in [*core, *others]], ["-lm"])
    return folder / "mpy-cross"


def compile_mpy(source: str | Path, name: str) -> bytes:
    """The bytecode of a script: its text, or its file. Errors name it so: "nadir_spin/flight.py"."""
    text = source.read_text(encoding="utf-8") if isinstance(source, Path) else source
    done = subprocess.run([cross_compiler(), f"-msmall-int-bits={SMALL_INT_BITS}", "-s", name, "-o", "/dev/stdout",
                           "--", "/dev/stdin"], input=text.encode(), capture_output=True)
    if done.returncode:
        reason = _reason(done.stderr.decode(errors="replace")).replace("/dev/stdin", name)
        raise Failure(f"{name} cannot be compiled for MicroPython:\n{reason}", 1)
    return done.stdout


def freeze(scripts: Mapping[str, str | Path], library: Library) -> str:
    """C that holds the bytecode of scripts, for programs with this library: path of a module, "nadir_spin/flight.py",
    -> its text or file."""
    scripts = scripts or {"_.py": ""}
    with tempfile.TemporaryDirectory() as folder:
        files = {}
        for name, source in sorted(scripts.items()):
            files[f"{name.removesuffix('.py')}.mpy"] = compile_mpy(source, name)
        write_files(files, folder)
        done = subprocess.run([sys.executable, _source() / "tools/mpy-tool.py", "-f", "-q",
                               library.folder / "genhdr/qstrdefs.preprocessed.h", f"-mlongint-impl={LONG_INT}",
                               *files], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise Failure(f"the scripts {', '.join(scripts)} cannot be frozen:\n{_reason(done.stderr)}", 1)
    for large in re.findall(r"{{&mp_type_int}, (-?\d+)}", done.stdout):
        if not -2**63 <= int(large) < 2**63:
            raise Failure(f"the scripts {', '.join(scripts)} have the integer {large}; MicroPython has 64 bits", 1)
    return done.stdout


def interpreter(folder: Path, scripts: Mapping[str, str | Path] | None = None, machine: str = "host",
                development: bool = False, cycles: int = 100, heap: int = 256 * 1024) -> Path:
    """Build a program for scripts without a mission: it runs the frozen `script`, or, in development, a file; then its
    functions `init` and, as often as `cycles`, under the lock, `loop`. It ends with the figures of its heap."""
    from fledge.targets.leon3 import board

    made = library(machine, development)
    name = "fledge_micropython"
    write_files({"frozen.c": freeze(scripts or {}, made)}, folder)
    sources = [PORT / "interpreter/main.c", folder / "frozen.c", *sorted((ROOT / "flight/exec").glob("*.c")),
               *(ROOT / path for path in COMMAND), *math_sources()]
    flags = [*made.flags, "-w", f"-DSCRIPT_CYCLES={cycles}", f"-DSCRIPT_HEAP={heap}"]
    if machine == "leon3":
        return board.program(folder / machine, name, sources, [ROOT], flags, archives=[made.archive])
    return program(folder / machine, name, sources, [ROOT], made.compiler, flags, ["-static", "-no-pie", "-lm"],
                   archives=[made.archive])


# --- the source ----------------------------------------------------------------------------------


@lru_cache
def _source() -> Path:
    """The folder of MicroPython's source, with our corrections."""
    with once("micropython/source", _recipe(Path(__file__)), "MicroPython's source") as (unpacked, missing):
        if missing:
            archive = _archive(unpacked.parent)
            for part in unpacked.iterdir():
                if part.is_dir():
                    shutil.rmtree(part)
            with tarfile.open(archive) as packed:
                for member in packed:
                    _, _, member.name = member.name.partition("/")
                    if member.isreg() and member.name.startswith(PARTS):
                        packed.extract(member, unpacked, set_attrs=False)
            _edit(unpacked, EDITS)
    return unpacked


def _edit(folder: Path, edits: Mapping[str, Sequence[tuple[str, str]]]) -> None:
    for name, changes in edits.items():
        text = (folder / name).read_text(encoding="utf-8")
        for old, new in changes:
            if text.count(old) != 1:
                raise Failure(f"{folder / name} is not that of MicroPython {VERSION}: '{old}' is there "
                              f"{text.count(old)} times", 1)
            text = text.replace(old, new)
        write_files({name: text}, folder)


def _archive(folder: Path) -> Path:
    """The archive of the source, which apt fetches if it is not there."""
    archive = folder / ARCHIVE
    if not archive.is_file():
        _fetch(folder)
    found = hashlib.sha256(archive.read_bytes()).hexdigest()
    if found != SHA256:
        raise Failure(f"{archive} is not MicroPython's source of Debian: its SHA-256 is {found}, not {SHA256}; "
                      "remove the file, then ./fledge setup --on micropython fetches it again", 1)
    return archive


def _fetch(folder: Path) -> None:
    """Fetch the archive from the mirror that this machine's apt uses, with lists of our own: the machine's stay."""
    mirror = _mirror(folder)
    own = folder / "apt"
    write_files({"sources.list": f"deb-src [signed-by={KEYRING}] {mirror} {SUITE} main\n"}, own)
    for name in ("lists/partial", "cache/archives/partial"):
        (own / name).mkdir(parents=True, exist_ok=True)
    options = [f"Dir::Etc::sourcelist={own}/sources.list", "Dir::Etc::sourceparts=-", f"Dir::State::Lists={own}/lists",
               f"Dir::Cache={own}/cache", "APT::Sandbox::User=", "Acquire::Languages=none", "Acquire::Retries=3"]
    words = [word for option in options for word in ("-o", option)]
    for command in (["update"], ["source", "--download-only", f"{PACKAGE}={VERSION}"]):
        done = subprocess.run(["apt-get", "-q", *words, *command], cwd=folder, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, errors="replace",
                              env=without_preload({**os.environ, "LC_ALL": "C"}))
        wrong = "\n".join(re.findall(r"^(?:E|W|Err):.*$", done.stdout, re.MULTILINE))
        if done.returncode or (command == ["update"] and wrong):
            raise Failure(f"apt cannot fetch MicroPython's source package, {PACKAGE} {VERSION}, from {mirror}; "
                          f"without a network, put {ARCHIVE} into {folder}:\n{wrong or done.stdout}", 1)
    shutil.rmtree(own)


def _mirror(folder: Path) -> str:
    """The address of Debian's archive in this machine's configuration of apt."""
    if not shutil.which("apt-get") or not KEYRING.is_file():
        raise Failure(f"MicroPython's source comes from Debian, by apt and its keys in {KEYRING}, and one of them is "
                      f"not here; put {ARCHIVE} into {folder}", 1)
    known = subprocess.run(["apt-get", "update", "--print-uris"], capture_output=True, text=True,
                           env=without_preload(os.environ)).stdout
    found = re.search(r"^'(.*)/dists/[^/'-]+/InRelease'", known, re.MULTILINE)
    if not found:
        raise Failure("apt's configuration names no mirror of Debian's archive, from which MicroPython's source could "
                      f"come; put {ARCHIVE} into {folder}", 1)
    return found[1]


# --- building ------------------------------------------------------------------------------------


def _recipe(*files: Path) -> str:
    made = hashlib.sha256()
    for file in sorted(files):
        made.update(f"{file.relative_to(ROOT) if file.is_relative_to(ROOT) else file}\0".encode())
        made.update(file.read_bytes())
    return made.hexdigest()


def _all(folder: Path) -> Iterable[Path]:
    return (path for path in folder.rglob("*.[ch]") if path.is_file())


def _missing(tool: str) -> str:
    raise Failure(f"{tool} is not installed")


def _reason(text: str) -> str:
    """The last lines of what a tool said."""
    return "\n".join(text.strip().splitlines()[-3:])


def _headers(folder: Path, source: Path, compiler: Sequence[str], sources: Sequence[Path]) -> None:
    """Write the headers that MicroPython's scripts make of all sources: names, modules, roots."""
    work = folder / "collected"
    shutil.rmtree(work, ignore_errors=True)
    (work / "genhdr").mkdir(parents=True)
    (folder / "genhdr").mkdir(exist_ok=True)
    py = source / "py"
    # While names are collected, the headers that follow from them are empty.
    for name in ("moduledefs.h", "root_pointers.h", "mpversion.h", "qstrdefs.generated.h"):
        (work / "genhdr" / name).touch()
    (work / "all.i").write_text(_run([*compiler[:1], f"-I{work}", *compiler[1:], "-E", "-DNO_QSTR", *sources]),
                                encoding="utf-8")
    for kind in ("qstr", "module", "root_pointer"):
        _run([sys.executable, py / "makeqstrdefs.py", "split", kind, "all.i", f"{kind}s", "_"], work)
        _run([sys.executable, py / "makeqstrdefs.py", "cat", kind, "_", f"{kind}s", f"{kind}s.h"], work)
    names = (py / "qstrdefs.h").read_text(encoding="utf-8") + (work / "qstrs.h").read_text(encoding="utf-8")
    quoted = re.sub(r"^(Q\(.*\))", r'"\1"', names, flags=re.MULTILINE)
    seen = _run([*compiler[:1], f"-I{work}", *compiler[1:], "-E", "-"], given=quoted)
    (work / "qstrdefs.preprocessed.h").write_text(re.sub(r'^"(Q\(.*\))"', r"\1", seen, flags=re.MULTILINE),
                                                  encoding="utf-8")
    write_files({
        "genhdr/qstrdefs.preprocessed.h": re.sub(r"^#.*\n", "", (work / "qstrdefs.preprocessed.h").read_text(
            encoding="utf-8"), flags=re.MULTILINE),
        "genhdr/qstrdefs.generated.h": _run([sys.executable, py / "makeqstrdata.py", "qstrdefs.preprocessed.h"], work),
        "genhdr/moduledefs.h": _run([sys.executable, py / "makemoduledefs.py", "modules.h"], work),
        "genhdr/root_pointers.h": _run([sys.executable, py / "make_root_pointers.py", "root_pointers.h"], work),
        "genhdr/mpversion.h": f'#define MICROPY_GIT_TAG "v{VERSION}"\n#define MICROPY_GIT_HASH ""\n'
                              '#define MICROPY_BUILD_DATE ""\n'}, folder)


def _run(command: Sequence[str | Path], folder: Path | None = None, given: str | None = None) -> str:
    done = subprocess.run(command, cwd=folder, input=given, capture_output=True, text=True)
    if done.returncode:
        raise Failure(f"MicroPython cannot be built: {' '.join(map(str, command[:3]))} ...:\n{done.stderr}", 1)
    return done.stdout


def _ninja(folder: Path, output: str, compiler: str, words: Sequence[str],
           sources: Sequence[tuple[Path, Sequence[str]]], link: Sequence[str] = ()) -> None:
    cached = "ccache " if shutil.which("ccache") else ""
    objects = [f"o/{path.parent.name}_{path.stem}.o" for path, _ in sources]
    rule = "link" if link else "ar"
    write_files({"build.ninja": "\n".join([
        "builddir = .",
        "rule cc", f"  command = {cached}{compiler} {_words(words)} $more -MMD -MF $out.d -c $in -o $out",
        "  depfile = $out.d", "  deps = gcc", "  description = compiling $in",
        "rule ar", "  command = rm -f $out && ar rcsD $out @$out.list", "  rspfile = $out.list",
        "  rspfile_content = $in", "rule link", f"  command = {compiler} $in {_words(link)} -o $out",
        *(f"build {name}: cc {_escaped(path)}\n  more = {_words(more)}"
          for name, (path, more) in zip(objects, sources)),
        f"build {output}: {rule} {' '.join(objects)}", ""])}, folder)
    run_ninja(folder, output)
