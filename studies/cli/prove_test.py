# SPDX-License-Identifier: Apache-2.0
"""`fledge prove --table`: what is kept of proofs, beside the decisions that were counted."""
import json
from pathlib import Path

import pytest

from fledge import prove
from fledge.cli.studies.prove import table

HEADER = """\
#ifndef FLIGHT_TWINS_H
#define FLIGHT_TWINS_H

#include "flight/msg/vehicle.h"

"""
MODULE = """\
/** Passes a torque on. */
typedef struct {0} {{
    struct {{
        BodyTorque torque;
    }} in;
    struct {{
        BodyTorque passed;
    }} out;
}} {0};

void {1}_reset({0} *m);
void {1}_update({0} *m, Tick t);

"""


def test_sums_count_a_source_once_and_say_what_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "flight").mkdir()
    (tmp_path / "build").mkdir()
    twins = HEADER + MODULE.format("FirstTwin", "first_twin") + MODULE.format("OtherTwin", "other_twin") + "#endif\n"
    (tmp_path / "flight/twins.h").write_text(twins, encoding="utf-8")
    (tmp_path / "flight/hand_proof.c").write_text("void main(void)\n{\n}\n", encoding="utf-8")
    counted = {"flight/twins.c": {"conditions": 9, "decided": 7}, "flight/hand.c": {"conditions": 4, "decided": 4}}
    (tmp_path / "build/decisions.json").write_text(json.dumps(counted), encoding="utf-8")
    alarms = tuple(prove.Finding("flight/twins.c", line, "f", "a kind", "a text", state)
                   for line, state in enumerate(["alarm", "open", "open", "beyond"]))
    loop = prove.Bound("flight/hand.c", 1, "f", 3, "proved")
    results = [prove.Result("FirstTwin", "flight/twins.h", "as declared", "", 2.5, 1, 1, 1, alarms, ()),
               prove.Result("flight/hand", "flight/hand_proof.c", "by hand", "", 4.0, 1, 1, 1, (), (loop,))]
    monkeypatch.setattr(prove, "kept", lambda project: results)
    lines = table([], tmp_path)
    assert lines[2:4] == ["| `flight` | 3 | 2 | 1 | 1 | 2 | 1 | 1 | 6 | 13 | 11 |",
                          "| all | 3 | 2 | 1 | 1 | 2 | 1 | 1 | 6 | 13 | 11 |"]
    assert lines[7:] == ["| `flight/hand` | flight/hand | by hand | yes | 0 | 0 | 0 | 1 | 4 | 4 | 4 |",
                         "| `flight/twins` | FirstTwin | as declared | no | 1 | 2 | 1 | 0 | 2.5 | 9 | 7 |",
                         "| `flight/twins` | OtherTwin |  | not kept |  |  |  |  |  | 9 | 7 |"]
    assert {line.count("|") for line in (*lines[:4], *lines[5:])} == {12}
    assert table(["OtherTwin"], tmp_path)[2] == "| `flight` | 1 | 0 | 0 | 0 | 0 | 0 | 0 | 0 | 9 | 7 |"
