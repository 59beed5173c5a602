# SPDX-License-Identifier: Apache-2.0
"""Lanes between two threads under the thread sanitizer: no access that is not ordered."""
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TSAN = ["-O1", "-fsanitize=thread", f"-I{ROOT}"]


def build(folder, text):
    """The test's program with lane.c as `text`."""
    source, program = folder / "lane.c", folder / "threads"
    source.write_text(text, encoding="utf-8")
    subprocess.run(["gcc", "-std=c99", *TSAN, "-c", str(source), "-o", str(folder / "lane.o")],
                   check=True)
    test = folder / "test.o"
    if not test.exists():
        subprocess.run(["g++", "-std=c++20", *TSAN, "-c",
                        str(ROOT / "registers/lane_threads_test.cpp"), "-o", str(test)], check=True)
    subprocess.run(["g++", *TSAN, str(test), str(folder / "lane.o"), "-lgtest", "-lgtest_main",
                    "-lpthread", "-o", str(program)], check=True)
    return subprocess.run([str(program)], capture_output=True, text=True)


@pytest.mark.long("builds with the thread sanitizer")
def test_two_threads_race_nowhere(tmp_path):
    empty = tmp_path / "empty.c"
    empty.write_text("int main(void) { return 0; }\n")
    starts = subprocess.run(f"cd {tmp_path} && gcc -fsanitize=thread empty.c -o empty && ./empty",
                            shell=True, capture_output=True)
    if starts.returncode:
        pytest.skip("the thread sanitizer does not start here")
    text = (ROOT / "registers/lane.c").read_text()
    done = build(tmp_path, text)
    assert done.returncode == 0, done.stdout + done.stderr
    # The sanitizer does find races: it reports one if the payload is stored by plain words.
    plain = text.replace("register_store_bytes(w, address + i, v);",
                         "*(uint32_t *)(uintptr_t)&w->words[(address + i) / 4u] = v;")
    assert plain != text
    result = build(tmp_path, plain)
    assert "data race" in result.stderr
