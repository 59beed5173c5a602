// SPDX-License-Identifier: Apache-2.0
// Tables: the parameters of modules on board. They are read, edited beside the values on board, and loaded whole.
import {of} from "../api.js";
import {attempt, h, hint, put} from "../dom.js";
import {bare, matcher} from "../format.js";
import {Followed, post as command, reached} from "../forms.js";
import {answerLine, button, plain, row as rowOf, search} from "../parts.js";
import {offer, opener} from "../transfer.js";

export const title = "Tables", key = "t", role = "command";

/** The numbers of a table in a list: [{path, keys, type, unit, meaning, rule, choices}]; keys: the path as a list. */
export function leaves(fields, before = "", keys = []) {
    return fields.flatMap(({name, type, shape, fields: members, unit, meaning, rule, enumerators}) =>
        indices((shape ?? []).slice(0, type === "char" ? -1 : undefined)).flatMap((index) => {
            const path = `${before}${name}${index.map((i) => `[${i}]`).join("")}`, here = [...keys, name, ...index];
            if (members?.length) return leaves(members, `${path}.`, here);
            return [{path, keys: here, type, unit, meaning, rule, choices: Object.keys(enumerators ?? {})}];
        }));
}

/** The indices of all elements of an array of this shape. */
const indices = ([n, ...rest]) =>
    (n === undefined ? [[]] : Array.from({length: n}, (_, i) => indices(rest).map((index) => [i, ...index])).flat());
export const at = (values, keys) => keys.reduce((inside, k) => inside?.[k], values);

/** A copy of values in which the element at these keys is replaced. */
export function changed(values, [first, ...rest], value) {
    const copy = Array.isArray(values) ? [...values] : {...values};
    copy[first] = rest.length ? changed(values?.[first], rest, value) : value;
    return copy;
}

/** Parse the value of a leaf: {value} or {problem}. */
export function parsed(leaf, text) {
    const given = text.trim();
    if (leaf.type === "char") return {value: text};
    if (leaf.choices.length)
        return leaf.choices.includes(given) ? {value: given} : {problem: `one of ${leaf.choices.join(", ")}`};
    if (/^f\d+$/.test(leaf.type)) {
        const value = Number(given);
        return given && Number.isFinite(value) ? {value} : {problem: "a number is needed"};
    }
    if (!/^[+-]?\d+$/.test(given)) return {problem: "a whole number is needed"};
    const bits = Number(leaf.type.slice(1)), n = BigInt(given), signed = leaf.type.startsWith("i");
    const low = signed ? -(1n << BigInt(bits - 1)) : 0n, high = (1n << BigInt(signed ? bits - 1 : bits)) - 1n;
    if (bits && (n < low || n > high)) return {problem: `${low} \u2026 ${high}`};
    return {value: Number.isSafeInteger(Number(n)) ? Number(n) : String(n)};
}

const same = (a, b) => a === b || String(a) === String(b) && a != null;
const edits = new Map();  // "craft/table" -> values that the user has changed, while the console is open

export async function open(context) {
    const {root, api, time, keys, craft, selection, select, can, on} = context, may = can("command");
    let tables = [], table = null, all = [];

    const list = h("ul", {class: "choose", "aria-label": "tables"});
    const wanted = search("search tables", "Search tables", () => names());
    const name = h("h2"), meaning = h("p", {class: "soft"}), when = h("span", {class: "soft"}),
          count = h("span", {class: "soft"});
    const read = button("Read from the spacecraft", () => post({read: true}), {disabled: true, title: "R"});
    const load = button("Load", () => loadAll(), {class: "primary", disabled: true});
    const edit = (values) => {
        edits.set(id(), values);
        show();
    };
    const undo = button("Undo the changes", () => edit(table.values), {disabled: true});
    const save = button("Save", () => offer(
        `${JSON.stringify({kind: "fledge-table", table: table.name, values: edited()}, null, 1)}\n`,
        `${table.name}.json`), {disabled: true});
    const file = opener("a saved table", () => pane, (text) => {
        const whole = JSON.parse(text);
        if (whole?.kind !== "fledge-table" || typeof whole.values !== "object")
            throw new Error("This file is no table that was saved here.");
        if (whole.table !== table.name)
            throw new Error(`This file has the table ${whole.table}; this is ${table.name}.`);
        edit(whole.values);
    });
    const from = button("Open a file", () => file.click(), {disabled: true});
    const body = h("tbody"), ticks = answerLine();
    const followed = new Followed(context, (rows, {state, text}) => ticks.say(state === "bad" ?
        `\u2717 refused: ${text}` : state === "good" ? "\u2713 done" : reached(rows), state === "bad"));
    const pane = h("section", {class: "panel pane", "aria-label": "the table"}, h("header", {}, name, meaning),
        h("div", {class: "row"}, read, load, undo, save, from, file, count, h("span", {class: "grow"}), when), ticks,
        h("div", {class: "frame"},
            plain(["parameter", "on board", "to load", "unit", "meaning"].map((title) => [title, title]), body)));

    const id = () => `${craft}/${table.name}`;
    const edited = () => edits.get(id()) ?? table.values ?? {};
    const different = () =>
        all.filter(({keys: k}) => at(edited(), k) !== undefined && !same(at(edited(), k), at(table.values, k)));
    const bad = () => body.querySelectorAll("[aria-invalid=true]").length;

    function names() {
        const fits = matcher(wanted.value);
        list.replaceChildren(...tables.filter((known) => fits(known.name)).map((known) => h("li", {}, button(
            [known.name, h("span", {class: "soft"}, known.read_ns ? time.text(known.read_ns, 0) : "")],
            () => choose(known),
            {class: known === table ? "at" : "", "aria-current": known === table ? "true" : undefined}))));
    }
    function choose(chosen) {
        table = chosen;
        all = leaves(chosen.fields);
        select(chosen.name);
        ticks.say("");
        names();
        show();
    }
    function show() {
        put(name, table.name);
        put(meaning, table.meaning ?? "");
        put(when, table.read_ns ? `read at ${time.brief(table.read_ns)}` : "not read yet");
        const rows = all.map((leaf) => {
            const board = at(table.values, leaf.keys), now = at(edited(), leaf.keys);
            const about = {"aria-label": `${leaf.path}, to load`, value: now === undefined ? "" : String(now),
                disabled: !may};
            const set = () => {
                const {value, problem} = parsed(leaf, field.value);
                field.toggleAttribute("aria-invalid", Boolean(problem));
                if (problem) field.setAttribute("aria-invalid", "true");
                hint(field, problem ?? "");
                if (!problem) edits.set(id(), changed(edited(), leaf.keys, value));
                row.classList.toggle("differs", !problem && !same(value, board));
                buttons();
            };
            const field = leaf.choices.length ?
                h("select", {...about, onchange: set}, now === undefined && h("option", {value: ""}, "\u2013"),
                    leaf.choices.map((choice) => h("option", {selected: choice === String(now)}, choice))) :
                h("input", {...about, oninput: set});
            const row = rowOf({class: now !== undefined && !same(board, now) ? "differs" : "", title: leaf.meaning},
                ["mono", leaf.path], ["num", board === undefined ? "\u2013" : String(board)], field,
                ["soft unit", bare(leaf.unit)],
                ["soft meaning", [leaf.meaning, leaf.rule ? ` (${leaf.rule})` : ""]]);
            return row;
        });
        body.replaceChildren(...rows);
        buttons();
    }
    function buttons() {
        const n = different().length;
        read.disabled = !may;
        load.disabled = !may || bad() > 0 || !n || table.values === null;
        undo.disabled = !n;
        save.disabled = bad() > 0;
        from.disabled = !may;
        const differing = `\u25c6 ${n} ${n > 1 ? "differ" : "differs"} from what is on board`;
        if (bad()) put(count, `${bad()} values are wrong`);
        else if (table.values === null) put(count, "Read it before you load it.");
        else put(count, n ? differing : "\u2713 as on board");
    }
    async function post(body) {
        const loaded = table;
        await attempt(pane, async () => {
            const answer = await command(api, craft, ["tables", loaded.name], body, `Loading ${loaded.name}`);
            if (!answer) return;
            ticks.say(body.read ? "requested \u2026" : "on its way \u2026");
            await followed.begin(answer.ids ?? []);
        });
    }
    /** Load the parameters that differ, each with all its elements. */
    const loadAll = () =>
        post({values: Object.fromEntries(different().map(({keys: [first]}) => [first, edited()[first]]))});
    on("table", (message) => {
        const held = tables.find(({name: n}) => n === message.name);
        if (!held) return;
        const mine = edits.get(`${craft}/${held.name}`);
        const untouched = !mine || leaves(held.fields).every(({keys: k}) => same(at(mine, k), at(held.values, k)));
        Object.assign(held, {values: message.values, read_ns: message.read_ns});
        if (untouched) edits.delete(`${craft}/${held.name}`);
        names();
        if (held === table) show();
    });
    root.append(h("div", {class: "split tables"}, h("section", {class: "panel"}, wanted, list), pane));
    keys.add("R", "read from the spacecraft", () => read.click());
    keys.add("j", "next table", () => choose(tables[Math.min(tables.length - 1, tables.indexOf(table) + 1)]));
    keys.add("k", "previous table", () => choose(tables[Math.max(0, tables.indexOf(table) - 1)]));
    await attempt(root, async () => {
        tables = await api.get(of(craft, "tables"));
        if (!tables.length)
            pane.replaceChildren(h("p", {class: "none soft"}, `${craft} has no parameters that can be loaded.`));
        else
            choose(tables.find((table) => table.name === selection) ?? tables[0]);
    });
    return () => followed.close();
}
