// SPDX-License-Identifier: Apache-2.0
// Limits as text, and the dialog that changes them.
import {of} from "./api.js";
import {h, put} from "./dom.js";
import {button, ends as endsOf, field, form as formOf, openDialog} from "./parts.js";
import {real} from "./store.js";
import {CONCERNS} from "./words.js";

const bound = (value, open) => (value === null || value === undefined ? open : real(value));

/** "watch -1 to 1, critical -2 to open" */
export const limitsText = (limits) => CONCERNS.filter((level) => limits?.[level]).map((level) =>
    `${level}: ${bound(limits[level][0], "open")} to ${bound(limits[level][1], "open")}`).join("; ");

/** Open the dialog of a slot's limits. Resolves to whether they were changed. */
export function editLimits({api, craft}, slot) {
    return new Promise((done) => {
        const rows = CONCERNS.slice(1).map((level) => ({level, fields: ["low", "high"].map((end, k) => h("input", {
            type: "text", inputMode: "decimal", size: 12, placeholder: "open", "aria-label": `${level}, ${end}`,
            value: slot.limits?.[level]?.[k] ?? ""}))}));
        const persistence = h("input", {type: "number", min: 1, max: 1000, value: slot.persistence ?? 1});
        const problem = h("p", {class: "problem", role: "alert", hidden: true});
        let changed = false;
        const fail = (text) => {
            put(problem, text);
            problem.hidden = false;
        };
        const set = async (limits, samples) => {
            try {
                Object.assign(slot, await api.put(of(craft, "limits", slot.slot), {limits, persistence: samples}));
                changed = true;
                dialog.close();
            } catch (error) {
                fail(error.message);
            }
        };
        const submit = () => {
            const limits = {};
            for (const {level, fields} of rows) {
                const ends = fields.map(({value}) => (value.trim() ? Number(value.replace("\u2212", "-")) : null));
                if (ends.some(Number.isNaN))
                    return fail(`${level}: "${fields.map(({value}) => value).join(" to ")}" is no number`);
                if (ends[0] !== null || ends[1] !== null) limits[level] = ends;
            }
            return set(limits, Number(persistence.value));
        };
        const about = `A value outside of low to high${slot.unit ? `, in ${slot.unit},` : ""} has that state.`;
        const dialog = openDialog("limits", () => done(changed), {}, formOf(submit, {},
            h("h2", {}, "Limits of ", slot.name), h("p", {class: "soft"}, `${about} Empty: no bound.`),
            h("table", {},
                h("thead", {}, h("tr", {}, ["State", "Low", "High"].map((title) => h("th", {scope: "col"}, title)))),
                h("tbody", {}, rows.map(({level, fields}, k) => h("tr", {}, h("th", {scope: "row", class: `c${k + 1}`},
                    level), fields.map((input) => h("td", {}, input)))))),
            field("Samples in a row before the state changes", persistence), problem,
            slot.replaced && h("p", {class: "soft"}, `In the database: ${limitsText(slot.replaced) || "none"}`),
            endsOf("Set limits", {first: slot.replaced &&
                button("As in the database", () => set(null, 1), {type: "button"})})));
    });
}
