// SPDX-License-Identifier: Apache-2.0
// What a person wants to know of a spacecraft first: its mode, attitude, power and link, as its telemetry has them. By
// the words of names and by units, so that any database has them; of several attitude errors or rates that Fledge's
// modules put out, the one that was written last counts, with its age.
import {bare, digits} from "./format.js";

const MOST = 4;     // rows of a topic
const STALE = 10;   // [s] since it was written

const degrees = (x) => x * 180 / Math.PI;
// Of Fledge's messages, by the names of their fields; a mission's ground.toml may show them in another unit.
const VECTORS = [
    {label: "Attitude error", field: "sigma_BR", shown: "deg", of: {"": (size) => degrees(4 * Math.atan(size))}},
    {label: "Rate", field: "omega_BN_B", shown: "deg/s", of: {"rad/s": degrees}},
];
const last = (name) => name.split(".").at(-1);
const number = ({kind}) => ["real", "natural", "integer"].includes(kind);
const word = (text) => new RegExp(`(^|[._])(${text})([._\\[]|$)`, "i");
const TOPICS = {
    mode: (one) => ["label", "text"].includes(one.kind) && word("(flight_|system_|aocs_|adcs_)?mode").test(one.name),
    attitude: (one) => number(one) && word("attitude|pointing|quaternion|q|roll|pitch|yaw").test(one.name),
    power: (one) => number(one) && bare(one.unit) && (/batter|charge|volt|power|(^|_)soc(_|$)/i.test(last(one.name)) ||
        ["W", "Wh", "V", "A"].includes(one.unit) && /batter|power|bus|panel/i.test(one.name)),
    link: (one) => word("radio|space_?link|transponder|receiver|transmitter|cop1|farm|clcw").test(one.name) &&
        ["label", "boolean", "real"].includes(one.kind),
};

export class Glance {
    constructor(store) {
        this.store = store;
        const all = store.slots.filter((one) => one && !one.header);
        this.rows = [];
        this.clocks = store.slots.filter((one) => one?.name.endsWith(".housekeeping.t")).map(({slot}) => slot);
        const topic = (fits) => all.filter(fits).slice(0, MOST).map((one) => this.rows.push({one, slots: [one.slot]}));
        const mode = store.slots.filter((one) => one?.name.endsWith(".housekeeping.mode"));     // Fledge's own
        topic((one) => TOPICS.mode(one) && (!mode.length || mode.includes(one)));
        for (const about of VECTORS) {
            const found = all.filter(({name}) => name.endsWith(`.${about.field}[0]`)).map(({name}) => this.vector(name))
                              .filter(Boolean);
            if (found.length)
                this.rows.push({about, found, slots: found.flatMap(({parts, head}) => [...parts, ...head])});
        }
        if (!this.rows.some(({about}) => about)) topic(TOPICS.attitude);
        topic(TOPICS.power);
        topic(TOPICS.link);
        for (const row of this.rows) row.label = row.about?.label ?? short(row.one.name);
        for (const row of this.rows)        // several of one name are told apart by what has them
            if (row.one && this.rows.some((other) => other !== row && other.label === row.label))
                row.label = short(row.one.name, 2);
        /** What has to be known for the rows. */
        this.slots = [...new Set([...this.rows.flatMap((row) => row.slots), ...this.clocks])];
    }

    vector(first) {
        const {byName} = this.store, base = first.slice(0, -3), output = base.slice(0, base.lastIndexOf("."));
        const parts = [0, 1, 2].map((k) => byName.get(`${base}[${k}]`));
        const head = ["t", "sequence"].map((one) => byName.get(`${output}.head.${one}`));
        return [...parts, ...head].includes(undefined) ? null : {base, parts, head};
    }

    /** A row as {text, unit, name, slot, age [s], level}; get(slot): {number, text, t, level}, or undefined. */
    read(row, get) {
        if (row.one) {
            const {name, slot, unit, kind} = row.one, now = get(slot);
            return {name, slot, unit: bare(unit), level: now?.level ?? 0, age: 0,
                    text: kind === "real" && now ? digits(now.number) : now?.text ?? ""};
        }
        const times = row.found.map(({head}) => (get(head[1])?.number ? get(head[0])?.number ?? -1 : -1));
        const at = times.indexOf(Math.max(...times)), {base, parts} = row.found[at];
        const size = Math.hypot(...parts.map((slot) => get(slot)?.number ?? NaN));
        const clock = Math.max(times[at], ...this.clocks.map((slot) => get(slot)?.number ?? -1));
        const there = times[at] >= 0 && Number.isFinite(size), {of, shown} = row.about;
        const unit = bare(this.store.slots[parts[0]].unit), known = of[unit];
        return {name: base, slot: parts[0], unit: !there ? "" : known ? shown : unit, level: 0,
                age: there ? (clock - times[at]) / 1e9 : 0,
                text: there ? digits(known ? known(size) : size) : "\u2013"};
    }
}

export const isStale = ({age}) => age > STALE;
const short = (name, parts = 1) => {
    const words = name.split(".").slice(-parts).join(" ").replaceAll("_", " ");
    return words[0].toUpperCase() + words.slice(1);
};
