// SPDX-License-Identifier: Apache-2.0
// The one time axis of all pages: live, or at a time that has been; and the bar by which it is moved.
import {of} from "./api.js";
import {h, put} from "./dom.js";
import {clock, ticks} from "./format.js";

const STEPS = 2000;     // of the slider

export class Time {
    /** changed(): the time was moved, so that the link has to follow. */
    constructor(live, keys, changed) {
        Object.assign(this, {live, craft: "", t: null, session: -1, sessions: [], hearers: new Set(), moved: changed});
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
        live.on("craft", (one) => one.craft === this.craft && this.show());
        live.on("event", (one) => one.craft === this.craft && one.source === "link" && this.load());   // gaps
        live.onFrame(() => this.show());
    }

    get isLive() { return this.t === null; }
    get utc() { return this.live.craft(this.craft)?.clock !== "simulated"; }

    /** The craft's newest time, in ns, or null. */
    get newest() {
        const said = this.live.craft(this.craft)?.t_ns, store = this.live.store(this.craft).t;
        const known = said === null || said === undefined ? null : BigInt(said);
        return store !== null && (known === null || store > known) ? store : known;
    }

    /** The time to show, in ns: the newest if live. */
    get at() { return this.t ?? this.newest ?? 0n; }

    text(ns, digits) { return clock(ns, this.utc, digits); }

    async open(craft, t, session) {
        Object.assign(this, {craft, t, session, sessions: []});
        this.show();
        await this.load();
    }

    /** Ask again what the archive has. */
    async load() {
        const {craft} = this;
        const found = craft ? await this.live.api.get(of(craft, "sessions")).catch(() => []) : [];
        if (craft === this.craft) this.sessions = found;
        this.show();
    }

    /** First and last time of the session, in ns. */
    extent() {
        const one = this.sessions.find(({session}) => session === this.session) ?? this.sessions.at(-1);
        const newest = this.newest ?? 0n, current = one === this.sessions.at(-1);
        const first = one ? BigInt(one.first_ns) : newest, last = one ? BigInt(one.last_ns) : newest;
        return [first, current && newest > last ? newest : last];
    }

    step(seconds) { this.seek(this.at + BigInt(seconds) * 1000000000n); }

    /** Go to a time, of the session that is shown or another one. Beyond the newest: return to now. */
    seek(t, session = this.session) {
        this.session = session;
        const [first, last] = this.extent();
        if (session === -1 && t >= last) return this.now();
        this.t = t < first ? first : t > last ? last : t;
        return this.tell();
    }

    now() {
        if (this.isLive) return;
        Object.assign(this, {t: null, session: -1});
        this.tell();
    }

    tell() {
        this.show();
        this.moved();
        for (const hear of [...this.hearers]) hear();
    }

    /** Hear of a time that was chosen. Returns what ends it. */
    on(hear) {
        this.hearers.add(hear);
        return () => this.hearers.delete(hear);
    }

    show() {
        const [first, last] = this.extent(), {at} = this;
        this.element.classList.toggle("past", !this.isLive);
        put(this.state, this.isLive ? "\u25cf live" : "\u25c0 back in time");
        this.button.disabled = this.isLive;
        if (document.activeElement !== this.field) this.field.value = this.text(at, 1);
        put(this.ends[0], this.text(first, 0).slice(this.utc ? 11 : 0));
        put(this.ends[1], this.text(last, 0).slice(this.utc ? 11 : 0));
        const place = last > first ? Number((at - first) * BigInt(STEPS) / (last - first)) : STEPS;
        if (Number(this.slider.value) !== place) this.slider.value = place;
        this.slider.setAttribute("aria-valuetext", this.text(at, 0));
    }
}
