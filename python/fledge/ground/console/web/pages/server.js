// SPDX-License-Identifier: Apache-2.0
// This server: what it uses, how long its loop was blocked, and its limits with what is in use of each.
import {attempt, h, put} from "../dom.js";
import {span} from "../format.js";
import {size} from "../transfer.js";

export const title = "This server", key = "i", role = "administer";

const NONE = "\u2013";
const amount = (value, unit) => value === null ? NONE : unit === "bytes" ? size(value) :
    unit === "s" ? span(value) : `${Math.round(value).toLocaleString("en")}${unit.startsWith("/") ? unit : ""}`;

export async function open({root, api, can, every}) {
    root.append(h("div", {class: "head"}, h("h1", {}, title)));
    if (!can(role)) return;
    const facts = h("dl", {class: "facts"}), rows = h("tbody"), problem = h("div"), known = new Map();
    root.append(problem, h("section", {class: "panel"}, facts), h("section", {class: "panel scroll", tabIndex: 0},
        h("table", {class: "plain limits", "aria-label": "limits"},
            h("thead", {}, h("tr", {}, h("th", {}, "Limit"),
                ["Most", "In use", "Highest", "Refused"].map((one) => h("th", {class: "num"}, one)),
                h("th", {}, "Says"))),
            rows)));
    const fact = (name, text) => {
        if (!known.has(name)) {
            known.set(name, h("dd"));
            facts.append(h("dt", {class: "soft"}, name), known.get(name));
        }
        put(known.get(name), text);
    };
    const load = () => attempt(problem, async () => {
        const found = await api.get("/api/server"), ms = (one) => `${one.toFixed(0)} ms`;
        fact("Version", found.version);
        fact("Up", `${span(found.up_s)}, ${(100 * found.cpu_s / found.up_s).toFixed(0)} % of a core since`);
        fact("Loop's longest block",
            `${ms(found.loop.recent_ms)} in the last minute (it computed for ${ms(found.loop.computed_ms)} at most, ` +
            `else it waited for a processor), ${ms(found.loop.longest_ms)} since the start`);
        fact("Memory", `${size(found.memory)}, ${found.threads} threads`);
        fact("Browsers and scripts", String(found.browsers));
        fact("Descriptors", `${found.descriptors} of ${found.descriptors_most}`);
        fact("Journal", found.journal.problem || size(found.journal.bytes));
        for (const one of found.limits) {
            if (!known.has(`limit ${one.name}`)) {
                const cells = ["", "num", "num", "num", "num", "soft"].map((kind) => h("td", {class: kind}));
                known.set(`limit ${one.name}`, cells);
                rows.append(h("tr", {}, cells));
            }
            const cells = known.get(`limit ${one.name}`);
            [one.name, amount(one.most, one.unit), amount(one.used, one.unit), amount(one.peak || null, one.unit),
                one.refused ? one.refused.toLocaleString("en") : "", one.refusal,
            ].forEach((text, i) => put(cells[i], text));
        }
    });
    every(2000, load);
    await load();
}
