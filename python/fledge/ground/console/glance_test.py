# SPDX-License-Identifier: Apache-2.0
"""What is shown first of a spacecraft: what was written last, with its age, grey if that is long ago."""
from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.scene.testing.node import in_node, needs_node


def test_the_server_says_when_a_value_is_stale(tmp_path):
    """By the tasks of the mission; what is written once does not age."""
    (tmp_path / "room.toml").write_text('folder = "kept"\n[[craft]]\nmission = "cubesat"\n')
    room = Room(read(tmp_path / "room.toml"))
    stale = {slot["name"]: slot["stale"] for slot in room.crafts["cubesat"].telemetry.slots()}
    room.close()
    assert stale["flight.tracking.error.sigma_BR[0]"] == 5      # twice a second
    assert stale["flight.sun_at.sun.r_PN_N[0]"] == 100          # each 10 s
    assert {stale[name] for name in stale if name.startswith(("flight.vehicle.", "flight.housekeeping."))} == {None}


@needs_node
def test_of_several_errors_the_newest_counts_and_what_is_stale_is_said_to_be():
    found = in_node("""
        import {Glance} from "SOURCES/../../../ground/console/web/glance.js";
        import {Store} from "SOURCES/../../../ground/console/web/store.js";
        const store = new Store("x"), slots = [];
        const add = (name, about = {}) => slots.push({slot: slots.length, name, kind: "real", unit: "", stale: 5,
                                                      header: name.includes(".head."), ...about});
        for (const one of ["off", "tracking", "sun"]) {
            for (const part of ["t", "quality", "sequence"]) add(`flight.${one}.error.head.${part}`);
            for (const k of [0, 1, 2]) add(`flight.${one}.error.sigma_BR[${k}]`);
        }
        store.learn(slots);
        const glance = new Glance(store), [row] = glance.rows;
        const told = (written, quality, at) => {
            const values = slots.map(({name}, slot) => {
                const one = name.split(".")[1], t = written[one];
                if (t === undefined) return undefined;
                const number = name.endsWith(".t") ? 1e9 * t : name.endsWith("quality") ? quality[one] ?? 3 :
                    name.endsWith("sequence") ? 7 : name.endsWith("[0]") ? t / 1e4 : 0;
                return {number, t: BigInt(1e9 * t), text: "", level: 0};
            });
            const {name, age, stale, text} = glance.read(row, (slot) => values[slot], BigInt(1e9 * at));
            return [name.split(".")[1] ?? "", age, stale, text];
        };
        console.log(JSON.stringify([
            told({tracking: 20, sun: 2100}, {}, 2100), told({tracking: 2180, sun: 100}, {}, 2181),
            told({tracking: 100, sun: 200}, {}, 2280), told({off: 50, tracking: 50}, {off: 2}, 50), told({}, {}, 9)]));
    """)
    assert [one[:3] for one in found[:4]] == [["sun", 0, False], ["tracking", 1, False], ["sun", 2080, True],
                                              ["tracking", 0, False]]
    assert found[4][1:] == [0, False, "\u2013"]
