// SPDX-License-Identifier: Apache-2.0
// This server: its use of the machine, how long its loop was blocked, and its limits with the use of each.
import {attempt, h, put} from "../dom.js";
import {span} from "../format.js";
import {Facts, head, plain, row} from "../parts.js";
import {size} from "../transfer.js";

export const title = "This server", key = "i", role = "administer";

const NONE = "\u2013";
const amount = (value, unit) => value === null ? NONE : unit === "bytes" ? size(value) :
    unit === "s" ? span(value) : `${Math.round(value).toLocaleString("en")}${unit.startsWith("/") ? unit : ""}`;

export async function open({root, api, can, every}) {
    root.append(head(title));
    if (!can(role)) return;
    const facts = new Facts({class: "soft"}), rows = h("tbody"), problem = h("div"), limits = new Map();
    const fact = (name, text) => facts.set(name, text);
    root.append(problem, h("section", {class: "panel"}, facts.element),
        h("section", {class: "panel scroll", tabIndex: 0}, plain(["Limit", ["num", "Most"], ["num", "In use"],
            ["num", "Highest"], ["num", "Refused"], "Says"], rows, {class: "plain limits", "aria-label": "limits"})));
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
        for (const {name, most, used, peak, refused, unit, refusal} of server.limits) {
            if (!limits.has(name))
                limits.set(name, rows.appendChild(row({}, "", ["num"], ["num"], ["num"], ["num"], ["soft"])));
            [name, amount(most, unit), amount(used, unit), amount(peak || null, unit),
                refused ? refused.toLocaleString("en") : "", refusal
            ].forEach((text, k) => put(limits.get(name).children[k], text));
        }
    });
    every(2000, load);
    await load();
}
