// SPDX-License-Identifier: Apache-2.0
// This server: its use of the machine, how long its loop was blocked, and its limits with the use of each.
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
                ["Most", "In use", "Highest", "Refused"].map((title) => h("th", {class: "num"}, title)),
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
        const server = await api.get("/api/server"), ms = (value) => `${value.toFixed(0)} ms`;
        fact("Version", server.version);
        fact("Up", `${span(server.up_s)}, ${(100 * server.cpu_s / server.up_s).toFixed(0)} % of a core since`);
        fact("Loop's longest block",
            `${ms(server.loop.recent_ms)} in the last minute ` +
            `(it computed for ${ms(server.loop.computed_ms)} at most, ` +
            `else it waited for a processor), ${ms(server.loop.longest_ms)} since the start`);
        fact("Memory", `${size(server.memory)}, ${server.threads} threads`);
        fact("Browsers and scripts", String(server.browsers));
        fact("Descriptors", `${server.descriptors} of ${server.descriptors_most}`);
        fact("Journal", server.journal.problem || size(server.journal.bytes));
        for (const limit of server.limits) {
            if (!known.has(`limit ${limit.name}`)) {
                const cells = ["", "num", "num", "num", "num", "soft"].map((kind) => h("td", {class: kind}));
                known.set(`limit ${limit.name}`, cells);
                rows.append(h("tr", {}, cells));
            }
            const cells = known.get(`limit ${limit.name}`);
            [limit.name, amount(limit.most, limit.unit), amount(limit.used, limit.unit),
                amount(limit.peak || null, limit.unit), limit.refused ? limit.refused.toLocaleString("en") : "",
                limit.refusal,
            ].forEach((text, i) => put(cells[i], text));
        }
    });
    every(2000, load);
    await load();
}
