// SPDX-License-Identifier: Apache-2.0
// Parameters by packet, tree and search: value, unit, age and state by limits; live, or back in time. Those that matter
// most come first; headers of packets and heads of messages are hidden at first.
import {attempt, dress, h, hint, put} from "../dom.js";
import {bare, matcher, span} from "../format.js";
import {Glance} from "../glance.js";
import {editLimits, limitsText} from "../limits.js";
import {Facts, button, head, putLevel, search, toggle} from "../parts.js";
import {Shown} from "../shown.js";
import {STATUSES, together} from "../store.js";
import {Table} from "../table.js";

export const title = "Parameters", key = "p";

export async function open(context) {
    const {root, live, time, craft, keys} = context, store = await live.slots(craft);
    let shown = [], pending = null, [folder, word] = split(context.selection);
    let only = false, headers = false, glance = new Glance(store), groups = packets(store, glance);
    const values = new Shown(context, store), {get} = values;

    const wanted = search("search parameters", "search names, units, meanings  ( / )", (text) => {
        word = text;
        filter();
    }, {value: word, size: 34});
    const counted = h("span", {class: "soft"});
    const bad = toggle("Beyond limits", (pressed) => {
        only = pressed;
        filter();
    });
    const folded = toggle("Headers", (pressed) => {
        headers = pressed;
        plant();
        filter();
    }, {title: "headers of packets and heads of messages: times, counts, lengths"});
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
            const {slot, name, group, about, glance: first} = shown[row], of = store.slots[slot];
            const write = (text, word, unit, level, state, age, soft) => {
                [text, word, unit].forEach((part, k) => put(cells[k], part));
                hint(cells[1], word);       // a narrow cell cuts it
                putLevel(cells[3], level, state);
                put(cells[4], age);
                dress(element, `tr${row === table.at ? " at" : ""}${soft ? " soft" : ""}${group ? " group" : ""}`);
            };
            hint(element, group ? about : first ? glance.read(first, get, time.at).name : of.name);
            if (group) return write(group, "", "", 0, "", "");
            if (first) {
                const {text, unit, level, age, stale, slot: from} = glance.read(first, get, time.at);
                return write(first.label, text, unit, level, "", get(from) ? span(age) : "", stale);
            }
            const value = get(slot), [age, stale] = values.age(slot);
            return write(name, value?.text ?? (time.isLive ? "" : values.past ? "\u2013" : "\u2026"), bare(of.unit),
                value?.level ?? 0, time.isLive && STATUSES[store.status[slot]] || "", value ? span(age) : "", stale);
        },
        moved: (row) => choose(shown[row]),
        viewed: () => request(),
        empty: "No parameter fits",
    });
    root.append(head(title, wanted, bad, folded, counted),
        h("div", {class: "with-tree"}, tree, table.element, detail));

    const wish = context.want([]);
    let chosen = -1;

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
        await attempt(root, () => values.remember(view));
        table.draw();
    }

    const listed = () => store.slots.filter((slot) => slot && (headers || !slot.header));

    function filter() {
        const words = word.trim(), all = matcher(word);
        const fits = (slot) => (headers || words || !slot.header) &&
            (!folder || slot.name === folder || slot.name.startsWith(`${folder}.`)) &&
            (!only || store.concern[slot.slot]) &&
            all(`${slot.name} ${slot.unit} ${slot.description}`);
        const matches = groups.map((group) => ({...group, slots: group.slots.filter(fits)}))
                          .filter(({slots}) => slots.length);
        const apart = !words && !only;       // by packets; a search gives a list of whole names
        shown = matches.flatMap(({name, about, slots}) => [
            ...apart && name ? [{group: name, about}] : [],
            ...slots.map(({slot, name: whole}) => ({slot, name: apart ? within(whole, name) : whole}))]);
        if (apart && !folder && glance.rows.length)
            shown.unshift({group: "At a glance", about: "what matters first"},
                ...glance.rows.map((row) => ({glance: row, slot: row.slots[0]})));
        put(counted, `${matches.reduce((sum, {slots}) => sum + slots.length, 0)} of ${listed().length}`);
        put(folded, `Headers (${store.slots.filter((slot) => slot?.header).length})`);
        context.select([folder, word].filter((part, k) => k === 0 || part).join("/"));
        table.set(shown.length);
        request();
    }

    function choose({group, glance: row, slot}) {
        if (group) return;
        chosen = row ? glance.read(row, get, time.at).slot : slot;
        const about = store.slots[chosen], administer = context.can("administer"), facts = new Facts();
        for (const [name, text] of Object.entries({
            Meaning: about.description, Kind: about.kind, Unit: about.unit, Packet: about.container?.split("/").at(-1),
            "In the database": about.path, Limits: limitsText(about.limits),
            "Set instead of": about.replaced && (limitsText(about.replaced) || "none"), Values: about.labels?.join(", ")
        })) if (text) facts.set(name, text);
        const value = h("p", {class: "value"});
        detail.replaceChildren(h("h2", {}, about.name), value, facts.element, h("div", {class: "row"},
            button("Plot", () => plot(chosen)),
            ["real", "integer", "natural"].includes(about.kind) && button("Edit limits",
                () => editLimits(context, about).then((done) => done && choose({slot: about.slot})),
                {disabled: !administer, title: administer ? "" : "This asks for the role administer"}) || "",
            button("Close", () => {
                detail.hidden = true;
                chosen = -1;
                request();
            })));
        detail.show = () => put(value, `${get(about.slot)?.text ?? ""} ${bare(about.unit)}`);
        detail.hidden = false;
        detail.show();
        request();
    }

    /** Open a plot of a parameter, with the other components of its vector. */
    const plot = (slot) => context.go({page: "plots", sel: together(store, store.slots[slot].name).join(",")});

    /** Build the tree of the names' folders. */
    function plant() {
        const counts = new Map();
        const seen = listed();
        for (const slot of seen) {
            const parts = slot.name.split(".");
            for (let k = 1; k < Math.min(parts.length, 4); k++) {
                const path = parts.slice(0, k).join(".");
                counts.set(path, (counts.get(path) ?? 0) + 1);
            }
        }
        const branch = (path, text, n, depth) => {
            const node = button([text, h("span", {class: "soft"}, n)], () => { folder = path; mark(); filter(); },
                {class: "branch"});
            node.style.paddingLeft = `${0.5 + 0.8 * depth}rem`;
            node.path = path;
            return node;
        };
        tree.replaceChildren(branch("", "All", seen.length, 0), ...[...counts].sort(([a], [b]) => (a < b ? -1 : 1))
            .map(([path, n]) => branch(path, path.split(".").at(-1), n, path.split(".").length - 1)));
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
    keys.add("l", "plot the chosen one", () => chosen >= 0 && plot(chosen));
    keys.add("h", "headers of packets and messages", () => folded.click());
    context.onFrame(() => {
        if (time.isLive) table.draw();
        detail.show?.();
    });
    context.every(1000, () => (only && time.isLive ? filter() : time.isLive && table.draw()));
    context.onTime(() => {
        if (time.isLive) values.past = null;
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
        wanted.value = word = folder = "";
        filter();
        wanted.focus();
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
