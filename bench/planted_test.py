# SPDX-License-Identifier: Apache-2.0
"""Which faults are planted in a text, and who sees them."""
import pytest

from bench import planted
from bench.mutants import ROOT
from bench.mutation import applied
from tests.needs import needs, section

TEXT = """double mean(const Row *m, uint32_t n)
{
    double sum = 0.0;
    for (uint32_t i = 0u; i < n; i++) {
        sum += m->x[i];
    }
    if (m->w == 0.0 || !isfinite(sum)) {
        return 0.0;
    }
    const double share = n > 0u ? sum / n : 0.0;
    if (!(m->w > 1e-9)) {
        return share;
    }
    return share / m->w;
}

double other(double w) { return 1.0 / w; }
"""


def lines(kind):
    before = TEXT.splitlines()
    changed = [applied(TEXT, change).splitlines() for k, change in planted.faults(TEXT) if k == kind]
    return {new.strip() for after in changed for old, new in zip(before, after, strict=True) if old != new}


def test_each_kind_changes_what_it_says():
    assert lines("index") == {"for (uint32_t i = 0u; i <= n; i++) {", "sum += m->x[i + 1];"}
    assert lines("division") == {"const double share = 1 ? sum / n : 0.0;", "if (0) {", "if (0 || !isfinite(sum)) {"}
    assert lines("nan") == {"if (m->w == 0.0 || !1) {"}
    assert lines("condition") == {
        "if (0 || !isfinite(sum)) {", "if (1 || !isfinite(sum)) {", "if (!isfinite(sum) || !isfinite(sum)) {",
        "if (m->w == 0.0 || 0) {", "if (m->w == 0.0 || 1) {", "if (m->w == 0.0 || m->w == 0.0) {",
        "const double share = 0 ? sum / n : 0.0;", "const double share = 1 ? sum / n : 0.0;", "if (0) {", "if (1) {"}


def test_a_seed_draws_one_fault_of_each_place():
    sources = {"a.c": TEXT, "b.c": TEXT}
    first = planted.candidates("condition", sources, 1)
    places = [(fault.file, fault.change.start) for fault in first]
    assert first == planted.candidates("condition", sources, 1) != planted.candidates("condition", sources, 2)
    assert len(places) == len(set(places)) == 2 * 4


def test_the_table_counts_what_each_means_sees():
    def row(kind, **seen):
        return {"kind": kind, **dict.fromkeys(planted.MEANS, ""), **seen}

    rows = [row("nan", prove="line 3", tests="A.b"), row("nan", prove="line 4", flights="-"), row("index")]
    shown = [line.split() for line in planted.table(rows)]
    assert shown[0] == ["kind", "faults", *planted.MEANS, "none"]
    assert ["nan", "2", "2", "0", "1", "0", "0"] in shown and ["index", "1", "0", "0", "0", "0", "1"] in shown
    assert ["all", "3", "2", "0", "1", "0", "1"] in shown and shown[-1] == ["alone", "1", "0", "0", "0"]


@pytest.mark.long("compiles, proves and flies a fault")
@needs("frama-c-base", *section("decisions"))
def test_a_number_that_is_not_finite_is_seen():
    bench = planted.Bench()
    file = "flight/control/mrp_steering.c"
    fault = next(fault for fault in planted.candidates("nan", bench.sources, 1)
                 if fault.file == file and "vec_finite(command.omega_DR_B) && 1)" in fault.lines()[1])
    seen = bench.seen(fault)
    assert "not finite while GOOD" in seen["prove"] and seen["tests"], seen
    same = fault._replace(change=fault.change._replace(start=0, stop=0, after=""))
    assert (ROOT / file).read_text(encoding="utf-8") == same.changed() and bench.seen(same) == {}
