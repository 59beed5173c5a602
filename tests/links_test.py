# SPDX-License-Identifier: Apache-2.0
"""Each link in a document leads to a file of this repository, and each anchor to a heading of it."""

import re

import pytest

from tests.tree import ROOT, files

FENCE = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(?<!`)\[[^]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.+?) *$", re.MULTILINE)


def prose(text):
    return FENCE.sub("", text)


def anchors(text):
    """The anchors that GitHub and MyST give to the headings of a document."""
    anchors = []
    for heading in HEADING.findall(prose(text)):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        anchors.append(anchor if anchor not in anchors else f"{anchor}-{anchors.count(anchor)}")
    return anchors


def broken(path, text, tree):
    """The links of a document that lead nowhere. `tree` has the repository's files."""
    wrong = []
    for link in LINK.findall(prose(text)):
        target, _, anchor = link.partition("#")
        if ":" in target:
            continue
        there = (ROOT / path).parent.joinpath(target).resolve() if target else ROOT / path
        try:
            name = str(there.relative_to(ROOT))
        except ValueError:
            wrong.append(link)
            continue
        exists = name in tree or name == "." or any(file.startswith(name + "/") for file in tree)
        if not exists or (anchor and anchor not in anchors(text if not target else there.read_text(encoding="utf-8"))):
            wrong.append(link)
    return wrong


def test_each_link_leads_to_a_file_and_a_heading():
    tree = {str(path) for path in files()}
    wrong_links = {str(path): wrong for path in files() if path.suffix == ".md"
                   if (wrong := broken(path, (ROOT / path).read_text(encoding="utf-8"), tree))}
    assert wrong_links == {}


def test_the_first_page_of_the_documents_lists_all_of_them():
    listed = LINK.findall((ROOT / "docs/README.md").read_text(encoding="utf-8"))
    assert {path.name for path in files() if path.parts[0] == "docs" and path.suffix in (".md", ".ipynb")} \
        == {"README.md", *(link for link in listed if not link.startswith(".."))}
    assert len(listed) == len(set(listed))


def test_each_step_of_the_walks_is_a_function_of_its_file():
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    walks = re.search(r"## Five walks(.*?)\n## ", text, re.DOTALL)[1]
    steps = re.findall(r"^\d+\. `([^`]+)`, `(?:\w+(?:\.|::))?(\w+)`:", walks, re.MULTILINE)
    assert walks.count("\n1. ") == 5 and len(steps) == len(re.findall(r"^\d+\. ", walks, re.MULTILINE))
    assert [step for step in steps
            if not re.search(rf"\b{step[1]}\b", (ROOT / step[0]).read_text(encoding="utf-8"))] == []


@pytest.mark.parametrize("text, wrong", [
    ("[a](../README.md)", []),
    ("[a](../missions)", []),
    ("[a](https://mcap.dev)", []),
    ("# One\n[a](#one)", []),
    ("[a](nothing.md)", ["nothing.md"]),
    ("[a](../README.md#nothing)", ["../README.md#nothing"]),
    ("[a](#nothing)", ["#nothing"]),
    ("[a](../../elsewhere)", ["../../elsewhere"]),
    ("```\n[a](nothing.md)\n```", []),
])
def test_a_broken_link_is_noticed(text, wrong):
    assert broken("docs/tutorial.md", text, {str(path) for path in files()}) == wrong


def test_headings_have_the_anchors_that_markdown_gives_them():
    assert anchors("# Many programs, one `run`\n## A [b](c)\n## A b\n") == ["many-programs-one-run", "a-b", "a-b-1"]


def test_each_test_that_the_table_of_attacks_names_exists():
    text = (ROOT / "docs" / "cosim.md").read_text(encoding="utf-8")
    rows = re.search(r"## Strangers on the network(.*?)\n## ", text, re.DOTALL)[1]
    named = {name for row in rows.splitlines() if row.startswith("| ")
             for name in re.findall(r"`([^`]+)`", row.rsplit("|", 2)[1])}
    tests = {path: (ROOT / path).read_text(encoding="utf-8") for path in files()
             if path.suffix in (".py", ".cpp") and "_test" in path.name}
    assert len(named) > 20
    assert [name for name in named if not any(
        str(path).endswith(name) if "." in name else re.search(rf"\b{name}\b", text)
        for path, text in tests.items())] == []
