// SPDX-License-Identifier: Apache-2.0
// Tables: the parameters of modules on board, read, edited beside what is on board, and loaded whole.
import {of} from "../api.js";
import {attempt, h, hint, put} from "../dom.js";
import {bare, clock} from "../format.js";
import {outcome, post as command, tick, STAGES} from "../forms.js";
import {offer} from "../transfer.js";

export const title = "Tables", key = "t", role = "command";

/** The numbers of a table, flat: [{path, keys, type, unit, meaning, rule, choices}]; keys: from its values inwards. */
export function leaves(fields, before = "", keys = []) {
    return fields.flatMap((
                              one) => elements(one.type === "char" ? (one.shape ?? []).slice(0, -1) :
                                                                     one.shape ??
                                      []).flatMap((index) => {
        const path = `${before}${one.name}${index.map((i) => `[${i}]`).join("")}`, here = [...keys, one.name, ...index];
        if (one.fields?.length) return leaves(one.fields, `${path}.`, here);
        const {type, unit, meaning, rule, enumerators} = one;
        return [{path, keys: here, type, unit, meaning, rule, choices: Object.keys(enumerators ?? {})}];
    }));
}

const elements = ([n, ...rest]) =>
    (n === undefined ? [[]] : Array.from({length: n}, (_, i) => elements(rest).map((element) => [i, ...one])).flat());
export const at = (values, keys) => keys.reduce((inside, k) => inside?.[k], values);

/** The same values with another one at its keys. */
export function changed(values, [first, ...rest], value) {
    const copy = Array.isArray(values) ? [...values] : {...values};
    copy[first] = rest.length ? changed(values?.[first], rest, value) : value;
    return copy;
}

/** A text as the value of a leaf: {value} or {problem}. */
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
const edits = new Map();  // "craft/table" -> values that a person has changed, while the browser's page is open

export async function open({root, api, live, keys, craft, selection, select, can, on}) {
    const utc = live.craft(craft)?.clock === "utc", may = can("command");
    let tables = [], table = null, all = [], waiting = new Map();

    const list = h("ul", {class: "choose", "aria-label": "tables"});
    const search = h(
        "input", {type: "search", placeholder: "Search tables", "aria-label": "search tables", oninput: () => names()});
    const name = h("h2"), meaning = h("p", {class: "soft"}), when = h("span", {class: "soft"}),
          count = h("span", {class: "soft"});
    const read =
        h("button", {disabled: true, title: "R", onclick: () => post({read: true})}, "Read from the spacecraft");
    const load = h("button", {class: "primary", disabled: true, onclick: () => loadAll()}, "Load");
    const take = h("button", {
        disabled: true,
        onclick: () => {
            edits.set(id(), table.values);
            show();
        }
    },
        "Undo the changes");
    const save = h("button", {
        disabled: true,
        onclick: () => offer(
            new Blob([`${JSON.stringify({kind: "fledge-table", table: table.name, values: edited()}, null, 1)}\n`],
                {type: "application/json"}),
            `${table.name}.json`)
    },
        "Save");
    const file = h("input", {
        type: "file",
        accept: ".json,application/json",
        hidden: true,
        "aria-label": "a saved table",
        onchange: () => attempt(pane,
            async () => {
                if (!file.files[0]) return;
                const whole = JSON.parse(await file.files[0].text());
                file.value = "";
                if (whole?.kind !== "fledge-table" || typeof whole.values !== "object")
                    throw new Error("This file is no table that was saved here.");
                if (whole.table !== table.name)
                    throw new Error(`This file has the table ${whole.table}; this is ${table.name}.`);
                edits.set(id(), whole.values);
                show();
            })
    });
    const from = h("button", {disabled: true, onclick: () => file.click()}, "Open a file");
    const body = h("tbody"), ticks = h("p", {class: "answer", role: "status"});
    const pane = h("section", {class: "panel pane", "aria-label": "the table"}, h("header", {}, name, meaning),
        h("div", {class: "row"}, read, load, take, save, from, file, count, h("span", {class: "grow"}), when), ticks,
        h("div", {class: "frame"},
            h("table", {class: "plain"},
                h("thead", {}, h("tr", {}, ["parameter", "on board", "to load", "unit",
                    "meaning"].map((one) => h("th", {class: one}, one)))),
                body)));

    const id = () => `${craft}/${table.name}`;
    const edited = () => edits.get(id()) ?? table.values ?? {};
    const different = () =>
        all.filter(({keys: k}) => at(edited(), k) !== undefined && !same(at(edited(), k), at(table.values, k)));
    const bad = () => body.querySelectorAll("[aria-invalid=true]").length;

    function names() {
        const words = search.value.toLowerCase().split(/\s+/);
        list.replaceChildren(
            ...tables.filter((table) => words.every((word) => table.name.toLowerCase().includes(word)))
                .map((one) => h("li", {},
                         h("button", {
                             class: one === table ? "at" : "",
                             "aria-current": one === table ? "true" : undefined,
                             onclick: () => choose(one)
                         },
                             one.name, h("span", {class: "soft"}, one.read_ns ? clock(one.read_ns, utc, 0) : "")))));
    }
    function choose(one) {
        table = one;
        all = leaves(one.fields);
        select(one.name);
        put(ticks, "");
        names();
        show();
    }
    function show() {
        put(name, table.name);
        put(meaning, table.meaning ?? "");
        put(when, table.read_ns ? `read at ${clock(table.read_ns, utc, utc ? 0 : 1)}` : "not read yet");
        const rows = all.map((leaf) => {
            const board = at(table.values, leaf.keys), now = at(edited(), leaf.keys);
            const about = {
                "aria-label": `${leaf.path}, to load`,
                value: now === undefined ? "" : String(now),
                disabled: !may
            };
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
            const row = h("tr", {class: now !== undefined && !same(board, now) ? "differs" : "", title: leaf.meaning},
                h("td", {class: "mono"}, leaf.path),
                h("td", {class: "num"}, board === undefined ? "\u2013" : String(board)), h("td", {}, field),
                h("td", {class: "soft unit"}, bare(leaf.unit)),
                h("td", {class: "soft meaning"}, leaf.meaning, leaf.rule ? ` (${leaf.rule})` : ""));
            return row;
        });
        body.replaceChildren(...rows);
        buttons();
    }
    function buttons() {
        const n = different().length;
        read.disabled = !may;
        load.disabled = !may || bad() > 0 || !n || table.values === null;
        take.disabled = !n;
        save.disabled = bad() > 0;
        from.disabled = !may;
        const differing = `\u25c6 ${n} ${n > 1 ? "differ" : "differs"} from what is on board`;
        if (bad()) put(count, `${bad()} values are wrong`);
        else if (table.values === null) put(count, "Read it before you load it.");
        else put(count, n ? differing : "\u2713 as on board");
    }
    async function post(what) {
        const one = table;
        await attempt(pane, async () => {
            const answer = await command(api, craft, ["tables", one.name], what, `Loading ${one.name}`);
            if (!answer) return;
            const {ids = []} = answer;
            waiting = new Map(ids.map((k) => [k, null]));
            put(ticks, what.read ? "asked for \u2026" : "on its way \u2026");
            for (const row of await live.rows(craft, "sent", "sent")) follow(row);
        });
    }
    /** Load what differs: whole parameters, as their elements are one on board. */
    const loadAll = () =>
        post({values: Object.fromEntries(different().map(({keys: [first]}) => [first, edited()[first]]))});
    function follow(row) {
        if (!waiting.has(row.id)) return;
        waiting.set(row.id, row);
        const rows = [...waiting.values()].filter(Boolean), outcomes = rows.map((one) => outcome(one)),
              failed = outcomes.find(({state}) => state === "bad");
        put(ticks,
            failed ? `\u2717 refused: ${failed.text}` :
                outcomes.length === waiting.size && outcomes.every(({state}) => state === "good") ?
                     "\u2713 done" :
                     STAGES.filter((stage) => rows.some((one) => tick(one, stage)[0] !== "\u00b7"))
                         .map((stage) => `\u2713 ${stage}`)
                         .join("  "));
        ticks.className = `answer ${failed ? "problem" : ""}`;
    }
    on("sent", (row) => row.craft === craft && follow(row));
    on("table", (one) => {
        const found = one.craft === craft && tables.find(({name: n}) => n === one.name);
        if (!found) return;
        const mine = edits.get(`${craft}/${found.name}`);
        const untouched = !mine || leaves(found.fields).every(({keys: k}) => same(at(mine, k), at(found.values, k)));
        Object.assign(found, {values: one.values, read_ns: one.read_ns});
        if (untouched) edits.delete(`${craft}/${found.name}`);
        names();
        if (found === table) show();
    });
    root.append(h("div", {class: "split tables"}, h("section", {class: "panel"}, search, list), pane));
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
}
