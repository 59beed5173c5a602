// SPDX-License-Identifier: Apache-2.0
// Commands: searched in the database, filled in, shown as bytes, sent, and followed by their verifiers.
import {of} from "../api.js";
import {attempt, dress, h, hint, put, stamp} from "../dom.js";
import {
    Form, bytesOf, groupOf, inWords, ladder, listed, outcome, send, stagesOf, tick, verifierOf
} from "../forms.js";
import {answerLine, button, form as formOf, hazard, search} from "../parts.js";
import {stackOf} from "../stack.js";
import {Table} from "../table.js";

const WAIT = 150;  // [ms] from the last key to the request for the bytes

export const title = "Commands", key = "c", role = "command";

export async function open(context) {
    const {root, api, time, keys, craft, selection, select, can} = context;
    let forms = await api.get(of(craft, "commands")).catch(() => []), rows = [], form = null, timer = 0, request = null;

    const wanted = search("search commands", "Search commands", () => find(), {onkeydown: (event) => {
        if (event.key !== "ArrowDown" && event.key !== "Enter") return;
        event.preventDefault();
        list.scroll.focus();
        const first = rows.findIndex((row) => row.form);
        if (first >= 0) list.go(first);
        if (event.key === "Enter") focusForm();
    }});
    const list = new Table({
        label: "commands",
        columns: [{title: "command"}],
        empty: "No command fits",
        fill([cell], k, element) {
            const {form: about, group, n} = rows[k];
            element.classList.toggle("group", !about);
            const inside = about && groupOf(about), within = about?.name.startsWith(inside) ? inside.length : 0;
            put(cell, about ? about.name.slice(within).replace(/^[./]/, "") + (about.hazardous ? " \u26a0" : "") :
                `${group} (${n})`);
            hint(cell, about ? `${about.name}\n${about.description}` : group);
        },
        moved: (k) => rows[k].form && show(rows[k].form),
        choose: (_, event) => event.key === "Enter" && focusForm(),
    });
    const find = () => {
        rows = listed(forms, wanted.value);
        list.at = rows.findIndex((row) => row.form && row.form === form?.form);
        list.set(rows.length);
    };
    const focusForm = () =>
        (middle.querySelector("input, select, textarea") ?? middle.querySelector("button.primary"))?.focus();

    // --- the form ---
    const middle = h("section", {class: "panel command", "aria-label": "the command"},
        h("p", {class: "none soft"}, "Choose a command."));
    const preview = h("div", {class: "preview"});
    const answer = answerLine();
    function show(about, values = {}) {
        if (about === form?.form && !Object.keys(values).length) return;
        select(about.name);
        form = new Form(about, values, () => later());
        const here = h("button", {class: "primary", type: "submit", disabled: !can("command")}, "Send");
        middle.replaceChildren(formOf(() => transmit(here), {},
            h("header", {}, h("h2", {}, about.name), about.description && h("p", {class: "soft"}, about.description),
                hazard(about), about.constraints.map((text) => h("p", {class: "soft"}, "leaves only if ", text)),
                about.verifiers.map((verifier) =>
                    h("p", {class: verifier.problem ? "problem" : "soft"}, verifierOf(verifier)))),
            form.element,
            h("div", {class: "row send"}, here, button("Add to the stack", () => stack(), {type: "button"}), answer),
            h("div", {class: "encoded"}, h("h3", {}, "Bytes"), preview)));
        answer.say("");
        later(0);
    }
    function later(wait = WAIT) {
        clearTimeout(timer);
        timer = setTimeout(refresh, wait);
    }
    async function refresh() {
        request?.abort();
        const now = form, values = form.values(false);
        preview.classList.toggle("old", values === null);
        if (values === null) {
            if (!preview.firstChild)
                preview.append(h("p", {class: "soft"}, "They are shown when all arguments are given."));
            return;
        }
        request = new AbortController();
        try {
            const bytes = await (await api.request("POST", of(craft, "preview"),
                {name: now.form.name, arguments: values}, {signal: request.signal})).json();
            if (now === form) preview.replaceChildren(bytesOf(bytes));
        } catch (error) {
            if (error.name === "AbortError" || now !== form) return;
            const beside = form.refused(error);
            preview.replaceChildren(beside ? h("p", {class: "soft"}, "They are shown when all arguments are right.") :
                                             h("p", {class: "problem"}, error.message));
        }
    }
    async function transmit(here) {
        const now = form, values = form.values();
        if (!values) return;
        here.disabled = true;
        answer.say("");
        try {
            answer.say(await send(api, craft, now.form.name, values) === null ? "Not sent." : "Sent.");
        } catch (error) {
            if (!now.refused(error, true)) answer.say(error.message, true);
        } finally { here.disabled = false; }
    }
    function stack() {
        const values = form.values();
        if (!values) return;
        stackOf(craft).add({command: form.form.name, arguments: values});
        answer.say("It is the last of the stack.");
    }

    // --- sent commands ---
    const sent = new Sent(context, stagesOf(forms), (row) => details(row)), detail = h("div", {class: "detail"});
    function details(row) {
        const again = forms.find((form) => form.name === row.name);
        detail.replaceChildren(
            h("div", {class: "row"}, h("strong", {}, row.name), h("span", {class: "grow soft"}, inWords(row.arguments)),
                again && button("Fill in again", () => {
                    show(again, row.arguments);
                    focusForm();
                })),
            h("ol", {class: "ladder"},
                row.stages.map((stage) => h("li", {class: {false: "bad", null: "soft"}[stage.good] ?? "good"},
                    [time.text(stage.t_ns), stage.stage].join(" ") + (stage.text ? `: ${stage.text}` : "")))),
            h("code", {class: "soft wrap"}, row.hex));
    }
    root.append(h("section", {class: "panel finder"}, wanted, list.element), middle,
        h("section", {class: "panel sent", "aria-label": "sent commands"}, h("h3", {}, "Sent"), sent.table.element,
            detail));
    keys.add("/", "search a command", () => wanted.focus());
    keys.add("h", "the commands that were sent", () => sent.table.scroll.focus());
    await attempt(root, async () => {
        if (!forms.length) forms = await api.get(of(craft, "commands"));
        find();
        const chosen = forms.find((form) => form.name === selection);
        if (chosen) show(chosen);
        list.go(rows.findIndex((row) => row.form && row.form === chosen), true);
        await sent.load();
    });
    return () => {
        clearTimeout(timer);
        request?.abort();
        list.close();
        sent.table.close();
    };
}

/** The table of sent commands, newest first, with a tick for each verifier. chosen(row): the cursor stands on it */
class Sent {
    constructor({live, craft, time, on}, stages, chosen) {
        Object.assign(this, {live, craft, time, rows: [], stages, chosen, shown: null});
        this.table = new Table({
            label: "sent commands",
            empty: "No command was sent yet",
            columns: [
                {title: "time", width: time.utc ? "10.5em" : "7.5em", narrow: "5.6rem"},
                {title: "command", width: "minmax(10em, 3fr)", narrow: "minmax(0, 1fr)"},
                {title: "arguments", width: "minmax(6em, 2fr)", narrow: ""}, ...stages.map((title) => ({
                    title: title === "progress" ? "%" : title,
                    width: title === "progress" ? "4em" : "5.4em",
                    narrow: "1.2rem",
                    class: "center"
                })),
                {title: "", width: "minmax(6em, 3fr)", narrow: ""}, {title: "by", width: "5.5em", narrow: ""}
            ],
            fill: (cells, k) => this.fill(cells, this.rows[k]),
            moved: (k) => this.show(this.rows[k]),
        });
        on("sent", (row) => this.update(row));
    }

    async load() {
        for (const row of await this.live.rows(this.craft, "sent", "sent")) this.update(row, false);
        this.table.set(this.rows.length);
        this.table.draw();
    }

    update(row, draw = true) {
        const at = this.rows.findIndex((other) => other.id === row.id);
        if (at >= 0) this.rows[at] = row;
        else {
            const place = this.rows.findIndex((other) => Number(other.id) < Number(row.id));
            this.rows.splice(place < 0 ? this.rows.length : place, 0, row);
            if (place === 0 && draw) this.table.shift(1);
        }
        if (this.shown === row.id) this.chosen(row);
        if (draw) this.table.set(this.rows.length);
    }

    show(row) {
        this.shown = row.id;
        this.chosen(row);
    }

    fill(cells, row) {
        const [time, name, values, ...rest] = cells, by = rest.pop(), why = rest.pop();
        stamp(time, this.time.brief(row.t_ns));
        put(name, row.name);
        put(values, inWords(row.arguments));
        this.stages.forEach((stage, i) => {
            const [sign, kind] = tick(row, stage), reached = ladder(row)[stage];
            dress(rest[i], `td center ${kind}`);
            put(rest[i], sign);
            rest[i].setAttribute(
                "aria-label", reached ? `${reached.stage}${reached.good === false ? ", no" : ""}` : `not ${stage}`);
        });
        const {state, text} = outcome(row);
        put(why, state === "bad" ? text : "");
        dress(why, `td aside ${state === "bad" ? "problem" : ""}`);
        put(by, row.user);
    }
}
