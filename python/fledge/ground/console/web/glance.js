// SPDX-License-Identifier: Apache-2.0
// What a person wants to know of a spacecraft first: its mode, attitude, power and link, as its telemetry has them. By
// the words of names and by units, so that any database has them; of several attitude errors or rates that Fledge's
// modules put out, the one that was written last counts, with its age.
import {bare, digits} from "./format.js";
import {ageOf, isStale} from "./store.js";

const MOST = 4;     // rows of a topic

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
        for (const row of this.rows)        // what has them distinguishes several of one name
            if (row.one && this.rows.some((other) => other !== row && other.label === row.label))
                row.label = short(row.one.name, 2);
        /** What has to be known for the rows. */
        this.slots = [...new Set(this.rows.flatMap((row) => row.slots))];
    }

    vector(first) {
        const {byName} = this.store, base = first.slice(0, -3), output = base.slice(0, base.lastIndexOf("."));
        const parts = [0, 1, 2].map((k) => byName.get(`${base}[${k}]`));
        const head = ["t", "sequence", "quality"].map((one) => byName.get(`${output}.head.${one}`));
        return [...parts, ...head].includes(undefined) ? null : {base, parts, head};
    }

    /** A row as {text, unit, name, slot, age [s], stale, level}; get(slot): {number, text, t, level}, or undefined; at:
        [ns] the time that is shown. */
    read(row, get, at) {
        const {slots} = this.store;
        if (row.one) {
            const {name, slot, unit, kind} = row.one, now = get(slot), age = now ? ageOf(now.t, at) : 0;
            return {name, slot, unit: bare(unit), level: now?.level ?? 0, age, stale: isStale(row.one, age),
                    text: kind === "real" && now ? digits(now.number) : now?.text ?? ""};
        }
        // The newest; of those as new the best.
        const times = row.found.map(({head}) => (get(head[1])?.number ? get(head[0])?.number ?? -1 : -1));
        const best = row.found.map(({head}, k) => [times[k], get(head[2])?.number ?? 0, k])
                         .reduce((a, b) => (b[0] > a[0] || b[0] === a[0] && b[1] > a[1] ? b : a))[2];
        const {base, parts} = row.found[best], written = get(parts[0])?.t;
        const size = Math.hypot(...parts.map((slot) => get(slot)?.number ?? NaN));
        const there = times[best] >= 0 && Number.isFinite(size), {of, shown} = row.about;
        const unit = bare(slots[parts[0]].unit), known = of[unit], age = there ? ageOf(written, at) : 0;
        return {name: base, slot: parts[0], unit: !there ? "" : known ? shown : unit, level: 0,
                age, stale: isStale(slots[parts[0]], age),
                text: there ? digits(known ? known(size) : size) : "\u2013"};
    }
}

const short = (name, parts = 1) => {
    const words = name.split(".").slice(-parts).join(" ").replaceAll("_", " ");
    return words[0].toUpperCase() + words.slice(1);
};
