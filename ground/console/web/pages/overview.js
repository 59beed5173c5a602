// SPDX-License-Identifier: Apache-2.0
// Every spacecraft at a glance: its state, link and radio, next passes, packets, alarms and newest events.
import {of} from "../api.js";
import {dress, h, hint, put} from "../dom.js";
import {bare, clock, count, span} from "../format.js";
import {Glance} from "../glance.js";
import {Facts, concern, head, putAlarms} from "../parts.js";
import {Radio} from "../radio.js";
import {ageOf, isStale} from "../store.js";
import {levelOf} from "../words.js";

export const title = "Overview", key = "o";

// Names of a radio's or a link's telemetry.
const RADIO = /(^|[._])(radio|space_?link|transponder|receiver|transmitter|cop1|farm|clcw)([._\[]|$)/i;
const MOST = 8;

export async function open(context) {
    const {root, live, api} = context, cards = new Map(), grid = h("div", {class: "cards"});
    root.append(head(title), grid);

    function add(name) {
        const facts = new Facts(), states = new Facts(), radio = new Facts(), part = (text, list) =>
            h("section", {hidden: true}, h("h3", {}, text), list.element);
        const state = h("span"), alarms = h("a", {href: `#/alarms?craft=${encodeURIComponent(name)}`});
        const archive = h("p", {class: "problem", hidden: true}), about = h("p", {class: "soft"});
        const card = {name, state, alarms, archive, about, facts, states, radio, slots: [], list: [],
            events: h("ul", {class: "lines"}), contact: new Radio(api, name), statePart: part("State", states),
            radioPart: part("Radio, by telemetry", radio)};
        card.element = h("article", {class: "panel card"},
            h("header", {}, live.craft(name)?.picture && h("img", {src: of(name, "picture"), alt: ""}),
                h("div", {class: "grow"}, h("div", {class: "row"},
                    h("h2", {}, h("a", {href: `#/parameters?craft=${encodeURIComponent(name)}`}, name)),
                    h("span", {class: "grow"}), state, alarms), about)),
            archive,
            h("div", {class: "parts"},
                h("div", {class: "part"}, card.statePart, h("section", {}, h("h3", {}, "Telemetry"), facts.element)),
                h("div", {class: "part"}, card.contact.part, card.radioPart), card.contact.table),
            h("section", {}, h("h3", {}, "Newest events"), card.events));
        grid.append(card.element);
        cards.set(name, card);
        fill(card);
        return card;
    }

    /** Load the events, and choose the parameters that are shown. */
    async function fill(card) {
        const [events, store] = await Promise.all([
            live.rows(card.name, "events", "event", {limit: MOST}).catch(() => []),
            live.slots(card.name).catch(() => null)]);
        card.list = events.sort((a, b) => b.id - a.id);
        show(card);
        if (!store || card.slots.length || card.glance?.rows.length) return;
        card.slots = store.slots.filter((slot) => slot && !slot.header && RADIO.test(slot.name)).slice(0, MOST);
        card.glance = new Glance(store);
        card.glance.rows = card.glance.rows.filter(({parameter}) => !card.slots.includes(parameter));
        for (const row of card.glance.rows) row.cell = card.states.add(row.label);
        card.statePart.hidden = !card.glance.rows.length;
        card.radioPart.hidden = !card.slots.length;
        for (const slot of card.slots)
            slot.cell = card.radio.add(slot.name.split(".").slice(-2).join("."), {title: slot.name});
        card.wish?.end();
        card.wish = live.want(card.name, [...card.slots.map(({slot}) => slot), ...card.glance.slots], 2);
    }

    function show(card) {
        const craft = live.craft(card.name), store = live.store(card.name);
        if (!craft) return;
        const {state = "", address = "", up, ...counts} = craft.link ?? {}, utc = craft.clock !== "simulated";
        dress(card.state, up ? "good" : "concern c4");
        put(card.state, `${up ? "\u25cf" : "\u25a0"} link ${state || "unknown"}`);
        put(card.about, [craft.mission === card.name ? "" : craft.mission, craft.simulated && "simulated",
            craft.replay && `replay of ${craft.replay}`].filter(Boolean).join(", "));
        const t = store.t ?? craft.t_ns, rate = card.contact.show(craft);
        for (const [name, text] of Object.entries({
            Time: t === null || t === undefined ? "nothing received yet" : clock(t, utc, 1),
            Packets: count(craft.packets) + (rate && ` \u00b7 ${rate}`), "Not decoded": count(craft.undecoded),
            Link: address || (craft.simulated ? "flown by this server" : "none"),
            Counts: Object.entries(counts).filter(([, value]) => ["number", "string"].includes(typeof value))
                .map(([name, value]) =>
                    `${name.replaceAll("_", " ")} ${typeof value === "number" ? count(value) : value}`)
                .join(" \u00b7 ") || "none"
        })) card.facts.set(name, text);
        const wrong = [craft.failed, craft.archive].filter(Boolean).join("; ");
        card.archive.hidden = !wrong;
        put(card.archive, wrong);
        putAlarms(card.alarms, context.alarms.waiting(card.name));
        const newest = BigInt(t ?? 0), old = (age, stale) => (stale ? `, ${span(age)} ago` : "");
        for (const parameter of card.slots) {
            const {slot, unit, cell} = parameter, value = store.get(slot), age = value ? ageOf(value.t, newest) : 0;
            const stale = isStale(parameter, age);
            put(cell, `${value?.text ?? ""} ${bare(unit)}${old(age, stale)}`);
            dress(cell, stale ? "soft" : "");
        }
        for (const row of card.glance?.rows ?? []) {
            const value = card.glance.read(row, (slot) => store.get(slot), newest);
            put(row.cell, value.text ? `${value.text} ${value.unit}${old(value.age, value.stale)}` : "\u2013");
            dress(row.cell, value.stale ? "soft" : value.level ? `c${value.level}` : "");
            hint(row.cell, value.name);
        }
        const lines = card.list.slice(0, MOST).map((event) => event.id).join();
        if (card.lines === lines) return;
        card.lines = lines;
        card.events.replaceChildren(...(card.list.length ? card.list.slice(0, MOST).map((event) => h("li", {},
            h("time", {class: "soft"}, clock(event.t_ns, utc, 0).slice(-8)),
            concern(levelOf(event)), h("span", {}, `${event.source}: ${event.text}`))) :
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
    context.onAny("event", (event) => {
        const card = cards.get(event.craft);
        if (card) card.list = [event, ...card.list].slice(0, MOST);
    });
    context.onAny("learned", ({craft}) => cards.has(craft) && fill(cards.get(craft)));
    context.onAny("crafts", all);
    context.onAny("alarms", all);
    context.onFrame(all);
    context.every(30000, () => cards.forEach((card) => card.contact.load()));
    all();
    return () => {
        for (const card of cards.values()) card.wish?.end();
    };
}
