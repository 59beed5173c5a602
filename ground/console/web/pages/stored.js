// SPDX-License-Identifier: Apache-2.0
// Commands that are stored on board, in lists with absolute times and in sequences, with the time when each is due.
import {of} from "../api.js";
import {attempt, h, put} from "../dom.js";
import {clock, span} from "../format.js";
import {Form, listed, post as command} from "../forms.js";
import {
    button, choice, ends, field, fillRows, form as formOf, has, openDialog, panel, plain, prompt, row
} from "../parts.js";

export const title = "On board", key = "b", role = "command";

const LISTS = 16;
/** The states of a list: [in words, the actions that it allows]. */
const STATES = {
    idle: ["idle", ["start", "inhibit"]],
    running: ["\u25b6 running", ["stop", "hold", "inhibit"]],
    held: ["\u23f8 held", ["release", "stop"]],
    inhibited: ["\u2298 inhibited", ["allow"]]
};

const heads = (...names) => names.map((name) => [name === "command" ? "" : "num", name]);

/** The commands that are due from now on, soonest first: [{due: s from now, list, step, name}]. */
export const due = (lists, now) =>
    lists
        .flatMap(({list, commands}) => commands.filter((command) => command.due_ns != null).map((command) => ({
            due: Number(BigInt(command.due_ns) - BigInt(now)) / 1e9,
            list,
            step: command.step,
            name: command.name
        })))
        .filter((command) => command.due >= 0)
        .sort((a, b) => a.due - b.due);

/** The span of a timeline that shows `last`, in s: a round number. */
export function reach(last) {
    return [60, 300, 600, 1800, 3600, 7200, 21600, 43200, 86400, 604800, 2592000].find((span) => span >= 1.02 * last) ??
        1.02 * last;
}

export async function open(context) {
    const {root, api, live, time, keys, craft, on, every, notify} = context, may = context.can("command");
    if (!has(context, "stored", "no StoredCommands, so no command waits on board")) return undefined;
    let stored = {lists: [], text: ""}, forms = [], shown = "", dialog = null;
    const own = new Set(), now = () => live.craft(craft)?.t_ns ?? "0";
    const line = h("div", {class: "timeline", role: "img", "aria-label": "what is due"}),
        soon = h("tbody"), lists = h("div", {class: "lists"});
    const strip = panel("what is due", "Due on board", line,
        plain(heads("in", "at", "list", "step", "command"), soon));
    strip.classList.add("wide");
    const problem = h("p", {class: "soft"});

    const which = choice("list", Array.from({length: LISTS}, (_, k) => [k, k ? `sequence ${k}` : "absolute times"]),
        () => {}, {disabled: !may});
    const read = () => post({list: Number(which.value), action: "report"});
    const send = async (body) => (await command(api, craft, "stored", body))?.ids.forEach((id) => own.add(id));
    const post = (body) => attempt(root, () => send(body));
    async function act(list, action) {
        if (action === "start" ||
            await prompt(`${action} list ${list}`, `The list ${list} of ${craft}: ${action}.`, [], action))
            await post({list, action});
    }
    function draw() {
        const at = now(), all = due(stored.lists, at), to = reach(all.at(-1)?.due ?? 0);
        line.setAttribute("aria-label", `${all.length} commands are due within ${span(to)}`);
        line.replaceChildren(
            ...[0, .25, .5, .75, 1].map(
                (share) => h("span", {class: `mark soft${share === 1 ? " end" : ""}`, style: `left: ${100 * share}%`},
                    share ? `+${span(share * to)}` : "now")),
            ...all.map((command) => h("span", {
                class: "due",
                style: `left: ${100 * command.due / to}%; top: ${1.5 + command.list % 4 * 1.1}rem`,
                title: `${command.name}\nlist ${command.list}, step ${command.step}, in ${span(command.due)}`
            },
                           String(command.list))));
        fillRows(soon, all.slice(0, 50), ({due, list, step, name}) => row({}, ["num", span(due)],
            ["num soft", time.text(BigInt(at) + BigInt(Math.round(due * 1e9)), 0)], ["num", list], ["num", step], name),
            "Nothing is due.", 5);
    }
    function sum() {
        const known = stored.lists.reduce((n, list) => n + list.commands.length, 0);
        const unread = (stored.stored ?? 0) - known;
        put(problem, stored.text || stored.stored == null ? stored.text : [
            `${stored.stored} on board${unread > 0 ? `, of which ${unread} were not read yet` : ""}`,
            `${stored.released} executed`, `${stored.skipped} skipped`,
            stored.next_ns && `the next one is due at ${time.text(stored.next_ns, 0)}`]
            .filter(Boolean).join(" \u00b7 "));
    }
    const tables = () => lists.replaceChildren(...stored.lists
        .filter((list) => list.commands.length || list.state !== "idle" || list.read_ns).map(part));
    const states = new Map();
    const showState = ({list, state, t_ns}) => states.has(list) &&
        put(states.get(list), (list || state !== "idle" ? STATES[state]?.[0] ?? state : "") +
            (t_ns == null ? "" : ` for ${clock(t_ns, false, 0)}`));
    function part({list, state, t_ns, read_ns, commands}) {
        const small = (word, action, about = {}) => may && button(word, action, {class: "small", ...about});
        const actions = (STATES[state]?.[1] ?? []).filter((action) => list || !["start", "stop"].includes(action));
        const status = h("span");
        states.set(list, status);
        showState({list, state, t_ns});
        return panel(`list ${list}`, "",
            h("div", {class: "row"}, h("h2", {}, list ? `Sequence ${list}` : "Absolute times"), status,
                h("span", {class: "grow"}), actions.map((action) => small(action, () => act(list, action))),
                small("read", () => post({list, action: "report"}))),
            plain(heads("time", "step", "command", "bytes", ""), h("tbody", {}, commands.map(
                ({time_ns, step, name, size}) => row({}, ["num", clock(time_ns, false, list ? 1 : 0)], ["num", step],
                    name, ["num soft", size], small("delete", () => post({list, step, action: "delete"}),
                        {"aria-label": `delete step ${step}`})))), {},
                h("caption", {class: "soft"}, read_ns ? `${commands.length ? "" : "Empty. "}Read at ${
                    time.text(read_ns, 0)}.` : "Not read yet: what was stored from here.")));
    }
    const load = async () => {
        stored = await api.get(of(craft, "stored"));
        const now = JSON.stringify(stored,
            (key, value) => (["flight_ns", "t_ns", "due_ns", "next_ns"].includes(key) ? null : value));
        if (now !== shown) tables();
        else stored.lists.forEach(showState);
        shown = now;
        sum();
        draw();
    };

    // --- a command to be stored ---
    function compose() {
        let form = null;
        const number = (about) => h("input", {type: "number", min: 0, required: true, ...about});
        const list = number({max: 15, value: "1", oninput: () => change()}), step = number({max: 65534, value: "0"});
        const at = number({step: "any"}), holder = h("div"), times = h("p", {class: "soft"});
        const change = () => {
            const flight = Math.round(Number(stored.flight_ns) / 1e9);
            put(times, Number(list.value) ? "Its time counts from the start of the sequence." :
                `Its time is that of flight, which is ${flight} s now.`);
            at.value = Number(list.value) ? "10" : String(flight + 60);
        };
        const fill = (name) => {
            form = new Form(forms.find((other) => other.name === name));
            holder.replaceChildren(form.element);
        };
        const which = choice(null, listed(forms, "").filter((row) => row.form).map((row) => row.form.name), fill);
        const store = async (arguments_) => {
            try {
                await send({list: Number(list.value), step: Number(step.value), name: which.value,
                    time_ns: String(Math.round(Number(at.value) * 1e9)), arguments: arguments_});
                dialog.close();
            } catch (error) {
                if (!form.refused(error)) throw error;
            }
        };
        const inside = formOf(() => {
            const values = form?.values();
            if (values) attempt(inside, () => store(values));
        }, {}, h("h2", {}, "Store a command"), times,
            h("div", {class: "row"}, field("list", list), field("step", step), field("time [s]", at)),
            field("command", which), holder, ends("Store"));
        change();
        fill(which.value);
        dialog = openDialog("store a command", () => {}, {}, inside);
    }
    root.append(h("div", {class: "row"},
        button("Store a command", compose, {class: "primary", disabled: !may, title: "a"}),
        button("Read the list", () => read(), {disabled: !may, title: "R"}), which, problem), strip, lists);
    if (may) {
        keys.add("a", "store a command", compose);
        keys.add("R", "read the list", () => read());
    }
    on("stored", () => load().catch(() => {}));
    on("sent", (row) => {
        if (!own.has(row.id)) return;
        const bad = row.stages.find(({good}) => good === false);
        if (bad) notify(`${row.name}: ${bad.text}`, true);
        if (bad || row.stages.some(({stage}) => stage === "completed")) own.delete(row.id);
    });
    every(1000, () => document.hidden || load().catch(() => {}));
    await attempt(root, async () => {
        await load();
        forms = await api.get(of(craft, "commands"));
    });
    return () => dialog?.close();
}
