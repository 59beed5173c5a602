// SPDX-License-Identifier: Apache-2.0
// Forms of commands: a field for each argument of the database, checks of values, the encoded bytes, and sending.
import "./operate.css";
import {of} from "./api.js";
import {h, put} from "./dom.js";
import {matcher, timeGiven} from "./format.js";
import {prompt} from "./parts.js";
import {RARE, STAGES} from "./words.js";

const bracket = ({low, high, low_open, high_open}) => {
    if (low != null && high != null && !low_open && !high_open) return `${low} \u2026 ${high}`;
    return [
        low != null && `${low_open ? ">" : "\u2265"} ${low}`, high != null && `${high_open ? "<" : "\u2264"} ${high}`
    ].filter(Boolean)
        .join(", ");
};

/** The allowed values of an argument as text: "real, 0 … 5 N m". */
export function allowed({type, unit, low, high, low_open, high_open, size, labels}) {
    const range = bracket({low, high, low_open, high_open});
    const room = (type === "text" || type === "binary") && size ? `at most ${size} bytes` : "";
    const word = {label: `one of ${labels?.length ?? 0}`, binary: "hexadecimal", natural: "integer",
        time: "a date, or ns since 1970", duration: "as 1.5 s, or ns"}[type] ?? type;
    return [word, range, room].filter(Boolean).join(", ") +
        (unit && unit !== "-" ? ` ${range ? "" : "in "}${unit}` : "");
}

/** Check the text of a field: {value} for the server, or {problem}; {} where it is empty and has an initial value. */
export function checked(argument, text) {
    const {type, low, high, low_open, high_open, initial, labels, size} = argument;
    const given = text.trim();
    if (!given && type !== "text") {
        if (initial != null && initial !== "") return {};
        return {problem: type === "label" || type === "boolean" ? "choose one" : "give a value"};
    }
    let number;
    switch (type) {
    case "natural":
    case "integer":
        if (!/^[+-]?(\d+|0x[\da-f]+)$/i.test(given)) return {problem: `a whole number is needed; found "${given}"`};
        number = given.startsWith("-") ? -BigInt(given.slice(1)) : BigInt(given.replace("+", ""));
        break;
    case "time":
    case "duration": return timeGiven(type, given);
    case "real":
        number = Number(given);
        if (!Number.isFinite(number)) return {problem: `a number is needed; found "${given}"`};
        break;
    case "boolean": return {value: given === String(labels?.[1] ?? "true")};
    case "label": return labels.includes(given) ? {value: given} : {problem: `there is no "${given}"`};
    case "binary": {
        const digits = given.replace(/^0x/i, "").replace(/[\s:]/g, "");
        if (!/^([\da-f]{2})*$/i.test(digits)) return {problem: "pairs of hexadecimal digits are needed, as in 0a ff"};
        if (size && digits.length / 2 > size) return {problem: `at most ${size} bytes; there are ${digits.length / 2}`};
        return {value: digits};
    }
    case "text": return {value: text};
    default: try { return {value: JSON.parse(given)};
        } catch {
            return {
                problem: type === "array" ? "a list is needed, as in [1, 2]" : 'members are needed, as in {"x": 1}'
            };
        }
    }
    if ((low != null && (low_open ? number <= low : number < low)) ||
        (high != null && (high_open ? number >= high : number > high)))
        return {problem: `it must be ${bracket(argument)}`};
    if (typeof number === "bigint")
        number = number >= -(2n ** 53n) && number <= 2n ** 53n ? Number(number) : String(number);
    return {value: number};
}

/** A value as the text of its field. */
export const textOf = (value) => (value == null ? "" :
        typeof value === "object"               ? JSON.stringify(value) :
                                                  String(value));

/** The fields of a command. changed(): called after each change by the user. */
export class Form {
    constructor(form, values = {}, changed = () => {}) {
        this.form = form;
        this.fields = new Map();
        this.element = h("div", {class: "form"},
            form.arguments.length ? form.arguments.map((argument) => this.field(argument, values, changed)) :
                                    h("p", {class: "soft"}, "This command has no arguments."));
    }

    field(argument, values, changed) {
        const {name, type, labels, initial, description} = argument, id = `argument-${name}`;
        const now = textOf(values[name] ?? initial),
              about = {id, name, "aria-describedby": `${id}-about ${id}-problem`};
        const choices = type === "boolean" && !labels?.length ? ["false", "true"] : labels;
        const shown = typeof values[name] === "boolean" ? String(choices?.[Number(values[name])]) : now;
        const input = type === "label" || type === "boolean" ?
            h("select", about, h("option", {value: ""}, "\u2013 choose \u2013"),
                choices.map((choice) => h("option", {value: choice, selected: String(choice) === shown},
                                          String(choice)))) :
            h(type === "text" && (argument.size ?? 0) > 64 || type === "aggregate" || type === "array" ? "textarea" :
                                                                                                         "input",
                {
                    ...about,
                    value: shown,
                    autocomplete: "off",
                    inputMode: type === "real" ? "decimal" : undefined,
                    rows: undefined
                });
        const problem = h("span", {class: "problem", id: `${id}-problem`, role: "alert"});
        input.addEventListener("input", () => {
            this.check(name);
            changed();
        });
        this.fields.set(name, {argument, input, problem});
        return h("div", {class: "argument"}, h("label", {htmlFor: id}, name),
            h("div", {class: "entry"}, input,
                argument.unit && argument.unit !== "-" && h("span", {class: "unit"}, argument.unit)),
            h("span", {class: "rule soft", id: `${id}-about`}, allowed({...argument, unit: ""}),
                description && ` \u2013 ${description}`),
            problem);
    }

    check(name) {
        const {argument, input} = this.fields.get(name), result = checked(argument, input.value);
        this.refuse(name, result.problem ?? "");
        return result;
    }

    /** Show the problem of an argument beside its field; "" removes it. */
    refuse(name, text) {
        const {input, problem} = this.fields.get(name);
        put(problem, text);
        input.toggleAttribute("aria-invalid", Boolean(text));
        if (text) input.setAttribute("aria-invalid", "true");
    }

    /** Show the server's error beside its argument; false if it names none of them. focus: move the focus there. */
    refused(error, focus = false) {
        const name = error.body?.argument;
        if (!this.fields.has(name)) return false;
        this.refuse(name, error.message);
        if (focus) this.fields.get(name).input.focus();
        return true;
    }

    /** {name: value}, or null if a value is wrong; if loud, each problem is shown, and the first such field focused. */
    values(loud = true) {
        const values = {};
        let first = null;
        for (const [name, {argument, input}] of this.fields) {
            const {value, problem} = loud ? this.check(name) : checked(argument, input.value);
            if (problem) first ??= input;
            if (value !== undefined) values[name] = value;
        }
        if (first && loud) first.focus();
        return first ? null : values;
    }
}

/** The bytes of a command in lines of 16, with its fields; the bytes of the field under the pointer are marked. */
export function bytesOf({hex, fields = []}) {
    const pairs = hex.replace(/\s/g, "").match(/../g) ?? [];
    const cells = pairs.map((pair) => h("span", {class: "byte"}, pair));
    const mark = (field, on) => {
        if (field.bit == null) return;
        for (let k = field.bit >> 3; k <= (field.bit + Math.max(1, field.bits) - 1) >> 3; k++)
            cells[k]?.classList.toggle("on", on);
    };
    for (const field of fields)
        if (field.argument && field.bit != null)
            for (let k = field.bit >> 3; k <= (field.bit + field.bits - 1) >> 3; k++) cells[k]?.classList.add("given");
    const lines = [];
    for (let k = 0; k < cells.length; k += 16)
        lines.push(h("div", {class: "line"}, h("span", {class: "offset soft"}, k.toString(16).padStart(4, "0")),
            cells.slice(k, k + 16)));
    const row = (field) => {
        const text = String(field.raw ?? ""), raw = text === textOf(field.value) || text.length > 10 ? "" : text;
        const place = field.bit == null   ? "" :
            field.bits % 8 || field.bit % 8 ? `bit ${field.bit}, ${field.bits}` :
                                          `byte ${field.bit / 8}, ${field.bits / 8}`;
        return h("tr", {
            class: field.argument === false ? "soft" : "",
            tabIndex: field.bit == null ? undefined : 0,
            onmouseenter: () => mark(field, true),
            onmouseleave: () => mark(field, false),
            onfocus: () => mark(field, true),
            onblur: () => mark(field, false)
        },
            h("td", {}, field.name),
            h("td", {class: "number"}, textOf(field.value), field.unit && field.unit !== "-" && ` ${field.unit}`),
            h("td", {class: "number"}, raw), h("td", {class: "soft"}, place));
    };
    const table = (all) => all.length > 0 &&
        h("table", {class: "plain"},
            h("thead", {}, h("tr", {}, ["field", "value", "raw", "where"].map((title) => h("th", {}, title)))),
            h("tbody", {}, all.map(row)));
    const fixed = fields.filter(({argument}) => argument === false);
    return h("div", {class: "bytes"},
        h("div", {class: "octets", role: "img", "aria-label": `${pairs.length} bytes: ${pairs.join(" ")}`}, lines),
        table(fields.filter(({argument}) => argument !== false)),
        fixed.length > 0 &&
            h("details", {}, h("summary", {}, `${fixed.length} fields that the database gives`), table(fixed)));
}

/** Post a command to a route that sends or stores it; a hazardous one after the user has confirmed it, one whose
 *  constraint may be suspended after the user has said that it is not checked. Returns the answer, or null if the user
 *  said no. */
export async function post(api, craft, route, body, name = body.name) {
    const path = of(craft, ...[route].flat()), given = {...body};
    for (;;) {
        try {
            return await api.post(path, given);
        } catch (error) {
            const {hazardous, constraint, suspendable} = error.status === 409 && error.body || {};
            if (!hazardous && !suspendable) throw error;
            const sure = hazardous ?
                await prompt(`${name} is hazardous`, `${hazardous}. Send it to ${craft} all the same?`, [], "Send it",
                    true) :
                await prompt(`${name} is constrained`, `${constraint}. Send it to ${craft} without this check?`, [],
                    "Send it unchecked", true);
            if (!sure) return null;
            given[hazardous ? "confirmed" : "unchecked"] = true;
        }
    }
}

/** Send a command: its id, or null. */
export const send = async (api, craft, name, values) =>
    (await post(api, craft, "send", {name, arguments: values}))?.id ?? null;

/** The stages that commands with these forms may have. */
export const stagesOf = (forms) => STAGES.filter((stage) => !RARE.includes(stage) ||
    forms.some((form) => form.verifiers.some((verifier) => verifier.stage === stage)));

/** A verifier of a form in words. */
export const verifierOf = ({stage, text, stop, from_release, problem}) => `${stage}: ${
    problem ? `not watched: ${problem}` :
    `${text}${stop === null ? "" : ` within ${stop} s of the ${from_release ? "release" : "verifier before"}`}`}`;

const TICKS = {
    true: "\u2713",
    false: "\u2717",
    null: "\u2026"
};

/** The stages that a sent command has reached: {stage: {good, text, t_ns}}; "failed" and "unknown" also stand under
 *  "completed". */
export function ladder(row) {
    const stages = {};
    for (const stage of row.stages) stages[stage.stage] = stage;
    if (stages.failed) stages.completed = stages.failed;
    stages.completed ??= stages.unknown;
    return stages;
}

/** The tick of a stage: its sign and class. */
export function tick(row, stage) {
    const reached = ladder(row)[stage];
    if (!reached) return ["\u00b7", "tick not"];
    if (reached.stage === "unknown") return ["?", "tick open"];
    if (stage === "progress" && reached.good !== false)
        return [reached.percent != null ? `${reached.percent} %` : reached.text || "\u2713", "tick good"];
    const name = {false: "bad", null: "open"}[reached.good] ?? "good";
    return [TICKS[reached.good] ?? "\u2713", `tick ${name}`];
}

/** "open", "good" or "bad", and why. until: the stage that must be reached. */
export function outcome(row, until = "completed") {
    const failed = row.stages.find((stage) => stage.good === false);
    if (failed) return {state: "bad", text: failed.text || failed.stage};
    const far = Math.max(-1, ...row.stages.map((stage) => STAGES.indexOf(stage.stage)));
    const done = far >= STAGES.indexOf(until), unknown = row.stages.find((stage) => stage.stage === "unknown");
    if (unknown && !done) return {state: "bad", text: unknown.text};
    return {state: done ? "good" : "open", text: row.stages.at(-1)?.stage ?? ""};
}

/** The stages that some of these sent commands have reached, in words. */
export const reached = (rows) => STAGES.filter((stage) => rows.some((row) => ladder(row)[stage]))
    .map((stage) => `\u2713 ${stage}`).join("  ");

/** Sent commands that are followed until the page closes or follows others. changed(rows, outcome): "bad" if one of
 *  them is, "good" if all are */
export class Followed {
    constructor({live, craft}, changed) {
        Object.assign(this, {live, craft, changed, rows: new Map()});
        this.close = live.on("sent", (row) => row.craft === craft && this.take(row));
    }

    async begin(ids) {
        this.rows = new Map(ids.map((id) => [id, null]));
        for (const row of ids.length ? await this.live.rows(this.craft, "sent", "sent") : []) this.take(row);
    }

    take(row) {
        if (!this.rows.has(row.id)) return;
        this.rows.set(row.id, row);
        const rows = [...this.rows.values()].filter(Boolean), all = rows.map((sent) => outcome(sent));
        const done = all.length === this.rows.size && all.every(({state}) => state === "good");
        this.changed(rows, all.find(({state}) => state === "bad") ?? {state: done ? "good" : "open"});
    }
}

/** "K = 3, mode = SAFE" */
export const inWords = (values) =>
    Object.entries(values ?? {}).map(([name, value]) => `${name} = ${textOf(value)}`).join(", ");

/** The group that a command is shown in. */
export const groupOf = ({name, group}) =>
    (name.includes(".") ? name.slice(0, name.lastIndexOf(".")) : group || "commands");

/** Commands in groups for a search: [{group} | {form}], all words must be in the name or description. */
export function listed(forms, search) {
    const fits = matcher(search), groups = new Map();
    for (const form of forms.filter(({name, description}) => fits(`${name} ${description}`))) {
        const group = groupOf(form);
        groups.set(group, [...(groups.get(group) ?? []), form]);
    }
    return [...groups].sort(([a], [b]) => (a < b ? -1 : 1))
        .flatMap(([group, inside]) => [{group, n: inside.length}, ...inside.map((form) => ({form}))]);
}
