// SPDX-License-Identifier: Apache-2.0
// Limits as text, and the dialog that changes them.
import {of} from "./api.js";
import {CONCERNS, h, put} from "./dom.js";
import {real} from "./store.js";

const bound = (value, open) => (value === null || value === undefined ? open : real(value));

/** "watch -1 to 1, critical -2 to open" */
export const limitsText = (limits) => CONCERNS.filter((level) => limits?.[level]).map((level) =>
    `${level}: ${bound(limits[level][0], "open")} to ${bound(limits[level][1], "open")}`).join("; ");

/** Open the dialog of a slot's limits. Resolves to whether they were changed. */
export function editLimits({api, craft}, slot) {
    return new Promise((done) => {
        const rows = CONCERNS.slice(1).map((level) => ({
            level,
            fields: [0, 1].map((k) => h("input", {
                type: "text",
                inputMode: "decimal",
                size: 12,
                placeholder: "open",
                "aria-label": `${level}, ${k ? "high" : "low"}`,
                value: slot.limits?.[level]?.[k] ?? ""
            }))
        }));
        const set = async (limits, samples) => {
            try {
                Object.assign(slot, await api.put(of(craft, "limits", slot.slot), {limits, persistence: samples}));
                changed = true;
                dialog.close();
            } catch (error) {
                fail(error.message);
            }
        };
        const persistence = h("input", {type: "number", min: 1, max: 1000, value: slot.persistence ?? 1});
        const problem = h("p", {class: "problem", role: "alert", hidden: true});
        let changed = false;
        const fail = (text) => {
            put(problem, text);
            problem.hidden = false;
        };
        const form = h("form", {
            onsubmit: async (event) => {
                event.preventDefault();
                const limits = {};
                for (const {level, fields} of rows) {
                    const ends =
                        fields.map((field) => (field.value.trim() ? Number(field.value.replace("\u2212", "-")) : null));
                    if (ends.some(Number.isNaN))
                        return fail(`${level}: "${fields.map((field) => field.value).join(" to ")}" is no number`);
                    if (ends[0] !== null || ends[1] !== null)
                        limits[level] = ends;
                }
                return set(limits, Number(persistence.value));
            }
        },
            h("h2", {}, "Limits of ", slot.name),
            h("p", {class: "soft"},
                `A value outside of low to high${
                    slot.unit ? `, in ${slot.unit},` : ""} has that state. Empty: no bound.`),
            h("table", {},
                h("thead", {}, h("tr", {}, ["State", "Low", "High"].map((title) => h("th", {scope: "col"}, title)))),
                h("tbody", {},
                    rows.map(({level, fields}) =>
                                 h("tr", {}, h("th", {scope: "row", class: `c${CONCERNS.indexOf(level)}`}, level),
                                     fields.map((field) => h("td", {}, field)))))),
            h("label", {class: "field"}, h("span", {}, "Samples in a row before the state changes"), persistence),
            problem,
            slot.replaced && h("p", {class: "soft"}, `In the database: ${limitsText(slot.replaced) || "none"}`),
            h("div", {class: "row end"},
                slot.replaced && h("button", {type: "button", onclick: () => set(null, 1)}, "As in the database"),
                h("button", {type: "button", onclick: () => dialog.close()}, "Cancel"),
                h("button", {class: "primary"}, "Set limits")));
        const dialog = h("dialog", {"aria-label": "limits", onclose: () => { dialog.remove(); done(changed); }}, form);
        document.body.append(dialog);
        dialog.showModal();
    });
}
