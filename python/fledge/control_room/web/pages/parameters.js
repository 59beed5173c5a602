// SPDX-License-Identifier: Apache-2.0
// Parameters by tree and search: value, unit, age, and how its limits judge it; live, or as they were at a time.
import {valuesAt} from "../api.js";
import {attempt, concern, dress, h, hint, put} from "../dom.js";
import {clock, span} from "../format.js";
import {editLimits, limitsText} from "../limits.js";
import {STATUSES, valueText} from "../store.js";
import {Table} from "../table.js";

export const title = "Parameters", key = "p";

export async function open(context) {
    const {root, api, live, time, craft, keys} = context, store = await live.slots(craft);
    let shown = [], past = null, asking = null, [folder, word] = split(context.selection);
    let only = false;

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
    const tree = h("div", {class: "tree panel", role: "navigation", "aria-label": "groups of parameters"});
    const detail = h("div", {class: "detail panel", hidden: true});
    const table = new Table({
        label: "parameters",
        columns: [
            {title: "Name", width: "minmax(9rem, 3fr)"},
            {title: "Value", width: "minmax(7rem, 2fr)", class: "num mono"}, {title: "Unit", width: "4rem"},
            {title: "State", width: "6rem"}, {title: "Age", width: "3.5rem", class: "num"}
        ],
        fill: (cells, row, element) => {
            const slot = shown[row], about = store.slots[slot], old = past?.get(slot);
            put(cells[0],
                folder && about.name.startsWith(`${folder}.`) ? about.name.slice(folder.length + 1) : about.name);
            if (cells[0].title !== about.name)
                hint(cells[0], about.name);
            put(cells[2], about.unit === "-" ? "" : about.unit);
            if (time.isLive) {
                put(cells[1], store.text(slot));
                const level = store.concern[slot], status = store.status[slot];
                concern(level, cells[3].firstChild ?? cells[3].appendChild(h("span")));
                if (!level)
                    put(cells[3].firstChild, STATUSES[status] ?? "");
                put(cells[4], store.seen[slot] ? age(slot) : "");
                dress(element, `tr${row === table.at ? " at" : ""}${store.seen[slot] ? "" : " soft"}`);
            } else {
                put(cells[1], old ? valueText(about, old) : past ? "\u2013" : "\u2026");
                concern(old?.concern ?? 0, cells[3].firstChild ?? cells[3].appendChild(h("span")));
                put(cells[4], old ? span(Number(time.at - old.t) / 1e9) : "");
                dress(element, `tr${row === table.at ? " at" : ""}`);
            }
        },
        moved: (row) => choose(shown[row]),
        viewed: () => look(),
        empty: "No parameter fits",
    });
    root.append(h("div", {class: "head"}, h("h1", {}, title), search, bad, counted),
        h("div", {class: "with-tree"}, tree, table.element, detail));

    const wish = context.want([]);
    let chosen = -1;

    function age(slot) { return span(Math.max(0, Number((time.newest ?? 0n) - store.at(slot)) / 1e9)); }

    /** What is in view is what the server sends; of a time that has been, what the archive is asked for. */
    function look() {
        const view = shown.slice(table.first, table.last + 1);
        if (time.isLive) wish.change(only ? "all" : chosen >= 0 ? [...view, chosen] : view);
        else {
            wish.change([]);
            clearTimeout(asking);
            asking = setTimeout(() => remember(view), 120);
        }
    }

    async function remember(view) {
        const {at} = time;
        if (!view.length) return;
        await attempt(root, async () => {
            const found = await valuesAt(api, craft, view.map((slot) => store.slots[slot].name), at, time.session);
            if (at !== time.at || time.isLive) return;
            past = new Map([...found].map(([name, one]) => [store.byName.get(name), one]));
        });
        table.draw();
    }

    function filter() {
        const words = word.toLowerCase().split(/\s+/).filter(Boolean);
        shown = store.slots
                    .filter((one) => one && (!folder || one.name === folder || one.name.startsWith(`${folder}.`)) &&
                                     (!only || store.concern[one.slot]) &&
                                     words.every(
                                         (part) =>
                                             `${one.name} ${one.unit} ${one.description}`.toLowerCase().includes(part)))
                    .map(({slot}) => slot);
        put(counted, `${shown.length} of ${store.slots.length}`);
        context.select([folder, word].filter((one, k) => k === 0 || one).join("/"));
        table.set(shown.length);
        look();
    }

    function choose(slot) {
        chosen = slot;
        const about = store.slots[slot];
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
            h("div", {class: "row"}, h("button", {onclick: () => context.go({page: "plots", sel: about.name})}, "Plot"),
                about.kind === "real" || about.kind === "integer" || about.kind === "natural" ? h("button", {
                    disabled: !administer,
                    title: administer ? "" : "This asks for the role administer",
                    onclick: () => editLimits(context, about).then((done) => done && choose(slot))
                },
                                                                                                    "Edit limits")
                                                                                              : null,
                h("button", {
                    onclick: () => {
                        detail.hidden = true;
                        chosen = -1;
                        look();
                    }
                },
                    "Close")));
        detail.show = () =>
            put(value, time.isLive ? `${store.text(slot)} ${about.unit === "-" ? "" : about.unit}` : "");
        detail.hidden = false;
        detail.show();
        look();
    }

    /** The folders of the names: one level more where the person has opened one. */
    function plant() {
        const counts = new Map();
        for (const one of store.slots) {
            const parts = one?.name.split(".") ?? [];
            for (let k = 1; k < Math.min(parts.length, 4); k++) {
                const path = parts.slice(0, k).join(".");
                counts.set(path, (counts.get(path) ?? 0) + 1);
            }
        }
        const button = (path, text, n, depth) => {
            const one = h("button", {class: "branch", onclick: () => { folder = path; mark(); filter(); }}, text,
                h("span", {class: "soft"}, n));
            one.style.paddingLeft = `${0.5 + 0.8 * depth}rem`;
            one.path = path;
            return one;
        };
        tree.replaceChildren(button("", "All", store.slots.length, 0),
            ...[...counts].sort(([a], [b]) => (a < b ? -1 : 1)).map(([path,
                n]) => button(path, path.split(".").at(-1), n, path.split(".").length - 1)));
        mark();
    }

    function mark() {
        for (const one of tree.children) {
            const depth = one.path.split(".").length;
            const parent = one.path.split(".").slice(0, -1).join(".");
            one.hidden =
                depth > 2 && !(folder === parent || folder.startsWith(`${parent}.`) || folder.startsWith(one.path));
            if (one.path === folder) one.setAttribute("aria-current", "true");
            else one.removeAttribute("aria-current");
        }
    }

    keys.add("b", "only those beyond limits", () => bad.click());
    keys.add(
        "l", "plot the chosen one", () => chosen >= 0 && context.go({page: "plots", sel: store.slots[chosen].name}));
    context.onFrame(() => {
        if (time.isLive) table.draw();
        detail.show?.();
    });
    context.every(1000, () => (only && time.isLive ? filter() : time.isLive && table.draw()));
    context.onTime(() => {
        if (time.isLive) past = null;
        detail.show?.();
        table.draw();
        look();
    });
    context.on("learned", () => { plant(); filter(); });
    plant();
    filter();
    if (context.selection === "/") {
        search.value = word = folder = "";
        filter();
        search.focus();
    }
    return () => {
        clearTimeout(asking);
        table.close();
    };
}

function split(selection) {
    const at = selection.indexOf("/");
    return at < 0 ? [selection, ""] : [selection.slice(0, at), selection.slice(at + 1)];
}
