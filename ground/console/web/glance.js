// SPDX-License-Identifier: Apache-2.0
// The parameters of a spacecraft that matter first: mode, attitude, power and link. They are chosen by words in names
// and by units, which any database has. Of several attitude errors or rates that modules of Fledge write, the newest
// one is shown, with its age.
import {bare, digits} from "./format.js";
import {ageOf, isStale} from "./store.js";

const MOST = 4;     // rows of a topic

const degrees = (x) => x * 180 / Math.PI;
// Vectors in Fledge's messages, by the names of their fields, with the unit that is shown.
const VECTORS = [
    {label: "Attitude error", field: "sigma_BR", shown: "deg", of: {"": (size) => degrees(4 * Math.atan(size))}},
    {label: "Rate", field: "omega_BN_B", shown: "deg/s", of: {"rad/s": degrees}},
];
const last = (name) => name.split(".").at(-1);
const number = ({kind}) => ["real", "natural", "integer"].includes(kind);
const word = (text) => new RegExp(`(^|[._])(${text})([._\\[]|$)`, "i");
const TOPICS = {
    mode: (slot) => ["label", "text"].includes(slot.kind) && word("(flight_|system_|aocs_|adcs_)?mode").test(slot.name),
    attitude: (slot) => number(slot) && word("attitude|pointing|quaternion|q|roll|pitch|yaw").test(slot.name),
    power: (slot) => number(slot) && bare(slot.unit) &&
        (/batter|charge|volt|power|(^|_)soc(_|$)/i.test(last(slot.name)) ||
        ["W", "Wh", "V", "A"].includes(slot.unit) && /batter|power|bus|panel/i.test(slot.name)),
    link: (slot) => word("radio|space_?link|transponder|receiver|transmitter|cop1|farm|clcw").test(slot.name) &&
        ["label", "boolean", "real"].includes(slot.kind),
};

export class Glance {
    constructor(store) {
        this.store = store;
        const all = store.slots.filter((slot) => slot && !slot.header);
        this.rows = [];
        const topic = (fits) => all.filter(fits).slice(0, MOST).forEach((parameter) =>
            this.rows.push({parameter, slots: [parameter.slot]}));
        const mode = store.slots.filter((slot) => slot?.name.endsWith(".housekeeping.mode"));     // Fledge's own
        topic((slot) => TOPICS.mode(slot) && (!mode.length || mode.includes(slot)));
        for (const about of VECTORS) {
            const outputs = all.filter(({name}) => name.endsWith(`.${about.field}[0]`))
                .map(({name}) => this.vector(name)).filter(Boolean);
            if (outputs.length)
                this.rows.push({about, outputs, slots: outputs.flatMap(({parts, head}) => [...parts, ...head])});
        }
        if (!this.rows.some(({about}) => about)) topic(TOPICS.attitude);
        topic(TOPICS.power);
        topic(TOPICS.link);
        for (const row of this.rows) row.label = row.about?.label ?? short(row.parameter.name);
        for (const row of this.rows)        // rows with the same label get one more part of their names
            if (row.parameter && this.rows.some((other) => other !== row && other.label === row.label))
                row.label = short(row.parameter.name, 2);
        /** The slots that the rows need. */
        this.slots = [...new Set(this.rows.flatMap((row) => row.slots))];
    }

    vector(first) {
        const {byName} = this.store, base = first.slice(0, -3), output = base.slice(0, base.lastIndexOf("."));
        const parts = [0, 1, 2].map((k) => byName.get(`${base}[${k}]`));
        const head = ["t", "sequence", "quality"].map((member) => byName.get(`${output}.head.${member}`));
        return [...parts, ...head].includes(undefined) ? null : {base, parts, head};
    }

    /** A row as {text, unit, name, slot, age [s], stale, level}; get(slot): {number, text, t, level}, or undefined; at:
        [ns] the time that is shown. */
    read(row, get, at) {
        const {slots} = this.store;
        if (row.parameter) {
            const {name, slot, unit, kind} = row.parameter, now = get(slot), age = now ? ageOf(now.t, at) : 0;
            return {name, slot, unit: bare(unit), level: now?.level ?? 0, age, stale: isStale(row.parameter, age),
                    text: kind === "real" && now ? digits(now.number) : now?.text ?? ""};
        }
        // The newest one; of equally new ones, that of the best quality.
        const times = row.outputs.map(({head}) => (get(head[1])?.number ? get(head[0])?.number ?? -1 : -1));
        const best = row.outputs.map(({head}, k) => [times[k], get(head[2])?.number ?? 0, k])
                         .reduce((a, b) => (b[0] > a[0] || b[0] === a[0] && b[1] > a[1] ? b : a))[2];
        const {base, parts} = row.outputs[best], written = get(parts[0])?.t;
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
