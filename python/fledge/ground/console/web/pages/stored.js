// SPDX-License-Identifier: Apache-2.0
// Commands that are stored on board, in lists with absolute times and in sequences, with the time when each is due.
import {of} from "../api.js";
import {attempt, h, has, prompt, put} from "../dom.js";
import {clock, span} from "../format.js";
import {Form, listed, post as command} from "../forms.js";

export const title = "On board", key = "b", role = "command";

const LISTS = 16;
const ACTIONS = {
    idle: ["start", "inhibit"],
    running: ["stop", "hold", "inhibit"],
    held: ["release", "stop"],
    inhibited: ["allow"]
};
const STATES = {
    idle: "idle",
    running: "\u25b6 running",
    held: "\u23f8 held",
    inhibited: "\u2298 inhibited"
};

const head = (name) => h("th", {class: name === "command" ? "" : "num"}, name);

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

export async function open({root, api, live, keys, craft, can, on, every, notify}) {
    if (!has(live, craft, root, "stored", "no StoredCommands, so no command waits on board")) return undefined;
    const utc = live.craft(craft)?.clock === "utc", may = can("command"), own = new Set();
    let stored = {lists: [], text: ""}, forms = [], shown = "";
    const now = () => live.craft(craft)?.t_ns ?? "0";
    const line = h("div", {class: "timeline", role: "img", "aria-label": "what is due"}),
        soon = h("tbody"), lists = h("div", {class: "lists"});
    const strip = h("section", {class: "panel wide", "aria-label": "what is due"}, h("h3", {}, "Due on board"), line,
        h("table", {class: "plain"},
            h("thead", {}, h("tr", {}, ["in", "at", "list", "step", "command"].map(head))), soon));
    const problem = h("p", {class: "soft"});

    const which = h("select", {"aria-label": "list", disabled: !may},
        Array.from({length: LISTS}, (_, k) => h("option", {value: k}, k ? `sequence ${k}` : "absolute times")));
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
        soon.replaceChildren(...all.slice(0, 50).map(
            (command) => h("tr", {}, h("td", {class: "num"}, span(command.due)),
                h("td", {class: "num soft"}, clock(BigInt(at) + BigInt(Math.round(command.due * 1e9)), utc, 0)),
                h("td", {class: "num"}, command.list), h("td", {class: "num"}, command.step),
                h("td", {}, command.name))));
        if (!all.length)
            soon.append(h("tr", {}, h("td", {class: "soft", colSpan: 5}, "Nothing is due.")));
    }
    function sum() {
        const known = stored.lists.reduce((n, list) => n + list.commands.length, 0);
        const unread = (stored.stored ?? 0) - known;
        put(problem, stored.text || stored.stored == null ? stored.text : [
            `${stored.stored} on board${unread > 0 ? `, of which ${unread} were not read yet` : ""}`,
            `${stored.released} executed`, `${stored.skipped} skipped`,
            stored.next_ns && `the next one is due at ${clock(stored.next_ns, utc, 0)}`]
            .filter(Boolean)
            .join(" \u00b7 "));
    }
    function tables() {
        lists.replaceChildren(...stored.lists
            .filter((list) => list.commands.length || list.state !== "idle" || list.read_ns)
            .map(part));
    }
    const states = new Map();
    const showState = ({list, state, t_ns}) => states.has(list) &&
        put(states.get(list), (list || state !== "idle" ? STATES[state] ?? state : "") +
            (t_ns == null ? "" : ` for ${clock(t_ns, false, 0)}`));
    function part({list, state, t_ns, read_ns, commands}) {
        const small = (word, action, about = {}) =>
            may && h("button", {class: "small", onclick: action, ...about}, word);
        const actions = (ACTIONS[state] ?? []).filter((action) => list || !["start", "stop"].includes(action));
        const status = h("span");
        states.set(list, status);
        showState({list, state, t_ns});
        return h("section", {class: "panel", "aria-label": `list ${list}`},
            h("div", {class: "row"}, h("h2", {}, list ? `Sequence ${list}` : "Absolute times"), status,
                h("span", {class: "grow"}), actions.map((action) => small(action, () => act(list, action))),
                small("read", () => post({list, action: "report"}))),
            h("table", {class: "plain"},
                h("thead", {}, h("tr", {}, ["time", "step", "command", "bytes", ""].map(head))),
                h("tbody", {},
                    commands.map(
                        ({time_ns, step, name, size}) =>
                            h("tr", {}, h("td", {class: "num"}, clock(time_ns, false, list ? 1 : 0)),
                                h("td", {class: "num"}, step), h("td", {}, name), h("td", {class: "num soft"}, size),
                                h("td", {},
                                    small("delete", () => post({list, step, action: "delete"}),
                                        {"aria-label": `delete step ${step}`}))))),
                h("caption", {class: "soft"}, read_ns ? `${commands.length ? "" : "Empty. "}Read at ${
                    clock(read_ns, utc, 0)}.` : "Not read yet: what was stored from here.")));
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
    const dialog = h("dialog", {"aria-label": "store a command"});
    function compose() {
        let form = null;
        const list = h("input", {type: "number", min: 0, max: 15, value: "1", required: true}),
              step = h("input", {type: "number", min: 0, max: 65534, value: "0", required: true});
        const at = h("input", {type: "number", min: 0, step: "any", value: "10", required: true}), holder = h("div");
        const times = h("p", {class: "soft"});
        list.oninput = () => {
            const flight = Math.round(Number(stored.flight_ns) / 1e9);
            put(times, Number(list.value) ? "Its time counts from the start of the sequence." :
                `Its time is that of flight, which is ${flight} s now.`);
            at.value = Number(list.value) ? "10" : String(flight + 60);
        };
        const which = h("select", {
            onchange: () => {
                form = new Form(forms.find(({name}) => name === which.value));
                holder.replaceChildren(form.element);
            }
        },
            listed(forms, "").filter((row) => row.form).map((row) => h("option", {}, row.form.name)));
        const field = (text, input) => h("label", {class: "field"}, h("span", {}, text), input);
        const inside = h("form", {
            onsubmit: (event) => {
                event.preventDefault();
                const values = form?.values();
                if (values)
                    attempt(inside, async () => {
                        try {
                            await send({
                                list: Number(list.value),
                                step: Number(step.value),
                                time_ns: String(Math.round(Number(at.value) * 1e9)),
                                name: which.value,
                                arguments: values
                            });
                            dialog.close();
                        } catch (error) {
                            if (!form.refused(error)) throw error;
                        }
                    });
            }
        },
            h("h2", {}, "Store a command"),
            times, h("div", {class: "row"}, field("list", list), field("step", step), field("time [s]", at)),
            field("command", which), holder,
            h("div", {class: "row end"}, h("button", {type: "button", onclick: () => dialog.close()}, "Cancel"),
                h("button", {class: "primary"}, "Store")));
        dialog.replaceChildren(inside);
        list.oninput();
        which.dispatchEvent(new Event("change"));
        dialog.showModal();
    }
    root.append(h("div", {class: "row"},
                    h("button", {class: "primary", disabled: !may, onclick: compose, title: "a"}, "Store a command"),
                    h("button", {disabled: !may, onclick: () => read(), title: "R"}, "Read the list"), which, problem),
        strip, lists, dialog);
    if (may) {
        keys.add("a", "store a command", compose);
        keys.add("R", "read the list", () => read());
    }
    on("stored", (message) => message.craft === craft && load().catch(() => {}));
    on("sent", (row) => {
        if (row.craft !== craft || !own.has(row.id)) return;
        const bad = row.stages.find(({good}) => good === false);
        if (bad) notify(`${row.name}: ${bad.text}`, true);
        if (bad || row.stages.some(({stage}) => stage === "completed")) own.delete(row.id);
    });
    every(1000, () => document.hidden || load().catch(() => {}));
    await attempt(root, async () => {
        await load();
        forms = await api.get(of(craft, "commands"));
    });
    return undefined;
}
