# SPDX-License-Identifier: Apache-2.0
"""Each flight module and world model is used by a mission: one that is in none is wired into one, or deleted."""
import ast
import subprocess
import sys
from pathlib import Path

import pytest

UNNAMED = "Choice"           # ends the names of modules that connections add, as that of the CubeSat's rods does
# The missions' Sun sensors come in pyramids, whose faults SunPyramids finds. EphemerisCraft follows a user's files;
# PlanetRadiation is for accuracies that no mission here asks for.
WITHOUT = {"SunDirection", "EphemerisCraft", "PlanetRadiation"}
MISSIONS = Path(__file__).resolve().parents[1] / "missions"


def used(library: str, text: str) -> set[str]:
    """The names of a library (flight, world) that a file uses, under any name of the import."""
    return used_in(library, list(ast.walk(ast.parse(text))))


def used_in(library: str, nodes: list[ast.AST]) -> set[str]:
    """The same of a file that has been parsed."""
    names = {alias.asname or alias.name for node in nodes
             if isinstance(node, ast.ImportFrom) and node.module == "fledge"
             for alias in node.names if alias.name == library}
    return {node.attr for node in nodes if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name) and node.value.id in names}


@pytest.mark.parametrize("name, kind", [("flight", "Module"), ("world", "Model")])
def test_a_mission_uses_each_module_and_model(name, kind):
    # In a process of its own: prototypes of other tests are modules, too.
    program = (f"from fledge import {name} as library\n"
               f"print(*[one for one, of in library.TYPES.items() if of.__mro__[1].__name__ == '{kind}'])")
    public = set(subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True,
                                check=True).stdout.split())
    texts = [path.read_text() for path in MISSIONS.rglob("*.py") if not path.name.endswith("_test.py")]
    named = {name for name in public - WITHOUT if not name.endswith(UNNAMED)}
    idle = named - set().union(*(used(name, text) for text in texts))
    assert len(public) > 30 and not idle, f"no mission uses {', '.join(sorted(idle))}: wire it into one, or delete it"


def test_a_use_is_found_by_the_name_of_the_import_and_in_code_alone():
    text = "from fledge import flight as fsw, world\nfsw.MrpFeedback(K=1), world.RK4\n# fsw.Files()\n'fsw.Monitors'"
    assert used("flight", text) == {"MrpFeedback"} and used("world", text) == {"RK4"}
    assert used("flight", "import fsw\nfsw.Files()") == set()
