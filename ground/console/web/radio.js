// SPDX-License-Identifier: Apache-2.0
// The radio of a spacecraft, as far as the server knows: stations in contact, locks, losses, and the next passes.
import {of} from "./api.js";
import {dress, h, put} from "./dom.js";
import {clock, count, seconds, span} from "./format.js";
import {Facts, row} from "./parts.js";

const WINDOW = 10;      // [s] of the spacecraft's clock over which a rate is measured
const FLAGS = {
    no_rf: "no RF",
    no_bit_lock: "no bit lock",
    lockout: "lockout",
    wait: "wait",
    retransmit: "retransmit"
};
const minus = (text) => text.replace("-", "\u2212");
const degrees = (angle) => minus(`${(angle * 180 / Math.PI).toFixed(1)}\u00b0`);

/** 2000000 bit/s -> "2 Mbit/s" */
export function bitRate(rate) {
    const [by, unit] = rate < 1e3 ? [1, ""] : rate < 1e6 ? [1e3, "k"] : rate < 1e9 ? [1e6, "M"] : [1e9, "G"];
    return `${+(rate / by).toPrecision(3)} ${unit}bit/s`;
}

/** The state of COP-1 and the flags of the last CLCW; "" if neither is known. */
export function cop1Text({state = "", ended = "", ...flags} = {}) {
    const set = Object.keys(FLAGS).filter((name) => flags[name]).map((name) => FLAGS[name]);
    return [state, state === "initial" && ended && `ended: ${ended}`,
        "no_rf" in flags && `CLCW: ${set.join(", ") || "no flags"}`].filter(Boolean).join(" \u00b7 ");
}

/** The rows about a direction of a radio: the title and the text of each. */
const WAY = {
    receiver: ({state, lock}) => state && `${lock ? "\u25cf" : "\u25cb"} ${state}`,
    "Eb/N0": ({eb_n0_dB}) => eb_n0_dB !== undefined && `${minus(eb_n0_dB.toFixed(1))} dB`,
    "bit rate": ({rate}) => bitRate(rate),
    ...Object.fromEntries(["received", "lost", "damaged", "dropped"].map(
        (name) => [name, (way) => way[name] !== undefined && count(way[name])])),
    bytes: ({bytes, waiting}) => bytes !== undefined && `${count(bytes)}${waiting ? `, ${count(waiting)} wait` : ""}`,
};

export class Radio {
    constructor(api, name) {
        Object.assign(this, {api, name, facts: new Facts(), ways: new Map(), passes: [], samples: []});
        this.links = h("div", {class: "radios"});
        this.part = h("section", {hidden: true}, h("h3", {}, "Link and radio"), this.facts.element,
            this.links);
        this.title = h("h3");
        this.head = h("tr");
        this.body = h("tbody");
        this.table = h("section", {hidden: true, "aria-label": "next passes"}, this.title,
            h("div", {class: "frame passes", tabIndex: 0}, h("table", {class: "plain"},
                h("thead", {}, this.head), this.body)),
            h("p", {class: "soft"}, "Of the coming day, from the orbit of this moment by two bodies and J2."));
        this.load();
    }

    async load() {
        this.passes = await this.api.get(of(this.name, "passes")).catch(() => []);
        this.drawn = null;
    }

    /** Show the server's data of the spacecraft. Returns the rate of its packets as text, or "". */
    show(craft) {
        const {stations = [], radios = [], link = {}} = craft, now = seconds(craft.t_ns);
        const fact = (name, good, text) => this.facts.set(name, text, good ? "good" : "");
        for (const station of stations) {
            const next = this.passes.find((pass) =>
                pass.station === station.name && pass.rise_ns && seconds(pass.rise_ns) > now);
            fact(station.name, station.seen, station.seen ? "\u25cf contact" :
                `\u25cb no contact${next ? `, rises in ${span(seconds(next.rise_ns) - now)}` : ""}`);
            const from = stations.length > 1 ? `${station.name}, from` : "Seen from it";
            fact(from, false, `${degrees(station.elevation)} high, ${
                count(Math.round(station.range / 1e3))} km, ${lightTime(station.light_time)} away`);
        }
        for (const radio of radios) this.radio(radio);
        const cop1 = cop1Text(link.cop1);
        if (cop1) fact(link.cop1.state ? "COP-1" : "CLCW", link.cop1.state === "active", cop1);
        this.part.hidden = !this.facts.known.size && !this.ways.size;
        this.draw(craft, now);
        return this.rate(craft, now);
    }

    /** Both directions of a radio, side by side. */
    radio({name, carries, down, up}) {
        if (!this.ways.has(name)) {
            const cells = Object.keys(WAY).map(() => [h("td", {class: "num"}), h("td", {class: "num"})]);
            this.ways.set(name, cells);
            this.links.append(h("table", {class: "plain"},
                h("caption", {class: "soft"}, name, !carries && ": packets of this server do not pass by it"),
                h("thead", {}, h("tr", {}, h("td"), ["down", "up"].map((way) => h("th", {class: "num"}, way)))),
                h("tbody", {},
                    Object.keys(WAY).map((row, k) => h("tr", {}, h("th", {scope: "row"}, row), cells[k])))));
        }
        Object.values(WAY).forEach((text, k) => [down, up].forEach((way, i) => {
            const cell = this.ways.get(name)[k][i];
            put(cell, text(way) || "unknown");
            if (!k) dress(cell, way.lock ? "num good" : "num");
        }));
    }

    draw(craft, now) {
        const utc = craft.clock !== "simulated", inView = ({rise_ns}) => !rise_ns || seconds(rise_ns) <= now,
              shown = this.passes.filter(({set_ns}) => !set_ns || seconds(set_ns) > now),
              about = `${shown.length} ${shown[0]?.highest_ns} ${shown.filter(inView).length}`;
        if (this.drawn === about) return;
        if (this.drawn && shown.length < this.passes.length) this.load();    // a pass is over
        this.drawn = about;
        this.table.hidden = !shown.length;
        const several = new Set(shown.map(({station}) => station)).size > 1;
        put(this.title, several ? "Next passes" : `Next passes over ${shown[0]?.station}`);
        this.head.replaceChildren(...[several && "station", "rise", "highest", "at", "set"].filter(Boolean).map(
            (column) => h("th", {class: column === "station" ? "" : "num"}, column)));
        this.body.replaceChildren(...shown.map((pass) => row({}, ...several ? [pass.station] : [],
            ...[inView(pass) ? "in view" : clock(pass.rise_ns, utc, 0), degrees(pass.elevation),
                clock(pass.highest_ns, utc, 0), pass.set_ns ? clock(pass.set_ns, utc, 0) : "later"].map(
                (text) => ["num", text]))));
    }

    rate(craft, now) {
        if (this.samples.some((sample) => now < sample.now || craft.bytes < sample.bytes)) this.samples = [];
        if (!this.samples.some((sample) => now <= sample.now))
            this.samples.push({now, bytes: craft.bytes, packets: craft.packets});
        while (this.samples.length > 2 && this.samples[1].now <= now - WINDOW) this.samples.shift();
        const [first] = this.samples, past = now - first.now;
        return past > 0 ? `${bitRate(8 * (craft.bytes - first.bytes) / past)}, ${
            ((craft.packets - first.packets) / past).toPrecision(3)} packets/s` : "";
    }
}

/** A light time: ms below 1 s. */
const lightTime = (seconds) => (seconds < 1 ? `${(1e3 * seconds).toFixed(1)} ms` : span(seconds));
