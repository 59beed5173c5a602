// SPDX-License-Identifier: Apache-2.0
// Every spacecraft at a glance: its link and radio, its next passes, packets, alarms and newest events.
import {of} from "../api.js";
import {CONCERNS, SHAPES, concern, dress, h, put} from "../dom.js";
import {clock, count} from "../format.js";
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
        const about = h("span", {class: "soft"});
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
        made.radioPart = h("section", {hidden: true}, h("h3", {}, "Radio, by telemetry"), radio);
        made.element = h("article", {class: "panel card"},
            h("div", {class: "row"},
                h("h2", {}, h("a", {href: `#/parameters?craft=${encodeURIComponent(name)}`}, name)), about,
                h("span", {class: "grow"}), state, alarms),
            archive, facts, made.contact.part, made.radioPart,
            h("section", {}, h("h3", {}, "Newest events"), events), made.contact.table);
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
        made.slots = store.slots.filter((one) => one && RADIO.test(one.name)).slice(0, MOST);
        if (!made.slots.length) return;
        made.radioPart.hidden = false;
        for (const one of made.slots) {
            one.cell = h("dd");
            made.radio.append(h("dt", {title: one.name}, one.name.split(".").slice(-2).join(".")), one.cell);
        }
        made.wish = live.want(made.name, made.slots.map(({slot}) => slot), 2);
    }

    function show(made) {
        const craft = live.craft(made.name), store = live.store(made.name);
        if (!craft) return;
        const {state = "", address = "", ...counts} = craft.link ?? {};
        const up = /^(up|connected|running|open|locked)$/.test(state);
        dress(made.state, up ? "good" : "concern c4");
        put(made.state, `${up ? "\u25cf" : "\u25a0"} link ${state || "unknown"}`);
        put(made.about, `${craft.mission ?? ""}${craft.simulated ? ", simulated" : ""}`);
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
        made.archive.hidden = !craft.archive;
        put(made.archive, craft.archive ?? "");
        const {count: waiting, worst} = context.alarms.waiting(made.name);
        dress(made.alarms, waiting ? `concern c${worst}` : "soft");
        put(made.alarms, waiting ? `${SHAPES[worst]} ${waiting} alarm${waiting > 1 ? "s" : ""}` : "no alarms");
        for (const {slot, unit, cell} of made.slots) put(cell, `${store.text(slot)} ${unit === "-" ? "" : unit ?? ""}`);
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
