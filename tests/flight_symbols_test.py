# SPDX-License-Identifier: Apache-2.0
"""The build refuses some symbols in flight code; each build checks Fledge's own code."""

import re
import subprocess

import pytest

from tests.tree import ROOT

FLIGHT = ["-O3", "-g", "-fPIC", "-ffp-contract=off", "-fno-math-errno"]


def check(tmp_path, text, options=FLIGHT, libraries=(), code=1):
    """The complaints about a C file, without the path."""
    source, place = tmp_path / "flight/a.c", tmp_path / "CMakeFiles/x.dir/flight/a.c.o"
    for path in (source, place):
        path.parent.mkdir(parents=True, exist_ok=True)
    source.write_text(text)
    subprocess.run(["gcc", *options, "-c", source, "-o", place], check=True)
    done = subprocess.run(["/usr/bin/python3", ROOT / "cmake/flight_symbols.py", "--root", tmp_path, *libraries, place],
                          capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    lines = done.stderr.splitlines()
    assert all(line.startswith(f"{source}:") for line in lines)
    return [line.removeprefix(f"{source}:").split(";")[0] for line in lines]


@pytest.mark.parametrize("text, complaint", [
    ("double sin(double);\ndouble f(double x) { return sin(x); }",
     "2: f calls sin of libm, whose last bits differ between machines"),
    ("float powf(float, float);\nfloat f(float x) { return powf(x, 3.3f); }",
     "2: f calls powf of libm, whose last bits differ between machines"),
    ("double cos(double);\ndouble (*const table[])(double) = {cos};",
     "2: table calls cos of libm, whose last bits differ between machines"),
    ("#include <stdlib.h>\nvoid *f(unsigned n) { return malloc(n); }", "2: f calls malloc"),
    ("#include <stdio.h>\nvoid f(void) { puts(\"x\"); }", "2: f refers to puts, which is neither flight code nor in "
     "flight/math"),
    ("static int n;\nint f(void) { return n++; }",
     "2: f keeps the variable n, which all instances, clones and threads share"),
    ("int f(void) {\n    static int n = 7;\n    return n++;\n}",
     "3: f keeps the variable n, which all instances, clones and threads share"),
    ("double last[3];\n", "1: this file keeps the variable last, which all instances, clones and threads share"),
    ("static _Thread_local int n;\nint f(void) { return ++n; }",
     "2: f keeps the variable n, which all instances, clones and threads share"),
    ("static const char *name = \"a\";\nconst char *f(int x) { if (x) { name = \"b\"; } return name; }",
     "2: f keeps the variable name, which all instances, clones and threads share"),
])
def test_what_breaks_the_promise_is_refused_with_its_place(tmp_path, text, complaint):
    assert check(tmp_path, text) == [complaint]


def test_each_variable_has_the_functions_that_use_it(tmp_path):
    text = "static int a, b;\nint f(void) { return a++; }\nint g(void) { return b++; }\nint h(void) { return b; }"
    assert [re.match(r"\d+: (.*) keeps the variable (\w)", problem).groups() for problem in check(tmp_path, text)] == [
        ("f", "a"), ("g, h", "b")]


ALLOWED = """
#include <math.h>
#include <stdint.h>
#include <string.h>
double fm_sin(double x);
static const char *const names[] = {"a", "b"};
static const double table[3] = {1, 2, 3};
typedef struct { double v[100]; } Big;
double f(Big *a, const Big *b, int i, unsigned __int128 n)
{
    memcpy(a, b, sizeof *a);
    a->v[i] = names[i & 1][0] + (double)(n / (unsigned)i);
    return sqrt(a->v[0]) + floor(a->v[1]) + fabs(a->v[2]) + fm_sin(table[i]);
}
"""


@pytest.mark.parametrize("options", [FLIGHT, ["-O0", "-g3", "-fPIC"], ["-O2", "-fno-pic", "-fstack-protector-all"],
                                     ["-O1", "-g", "-fPIC", "-fsanitize=address,undefined"]])
def test_exact_functions_constants_and_flight_math_are_allowed(tmp_path, options):
    (tmp_path / "m.c").write_text("double fm_sin(double x) { return x; }\n")
    subprocess.run(["gcc", "-c", tmp_path / "m.c", "-o", tmp_path / "m.o"], check=True)
    assert check(tmp_path, ALLOWED, options, ["--library", tmp_path / "m.o"], code=0) == []
    assert check(tmp_path, ALLOWED, options)[0].split(": ")[1].startswith("f refers to fm_sin")
