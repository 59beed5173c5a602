// SPDX-License-Identifier: Apache-2.0
// The values of a spacecraft at the time that is shown: the newest, or those that the archive has of that time.
import {valuesAt} from "./api.js";
import {ageOf, isStale, valueText} from "./store.js";

export class Shown {
    constructor({api, craft, time}, store) {
        Object.assign(this, {api, craft, time, store, past: null});
        this.get = this.get.bind(this);
    }

    /** A slot's value as {number, text, level, t [ns]}; undefined: there is none. */
    get(slot) {
        if (this.time.isLive) return this.store.get(slot);
        const old = this.past?.get(slot);
        return old && {number: old.value ?? NaN, text: valueText(this.store.slots[slot], old), level: old.concern,
            t: old.t};
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
