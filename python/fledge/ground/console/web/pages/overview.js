// SPDX-License-Identifier: Apache-2.0
// Every spacecraft at a glance: its state, link and radio, next passes, packets, alarms and newest events.
import {of} from "../api.js";
import {CONCERNS, SHAPES, concern, dress, h, hint, put} from "../dom.js";
import {bare, clock, count, span} from "../format.js";
import {Glance} from "../glance.js";
import {ageOf, isStale} from "../store.js";
import {Radio} from "../radio.js";

export const title = "Overview", key = "o";

// Names of a radio's or a link's telemetry.
const RADIO = /(^|[._])(radio|space_?link|transponder|receiver|transmitter|cop1|farm|clcw)([._\[]|$)/i;
const MOST = 8;

export async function open(context) {
    const {root, live, api} = context, cards = new Map(), grid = h("div", {class: "cards"});
    root.append(h("div", {class: "head"}, h("h1", {}, title)), grid);

    function add(name) {
        const facts = h("dl", {class: "facts"}), radio = h("dl", {class: "facts"}), events = h("ul", {class: "lines"});
        const state = h("span"), alarms = h("a", {href: `#/alarms?craft=${encodeURIComponent(name)}`});
        const archive = h("p", {class: "problem", hidden: true});
        const about = h("p", {class: "soft"});
        const row = (text) => {
            const value = h("dd");
            facts.append(h("dt", {}, text), value);
            return value;
        };
        const card = {
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
        card.stateList = h("dl", {class: "facts"});
        card.statePart = h("section", {hidden: true}, h("h3", {}, "State"), card.stateList);
        card.radioPart = h("section", {hidden: true}, h("h3", {}, "Radio, by telemetry"), radio);
        card.element = h("article", {class: "panel card"},
            h("header", {}, live.craft(name)?.picture && h("img", {src: of(name, "picture"), alt: ""}),
                h("div", {class: "grow"}, h("div", {class: "row"},
                    h("h2", {}, h("a", {href: `#/parameters?craft=${encodeURIComponent(name)}`}, name)),
                    h("span", {class: "grow"}), state, alarms), about)),
            archive,
            h("div", {class: "parts"},
                h("div", {class: "part"}, card.statePart, h("section", {}, h("h3", {}, "Telemetry"), facts)),
                h("div", {class: "part"}, card.contact.part, card.radioPart), card.contact.table),
            h("section", {}, h("h3", {}, "Newest events"), events));
        grid.append(card.element);
        cards.set(name, card);
        fill(card);
        return card;
    }

    /** Load the events, and choose the parameters that are shown. */
    async function fill(card) {
        const [events, store] = await Promise.all([
            api.get(of(card.name, "events"), {limit: MOST}).catch(() => []), live.slots(card.name).catch(() => null)]);
        card.list = events;
        show(card);
        if (!store || card.slots.length) return;
        card.slots = store.slots.filter((slot) => slot && !slot.header && RADIO.test(slot.name)).slice(0, MOST);
        card.glance = new Glance(store);
        card.glance.rows = card.glance.rows.filter(({parameter}) => !card.slots.includes(parameter));
        for (const row of card.glance.rows) {
            row.cell = h("dd");
            card.stateList.append(h("dt", {}, row.label), row.cell);
        }
        card.statePart.hidden = !card.glance.rows.length;
        card.radioPart.hidden = !card.slots.length;
        for (const slot of card.slots) {
            slot.cell = h("dd");
            card.radio.append(h("dt", {title: slot.name}, slot.name.split(".").slice(-2).join(".")), slot.cell);
        }
        card.wish = live.want(card.name, [...card.slots.map(({slot}) => slot), ...card.glance.slots], 2);
    }

    function show(card) {
        const craft = live.craft(card.name), store = live.store(card.name);
        if (!craft) return;
        const {state = "", address = "", ...counts} = craft.link ?? {};
        const up = /^(up|connected|running|open|locked)$/.test(state);
        dress(card.state, up ? "good" : "concern c4");
        put(card.state, `${up ? "\u25cf" : "\u25a0"} link ${state || "unknown"}`);
        put(card.about, [craft.mission === card.name ? "" : craft.mission, craft.simulated && "simulated",
            craft.replay && `replay of ${craft.replay}`].filter(Boolean).join(", "));
        const t = store.t ?? craft.t_ns;
        put(card.t, t === null || t === undefined ? "nothing received yet" : clock(t, craft.clock !== "simulated", 1));
        const rate = card.contact.show(craft);
        put(card.packets, count(craft.packets) + (rate && ` \u00b7 ${rate}`));
        put(card.undecoded, count(craft.undecoded));
        put(card.link, address || (craft.simulated ? "flown by this server" : "none"));
        put(card.counts,
            Object.entries(counts)
                    .filter(([, value]) => ["number", "string"].includes(typeof value))
                    .map(([name, value]) =>
                             `${name.replaceAll("_", " ")} ${typeof value === "number" ? count(value) : value}`)
                    .join(" \u00b7 ") ||
                "none");
        const wrong = [craft.failed, craft.archive].filter(Boolean).join("; ");
        card.archive.hidden = !wrong;
        put(card.archive, wrong);
        const {count: waiting, worst} = context.alarms.waiting(card.name);
        dress(card.alarms, waiting ? `concern c${worst}` : "soft");
        put(card.alarms, waiting ? `${SHAPES[worst]} ${waiting} alarm${waiting > 1 ? "s" : ""}` : "no alarms");
        const newest = BigInt(t ?? 0), old = (age, stale) => (stale ? `, ${span(age)} ago` : "");
        for (const parameter of card.slots) {
            const {slot, unit, cell} = parameter, age = store.seen[slot] ? ageOf(store.at(slot), newest) : 0;
            const stale = isStale(parameter, age);
            put(cell, `${store.text(slot)} ${bare(unit)}${old(age, stale)}`);
            dress(cell, stale ? "soft" : "");
        }
        for (const row of card.glance?.rows ?? []) {
            const value = card.glance.read(row, (slot) => (store.seen[slot] ? {number: store.number(slot),
                text: store.text(slot), level: store.concern[slot], t: store.at(slot)} : undefined), newest);
            put(row.cell, value.text ? `${value.text} ${value.unit}${old(value.age, value.stale)}` : "\u2013");
            dress(row.cell, value.stale ? "soft" : value.level ? `c${value.level}` : "");
            hint(row.cell, value.name);
        }
        const lines = card.list.slice(0, MOST).map((event) => event.id).join();
        if (card.lines === lines) return;
        card.lines = lines;
        card.events.replaceChildren(...(card.list.length ? card.list.slice(0, MOST).map((event) => h("li", {},
            h("time", {class: "soft"}, clock(event.t_ns, craft.clock !== "simulated", 0).slice(-8)),
            concern(Math.max(0, CONCERNS.indexOf(event.severity))), h("span", {}, `${event.source}: ${event.text}`))) :
            [h("li", {class: "soft"}, "none")]));
    }

    function all() {
        for (const {name} of live.crafts) show(cards.get(name) ?? add(name));
        for (const [name, card] of cards)
            if (!live.craft(name)) {
                card.wish?.end();
                card.element.remove();
                cards.delete(name);
            }
    }
    context.on("event", ({craft, kind, ...event}) => {
        const card = cards.get(craft);
        if (card) card.list = [event, ...card.list].slice(0, MOST);
    });
    context.on("crafts", all);
    context.on("alarms", all);
    context.onFrame(all);
    context.every(30000, () => cards.forEach((card) => card.contact.load()));
    all();
    return () => {
        for (const card of cards.values()) card.wish?.end();
    };
}
