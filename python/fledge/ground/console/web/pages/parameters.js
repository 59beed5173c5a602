// SPDX-License-Identifier: Apache-2.0
// Parameters by packet, tree and search: value, unit, age and state by limits; live, or back in time. Those that matter
// most come first; headers of packets and heads of messages are hidden at first.
import {valuesAt} from "../api.js";
import {attempt, concern, dress, h, hint, put} from "../dom.js";
import {bare, span} from "../format.js";
import {Glance} from "../glance.js";
import {editLimits, limitsText} from "../limits.js";
import {STATUSES, ageOf, isStale, together, valueText} from "../store.js";
import {Table} from "../table.js";

export const title = "Parameters", key = "p";

export async function open(context) {
    const {root, api, live, time, craft, keys} = context, store = await live.slots(craft);
    let shown = [], past = null, pending = null, [folder, word] = split(context.selection);
    let only = false, headers = false, glance = new Glance(store), groups = packets(store, glance);

    const search = h("input", {
        type: "search",
        placeholder: "search names, units, meanings  ( / )",
        value: word,
        size: 34,
        "aria-label": "search parameters",
        oninput: () => {
            word = search.value;
            filter();
        }
    });
    const counted = h("span", {class: "soft"});
    const bad = h("button", {"aria-pressed": "false", onclick: () => {
        only = !only;
        bad.setAttribute("aria-pressed", only);
        filter();
    }}, "Beyond limits");
    const folded = h("button", {
        "aria-pressed": "false",
        title: "headers of packets and heads of messages: times, counts, lengths",
        onclick: () => {
            headers = !headers;
            folded.setAttribute("aria-pressed", headers);
            plant();
            filter();
        }
    }, "Headers");
    const tree = h("div", {class: "tree panel", role: "navigation", "aria-label": "groups of parameters"});
    const detail = h("div", {class: "detail panel", hidden: true});
    const table = new Table({
        label: "parameters",
        columns: [
            {title: "Name", width: "minmax(9rem, 3fr)", narrow: "minmax(0, 3fr)"},
            {title: "Value", width: "minmax(7rem, 2fr)", class: "num mono", narrow: "minmax(0, 3fr)"},
            {title: "Unit", width: "4rem", narrow: "2.9rem"},
            {title: "State", width: "6rem", class: "shape", narrow: "1.2rem"},
            {title: "Age", width: "3.5rem", class: "num", narrow: "2.8rem"}
        ],
        fill: (cells, row, element) => {
            const row_ = shown[row], {slot} = row_, about = store.slots[slot], old = past?.get(slot);
            const write = (name, text, unit, level, word, since, soft) => {
                put(cells[0], name);
                put(cells[1], text);
                put(cells[2], unit);
                concern(level, cells[3].firstChild ?? cells[3].appendChild(h("span")));
                if (!level) put(cells[3].firstChild, word);
                put(cells[4], since);
                dress(element, `tr${row === table.at ? " at" : ""}${soft ? " soft" : ""}${row_.group ? " group" : ""}`);
            };
            hint(element,
                row_.group ? row_.about : row_.glance ? glance.read(row_.glance, now, shownAt()).name : about.name);
            if (row_.group) return write(row_.group, "", "", 0, "", "");
            if (row_.glance) {
                const {text, unit, level, age, stale, slot: from} = glance.read(row_.glance, now, shownAt());
                return write(row_.glance.label, text, unit, level, "", now(from) ? span(age) : "", stale);
            }
            if (time.isLive)
                return write(row_.name, store.text(slot), bare(about.unit), store.concern[slot],
                    STATUSES[store.status[slot]] ?? "", ...since(slot));
            return write(row_.name, old ? valueText(about, old) : past ? "\u2013" : "\u2026", bare(about.unit),
                old?.concern ?? 0, "", ...since(slot));
        },
        moved: (row) => choose(shown[row]),
        viewed: () => request(),
        empty: "No parameter fits",
    });
    root.append(h("div", {class: "head"}, h("h1", {}, title), search, bad, folded, counted),
        h("div", {class: "with-tree"}, tree, table.element, detail));

    const wish = context.want([]);
    let chosen = -1;

    /** A slot's value at the time that is shown. */
    function now(slot) {
        if (time.isLive)
            return store.seen[slot] ? {number: store.number(slot), text: store.text(slot), level: store.concern[slot],
                t: store.at(slot)} : undefined;
        const old = past?.get(slot);
        return old && {number: old.value, text: valueText(store.slots[slot], old), level: old.concern, t: old.t};
    }
    const shownAt = () => (time.isLive ? time.newest ?? 0n : time.at);
    /** A value's age as text, and whether it is grey: stale, or missing. */
    function since(slot) {
        const value = now(slot), age = value ? ageOf(value.t, shownAt()) : 0;
        return value ? [span(age), isStale(store.slots[slot], age)] : ["", true];
    }

    /** Request the values in view: live ones from the server, past ones from the archive. */
    function request() {
        const rows = shown.slice(table.first, table.last + 1);
        const view = [...new Set(rows.flatMap((row) => (row.glance ? glance.slots : row.group ? [] : [row.slot])))];
        if (time.isLive) wish.change(only ? "all" : chosen >= 0 ? [...view, chosen] : view);
        else {
            wish.change([]);
            clearTimeout(pending);
            pending = setTimeout(() => remember(view), 120);
        }
    }

    async function remember(view) {
        const {at} = time;
        if (!view.length) return;
        await attempt(root, async () => {
            const values = await valuesAt(api, craft, view.map((slot) => store.slots[slot].name), at, time.session);
            if (at !== time.at || time.isLive) return;
            past = new Map([...values].map(([name, value]) => [store.byName.get(name), value]));
        });
        table.draw();
    }

    function filter() {
        const words = word.toLowerCase().split(/\s+/).filter(Boolean);
        const fits = (slot) => (headers || words.length || !slot.header) &&
            (!folder || slot.name === folder || slot.name.startsWith(`${folder}.`)) &&
            (!only || store.concern[slot.slot]) &&
            words.every((part) => `${slot.name} ${slot.unit} ${slot.description}`.toLowerCase().includes(part));
        const matches = groups.map((group) => ({...group, slots: group.slots.filter(fits)}))
                          .filter(({slots}) => slots.length);
        const apart = !words.length && !only;       // by packets; a search gives a list of whole names
        shown = matches.flatMap(({name, about, slots}) => [
            ...apart && name ? [{group: name, about}] : [],
            ...slots.map(({slot, name: whole}) => ({slot, name: apart ? within(whole, name) : whole}))]);
        if (apart && !folder && glance.rows.length)
            shown.unshift({group: "At a glance", about: "what matters first"},
                ...glance.rows.map((row) => ({glance: row, slot: row.slots[0]})));
        const all = store.slots.filter((slot) => slot && (headers || !slot.header)).length;
        put(counted, `${matches.reduce((sum, {slots}) => sum + slots.length, 0)} of ${all}`);
        put(folded, `Headers (${store.slots.filter((slot) => slot?.header).length})`);
        context.select([folder, word].filter((part, k) => k === 0 || part).join("/"));
        table.set(shown.length);
        request();
    }

    function choose({group, glance: row, slot}) {
        if (group) return;
        chosen = row ? glance.read(row, now, shownAt()).slot : slot;
        const about = store.slots[chosen];
        const administer = context.can("administer");
        const facts = h("dl", {class: "facts"});
        const fact = (name, text) => text && facts.append(h("dt", {}, name), h("dd", {}, text));
        fact("Meaning", about.description);
        fact("Kind", about.kind);
        fact("Unit", about.unit);
        fact("Packet", about.container?.split("/").at(-1));
        fact("In the database", about.path);
        fact("Limits", limitsText(about.limits));
        fact("Set instead of", about.replaced && (limitsText(about.replaced) || "none"));
        if (about.labels?.length) fact("Values", about.labels.join(", "));
        const value = h("p", {class: "value"});
        detail.replaceChildren(h("h2", {}, about.name), value, facts,
            h("div", {class: "row"}, h("button", {onclick: () => plot(chosen)}, "Plot"),
                about.kind === "real" || about.kind === "integer" || about.kind === "natural" ? h("button", {
                    disabled: !administer,
                    title: administer ? "" : "This asks for the role administer",
                    onclick: () => editLimits(context, about).then((done) => done && choose({slot: about.slot}))
                },
                                                                                                    "Edit limits")
                                                                                              : null,
                h("button", {
                    onclick: () => {
                        detail.hidden = true;
                        chosen = -1;
                        request();
                    }
                },
                    "Close")));
        detail.show = () =>
            put(value, `${now(about.slot)?.text ?? ""} ${bare(about.unit)}`);
        detail.hidden = false;
        detail.show();
        request();
    }

    /** Open a plot of a parameter, with the other components of its vector. */
    const plot = (slot) => context.go({page: "plots", sel: together(store, store.slots[slot].name).join(",")});

    /** Build the tree of the names' folders. */
    function plant() {
        const counts = new Map();
        const seen = store.slots.filter((slot) => slot && (headers || !slot.header));
        for (const slot of seen) {
            const parts = slot.name.split(".");
            for (let k = 1; k < Math.min(parts.length, 4); k++) {
                const path = parts.slice(0, k).join(".");
                counts.set(path, (counts.get(path) ?? 0) + 1);
            }
        }
        const button = (path, text, n, depth) => {
            const branch = h("button", {class: "branch", onclick: () => { folder = path; mark(); filter(); }}, text,
                h("span", {class: "soft"}, n));
            branch.style.paddingLeft = `${0.5 + 0.8 * depth}rem`;
            branch.path = path;
            return branch;
        };
        tree.replaceChildren(button("", "All", seen.length, 0),
            ...[...counts].sort(([a], [b]) => (a < b ? -1 : 1)).map(([path,
                n]) => button(path, path.split(".").at(-1), n, path.split(".").length - 1)));
        mark();
    }

    function mark() {
        for (const child of tree.children) {
            const depth = child.path.split(".").length;
            const parent = child.path.split(".").slice(0, -1).join(".");
            child.hidden =
                depth > 2 && !(folder === parent || folder.startsWith(`${parent}.`) || folder.startsWith(child.path));
            if (child.path === folder) child.setAttribute("aria-current", "true");
            else child.removeAttribute("aria-current");
        }
    }

    keys.add("b", "only those beyond limits", () => bad.click());
    keys.add(
        "l", "plot the chosen one", () => chosen >= 0 && plot(chosen));
    keys.add("h", "headers of packets and messages", () => folded.click());
    context.onFrame(() => {
        if (time.isLive) table.draw();
        detail.show?.();
    });
    context.every(1000, () => (only && time.isLive ? filter() : time.isLive && table.draw()));
    context.onTime(() => {
        if (time.isLive) past = null;
        detail.show?.();
        table.draw();
        request();
    });
    context.on("learned", () => {
        glance = new Glance(store);
        groups = packets(store, glance);
        plant();
        filter();
    });
    plant();
    filter();
    if (context.selection === "/") {
        search.value = word = folder = "";
        filter();
        search.focus();
    }
    return () => {
        clearTimeout(pending);
        table.close();
    };
}

/**
 * The packets of a store: [{name, about, slots}]; name: the common beginning of its parameters' names. First those with
 * parameters of the glance, then those of modules' outputs, which have a head, then others; last headers alone.
 */
function packets(store, glance) {
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

function split(selection) {
    const at = selection.indexOf("/");
    return at < 0 ? [selection, ""] : [selection.slice(0, at), selection.slice(at + 1)];
}
