# SPDX-License-Identifier: Apache-2.0
"""The order of the parameters on their page."""
from fledge.scene.testing.node import in_node, needs_node


def rows(there, options=""):
    """The rows of four packets, of which these parameters have a value."""
    return in_node(f"""
        import {{packets, rowsOf}} from "SOURCES/../../../ground/console/web/groups.js";
        const names = ["f.a.x", "f.a.y", "f.b.x", "f.b.y", "f.c.x", "f.d.x"], there = {there};
        const slots = names.map((name, slot) => ({{slot, name, container: name.slice(0, 3), header: false}}));
        const glance = {{slots: [0], rows: [{{label: "first", slots: [0]}}, {{label: "second", slots: [2, 3]}}]}};
        const shown = rowsOf(packets({{slots}}, glance), {{fits: ({{name}}) => name !== "f.d.x", apart: true,
            there: (slot) => there.includes(names[slot]), glance: glance.rows, ...{{{options}}}}});
        console.log(JSON.stringify(shown.map(({{group, name, glance}}) => group ?? glance?.label ?? name)));
    """)


@needs_node
def test_parameters_without_a_value_come_last_under_their_own_head():
    glance = ["At a glance", "first", "second"]
    a, b, c = ["f.a", "x", "y"], ["f.b", "x", "y"], ["f.c", "x"]
    assert rows(["f.a.x", "f.b.y", "f.c.x"]) == [*glance, *a, *b, *c]
    assert rows(["f.b.y"]) == ["At a glance", "second", "first", *b, "No value yet (3)", *a, *c]
    assert rows([]) == [*glance, "No value yet (5)", *a, *b, *c]


@needs_node
def test_a_search_is_one_list_of_whole_names_those_with_a_value_first():
    assert rows(["f.c.x"], "apart: false") == ["f.c.x", "f.a.x", "f.a.y", "f.b.x", "f.b.y"]
