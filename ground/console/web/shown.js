// SPDX-License-Identifier: Apache-2.0
// The values of a spacecraft at the time that is shown: the newest, or those that the archive has of that time.
import {LOOK_BACK, valuesAt} from "./api.js";
import {h} from "./dom.js";
import {seconds, span} from "./format.js";
import {ageOf, isStale, valueText} from "./store.js";

const LOOKED = span(seconds(LOOK_BACK));

export class Shown {
    constructor({api, craft, time, onTime}, store) {
        const words = `each value is the newest of the ${LOOKED} before`;
        const note = h("span", {class: "soft", hidden: time.isLive}, words);
        Object.assign(this, {api, craft, time, store, past: null, /** For the page's head, at a past time. */ note});
        onTime(() => { note.hidden = time.isLive; });
        this.get = this.get.bind(this);
    }

    /** A slot's value as {number, text, level, t [ns]}; undefined: there is none. */
    get(slot) {
        if (this.time.isLive) return this.store.get(slot);
        const old = this.past?.get(slot);
        return old && {number: old.value ?? NaN, text: valueText(this.store.slots[slot], old), level: old.concern,
            t: old.t};
    }

    /** The words instead of a value that is not there. there: whether it will be, of a live one. */
    none(there) {
        return this.time.isLive ? there ? "" : "no value yet" :
            this.past ? `none in ${LOOKED}` : "\u2026";
    }

    /** [s] The age of a slot's value, and whether it is stale; a missing value is. */
    age(slot) {
        const value = this.get(slot), age = value ? ageOf(value.t, this.time.at) : 0;
        return [age, !value || isStale(this.store.slots[slot], age)];
    }

    /** Read the values of slots from the archive, if the time is not now. */
    async remember(slots) {
        const {time, store} = this, {at} = time, names = [...new Set(slots.map((slot) => store.slots[slot].name))];
        if (time.isLive || !names.length) return;
        const values = await valuesAt(this.api, this.craft, names, at, time.session);
        if (at !== time.at || time.isLive) return;
        this.past = new Map([...values].map(([name, value]) => [store.byName.get(name), value]));
    }
}
