# SPDX-License-Identifier: Apache-2.0
"""The parameters that are shown first: the newest of several, with its age, grey if it is stale."""
from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.scene.testing.node import in_node, needs_node


def test_the_server_says_when_a_value_is_stale(tmp_path):
    """By the tasks of the mission; a value that is written once does not age."""
    (tmp_path / "room.toml").write_text('folder = "kept"\n[[craft]]\nmission = "cubesat"\n')
    room = Room(read(tmp_path / "room.toml"))
    stale = {slot["name"]: slot["stale"] for slot in room.crafts["cubesat"].telemetry.slots()}
    room.close()
    assert stale["flight.tracking.error.sigma_BR[0]"] == 5      # twice a second
    assert stale["flight.sun_at.sun.r_PN_N[0]"] == 100          # each 10 s
    assert {stale[name] for name in stale if name.startswith(("flight.vehicle.", "flight.housekeeping."))} == {None}


@needs_node
def test_the_newest_of_several_errors_is_shown_and_marked_where_it_is_stale():
    shown = in_node("""
        import {Glance} from "SOURCES/../../../ground/console/web/glance.js";
        import {Store} from "SOURCES/../../../ground/console/web/store.js";
        const store = new Store("x"), slots = [];
        const add = (name, about = {}) => slots.push({slot: slots.length, name, kind: "real", unit: "", stale: 5,
                                                      header: name.includes(".head."), ...about});
        for (const module of ["off", "tracking", "sun"]) {
            for (const part of ["t", "quality", "sequence"]) add(`flight.${module}.error.head.${part}`);
            for (const k of [0, 1, 2]) add(`flight.${module}.error.sigma_BR[${k}]`);
        }
        store.learn(slots);
        const glance = new Glance(store), [row] = glance.rows;
        const read = (written, quality, at) => {
            const values = slots.map(({name}, slot) => {
                const module = name.split(".")[1], t = written[module];
                if (t === undefined) return undefined;
                const number = name.endsWith(".t") ? 1e9 * t : name.endsWith("quality") ? quality[module] ?? 3 :
                    name.endsWith("sequence") ? 7 : name.endsWith("[0]") ? t / 1e4 : 0;
                return {number, t: BigInt(1e9 * t), text: "", level: 0};
            });
            const {name, age, stale, text} = glance.read(row, (slot) => values[slot], BigInt(1e9 * at));
            return [name.split(".")[1] ?? "", age, stale, text];
        };
        console.log(JSON.stringify([
            read({tracking: 20, sun: 2100}, {}, 2100), read({tracking: 2180, sun: 100}, {}, 2181),
            read({tracking: 100, sun: 200}, {}, 2280), read({off: 50, tracking: 50}, {off: 2}, 50), read({}, {}, 9)]));
    """)
    assert [values[:3] for values in shown[:4]] == [["sun", 0, False], ["tracking", 1, False], ["sun", 2080, True],
                                                    ["tracking", 0, False]]
    assert shown[4][1:] == [0, False, "\u2013"]
