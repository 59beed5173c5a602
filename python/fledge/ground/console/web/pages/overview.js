// SPDX-License-Identifier: Apache-2.0
// Every spacecraft at a glance: what it does, its link and radio, its next passes, packets, alarms and newest events.
import {of} from "../api.js";
import {CONCERNS, SHAPES, concern, dress, h, hint, put} from "../dom.js";
import {bare, clock, count, span} from "../format.js";
import {Glance} from "../glance.js";
import {ageOf, isStale} from "../store.js";
import {Radio} from "../radio.js";

export const title = "Overview", key = "o";

// What a radio's or a link's telemetry is called, by the last part of its name.
const RADIO = /(^|[._])(radio|space_?link|transponder|receiver|transmitter|cop1|farm|clcw)([._\[]|$)/i;
const MOST = 8;

export async function open(context) {
    const {root, live, api} = context, cards = new Map(), grid = h("div", {class: "cards"});
    root.append(h("div", {class: "head"}, h("h1", {}, title)), grid);

    function card(name) {
        const facts = h("dl", {class: "facts"}), radio = h("dl", {class: "facts"}), events = h("ul", {class: "lines"});
        const state = h("span"), alarms = h("a", {href: `#/alarms?craft=${encodeURIComponent(name)}`});
        const archive = h("p", {class: "problem", hidden: true});
        const about = h("p", {class: "soft"});
        const row = (text) => {
            const value = h("dd");
            facts.append(h("dt", {}, text), value);
            return value;
        };
        const made = {
            name,
            state,
            alarms,
            archive,
            about,
            radio,
            events,
            slots: [],
            list: [],
            t: row("Time"),
            packets: row("Packets"),
            undecoded: row("Not decoded"),
            link: row("Link"),
            counts: row("Counts"),
            contact: new Radio(api, name)
        };
        made.stateList = h("dl", {class: "facts"});
        made.statePart = h("section", {hidden: true}, h("h3", {}, "State"), made.stateList);
        made.radioPart = h("section", {hidden: true}, h("h3", {}, "Radio, by telemetry"), radio);
        made.element = h("article", {class: "panel card"},
            h("header", {}, live.craft(name)?.picture && h("img", {src: of(name, "picture"), alt: ""}),
                h("div", {class: "grow"}, h("div", {class: "row"},
                    h("h2", {}, h("a", {href: `#/parameters?craft=${encodeURIComponent(name)}`}, name)),
                    h("span", {class: "grow"}), state, alarms), about)),
            archive,
            h("div", {class: "parts"},
                h("div", {class: "part"}, made.statePart, h("section", {}, h("h3", {}, "Telemetry"), facts)),
                h("div", {class: "part"}, made.contact.part, made.radioPart), made.contact.table),
            h("section", {}, h("h3", {}, "Newest events"), events));
        grid.append(made.element);
        cards.set(name, made);
        fill(made);
        return made;
    }

    /** What does not come with the craft's own counts: events, and which parameters are the radio's. */
    async function fill(made) {
        const [events, store] = await Promise.all([
            api.get(of(made.name, "events"), {limit: MOST}).catch(() => []), live.slots(made.name).catch(() => null)]);
        made.list = events;
        show(made);
        if (!store || made.slots.length) return;
        made.slots = store.slots.filter((one) => one && !one.header && RADIO.test(one.name)).slice(0, MOST);
        made.glance = new Glance(store);
        made.glance.rows = made.glance.rows.filter(({one}) => !made.slots.includes(one));
        for (const row of made.glance.rows) {
            row.cell = h("dd");
            made.stateList.append(h("dt", {}, row.label), row.cell);
        }
        made.statePart.hidden = !made.glance.rows.length;
        made.radioPart.hidden = !made.slots.length;
        for (const one of made.slots) {
            one.cell = h("dd");
            made.radio.append(h("dt", {title: one.name}, one.name.split(".").slice(-2).join(".")), one.cell);
        }
        made.wish = live.want(made.name, [...made.slots.map(({slot}) => slot), ...made.glance.slots], 2);
    }

    function show(made) {
        const craft = live.craft(made.name), store = live.store(made.name);
        if (!craft) return;
        const {state = "", address = "", ...counts} = craft.link ?? {};
        const up = /^(up|connected|running|open|locked)$/.test(state);
        dress(made.state, up ? "good" : "concern c4");
        put(made.state, `${up ? "\u25cf" : "\u25a0"} link ${state || "unknown"}`);
        put(made.about, [craft.mission === made.name ? "" : craft.mission, craft.simulated && "simulated",
            craft.replay && `replay of ${craft.replay}`].filter(Boolean).join(", "));
        const t = store.t ?? craft.t_ns;
        put(made.t, t === null || t === undefined ? "nothing received yet" : clock(t, craft.clock !== "simulated", 1));
        const rate = made.contact.show(craft);
        put(made.packets, count(craft.packets) + (rate && ` \u00b7 ${rate}`));
        put(made.undecoded, count(craft.undecoded));
        put(made.link, address || (craft.simulated ? "flown by this server" : "none"));
        put(made.counts,
            Object.entries(counts)
                    .filter(([, value]) => ["number", "string"].includes(typeof value))
                    .map(([name, value]) =>
                             `${name.replaceAll("_", " ")} ${typeof value === "number" ? count(value) : value}`)
                    .join(" \u00b7 ") ||
                "none");
        const wrong = [craft.failed, craft.archive].filter(Boolean).join("; ");
        made.archive.hidden = !wrong;
        put(made.archive, wrong);
        const {count: waiting, worst} = context.alarms.waiting(made.name);
        dress(made.alarms, waiting ? `concern c${worst}` : "soft");
        put(made.alarms, waiting ? `${SHAPES[worst]} ${waiting} alarm${waiting > 1 ? "s" : ""}` : "no alarms");
        const newest = BigInt(t ?? 0), old = (age, stale) => (stale ? `, ${span(age)} ago` : "");
        for (const one of made.slots) {
            const {slot, unit, cell} = one, age = store.seen[slot] ? ageOf(store.at(slot), newest) : 0;
            const stale = isStale(one, age);
            put(cell, `${store.text(slot)} ${bare(unit)}${old(age, stale)}`);
            dress(cell, stale ? "soft" : "");
        }
        for (const row of made.glance?.rows ?? []) {
            const one = made.glance.read(row, (slot) => (store.seen[slot] ? {number: store.number(slot),
                text: store.text(slot), level: store.concern[slot], t: store.at(slot)} : undefined), newest);
            put(row.cell, one.text ? `${one.text} ${one.unit}${old(one.age, one.stale)}` : "\u2013");
            dress(row.cell, one.stale ? "soft" : one.level ? `c${one.level}` : "");
            hint(row.cell, one.name);
        }
        const lines = made.list.slice(0, MOST).map((one) => one.id).join();
        if (made.lines === lines) return;
        made.lines = lines;
        made.events.replaceChildren(...(made.list.length ? made.list.slice(0, MOST).map((one) => h("li", {},
            h("time", {class: "soft"}, clock(one.t_ns, craft.clock !== "simulated", 0).slice(-8)),
            concern(Math.max(0, CONCERNS.indexOf(one.severity))), h("span", {}, `${one.source}: ${one.text}`))) :
            [h("li", {class: "soft"}, "none")]));
    }

    function all() {
        for (const {name} of live.crafts) show(cards.get(name) ?? card(name));
        for (const [name, made] of cards)
            if (!live.craft(name)) {
                made.wish?.end();
                made.element.remove();
                cards.delete(name);
            }
    }
    context.on("event", ({craft, kind, ...event}) => {
        const made = cards.get(craft);
        if (made) made.list = [event, ...made.list].slice(0, MOST);
    });
    context.on("crafts", all);
    context.on("alarms", all);
    context.onFrame(all);
    context.every(30000, () => cards.forEach((made) => made.contact.load()));
    all();
    return () => {
        for (const made of cards.values()) made.wish?.end();
    };
}
