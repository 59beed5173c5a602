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
from fledge.disk import write_files
from fledge.programs import without_preload
from fledge.targets.build import COMMAND, OF_OTHERS, ROOT, _escaped, _words, math_sources, once, program, run_ninja
from fledge.targets.leon3 import toolchain as leon3

PACKAGE, SUITE, VERSION = "micropython", "trixie", "1.25.0+ds-1"
ARCHIVE = f"{PACKAGE}_{VERSION.rpartition('-')[0]}.orig.tar.xz"
SHA256 = "7b25be99a502f070b2de81dafc08da7051d992325d6e67daa9045a918fffdbea"
KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")

PORT = ROOT / "targets/micropython"
PARTS = ("py/", "mpy-cross/", "extmod/", "shared/", "tools/mpy-tool.py")   # of the source; the rest is for other ports

# The representation of objects with 64 bits is made for machines of 32: corrections for others. Decimals are exact
# (decimal.h). file -> (what is there once, what takes its place)
EDITS: dict[str, list[tuple[str, str]]] = {
    "py/obj.h": [("const void *lo, *hi;", "FLEDGE_ROM_OBJ"), ("{.lo = (p), .hi = NULL}", "{.lo = (p)}")],
    "py/parse.c": [("sizeof(mp_parse_node_struct_t) + sizeof(mp_obj_t));",
                    "sizeof(mp_parse_node_struct_t) + 2 * sizeof(mp_parse_node_t));")],
    "py/objint.c": [("8 * sizeof(uintptr_t) + MP_FLOAT_EXP_BIAS", "MP_SMALL_INT_BITS + 1 + MP_FLOAT_EXP_BIAS")],
    "py/objfloat.c": [("const int precision = 16;", "const int precision = DECIMAL_SHORTEST;"),
                      ("MICROPY_FLOAT_C_FUN(pow)(lhs_val, rhs_val)", "script_pow(lhs_val, rhs_val)")],
    "py/modbuiltins.c": [("        mp_float_t mult = MICROPY_FLOAT_C_FUN(pow)(10, (mp_float_t)num_dig);\n", ""),
                         ("MICROPY_FLOAT_C_FUN(nearbyint)(val * mult) / mult;",
                          "decimal_round(val, num_dig);\n        if (isinf(rounded) && !isinf(val)) {\n"
                          "            mp_raise_msg(&mp_type_OverflowError, MP_ERROR_TEXT(\"beyond a float\"));\n"
                          "        }")],
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

# The interpreter trusts what a script does; flight does not. Loops and recursion in C count for a budget and have a
# limit of depth (script_step). What a script keeps in an object may change while C looks at it: a class's methods are
# called, so C checks again. An absent object is as None, not a NULL pointer. No bytes become an object's address.
INSTANCE = "assert(mp_obj_is_instance_type(mp_obj_get_type(%s)));"
CONTAINED: dict[str, list[tuple[str, str]]] = {
    "py/obj.h": [
        ("return (((uint64_t)(o)) & 0xffff000000000000) == 0x0000000000000000;",
         "return (uint64_t)(o) - 1 < 0x0000ffffffffffff;"),
        ("    return num.r + 0x8004000000000000;",      # a NaN that would be read as another object
         "    num.r += 0x8004000000000000; return num.r >> 50 ? num.r : 0xfffc000000000000;"),
        ("mp_obj_cell_t *self = (mp_obj_cell_t *)MP_OBJ_TO_PTR(self_in);\n    return",
         "if (!mp_obj_is_exact_type(self_in, &mp_type_cell)) { script_broken(); }\n"
         "    mp_obj_cell_t *self = (mp_obj_cell_t *)MP_OBJ_TO_PTR(self_in);\n    return"),
        ("mp_obj_cell_t *self = (mp_obj_cell_t *)MP_OBJ_TO_PTR(self_in);\n    self",
         "if (!mp_obj_is_exact_type(self_in, &mp_type_cell)) { script_broken(); }\n"
         "    mp_obj_cell_t *self = (mp_obj_cell_t *)MP_OBJ_TO_PTR(self_in);\n    self"),
        ("extern const mp_obj_type_t mp_type_fun_bc;", "extern const mp_obj_type_t mp_type_fun_bc, mp_type_cell;")],
    "py/objcell.c": [("static MP_DEFINE_CONST_OBJ_TYPE(", "MP_DEFINE_CONST_OBJ_TYPE(")],
    "py/obj.c": [
        ("        return o->type;\n    }\n\n    #endif\n}",
         "        return o ? o->type : &mp_type_NoneType;\n    }\n\n    #endif\n}"),
        ("or just recursive\n    mp_cstack_check();", "or just recursive\n    script_step();"),
        ("    // generic type, call binary_op(MP_BINARY_OP_EQUAL)", "    mp_cstack_check();")],
    "py/sequence.c": [(f"        if (mp_obj_equal({what}", f"        script_step();\n        if (mp_obj_equal({what}")
                      for what in ("items1[i], items2[i])", "items[i], value)) {\n            //",
                                   "items[i], value)) {\n            count")]
    + [("    for (size_t i = 0; i < times; i++) {\n        size_t copy_sz",
        "    assert(len == 0 || times < SIZE_MAX / item_sz / len);\n"
        "    for (size_t i = 0; len != 0 && i < times; i++) {\n        size_t copy_sz")],
    "py/objtuple.c": [("hash += MP_OBJ", "script_step();\n                hash += MP_OBJ")],
    "py/objdict.c": [("mp_map_elem_t *elem = mp_map_lookup(&rhs->map, next",
                      "script_step();\n                    mp_map_elem_t *elem = mp_map_lookup(&rhs->map, next")],
    "py/objstr.c": [("if (memcmp(&haystack[str_index]", "script_step();\n            if (memcmp(&haystack[str_index]")],
    "py/runtime.h": [("#define mp_check_self(pred)\n", "#define mp_check_self(pred) assert(pred)\n")],
    "py/runtime.c": [
        ("mp_cstack_check(); // enumerate", "script_step(); // enumerate"),
        ("    // get the type\n    const mp_obj_type_t *type = mp_obj_get_type(fun_in);",
         "    mp_cstack_check();\n    const mp_obj_type_t *type = mp_obj_get_type(fun_in);"),
        ("mp_obj_t len = mp_obj_len_maybe(args[i]);",
         "mp_obj_t len = mp_obj_is_instance_type(mp_obj_get_type(args[i])) ? MP_OBJ_NULL : mp_obj_len_maybe(args[i]);"),
        ("assert(args2_len + len <= args2_alloc);",      # an iterator before it may have been longer than announced
         "if (args2_len + len + n_args > args2_alloc) {\n"
         "                        args2_alloc = args2_len + len + n_args;\n"
         "                        args2 = mp_nonlocal_realloc(args2, 0, args2_alloc * sizeof(mp_obj_t));\n"
         "                    }"),
        ("mp_map_t *map = &mp_obj_module_get_globals(module)->map;",
         "assert(mp_obj_is_type(module, &mp_type_module));\n"
         "    mp_map_t *map = &mp_obj_module_get_globals(module)->map;")],
    "py/vm.c": [        # the compiler leaves no place on the stack for the second of both
        ("PUSH((mp_obj_t)(mp_uint_t)(*ip));", "obj_shared = (mp_obj_t)(mp_uint_t)*ip;"),
        ("mp_uint_t unum = (mp_uint_t)POP();", "mp_uint_t unum = (mp_uint_t)obj_shared;"),
        ("PUSH((mp_obj_t)cause);", "obj_shared = (mp_obj_t)cause;")],
    "py/objfun.c": [("    mp_obj_fun_bc_t *o = mp_obj_malloc_var(mp_obj_fun_bc_t, extra_args, mp_obj_t, n_extra_args, "
                     "&mp_type_fun_bc);\n    o->bytecode = code;",
                     "    const byte *ip = code;\n    MP_BC_PRELUDE_SIG_DECODE(ip);\n"
                     "    assert(n_def_pos_args == n_def_args"
                     " && !(scope_flags & MP_SCOPE_FLAG_DEFKWARGS) == (def_kw_args == MP_OBJ_NULL));\n"
                     "    mp_obj_fun_bc_t *o = mp_obj_malloc_var(mp_obj_fun_bc_t, extra_args, mp_obj_t, n_extra_args, "
                     "&mp_type_fun_bc);\n    o->bytecode = code;")],
    "py/map.c": [
        ("mp_obj_equal(slot->key, index)", "({ bool same = mp_obj_equal(slot->key, index);"
         " assert(slot == &map->table[pos]); same; })"),
        ("mp_obj_equal(elem, index)", "({ mp_obj_t *table = set->table; bool same = mp_obj_equal(elem, index);"
         " assert(set->table == table); same; })"),
        ("index));\n    }\n\n    size_t pos", "index));\n        assert(map->alloc != 0);\n    }\n\n    size_t pos"),
        ("index));\n    size_t pos", "index));\n    assert(set->alloc != 0);\n    size_t pos"),
        ("    set->alloc = get_hash_alloc_greater_or_equal_to(set->alloc + 1);\n    set->used = 0;\n"
         "    set->table = m_new0(mp_obj_t, set->alloc);",      # without memory, the set stays as it is
         "    size_t new_alloc = get_hash_alloc_greater_or_equal_to(set->alloc + 1);\n"
         "    set->table = m_new0(mp_obj_t, new_alloc);\n    set->alloc = new_alloc;\n    set->used = 0;")],
    "py/objarray.c": [
        ("    o->items = m_new(byte, typecode_size * o->len);",
         "    assert(n < SIZE_MAX / 8);\n    o->items = m_new(byte, typecode_size * o->len);"),
        ("        if (len == 0) {\n            array_append", "        if (i >= len) {\n            array_append")],
    "py/binary.c": [("                case 'P':\n                case 'O':\n                case 'S':\n"
                     "                    align = alignof(void *);\n                    size = sizeof(void *);\n"
                     "                    break;\n", "")],
    "py/objexcept.c": [("        return MP_OBJ_TO_PTR(((mp_obj_instance_t *)MP_OBJ_TO_PTR(self_in))->subobj[0]);",
                        "        mp_obj_t native = ((mp_obj_instance_t *)MP_OBJ_TO_PTR(self_in))->subobj[0];\n"
                        "        if (!mp_obj_is_native_exception_instance(native)) {\n"
                        "            mp_raise_TypeError(MP_ERROR_TEXT(\"call super().__init__() first\"));\n        }\n"
                        "        return MP_OBJ_TO_PTR(native);")],
    "py/objproperty.c": [(f"{name}) {{\n    mp_obj_property_t *p2", f"{name}) {{\n"
                          "    assert(mp_obj_is_type(self_in, &mp_type_property));\n    mp_obj_property_t *p2")
                         for name in ("getter", "setter", "deleter")],
    "py/objint.c": [("    bool overflow;\n\n    mp_int_t dlen",
                     "    bool overflow;\n    assert(mp_obj_is_int(args[0]));\n    mp_int_t dlen")],
    "py/objtype.c": [
        ("    mp_obj_instance_t *self = MP_OBJ_TO_PTR(args[0]);\n    const",
         f"    {INSTANCE % 'args[0]'}\n    mp_obj_instance_t *self = MP_OBJ_TO_PTR(args[0]);\n    const"),
        ("(self->base.type, &native_base);", "(self->base.type, &native_base);\n    assert(native_base != NULL);"),
        ("                count += instance", "                script_step();\n                count += instance"),
        ("                mp_obj_class_lookup(lookup, bt);",
         "                script_step();\n                mp_obj_class_lookup(lookup, bt);"),
        ("                if (mp_obj_is_subclass_fast(*item", "                script_step();\n"
         "                if (mp_obj_is_subclass_fast(*item"),
        # A method of a native class gets an object of that class alone, also by way of a class derived from it.
        ("(MP_OBJ_NULL, org_type, elem", "(MP_OBJ_NULL, mp_obj_is_native_type(type) ? type : org_type, elem"),
        ("                dest[0] = MP_OBJ_FROM_PTR(dict);\n            } else",
         "                dest[0] = MP_OBJ_FROM_PTR(&mp_const_empty_dict_obj);\n            } else"),
        ("obj_obj = obj->subobj[0];", f"{INSTANCE % 'MP_OBJ_FROM_PTR(obj)'}\n"
         "                        obj_obj = obj->subobj[0];"),
        ("mp_load_method_maybe(lookup->obj->subobj[0]", f"{INSTANCE % 'MP_OBJ_FROM_PTR(lookup->obj)'}\n"
         "            mp_load_method_maybe(lookup->obj->subobj[0]"),
        ("    mp_obj_type_t *type = MP_OBJ_TO_PTR(self->type);\n", "    assert(mp_obj_is_obj(self->obj));\n"
         "    mp_obj_type_t *type = MP_OBJ_TO_PTR(self->type);\n"),
        ("    mp_obj_super_t super = {{&mp_type_super}, dest[1], dest[2]};",
         "    mp_obj_t type = MP_OBJ_FROM_PTR(mp_obj_get_type(dest[2]));\n"
         "    assert(mp_obj_is_subclass(type == MP_OBJ_FROM_PTR(&mp_type_type) ? dest[2] : type, dest[1]) == "
         "mp_const_true);\n    mp_obj_super_t super = {{&mp_type_super}, dest[1], dest[2]};"),
        ("        return self->subobj[0];\n    }\n}",
         "        return self->subobj[0] == MP_OBJ_FROM_PTR(&native_base_init_wrapper_obj) ? MP_OBJ_NULL"
         " : self->subobj[0];\n    }\n}"),
        # An index that is a number alone changes no list while the list looks for it.
        ("    [MP_UNARY_OP_INT_MAYBE] = MP_QSTR___int__,\n", ""),
        ("    [MP_UNARY_OP_FLOAT_MAYBE] = MP_QSTR___float__,\n", "")],
}
LEFT_OUT = {"objint_longlong.c", "formatfloat.c"}   # longint.c and decimal.c take their places

WORDS = ["-std=gnu99", "-Os", "-fwrapv", "-ffp-contract=off", "-fno-math-errno", "-ffunction-sections",
         "-fdata-sections", "-fno-asynchronous-unwind-tables", "-DNDEBUG"]
OURS = ["-Wall", "-Wextra", "-Wno-unused-parameter"]
DECIMAL = ["-Dmp_format_float=decimal_format", "-include", "targets/micropython/decimal.h"]
SEVERAL = {"vm.c": ["-O2", "-DBYTECODE_IS_SOUND"],      # -Os doubles the time of a loop
           # what would cut an integer to fewer bits
           "objrange.c": ["-Dmp_obj_get_int=script_range_int"],
           **{name: ["-Dmp_obj_get_int_maybe=script_times"] for name in ("objlist.c", "objtuple.c", "objstr.c")},
           "mpprint.c": DECIMAL, "parsenum.c": DECIMAL, "modbuiltins.c": DECIMAL,
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
            _ninja(folder, "libmicropython.a", compiler, [*WORDS, f"-I{PORT}/interpreter", *flags],
                   [*((path, [*OF_OTHERS, *SEVERAL.get(path.name, [])]) for path in core),
                    *((path, OURS) for path in port)])
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
            words = ["-std=gnu99", "-O0", *OF_OTHERS, *DECIMAL, "-Dscript_pow=pow", "-Dscript_check_fits(a,b)=",
                     "-Dscript_step()=", "-Dscript_broken()=__builtin_trap()",
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

    archive = library(machine, development)
    name = "fledge_micropython"
    write_files({"frozen.c": freeze(scripts or {}, archive)}, folder)
    sources = [PORT / "interpreter/main.c", folder / "frozen.c", *(ROOT / path for path in COMMAND), *math_sources()]
    flags = [*archive.flags, *OF_OTHERS, f"-DSCRIPT_CYCLES={cycles}", f"-DSCRIPT_HEAP={heap}"]
    if machine == "leon3":
        return board.program(folder / machine, name, sources, [ROOT], flags, archives=[archive.archive])
    return program(folder / machine, name, sources, [ROOT], archive.compiler, flags, ["-static", "-no-pie", "-lm"],
                   archives=[archive.archive])


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
            _edit(unpacked, CONTAINED)
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
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    if digest != SHA256:
        raise Failure(f"{archive} is not MicroPython's source of Debian: its SHA-256 is {digest}, not {SHA256}; "
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
    match = re.search(r"^'(.*)/dists/[^/'-]+/InRelease'", known, re.MULTILINE)
    if not match:
        raise Failure("apt's configuration names no mirror of Debian's archive, from which MicroPython's source could "
                      f"come; put {ARCHIVE} into {folder}", 1)
    return re.sub("/ubuntu$", "/debian", match[1])      # many mirrors have both; Debian's keys check what comes


# --- building ------------------------------------------------------------------------------------


def _recipe(*files: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(f"{file.relative_to(ROOT) if file.is_relative_to(ROOT) else file}\0".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


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
