// SPDX-License-Identifier: Apache-2.0
// Alarms: what is or was beyond its limits, until a person has acknowledged it; shelved ones keep quiet for a while.
import {isShelved} from "../alarms.js";
import {of} from "../api.js";
import {ask, attempt, concern, dress, h, put, stamp} from "../dom.js";
import {clock} from "../format.js";
import {editLimits, limitsText} from "../limits.js";
import {real} from "../store.js";
import {Table} from "../table.js";

export const title = "Alarms", key = "a";

export async function open(context) {
    const {root, api, live, time, craft, keys} = context;
    let alarms = [];
    const buttons = [], notes = h("div", {class: "notes"}), about = h("p", {class: "soft"});
    const state = (one) => (isShelved(one) ? "shelved"
                            : one.acknowledged   ? "acknowledged"
                            : one.concern        ? "open"
                                                 : "open, over");
    const table = new Table({
        label: "alarms",
        empty: "No alarm is open",
        columns: [
            {title: "Now", width: "6.5rem", narrow: "1.2rem", class: "shape"},
            {title: "Worst", width: "6.5rem", narrow: ""},
            {title: "Parameter", width: "minmax(10rem, 3fr)", narrow: "minmax(0, 3fr)"},
            {title: "Value", width: "minmax(6rem, 1fr)", class: "num mono", narrow: "minmax(0, 2fr)"},
            {title: "Since", width: "12rem", class: "tab", narrow: "5.6rem"},
            {title: "State", width: "minmax(7rem, 1.2fr)", narrow: "minmax(0, 2fr)"}
        ],
        fill: (cells, row, element) => {
            const one = alarms[row];
            for (const [k, level] of [[0, one.concern], [1, one.worst]]) {
                concern(level, cells[k].firstChild ?? cells[k].appendChild(h("span")));
                if (!level)
                    put(cells[k].firstChild, "within");
            }
            put(cells[2], one.name);
            put(cells[3], typeof one.value === "number" ? real(one.value) : String(one.value ?? ""));
            stamp(cells[4], time.text(one.since_ns));
            put(cells[5], state(one));
            dress(element,
                `tr${row === table.at ? " at" : ""}${one.acknowledged || isShelved(one) ? " soft" : ""}`);
        },
        moved: () => detail(),
        choose: () => acknowledge(),
    });

    /** Keep the order, and the cursor on its alarm. */
    function show() {
        const at = alarms[table.at]?.name ?? context.selection;
        alarms = context.alarms.of(craft);
        table.set(alarms.length);
        const row = alarms.findIndex((alarm) => alarm.name === at);
        if (alarms.length) table.go(row < 0 ? Math.max(0, table.at) : row, true);
        detail();
    }

    const post = (one, body) => attempt(notes, async () => {
        context.alarms.merge(craft, await api.post(of(craft, "alarms", one.slot), body));
    });

    async function acknowledge() {
        const one = alarms[table.at];
        if (!one || one.acknowledged) return;
        const note = h("input", {name: "note", autofocus: true, maxLength: 500, autocomplete: "off"});
        const said = await ask("Acknowledge", one.name, [["Note, for those who come after you", note]], "Acknowledge");
        if (said) await post(one, {acknowledge: true, note: said.note});
    }

    async function shelve() {
        const one = alarms[table.at];
        if (!one) return;
        if (isShelved(one)) {
            await post(one, {shelve_s: 0});
            return;
        }
        const time_s =
            h("select", {name: "time"}, [[600, "10 minutes"], [3600, "1 hour"], [28800, "8 hours"],
                [86400, "1 day"]].map(([value, text]) => h("option", {value}, text)));
        const said = await ask("Shelve", `${one.name} keeps quiet for so long.`, [["Time", time_s]], "Shelve");
        if (said) await post(one, {shelve_s: Number(said.time)});
    }

    async function limits() {
        const one = alarms[table.at];
        if (!one) return;
        const store = await live.slots(craft);
        if (await editLimits(context, store.slots[one.slot])) detail();
    }

    function detail() {
        const one = alarms[table.at], said = one?.acknowledged,
              may = context.can("command") || context.can("administer");
        for (const [button, right, words] of buttons) {
            button.disabled = !one || !right || (words === "Acknowledge" && Boolean(said));
            if (words === "Shelve") put(button.firstChild, one && isShelved(one) ? "End shelving" : "Shelve");
        }
        if (!one) return put(about, may ? "" : "To acknowledge asks for the role command.");
        const slot = live.store(craft).slots[one.slot];
        const parts = [one.name, limitsText(slot?.limits)];
        if (said) parts.push(`acknowledged by ${said.user}${said.note ? `: ${said.note}` : ""}`);
        if (isShelved(one)) parts.push(`shelved until ${clock(one.shelved_until_ns, true, 0)} UTC`);
        return put(about, parts.filter(Boolean).join(" \u00b7 "));
    }

    for (const [words, letter, action, role] of [["Acknowledge", "a", acknowledge, "command"],
             ["Shelve", "s", shelve, "command"], ["Edit limits", "i", limits, "administer"], [
                 "Plot", "l", () => alarms[table.at] && context.go({page: "plots", sel: alarms[table.at].name}), "view"
             ]]) {
        const button = h("button", {onclick: action, disabled: true}, h("span", {}, words), " ",
            h("kbd", {"aria-hidden": "true"}, letter));
        buttons.push([button, context.can(role), words]);
        keys.add(letter, words.toLowerCase(), () => button.click());
    }
    root.append(
        h("div", {class: "head"}, h("h1", {}, title), buttons.map(([one]) => one)), notes, table.element, about);
    context.on("alarms", show);
    context.every(5000, show);      // a shelving ends by itself
    await attempt(notes, () => Promise.all([context.alarms.load(craft), live.slots(craft)]));
    show();
    return () => table.close();
}
