// SPDX-License-Identifier: Apache-2.0
// The newest value of each slot of one craft, as the server's frames bring them. The 64 bits of a word are kept as they
// are: a word becomes a number or a text when it is shown.
import {clock} from "./format.js";

const MAGIC = 0x31444c46, HEAD = 8, ROW = 6;     // in words of 32 bits
export const [GOOD, UNCALIBRATED, UNLABELLED, MALFORMED] = [0, 1, 2, 3];
export const STATUSES = ["", "uncalibrated", "unlabelled", "malformed"];

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
            const made = new Kind(size);
            if (old) made.set(old);
            return made;
        };
        this.time = keep(Uint32Array, this.time, 2 * n);
        this.word = keep(Uint32Array, this.word, 2 * n);
        this.concern = keep(Uint8Array, this.concern, n);
        this.status = keep(Uint8Array, this.status, n);
        this.seen = keep(Uint8Array, this.seen, n);
        this.size = n;
    }

    /** Learn of slots, as GET slots gives them. */
    learn(slots) {
        for (const one of slots) {
            this.slots[one.slot] = one;
            this.byName.set(one.name, one.slot);
            if (one.path) this.byName.set(one.path, one.slot);
        }
        if (this.slots.length > this.size) this.grow(2 * this.slots.length);
    }

    /** Take a frame. Throws if it is none. */
    take(buffer) {
        const words = new Uint32Array(buffer, 0, buffer.byteLength >> 2);
        if (words[0] !== MAGIC) throw new Error("This is no frame of values");
        this.t = new BigInt64Array(buffer, 16, 1)[0];
        this.frames++;
        const n = words[6], {time, word, concern, status, seen, slots} = this, texts = 4 * (HEAD + ROW * n);
        for (let k = 0, p = HEAD; k < n; k++, p += ROW) {
            const slot = words[p], about = words[p + 1];
            if (slot >= this.size) {
                this.grow(2 * (slot + 1));
                return this.take(buffer);
            }
            concern[slot] = about & 255;
            status[slot] = (about >> 8) & 255;
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

    /** When a slot's value was on board, in ns. */
    at(slot) { return join(this.time, slot, "getBigInt64"); }

    /** A slot's value as a number; an integer beyond 2^53 is rounded; a text gives NaN. */
    number(slot) {
        if (!this.seen[slot]) return NaN;
        const low = this.word[2 * slot], high = this.word[2 * slot + 1];
        switch (this.slots[slot]?.kind) {
        case "real": return join(this.word, slot, "getFloat64");
        case "integer": return (high | 0) * 4294967296 + low;
        case "time": return ((high | 0) * 4294967296 + low) / 1e9;
        case "natural": return high * 4294967296 + low;
        case "boolean":
        case "label": return low;
        default: return NaN;
        }
    }

    /** A slot's value as a text, exact; "" if there is none yet. */
    text(slot) {
        if (!this.seen[slot]) return "";
        const about = this.slots[slot] ?? {kind: "natural"};
        switch (about.kind) {
        case "real": return real(join(this.word, slot, "getFloat64"));
        case "integer": return String(join(this.word, slot, "getBigInt64"));
        case "natural": return String(join(this.word, slot, "getBigUint64"));
        case "time": return clock(join(this.word, slot, "getBigInt64"), true);
        case "boolean": return this.word[2 * slot] ? "true" : "false";
        case "label":
            if (this.status[slot] === UNLABELLED)
                return `${join(this.word, slot, "getBigUint64") & 0x7fffffffffffffffn} (no name)`;
            return about.labels?.[this.word[2 * slot]] ?? String(this.word[2 * slot]);
        case "text": return utf8.decode(this.texts.get(slot));
        default: return Array.from(this.texts.get(slot) ?? [], (one) => one.toString(16).padStart(2, "0")).join(" ");
        }
    }
}

const MOST = 7;     // curves of a plot

/** A parameter's name with those of the other components of its vector, as far as a plot can have them. */
export function together(store, name) {
    const base = name.replace(/\[\d+\]$/, "");
    const found = base === name ? [] : store.slots.filter((one) => one && one.name.startsWith(`${base}[`) &&
        /^\[\d+\]$/.test(one.name.slice(base.length))).map((one) => one.name);
    return found.length && found.length <= MOST ? found : [name];
}

/** [s] How old what is of a time is at another one, both in ns. */
export const ageOf = (t, now) => Math.max(0, Number(now - t) / 1e9);

/** Whether a slot's value, so old [s], is stale: what writes it has not for long. The server says how long. */
export const isStale = (slot, age) => (slot?.stale ?? Infinity) < age;

function join(from, slot, how) {
    bits.setUint32(0, from[2 * slot], true);
    bits.setUint32(4, from[2 * slot + 1], true);
    return bits[how](0, true);
}

/** A double in few digits: 7 that matter. */
export function real(value) {
    if (!Number.isFinite(value))
        return Number.isNaN(value) ? "not a number" : value > 0 ? "+infinite" : "\u2212infinite";
    const size = Math.abs(value);
    const text = size && (size >= 1e7 || size < 1e-4) ? value.toExponential(5) : String(+value.toPrecision(7));
    return text.replaceAll("-", "\u2212");
}

/** A value of the archive, of valuesAt, as a slot's value is shown. */
export function valueText(slot, {value, text}) {
    if (value === null || value === undefined) return "\u2013";
    switch (slot.kind) {
    case "real": return real(value);
    case "label": return slot.labels?.includes(text) ? text : `${text} (no name)`;
    case "boolean": return value ? "true" : "false";
    case "time": return clock(BigInt(text.replace(".", "")), true);
    case "binary": return (value.match(/../g) ?? []).join(" ");
    default: return text ?? String(value);
    }
}
