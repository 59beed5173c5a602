// SPDX-License-Identifier: Apache-2.0
// The order of the parameters on their page: by packets, what matters first, what has no value yet last.

/**
 * The packets of a store: [{name, about, slots}]; name: the common beginning of its parameters' names. First those with
 * parameters of the glance, then those of modules' outputs, which have a head, then others; last headers alone.
 */
export function packets(store, glance) {
    const first = ({slots}) => glance.slots.findIndex((wanted) => slots.some(({slot}) => slot === wanted));
    const rank = (group) => (group.slots.every(({header}) => header) ? 3e9 :
        !group.slots.some(({name, header}) => header && name.includes(".head.")) ? 2e9 :
        first(group) < 0 ? 1e9 : first(group));
    const containers = new Map();
    for (const slot of store.slots) {
        if (!slot) continue;
        if (!containers.has(slot.container)) containers.set(slot.container, []);
        containers.get(slot.container).push(slot);
    }
    return [...containers].map(([container, slots]) => {
        const [begin, ...rest] = slots.map(({name}) => name.split(".").slice(0, -1));
        const same = begin.findIndex((part, k) => rest.some((parts) => parts[k] !== part));
        const name = begin.slice(0, same < 0 ? begin.length : same).join(".");
        return {name: name || container?.split("/").at(-1) || "Computed by this server", slots, rank: rank({slots}),
                about: container ? `packet ${container}` : ""};
    }).sort((a, b) => a.rank - b.rank);
}

const within = (name, group) => (name.startsWith(`${group}.`) ? name.slice(group.length + 1) : name);

/**
 * The rows of a table of these packets: {group, about}, {slot, name}, {slot, name, glance}.
 * fits(slot): which are shown;  there(number): whether a slot has a value
 * apart: by packets; else a list of whole names;  glance: the rows of what matters first, as of Glance
 */
export function rowsOf(groups, {fits, there, apart, glance = []}) {
    const matches = groups.map((group) => ({...group, slots: group.slots.filter(fits)}))
                        .filter(({slots}) => slots.length);
    const rows = ({name, about, slots}) => [
        ...apart && name ? [{group: name, about}] : [],
        ...slots.map(({slot, name: whole}) => ({slot, name: apart ? within(whole, name) : whole}))];
    const has = ({slots}) => slots.some(({slot}) => there(slot)), hasNone = (group) => !has(group);
    const empty = matches.filter(hasNone), parameters = empty.reduce((sum, {slots}) => sum + slots.length, 0);
    const first = [...glance].sort((a, b) => b.slots.some(there) - a.slots.some(there));
    return [
        ...apart && first.length ? [{group: "At a glance", about: "what matters first"}] : [],
        ...apart ? first.map((row) => ({glance: row, slot: row.slots[0]})) : [],
        ...matches.filter(has).flatMap(rows),
        ...empty.length && apart ? [{group: `No value yet (${parameters})`,
            about: "no packet has brought these parameters so far"}] : [],
        ...empty.flatMap(rows)];
}
