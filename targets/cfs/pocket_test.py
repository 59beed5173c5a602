# SPDX-License-Identifier: Apache-2.0
"""The pocket cFE as a whole: its size, its cleanliness, and its tasks under the thread sanitizer."""
import subprocess

import pytest

from fledge.disk import ROOT
from tests.needs import needs

SOURCES = sorted(file for file in (ROOT / "targets/cfs").glob("*.c") if file.name not in ("host.c", "watch.c"))
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes", "-Werror",
          f"-I{ROOT}", f"-I{ROOT}/targets/cfs/inc"]
MOST_TEXT = 32 * 1024       # bytes, x86-64, -Os


def compiled(folder, *options, compiler="gcc"):
    subprocess.run([compiler, *STRICT, *options, "-c", *map(str, SOURCES)], check=True, cwd=folder)
    return sorted(folder.glob("*.o"))


@pytest.mark.long("compiles all with other options")
def test_it_is_small_and_has_no_heap(tmp_path):
    objects = list(map(str, compiled(tmp_path, "-Os")))
    lines = subprocess.run(["size", *objects], check=True, capture_output=True, text=True).stdout.splitlines()[1:]
    assert sum(int(line.split()[0]) for line in lines) < MOST_TEXT
    wanted = subprocess.run(["nm", "-u", *objects], check=True, capture_output=True, text=True).stdout.split()
    assert not {"malloc", "calloc", "realloc", "free"} & set(wanted)
    # What is POSIX stands in one file: the others want memory, text, and the port.
    others = [o for o in objects if "port_posix" not in o]
    libc = {name for name in subprocess.run(["nm", "-u", *others], check=True, capture_output=True,
                                            text=True).stdout.split() if name.islower()
            and not name.startswith(("port_", "pocket_", "_")) and ":" not in name and name != "u"}
    assert libc <= {"memcpy", "memset", "memcmp", "strchr", "strcmp", "strcpy", "strlen", "strncmp", "strtoul",
                    "snprintf", "vsnprintf"}


@pytest.mark.long("builds all with clang")
@needs("clang")
def test_it_is_clean_under_another_compiler(tmp_path):
    compiled(tmp_path, "-O1", compiler="clang")
    subprocess.run(["clang", *STRICT, "-c", str(ROOT / "targets/cfs/host.c")], check=True, cwd=tmp_path)


@pytest.mark.long("builds all with the thread sanitizer")
def test_its_tasks_race_nowhere(tmp_path):
    empty = tmp_path / "empty.c"
    empty.write_text("int main(void) { return 0; }\n")
    starts = subprocess.run(f"cd {tmp_path} && gcc -fsanitize=thread empty.c -o empty && ./empty", shell=True,
                            capture_output=True)
    if starts.returncode:
        pytest.skip("the thread sanitizer does not start here")
    program = tmp_path / "tests"
    for name in ("osal", "apps"):
        subprocess.run(["g++", "-std=c++20", "-fsanitize=thread", *STRICT[-2:], "-c",
                        str(ROOT / f"targets/cfs/{name}_test.cpp")], check=True, cwd=tmp_path)
    compiled(tmp_path, "-O1", "-fsanitize=thread")
    done = linked(tmp_path, program)
    assert done.returncode == 0 and "data race" not in done.stderr, done.stdout[-3000:] + done.stderr[-3000:]
    # The sanitizer finds a race where there is one.
    empty.write_text("#include <pthread.h>\nint n;\nvoid *f(void *p) { n++; return p; }\nint main(void)\n{\n"
                     "    pthread_t t[2];\n    for (int i = 0; i < 2; i++) pthread_create(&t[i], 0, f, 0);\n"
                     "    for (int i = 0; i < 2; i++) pthread_join(t[i], 0);\n    return 0;\n}\n")
    subprocess.run(["gcc", "-fsanitize=thread", "empty.c", "-o", "empty"], check=True, cwd=tmp_path)
    assert "data race" in subprocess.run([tmp_path / "empty"], capture_output=True, text=True).stderr


def linked(folder, program, *arguments):
    objects = sorted(map(str, folder.glob("*.o")))
    subprocess.run(["g++", "-fsanitize=thread", *objects, "-lgtest", "-lgtest_main", "-lpthread", "-o", str(program)],
                   check=True)
    return subprocess.run([str(program), *arguments], capture_output=True, text=True,
                          env={"TSAN_OPTIONS": "halt_on_error=1"})
