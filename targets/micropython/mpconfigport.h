/* SPDX-License-Identifier: Apache-2.0 */
/* What MicroPython can do in flight: the language of a mission's scripts, without a garbage collector. A build of
 * development (FLEDGE_COMPILER) also reads Python; the others run frozen scripts and bytecode. The toolchain
 * (toolchain.py) compiles mpy-cross for the same sizes of integers. */
#ifndef TARGETS_MICROPYTHON_MPCONFIGPORT_H
#define TARGETS_MICROPYTHON_MPCONFIGPORT_H

#include <stddef.h>
#include <stdint.h>

#ifndef FLEDGE_COMPILER
#define FLEDGE_COMPILER 0
#endif

#define MICROPY_CONFIG_ROM_LEVEL MICROPY_CONFIG_ROM_LEVEL_MINIMUM

/* ---- numbers: doubles within the object, so that arithmetic needs no memory; all integers have 64 bits */
#define MICROPY_OBJ_REPR MICROPY_OBJ_REPR_D
#define MICROPY_FLOAT_IMPL MICROPY_FLOAT_IMPL_DOUBLE
#define MICROPY_LONGINT_IMPL MICROPY_LONGINT_IMPL_LONGLONG
typedef int64_t mp_int_t;
typedef uint64_t mp_uint_t;
typedef long mp_off_t;
#define INT_FMT "%lld"
#define UINT_FMT "%llu"
#define MP_SSIZE_MAX INT32_MAX
#if UINTPTR_MAX > UINT32_MAX
#define FLEDGE_ROM_OBJ const void *lo; /* a pointer has all 64 bits of a constant object */
#else
#define FLEDGE_ROM_OBJ const void *lo, *hi;
#endif

/* ---- memory: the arena alone; frames of functions lie on a stack of their own */
#define MICROPY_ENABLE_GC 0
#define MICROPY_ENABLE_PYSTACK 1
#define MICROPY_ENABLE_EMERGENCY_EXCEPTION_BUF 1
#define MICROPY_EMERGENCY_EXCEPTION_BUF_SIZE 512
#define MICROPY_STACK_CHECK 1
#define MICROPY_STACK_CHECK_MARGIN 2048
#define MICROPY_ALLOC_QSTR_CHUNK_INIT 64
#define MICROPY_QSTR_BYTES_IN_HASH 1
#define MICROPY_LOADED_MODULES_DICT_SIZE 4
#define MICROPY_ALLOC_PATH_MAX 128
#define MICROPY_ALLOC_PARSE_CHUNK_INIT 64

/* ---- speed, and the end of scripts over their budget */
#define MICROPY_OPT_COMPUTED_GOTO 1
#define MICROPY_OPT_LOAD_ATTR_FAST_PATH 1
#define MICROPY_OPT_MAP_LOOKUP_CACHE 1
extern uint32_t script_turns;
void script_turned(void);
void script_step(void); /* a turn of a loop or recursion in C (toolchain.py) */
_Noreturn void script_broken(void);
#define MICROPY_VM_HOOK_LOOP                                                                                           \
    if (__builtin_expect(--script_turns == 0u, 0)) {                                                                   \
        script_turned();                                                                                               \
    }
#define MICROPY_VM_HOOK_RETURN MICROPY_VM_HOOK_LOOP

/* ---- the language */
#define MICROPY_ENABLE_COMPILER FLEDGE_COMPILER
#define MICROPY_COMP_CONST_FOLDING FLEDGE_COMPILER
#define MICROPY_COMP_CONST_TUPLE FLEDGE_COMPILER
#define MICROPY_COMP_CONST_LITERAL FLEDGE_COMPILER
#define MICROPY_COMP_DOUBLE_TUPLE_ASSIGN FLEDGE_COMPILER
#define MICROPY_PY_FSTRINGS FLEDGE_COMPILER
#define MICROPY_PY_BUILTINS_EVAL_EXEC FLEDGE_COMPILER
#define MICROPY_HELPER_REPL FLEDGE_COMPILER
#define MICROPY_PY_ASSIGN_EXPR 1
#define MICROPY_PY_ASYNC_AWAIT 0
#define MICROPY_CPYTHON_COMPAT 1
#define MICROPY_FULL_CHECKS 1
#define MICROPY_BUILTIN_METHOD_CHECK_SELF_ARG 1
#define MICROPY_MULTIPLE_INHERITANCE 1
#define MICROPY_MODULE_GETATTR 1
#define MICROPY_MODULE_BUILTIN_INIT 1
#define MICROPY_MODULE_BUILTIN_SUBPACKAGES 1
#define MICROPY_ENABLE_SOURCE_LINE 1
#define MICROPY_ERROR_REPORTING MICROPY_ERROR_REPORTING_DETAILED
#define MICROPY_WARNINGS 0
#define MICROPY_PY_DESCRIPTORS 1
#define MICROPY_PY_DELATTR_SETATTR 1
#define MICROPY_PY_FUNCTION_ATTRS 1
#define MICROPY_PY_ALL_SPECIAL_METHODS 1
#define MICROPY_PY_REVERSE_SPECIAL_METHODS 1
#define MICROPY_PY_GENERATOR_PEND_THROW 0

#define MICROPY_PY_BUILTINS_STR_UNICODE 0
#define MICROPY_PY_BUILTINS_STR_COUNT 1
#define MICROPY_PY_BUILTINS_STR_OP_MODULO 1
#define MICROPY_PY_BUILTINS_BYTEARRAY 1
#define MICROPY_PY_BUILTINS_MEMORYVIEW 1
#define MICROPY_PY_BUILTINS_DICT_FROMKEYS 0
#define MICROPY_PY_BUILTINS_SET 1
#define MICROPY_PY_BUILTINS_SLICE 1
#define MICROPY_PY_BUILTINS_PROPERTY 1
#define MICROPY_PY_BUILTINS_NEXT2 1
#define MICROPY_PY_BUILTINS_ROUND_INT 1
#define MICROPY_PY_BUILTINS_ENUMERATE 1
#define MICROPY_PY_BUILTINS_FILTER 1
#define MICROPY_PY_BUILTINS_REVERSED 1
#define MICROPY_PY_BUILTINS_NOTIMPLEMENTED 1
#define MICROPY_PY_BUILTINS_MIN_MAX 1
#define MICROPY_PY_BUILTINS_COMPLEX 0
#define MICROPY_PY___FILE__ 0
#define MICROPY_PY_ARRAY 1
#define MICROPY_PY_ATTRTUPLE 1
#define MICROPY_PY_COLLECTIONS 0
#define MICROPY_PY_STRUCT 0
#define MICROPY_PY_GC 0
#define MICROPY_PY_IO 0
#define MICROPY_PY_MICROPYTHON 0
#define MICROPY_PY_MATH 0 /* math.c has it, on flight/math */
#define MICROPY_PY_MATH_CONSTANTS 1
#define MICROPY_PY_SYS 1 /* for the path that leads to frozen modules */
#define MICROPY_PY_SYS_MODULES 0
#define MICROPY_PY_SYS_EXIT 0
#define MICROPY_PY_SYS_ARGV 0
#define MICROPY_PY_SYS_PATH 1
#define MICROPY_PY_SYS_PATH_ARGV_DEFAULTS 0
#define MICROPY_STREAMS_NON_BLOCK 0

/* ---- scripts: frozen ones, and bytecode from memory */
#define MICROPY_MODULE_FROZEN_MPY 1
#define MICROPY_QSTR_EXTRA_POOL mp_qstr_frozen_const_pool
#define MICROPY_PERSISTENT_CODE_LOAD 1
#define MICROPY_ENABLE_EXTERNAL_IMPORT 1

/* ---- the machine */
#define MICROPY_PY_SYS_PLATFORM "fledge"
#define MICROPY_HW_BOARD_NAME "Fledge"
#define MICROPY_HW_MCU_NAME "flight"
#define MICROPY_MPHALPORT_H "targets/micropython/mphalport.h"
#define MP_STATE_PORT MP_STATE_VM
#define MICROPY_USE_INTERNAL_ERRNO 1
#define MICROPY_USE_INTERNAL_PRINTF 0
void script_check_fits(char typecode, uint64_t object); /* longint.c */
double script_pow(double x, double y);                  /* math.c: as on the desktop; raises beyond a double */
void script_print(const char *text, size_t n);
#define MP_PLAT_PRINT_STRN(text, n) script_print(text, n)

#include <alloca.h>

#endif
