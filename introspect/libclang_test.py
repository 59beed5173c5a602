# SPDX-License-Identifier: Apache-2.0
"""Each version of libclang reads the same from the same headers."""
import re
import subprocess
import sys
from pathlib import Path

import pytest
from clang import cindex

from introspect.emit import EMITTERS
from introspect.testing import ROOT, read_this
from tests.needs import needs

# Versions stand side by side. Bindings work with their own version and with newer ones, if its headers are there.
BOUND = int(re.search(r"-([0-9]+)", cindex.conf.get_filename())[1])
VERSIONS = {int(path.parts[3][5:]): path for path in Path("/usr/lib").glob("llvm-*/lib/libclang-*.so.1")
            if any(path.parent.glob("clang/*/include/stddef.h"))}

UNDER = """
import sys
from clang import cindex
cindex.Config.set_library_file(sys.argv[1])
import pytest
from introspect import libclang_test
print(libclang_test.tables())
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "introspect/refusals_test.py"]))
"""


def tables():
    """All that the emitter of tables makes of this repository's headers."""
    model = read_this()
    return [EMITTERS["tables"](model.library(name)) for name in model.library_names]


@pytest.mark.long("reads all headers with each version of libclang")
@needs("libclang1-19", "libclang-common-19-dev")
@pytest.mark.parametrize("version", sorted(version for version in VERSIONS if version > BOUND))
def test_every_version_reads_and_refuses_alike(version):
    done = subprocess.run([sys.executable, "-c", UNDER, VERSIONS[version]], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout[-9000:]
    assert done.stdout.splitlines()[0] == str(tables())
