// SPDX-License-Identifier: Apache-2.0
// Parameters by packet, tree and search: value, unit, age and state by limits; live, or back in time. Those that matter
// most come first, those without a value last; headers of packets and heads of messages are hidden at first.
import {of as path} from "../api.js";
import {attempt, dress, h, hint, put} from "../dom.js";
import {bare, matcher, span} from "../format.js";
import {Glance} from "../glance.js";
import {packets, rowsOf} from "../groups.js";
import {editLimits, limitsText} from "../limits.js";
import {Facts, button, head, putLevel, search, toggle} from "../parts.js";
import {Shown} from "../shown.js";
import {STATUSES, together} from "../store.js";
import {Table} from "../table.js";

export const title = "Parameters", key = "p";

const AGAIN = 5000;     // [ms] between two requests for the parameters that have no value yet

export async function open(context) {
    const {root, api, live, time, craft, keys} = context, searching = context.selection === "/";
    let store = null, [folder, word] = searching ? ["", ""] : split(context.selection);
    const wanted = search("search parameters", "search names, units, meanings  ( / )", (text) => {
        word = text;
        if (store) filter();
    }, {value: word, size: 34});
    if (searching) {        // who types at once after "/" types into the field, while the names are still on their way
        root.append(wanted);
        wanted.focus();
    }
    store = await live.slots(craft);
    let shown = [], pending = null;
    let missing = new Uint8Array(0), answered = "";      // the slots that have no value yet; as the server answered it
    const there = (slot) => Boolean(store.seen[slot] || !missing[slot]);
    let only = false, headers = false, glance = new Glance(store), groups = packets(store, glance);
    const values = new Shown(context, store), {get} = values;

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
                const value = get(from);
                return write(first.label, value ? text : values.none(there(from)) || text, value ? unit : "", level, "",
                    value ? span(age) : "", stale || !value);
            }
            const value = get(slot), [age, stale] = values.age(slot);
            return write(name, value?.text ?? values.none(there(slot)), bare(of.unit), value?.level ?? 0,
                time.isLive && STATUSES[store.status[slot]] || "", value ? span(age) : "", stale);
        },
        moved: (row) => choose(shown[row]),
        viewed: () => request(),
        empty: "No parameter fits",
    });
    root.append(head(title, wanted, bad, folded, counted, values.note),
        h("div", {class: "with-tree"}, tree, table.element, detail));
    if (searching) wanted.focus();

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
        const cursor = shown[table.at], apart = !words && !only;     // by packets; a search gives a list of whole names
        shown = rowsOf(groups, {fits, there, apart, glance: folder ? [] : glance.rows});
        if (cursor) table.at = shown.findIndex(({slot, glance: row}) => slot === cursor.slot && row === cursor.glance);
        put(counted, `${shown.filter(({group, glance: row}) => !group && !row).length} of ${listed().length}`);
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
    async function learnMissing() {
        if (!time.isLive || answered === "[]") return;
        const stretches = await api.get(path(craft, "missing")).catch(() => null), text = JSON.stringify(stretches);
        if (!stretches || text === answered) return;
        missing = new Uint8Array(store.slots.length);
        for (const [from, to] of stretches) missing.fill(1, from, to + 1);
        answered = text;
        filter();
    }
    context.every(AGAIN, learnMissing);
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
        answered = "";
        plant();
        filter();
    });
    plant();
    await learnMissing();
    filter();
    return () => {
        clearTimeout(pending);
        table.close();
    };
}

function split(selection) {
    const at = selection.indexOf("/");
    return at < 0 ? [selection, ""] : [selection.slice(0, at), selection.slice(at + 1)];
}
