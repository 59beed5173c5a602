# SPDX-License-Identifier: Apache-2.0
import pytest

from introspect import comment
from introspect.errors import Refusal
from introspect.model import Bounds


def parse(text):
    """(unit, clauses, bounds, count, meaning) of a comment."""
    parsed = comment.parse(text)
    return (parsed.unit.text if parsed.unit else None, set(parsed.clauses), parsed.bounds, parsed.count,
            parsed.meaning)


def test_the_comment_of_an_event():
    event = comment.event("medium, monitor [-], value [SI]: it fired: a check stayed wrong")
    assert (event.severity, event.meaning) == ("medium", "it fired: a check stayed wrong")
    assert event.arguments == (("monitor", "-"), ("value", "SI"))
    assert comment.event("info: done") == comment.Event("info", (), "done")


@pytest.mark.parametrize("text", ["", "info", "info:", "fatal: done", "low, x: no unit", "low, x [m], : two",
                                  "high, a [m], b [m], c [m], d [m], e [m]: five", "low, x [furlong]: no such unit"])
def test_a_wrong_comment_of_an_event_is_refused(text):
    with pytest.raises(Refusal):
        comment.event(text)


@pytest.mark.parametrize("text, expected", [
    ("[N m / s] >= 0: gain on the error; 0: off",
     ("N m / s", set(), Bounds(lo=0.0), None, "gain on the error; 0: off")),
    ("[kg m^2] required, count n, > 0: inertia",
     ("kg m^2", {"required"}, Bounds(lo=0.0, lo_open=True), "n", "inertia")),
    ("optional: the wheels' axes", (None, {"optional"}, None, None, "the wheels' axes")),
    ("inertia, from the vehicle configuration",
     (None, set(), None, None, "inertia, from the vehicle configuration")),
    ("[kg m^2] required, inertia: about the centre of mass",
     ("kg m^2", {"required", "inertia"}, None, None, "about the centre of mass")),
    ("[-] in [0, 8]: number", ("-", set(), Bounds(0.0, 8.0), None, "number")),
    ("[-] required, in [ -1.5e-3 , .5 ], count n: x",
     ("-", {"required"}, Bounds(-1.5e-3, 0.5), "n", "x")),
    ("[-] > -1, < 1: open", ("-", set(), Bounds(-1.0, 1.0, True, True), None, "open")),
    ("[-] > 0, <= 1: half open", ("-", set(), Bounds(0.0, 1.0, True, False), None, "half open")),
    ("[rad/s] assumed, non-zero: rate", ("rad/s", {"assumed", "non-zero"}, None, None, "rate")),
    ("Ri: what to follow", (None, set(), None, None, "Ri: what to follow")),
    ("[m] of two things, optional: no clause",
     ("m", set(), None, None, "of two things, optional: no clause")),
    ("[kg m^2] inertia", ("kg m^2", set(), None, None, "inertia")),
    ("[m] in the frame [N]: position", ("m", set(), None, None, "in the frame [N]: position")),
    ("[m]", ("m", set(), None, None, "")),
    ("", (None, set(), None, None, "")),
    ("[-] σ relative to R — with a shadow set",
     ("-", set(), None, None, "σ relative to R — with a shadow set")),
])
def test_a_comment_says_unit_clauses_and_meaning(text, expected):
    assert parse(text) == expected


@pytest.mark.parametrize("clause", [
    "> x", ">= ", "< 1 m", "<= 1,5 ", "in [0]", "in [0, 1", "in [a, b]", "in [0, 1, 2]",
    "in (0, 1)", "> nan", "> inf", "< 1e999"])
def test_malformed_bounds_are_refused(clause):
    with pytest.raises(Refusal) as refusal:
        parse(f"[m] {clause}: meaning")
    assert "a bound is `> x`" in refusal.value.rule or "a clause is one of" in refusal.value.rule


@pytest.mark.parametrize("clauses, rule", [
    ("> 0, >= 1", "a bound is given once"),
    ("in [0, 1], < 3", "a bound is given once"),
    ("in [3, 1]", "bounds leave room for a value"),
    ("> 1, < 1", "bounds leave room for a value"),
    ("range [3, 1]", "bounds leave room for a value"),
])
def test_bounds_make_sense_together(clauses, rule):
    with pytest.raises(Refusal) as refusal:
        parse(f"[m] {clauses}: meaning")
    assert refusal.value.rule == rule


def test_a_range_says_where_a_number_is_in_use():
    parsed = comment.parse("[m] > 0, range [-1e13, 2]: from the Sun")
    assert parsed.bounds == Bounds(0.0, lo_open=True) and parsed.range == Bounds(-1e13, 2.0)
    assert parsed.meaning == "from the Sun" and comment.parse("[m] range of the radar: far").range is None


def test_a_misspelt_clause_among_clauses_is_not_swallowed():
    with pytest.raises(Refusal) as refusal:
        parse("[m] required, conut n: axes")
    assert refusal.value.found == "`conut n` between other clauses"


@pytest.mark.parametrize("word", ["requird", "Optional", "non-zer", "initials", "inertai"])
def test_a_misspelt_clause_alone_is_not_taken_for_the_meaning(word):
    with pytest.raises(Refusal) as refusal:
        parse(f"[m] {word}: where it is")
    assert refusal.value.found.startswith(f"`{word}`, which is almost `")


@pytest.mark.parametrize("text", ["[m] required", "[m] required, > 0", "optional", "[-] in [0, 1]"])
def test_clauses_without_a_meaning_are_not_taken_for_one(text):
    with pytest.raises(Refusal) as refusal:
        parse(text)
    assert refusal.value.rule == "a clause ends with a colon, before the meaning"


def test_markers_and_continuations_are_stripped():
    assert comment.field_text("///< [m]  one\n      ///< two\n  ///<three") == "[m] one two three"
    assert comment.field_text("/**< [m] one\n      * two */") == "[m] one two"
    assert comment.field_text("/** before */") is None
    assert comment.field_text("///< after\n/// before the next") is None
    assert comment.field_text(None) is None


def test_docs_keep_their_lines():
    assert comment.doc_text("/** One.\n *  Two:\n *\n *  three. */") == "One.\nTwo:\n\nthree."
    assert comment.doc_text("/** One:\n *     a = b\n *  two. */") == "One:\n   a = b\ntwo."
    assert comment.plain_text("/* One:\n *     a = b\n * two. */") == "One:\n   a = b\ntwo."
    assert comment.plain_text("// One:\n//    a = b\n// two.") == "One:\n   a = b\ntwo."
    assert comment.doc_text("/// One.\n/// Two.") == "One.\nTwo."
    assert comment.doc_text("///< of another member") == ""
    assert comment.doc_text(None) == ""
