// SPDX-License-Identifier: Apache-2.0
// The time that all pages show, live or past; and the bar that moves it.
import {of} from "./api.js";
import {h, put} from "./dom.js";
import {clock, ticks} from "./format.js";

const STEPS = 2000;     // of the slider

export class Time {
    /** changed(): called when the time was moved, so that the link follows. */
    constructor(live, keys, changed) {
        Object.assign(this, {live, changed, craft: "", t: null, session: -1, sessions: [], listeners: new Set()});
        this.slider = h("input", {
            type: "range",
            min: 0,
            max: STEPS,
            value: STEPS,
            "aria-label": "time",
            oninput: () => {
                const [first, last] = this.extent();
                this.seek(first + (last - first) * BigInt(this.slider.value) / BigInt(STEPS));
            }
        });
        this.field = h("input", {class: "when", "aria-label": "time shown", spellcheck: false, autocomplete: "off",
            onchange: () => {
                const t = ticks(this.field.value, this.utc);
                this.field.setAttribute("aria-invalid", t === null);
                if (t !== null) this.seek(t);
            }, onblur: () => this.show()});
        this.state = h("span", {class: "mode"});
        this.button = h("button", {onclick: () => this.now(), title: "return to now (n)"}, "Now");
        this.ends = [h("span", {class: "soft end"}), h("span", {class: "soft end"})];
        const step = (words, seconds) =>
            h("button", {onclick: () => this.step(seconds), "aria-label": `${words} s`}, words);
        this.element =
            h("footer", {class: "time"}, this.state, this.field, step("\u221260", -60), step("\u221210", -10),
                step("+10", 10), step("+60", 60), this.ends[0], this.slider, this.ends[1], this.button);
        keys.always("n", "return to now", () => this.now());
        keys.always(",", "10 s back in time", () => this.step(-10));
        keys.always(".", "10 s on in time", () => this.step(10));
        keys.always("<", "1 min back in time", () => this.step(-60));
        keys.always(">", "1 min on in time", () => this.step(60));
        live.on("craft", (message) => message.craft === this.craft && this.show());
        live.on("event", (message) =>       // gaps
            message.craft === this.craft && message.source === "link" && this.load());
        live.onFrame(() => this.show());
    }

    get isLive() { return this.t === null; }
    get utc() { return this.live.craft(this.craft)?.clock !== "simulated"; }

    /** The craft's newest time, in ns, or null. */
    get newest() {
        const reported = this.live.craft(this.craft)?.t_ns, store = this.live.store(this.craft).t;
        const known = reported === null || reported === undefined ? null : BigInt(reported);
        return store !== null && (known === null || store > known) ? store : known;
    }

    /** The time that is shown, in ns: the newest if live. */
    get at() { return this.t ?? this.newest ?? 0n; }

    text(ns, digits) { return clock(ns, this.utc, digits); }

    /** A time in whole seconds of UTC, or tenths since the start; and one of the day alone. */
    brief(ns) { return this.text(ns, this.utc ? 0 : 1); }
    ofDay(ns, digits) { return this.text(ns, digits).slice(this.utc ? 11 : 0); }

    async open(craft, t, session) {
        Object.assign(this, {craft, t, session, sessions: []});
        this.show();
        await this.load();
    }

    /** Load the sessions of the archive. */
    async load() {
        const {craft} = this;
        const sessions = craft ? await this.live.api.get(of(craft, "sessions")).catch(() => []) : [];
        if (craft === this.craft) this.sessions = sessions;
        this.show();
    }

    /** The session that is shown, as the server lists it; undefined if there is none. */
    get entry() { return this.sessions.find(({session}) => session === this.session) ?? this.sessions.at(-1); }

    /** First and last time of the session, in ns. */
    extent() {
        const newest = this.newest ?? 0n, latest = this.sessions.at(-1), {entry} = this;
        const first = BigInt(entry?.first_ns ?? newest), last = BigInt(entry?.last_ns ?? newest);
        return [first, entry === latest && newest > last ? newest : last];
    }

    step(seconds) { this.seek(this.at + BigInt(seconds) * 1000000000n); }

    /** Go to a time, of the session that is shown or another one. Beyond the newest: return to now. */
    seek(t, session = this.session) {
        this.session = session;
        const [first, last] = this.extent();
        if (session === -1 && t >= last) return this.now();
        this.t = t < first ? first : t > last ? last : t;
        return this.notify();
    }

    now() {
        if (this.isLive) return;
        Object.assign(this, {t: null, session: -1});
        this.notify();
    }

    notify() {
        this.show();
        this.changed();
        for (const listener of [...this.listeners]) listener();
    }

    /** Add a listener of the chosen time. Returns a function that removes it. */
    on(listener) {
        this.listeners.add(listener);
        return () => this.listeners.delete(listener);
    }

    show() {
        const [first, last] = this.extent(), {at} = this;
        this.element.classList.toggle("past", !this.isLive);
        put(this.state, this.isLive ? "\u25cf live" : "\u25c0 back in time");
        this.button.disabled = this.isLive;
        if (document.activeElement !== this.field) this.field.value = this.text(at, 1);
        put(this.ends[0], this.ofDay(first, 0));
        put(this.ends[1], this.ofDay(last, 0));
        const place = last > first ? Number((at - first) * BigInt(STEPS) / (last - first)) : STEPS;
        if (Number(this.slider.value) !== place) this.slider.value = place;
        this.slider.setAttribute("aria-valuetext", this.text(at, 0));
    }
}
