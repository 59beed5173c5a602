# SPDX-License-Identifier: Apache-2.0
"""`fledge rules` on small projects whose findings are known, and on sources of Fledge."""

import json
import re
import textwrap
from pathlib import Path

import pytest

from fledge import cli, rules
from fledge.disk import ROOT
from fledge.errors import Failure
from fledge.prove.sources import Tree
from tests.needs import needs

pytestmark = needs("cppcheck")

# Each line breaks the rule in its comment, and no other.
BAD = """\
    #include "flight/turn.h"
    static double half(double x)
    {
        return 0.5 * x;
    }
    double turn(double x, int count)
    {
        double y = 0.0;
        if (x > 1.0) {
            goto end; /* 15.1 */
        }
        y = half(x);
        half(y); /* 17.7 */
    end:
        return y + (double)(count + 010); /* 7.1 */
    }
    """


def project(folder, source=BAD, deviations=None):
    files = {"turn.h": "#ifndef TURN_H\n#define TURN_H\ndouble turn(double x, int count);\n#endif\n",
             "turn.c": textwrap.dedent(source)}
    if deviations is not None:
        files["deviations.toml"] = textwrap.dedent(deviations)
    for name, text in files.items():
        path = folder / "flight" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    (folder / "build").mkdir(exist_ok=True)
    return Tree((folder,))


def judged(tree, paths=()):
    return {row.rule: row for row in rules.judge(rules.check(tree, paths), rules.reasons(tree))}


def commented(folder):
    lines = (folder / "flight/turn.c").read_text().splitlines()
    return {(found[1], n) for n, line in enumerate(lines, 1) if (found := re.search(r"/\* (\d+\.\d+) \*/", line))}


def test_each_finding_has_its_rule_and_line(tmp_path):
    rows = judged(project(tmp_path))
    found = {(finding.rule, finding.line) for row in rows.values() for finding in row.left}
    assert commented(tmp_path) <= found
    assert rows["15.1"].state == "broken" and rows["15.2"].state == "kept" and rows["15.1"].category == "advisory"


def test_a_finding_of_cppcheck_itself_has_the_rule_of_its_check(tmp_path):
    rows = judged(project(tmp_path, """\
        #include "flight/turn.h"
        double turn(double x, int count)
        {
            double y;
            if (x > 1.0) {
                y = x;
            }
            return y + (double)count;
        }
        """))
    assert [(f.file, f.line) for f in rows["9.1"].left] == [("flight/turn.c", 8)]


def test_the_nearest_reason_counts_and_the_table_has_it(tmp_path):
    tree = project(tmp_path, deviations="""\
        "7.1" = "a reason for all"
        "17.7" = "false: half() has no effect"
        "15.1" = "a reason without use"
        ["flight/turn.c"]
        "15.1" = "the end of a function"
        """)
    check = rules.check(tree)
    with pytest.raises(Failure, match=r"deviations.toml:3: nothing breaks rule 15.1 any more; delete its reason"):
        rules.judge(check, rules.reasons(tree))
    project(tmp_path, deviations=(tmp_path / rules.DEVIATIONS).read_text().replace('"15.1" = "a reason without use"\n',
                                                                                   ""))
    rows = {row.rule: row for row in rules.judge(check, rules.reasons(tree))}
    assert [rows[rule].state for rule in ("7.1", "15.1", "17.7")] == ["deviation", "deviation", "kept"]
    table = rules.table(list(rows.values()))
    assert "| 15.1 | advisory | `flight/turn.c` | 1 | the end of a function |" in table
    assert "| 7.1 | required | all | 1 | a reason for all |" in table


def test_a_project_inherits_reasons(tmp_path):
    own = project(tmp_path, deviations='"15.1" = "the end of a function"\n')
    rows = judged(Tree((own.roots[0], ROOT)))
    assert rows["15.1"].state == rows["17.7"].state == "deviation" and rows["7.1"].state == "broken"


@pytest.mark.parametrize("text, answer", [
    ('"15.1" = "the end"', r"deviations.toml:1: rule 15.1 needs a reason, a sentence"),
    ('\n"goto" = "the end of a function"', r"deviations.toml:2: 'goto' is no rule; write \"15.5\" = \"the reason\""),
    ('["flight"]\n"9.1" = "it is never read"', r"deviations.toml:2: rule 9.1 is mandatory, which allows no deviation"),
    ('\n["flight/trun.c"]\n"15.1" = "a b c"', r"deviations.toml:2: there is no file or folder 'flight/trun.c'"),
    ('"15.1" = ', r"deviations.toml: Invalid value \(at line 1"),
])
def test_a_wrong_file_of_reasons_is_named_with_its_line(tmp_path, text, answer):
    tree = project(tmp_path, deviations=text + "\n")
    with pytest.raises(Failure, match=answer):
        rules.reasons(tree)


def test_code_that_no_configuration_reads_is_no_success(tmp_path):
    tree = project(tmp_path, '#include "flight/turn.h"\n#ifndef FROM_A_BOARD\n#error "no board"\n#endif\n')
    with pytest.raises(Failure, match="cppcheck cannot read flight/turn.c"):
        rules.check(tree)


def test_what_was_found_is_kept_until_a_header_changes(tmp_path):
    tree = project(tmp_path)
    before = rules.check(tree)
    kept = tmp_path / "build/rules/flight/turn.c.json"
    facts = json.loads(kept.read_text())
    kept.write_text(json.dumps({**facts, "findings": []}))
    assert not [f for f in rules.check(tree).findings if f.rule == "15.1"]
    header = tmp_path / "flight/turn.h"
    header.write_text(header.read_text() + "/* changed */\n")
    assert rules.check(tree).findings == before.findings


def test_a_rule_over_several_sources_counts_for_the_whole_tree(tmp_path):
    tree = project(tmp_path)
    (tmp_path / "flight/other.c").write_text(
        "static double half(double x)\n{\n    return 0.5 * x;\n}\ndouble other(double x);\n"
        "double other(double x)\n{\n    return half(x);\n}\n")
    found = [f.rule for f in rules.check(tree).findings if f.file == "flight/other.c" and f.rule == "5.9"]
    if not found and rules.version() != rules.REASONED:
        pytest.skip(f"cppcheck {rules.version()} finds no names that two sources share")
    assert found
    part = rules.check(tree, ["flight/other.c"])
    assert not part.whole and not [f for f in part.findings if f.rule == "5.9"]


def test_the_command_fails_for_a_finding_without_reason(tmp_path, monkeypatch, capsys):
    project(tmp_path)
    monkeypatch.setenv("FLEDGE_PROJECT", str(tmp_path))
    assert cli.main(["rules"]) == 1
    assert re.search(r"flight/turn.c:15: rule 7.1; mend it, or give a reason", capsys.readouterr().out)
    assert cli.main(["rules", "turns"]) == 2
    assert "there is no file or folder 'turns'" in capsys.readouterr().err
    monkeypatch.setattr(rules, "which", lambda _: None)
    assert cli.main(["rules"]) == 2
    assert "cppcheck is not installed; as root, run: apt-get install cppcheck" in capsys.readouterr().err


def test_mandatory_rules_have_no_deviation_here():
    assert not [reason for reason in rules.reasons(Tree((ROOT,)))
                if reason.rule in rules.MANDATORY and not reason.false]


def test_flight_control_keeps_its_rules():
    rows = rules.judge(rules.check(paths=["flight/control"]))
    assert not [finding for row in rows for finding in row.left]


def columns(table):
    """Without the counts, which each change of flight changes."""
    return [line if line.startswith("No finding") else re.sub(r"\| \d+ \|", "|", line) for line in table.splitlines()]


@pytest.mark.long("160 sources of flight, hosts and protocols by cppcheck: 40 s")
def test_all_keep_the_rules_as_the_document_says():
    rows = rules.judge(rules.check())
    assert not [finding for row in rows for finding in row.left]
    shown = Path(ROOT, "docs/evidence.md").read_text().partition("<!-- printed by fledge rules --table -->\n")[2]
    assert columns(shown.partition("<!-- end of what fledge rules prints -->")[0]) == columns(rules.table(rows))


def test_the_document_has_each_reason():
    shown = Path(ROOT, "docs/evidence.md").read_text()
    for reason in rules.reasons(Tree((ROOT,))):
        where = f"`{reason.where}`" if reason.where else "all"
        assert re.search(re.escape(f"| {where} | ") + r"\d+" + re.escape(f" | {reason.text} |"), shown), reason
