# SPDX-License-Identifier: Apache-2.0
"""Live plots have the points of the archive, and no gap that the archive does not have."""
import pytest

from fledge.ground.server.scene_test import in_browser, served
from fledge.scene.browser import Browser
from fledge.scene.testing.node import in_node, needs_node
from tests.waiting import PATIENCE

SPEEDS = (1, 20, 1000)


@needs_node
@pytest.mark.parametrize("speed", SPEEDS)
def test_samples_that_did_not_come_live_are_read_and_are_no_gap(speed):
    """The archive has a value each second, later each third second, and none in half a minute. The page gets the newest
    value 20 times a second of real time, and none for two seconds of it."""
    result = in_node(f"""
        import {{Curve, Mender}} from "SOURCES/../../../ground/console/web/curve.js";
        const until = Math.max(400, 10 * {speed}), lost = (t) => t > 150 && t < 180;
        const archive = Array.from({{length: until + 1}}, (_, t) => t).filter((t) => !lost(t) && (t < 200 || t > 260 ||
            t % 3 === 0));
        const has = (from, to) => {{
            const t = archive.filter((s) => s >= from && s <= to), value = t.map(Math.sqrt);
            return {{t, value, low: value, high: value, worst: value.map(() => 0)}};
        }};
        let now = 0, requests = 0, wall = 0;
        Object.defineProperty(performance, "now", {{value: () => wall}});
        const curve = new Curve("x");
        curve.fill(has(0, 20), 20e9);
        const mender = new Mender(async (from, to) => {{
            requests++;
            return [has(from, to)];
        }}, () => {{}});
        for (now = 20; now <= until; now += {speed} / 20, wall += 50) {{
            const newest = archive.findLast((t) => t <= now);
            if (!(wall > 3000 && wall < 5000)) curve.add(newest, Math.sqrt(newest));
            await mender.check([curve], 0);
        }}
        wall += 1000;
        curve.add(until, Math.sqrt(until));
        await mender.check([curve], 0);
        const real = curve.t.filter((_, k) => curve.value[k] !== null);
        console.log(JSON.stringify({{same: real.join() === archive.join(), requests,
            values: curve.value.every((value, k) => value === null || value === Math.sqrt(curve.t[k])),
            gaps: curve.t.filter((_, k) => curve.value[k] === null)}}));
    """)
    assert result["same"] and result["values"]
    assert result["gaps"] == [165]
    assert result["requests"] < 40


@needs_node
def test_a_chart_has_no_infinite_value_and_an_axis_whose_marks_differ():
    result = in_node("""
        import {Curve, room} from "SOURCES/../../../ground/console/web/curve.js";
        const curve = new Curve("x");
        [1, Infinity, 3, -Infinity, NaN, 6].forEach((value, t) => curve.add(t, value, Math.min(value, 0), value));
        const ranges = [[0, 1], [2, 2], [0, 0], [-3, -3], [1.7e18, 1.7e18 + 512], [1.7e18, 1.7e18 + 256],
                        [-1e300, -1e300], [5e-324, 1e-323], [1, 1 + 2 ** -52], [null, null]].map(([low, high]) => {
            const [from, to] = room(low, high), step = (to - from) / 40;     // of the smallest marks
            return [low === null || (from < low && to > high), from + step > from, to - step < to];
        });
        console.log(JSON.stringify({table: curve.table, kept: String(curve.value[1]), ranges, one: room(0, 1),
            same: room(2, 2), none: room(0, 0)}));
    """)
    assert result["table"][1] == [1, None, 3, None, None, 6] and result["table"][2] == [0, 0, 0, None, None, 0]
    assert result["kept"] == "Infinity"     # as the legend says
    assert all(all(each) for each in result["ranges"]), result["ranges"]
    assert (result["one"], result["same"], result["none"]) == ([-0.06, 1.06], [1.8, 2.2], [-1, 1])


@pytest.mark.long("three flights and a browser: 40 s")
@in_browser
def test_live_plots_have_the_points_of_the_archive(tmp_path):
    """At 1, 20 and 1,000 times real time, for a value that comes twice a second of the flight."""
    name = "flight.tracking.error.sigma_BR[0]"
    text = 'port = 0\nfolder = "runs"\n' + "".join(
        f'[[craft]]\nname = "x{speed}"\nmission = "nadir_spin"\nspeed = {speed}\n' for speed in SPEEDS)
    with served(tmp_path, text) as (address, room), Browser(900, 600, wait=PATIENCE) as browser:
        for speed in SPEEDS:
            craft = room.crafts[f"x{speed}"]
            browser.go("about:blank")
            browser.go(f"{address}#/plots?craft={craft.name}&sel={name}")
            plot = "document.querySelector('.holder')?.plot"
            browser.wait_for(f"{plot}?.data[0].length > 3")
            begun = craft.clock.now / 1e9
            browser.wait_for(f"{plot}.data[0].at(-1) > {begun + 6 * speed}")
            craft.call(lambda craft=craft: craft.run.command("pause")).result(PATIENCE)
            end = craft.clock.now / 1e9
            browser.wait_for(f"{plot}.data[0].at(-1) >= {end} - 0.5")
            t, value, *_ = craft.past.series([name], 0, 2**62, 0, -1)[name]
            some = t / 1e9 > max(begun, end - 250)      # of the 300 s in view
            drawn = f"{plot}.data.slice(0, 2).map((column) => Array.from(column).slice({-int(some.sum())}))"
            browser.wait_for(f"JSON.stringify({drawn}[0]) === JSON.stringify({(t[some] / 1e9).tolist()})")
            assert browser.evaluate(drawn)[1] == value[some].tolist(), "the same values, and no gap"
        assert [problem for problem in browser.problems if "console.js" in problem] == []
