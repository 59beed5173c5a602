// SPDX-License-Identifier: Apache-2.0
// Alarms: parameters that are or were beyond their limits, until an operator acknowledges them; shelving silences one.
import {isShelved} from "../alarms.js";
import {of} from "../api.js";
import {attempt, dress, h, put, stamp} from "../dom.js";
import {clock} from "../format.js";
import {editLimits, limitsText} from "../limits.js";
import {button, choice, head, prompt, putLevel} from "../parts.js";
import {real} from "../store.js";
import {Table} from "../table.js";
import {CONCERNS} from "../words.js";

export const title = "Alarms", key = "a";

export async function open(context) {
    const {root, api, live, time, craft, keys} = context;
    let alarms = [];
    const buttons = [], notes = h("div", {class: "notes"}), about = h("p", {class: "soft"});
    const state = (alarm) => (isShelved(alarm) ? "shelved" : alarm.acknowledged ? "acknowledged" :
        alarm.concern ? "open" : "open, over");
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
            const alarm = alarms[row];
            [alarm.concern, alarm.worst].forEach((level, k) => putLevel(cells[k], level, CONCERNS[0]));
            put(cells[2], alarm.name);
            const {single, kind} = live.store(craft).slots[alarm.slot] ?? {};
            put(cells[3], kind === "time" || kind === "duration" ? alarm.text :
                typeof alarm.value === "number" ? real(alarm.value, single) : String(alarm.value ?? ""));
            stamp(cells[4], time.text(alarm.since_ns));
            put(cells[5], state(alarm));
            dress(element,
                `tr${row === table.at ? " at" : ""}${alarm.acknowledged || isShelved(alarm) ? " soft" : ""}`);
        },
        moved: () => detail(),
        choose: () => acknowledge(),
    });

    /** Show the alarms in their order; the cursor stays on its alarm. */
    function show() {
        const at = alarms[table.at]?.name ?? context.selection;
        alarms = context.alarms.of(craft);
        table.set(alarms.length);
        const row = alarms.findIndex((alarm) => alarm.name === at);
        if (alarms.length) table.go(row < 0 ? Math.max(0, table.at) : row, true);
        detail();
    }

    const post = (alarm, body) => attempt(notes, async () => {
        context.alarms.merge(craft, await api.post(of(craft, "alarms", alarm.slot), body));
    });

    async function acknowledge() {
        const alarm = alarms[table.at];
        if (!alarm || alarm.acknowledged) return;
        const note = h("input", {name: "note", autofocus: true, maxLength: 500, autocomplete: "off"});
        const answers = await prompt("Acknowledge", alarm.name, [["Note, for those who come after you", note]],
            "Acknowledge");
        if (answers) await post(alarm, {acknowledge: true, note: answers.note});
    }

    async function shelve() {
        const alarm = alarms[table.at];
        if (!alarm) return undefined;
        if (isShelved(alarm)) return post(alarm, {shelve_s: 0});
        const time_s = choice(null, [[600, "10 minutes"], [3600, "1 hour"], [28800, "8 hours"], [86400, "1 day"]],
            () => {}, {name: "time"});
        const answers = await prompt("Shelve", `${alarm.name} keeps quiet for so long.`, [["Time", time_s]], "Shelve");
        return answers && post(alarm, {shelve_s: Number(answers.time)});
    }

    async function limits() {
        const alarm = alarms[table.at];
        if (!alarm) return;
        const store = await live.slots(craft);
        if (await editLimits(context, store.slots[alarm.slot])) detail();
    }

    function detail() {
        const alarm = alarms[table.at], acknowledged = alarm?.acknowledged,
              may = context.can("command") || context.can("administer");
        for (const [node, right, words] of buttons) {
            node.disabled = !alarm || !right || (words === "Acknowledge" && Boolean(acknowledged));
            if (words === "Shelve") put(node.firstChild, alarm && isShelved(alarm) ? "End shelving" : "Shelve");
        }
        if (!alarm) return put(about, may ? "" : "To acknowledge asks for the role command.");
        const slot = live.store(craft).slots[alarm.slot];
        const parts = [alarm.name, limitsText(slot?.limits)];
        if (acknowledged) {
            const {user, note} = acknowledged;
            parts.push(`acknowledged by ${user}${note ? `: ${note}` : ""}`);
        }
        if (isShelved(alarm)) parts.push(`shelved until ${clock(alarm.shelved_until_ns, true, 0)} UTC`);
        return put(about, parts.filter(Boolean).join(" \u00b7 "));
    }

    const plot = () => alarms[table.at] && context.go({page: "plots", sel: alarms[table.at].name});
    for (const [words, letter, action, role] of [["Acknowledge", "a", acknowledge, "command"],
        ["Shelve", "s", shelve, "command"], ["Edit limits", "i", limits, "administer"], ["Plot", "l", plot, "view"]]) {
        const node = button([h("span", {}, words), " ", h("kbd", {"aria-hidden": "true"}, letter)], action,
            {disabled: true});
        buttons.push([node, context.can(role), words]);
        keys.add(letter, words.toLowerCase(), () => node.click());
    }
    root.append(head(title, buttons.map(([node]) => node)), notes, table.element, about);
    context.on("alarms", show);
    context.every(5000, show);      // a shelving ends by itself
    await attempt(notes, () => Promise.all([context.alarms.load(craft), live.slots(craft)]));
    show();
    return () => table.close();
}
