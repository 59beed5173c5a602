// SPDX-License-Identifier: Apache-2.0
// The newest value of each slot of a craft, from the server's frames. A value stays a word of 64 bits until it is shown
// as a number or text.
import {dateText, secondsText} from "./format.js";

const MAGIC = 0x31444c46, HEAD = 8, ROW = 6;     // in words of 32 bits
export const STATUSES = ["", "uncalibrated", "unlabelled", "malformed"];
const UNLABELLED = STATUSES.indexOf("unlabelled");

const bits = new DataView(new ArrayBuffer(8));
const utf8 = new TextDecoder();

/** The craft's number in a frame. */
export const craftOf = (buffer) => new Uint32Array(buffer, 4, 1)[0];

export class Store {
    constructor(name) {
        Object.assign(this, {name, slots: [], byName: new Map(), t: null, frames: 0, texts: new Map()});
        this.grow(1024);
    }

    grow(n) {
        const keep = (Kind, old, size) => {
            const grown = new Kind(size);
            if (old) grown.set(old);
            return grown;
        };
        this.time = keep(Uint32Array, this.time, 2 * n);
        this.word = keep(Uint32Array, this.word, 2 * n);
        this.concern = keep(Uint8Array, this.concern, n);
        this.status = keep(Uint8Array, this.status, n);
        this.seen = keep(Uint8Array, this.seen, n);
        this.size = n;
    }

    /** Add slots, as GET slots lists them. */
    learn(slots) {
        for (const slot of slots) {
            this.slots[slot.slot] = slot;
            this.byName.set(slot.name, slot.slot);
            if (slot.path) this.byName.set(slot.path, slot.slot);
        }
        if (this.slots.length > this.size) this.grow(2 * this.slots.length);
    }

    /** Read the values of a frame. Throws if it is none. */
    update(buffer) {
        const words = new Uint32Array(buffer, 0, buffer.byteLength >> 2);
        if (words[0] !== MAGIC) throw new Error("This is no frame of values");
        this.t = new BigInt64Array(buffer, 16, 1)[0];
        this.frames++;
        const n = words[6], {time, word, concern, status, seen, slots} = this, texts = 4 * (HEAD + ROW * n);
        for (let k = 0, p = HEAD; k < n; k++, p += ROW) {
            const slot = words[p], state = words[p + 1];
            if (slot >= this.size) {
                this.grow(2 * (slot + 1));
                return this.update(buffer);
            }
            concern[slot] = state & 255;
            status[slot] = (state >> 8) & 255;
            seen[slot] = 1;
            time[2 * slot] = words[p + 2];
            time[2 * slot + 1] = words[p + 3];
            word[2 * slot] = words[p + 4];
            word[2 * slot + 1] = words[p + 5];
            const kind = slots[slot]?.kind;
            if (kind === "text" || kind === "binary")
                this.texts.set(slot, new Uint8Array(buffer, texts + words[p + 5], words[p + 4]).slice());
        }
        return undefined;
    }

    /** A slot's value as {number, text, level, t [ns]}; undefined: there is none yet. */
    get(slot) {
        return this.seen[slot] ? {number: this.number(slot), text: this.text(slot), level: this.concern[slot],
            t: this.at(slot)} : undefined;
    }

    /** The time of a slot's value on board, in ns. */
    at(slot) { return join(this.time, slot, "getBigInt64"); }

    /** A slot's value as a number; an integer beyond 2^53 is rounded; a text gives NaN. */
    number(slot) {
        if (!this.seen[slot]) return NaN;
        const low = this.word[2 * slot], high = this.word[2 * slot + 1];
        switch (this.slots[slot]?.kind) {
        case "real": return join(this.word, slot, "getFloat64");
        case "integer": return (high | 0) * 4294967296 + low;
        case "time":
        case "duration": return ((high | 0) * 4294967296 + low) / 1e9;
        case "natural": return high * 4294967296 + low;
        case "boolean":
        case "label": return low;
        default: return NaN;
        }
    }

    /** A slot's value as exact text; "" if there is none yet. */
    text(slot) {
        if (!this.seen[slot]) return "";
        const about = this.slots[slot] ?? {kind: "natural"};
        switch (about.kind) {
        case "real": return real(join(this.word, slot, "getFloat64"), about.single);
        case "integer": return String(join(this.word, slot, "getBigInt64"));
        case "natural": return String(join(this.word, slot, "getBigUint64"));
        case "time": return dateText(join(this.word, slot, "getBigInt64"));
        case "duration": return secondsText(join(this.word, slot, "getBigInt64"));
        case "boolean": return this.word[2 * slot] ? "true" : "false";
        case "label":
            if (this.status[slot] === UNLABELLED)
                return `${join(this.word, slot, "getBigUint64") & 0x7fffffffffffffffn} (no name)`;
            return about.labels?.[this.word[2 * slot]] ?? String(this.word[2 * slot]);
        case "text": return utf8.decode(this.texts.get(slot));
        default: return Array.from(this.texts.get(slot) ?? [], (byte) => byte.toString(16).padStart(2, "0")).join(" ");
        }
    }
}

const MOST = 7;     // curves of a plot

/** The names of all components of a parameter's vector; its own alone if these are too many for a plot. */
export function together(store, name) {
    const base = name.replace(/\[\d+\]$/, "");
    const components = base === name ? [] : store.slots.filter((slot) => slot && slot.name.startsWith(`${base}[`) &&
        /^\[\d+\]$/.test(slot.name.slice(base.length))).map((slot) => slot.name);
    return components.length && components.length <= MOST ? components : [name];
}

/** [s] The age of a value of time t; both times in ns. */
export const ageOf = (t, now) => Math.max(0, Number(now - t) / 1e9);

/** Whether a slot's value of this age [s] is stale: older than the limit that the server has for the slot. */
export const isStale = (slot, age) => (slot?.stale ?? Infinity) < age;

function join(from, slot, how) {
    bits.setUint32(0, from[2 * slot], true);
    bits.setUint32(4, from[2 * slot + 1], true);
    return bits[how](0, true);
}

/** The shortest text that reads back as the same double, or, if single, as the same number of 32 bits. */
export function real(value, single = false) {
    if (!Number.isFinite(value))
        return Number.isNaN(value) ? "not a number" : value > 0 ? "+infinite" : "\u2212infinite";
    let number = value;
    if (single && value && Math.fround(value) === value)
        for (let digits = 1; digits === 1 || Math.fround(number) !== value; digits++)
            number = Number(value.toPrecision(digits));
    const size = Math.abs(number), plain = Object.is(number, -0) ? "-0" : String(number);
    const power = size && (size >= 1e7 || size < 1e-4) ? number.toExponential() : plain;
    return (power.length < plain.length ? power : plain).replaceAll("-", "\u2212");
}

/** A value of the archive (valuesAt) as text, in the form of Store.text. */
export function valueText(slot, {value, text}) {
    if (value === null || value === undefined) return "\u2013";
    switch (slot.kind) {
    case "real": return real(value, slot.single);
    case "label": return slot.labels?.includes(text) ? text : `${text} (no name)`;
    case "boolean": return value ? "true" : "false";
    case "time": return dateText(text.replace(".", ""));
    case "duration": return secondsText(text.replace(".", ""));
    case "binary": return (value.match(/../g) ?? []).join(" ");
    default: return text ?? String(value);
    }
}
