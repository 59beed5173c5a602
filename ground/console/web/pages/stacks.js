// SPDX-License-Identifier: Apache-2.0
// Stacks of commands: edit them, save and load them as files, run them step by step or until a verifier fails.
import {of} from "../api.js";
import {attempt, h} from "../dom.js";
import {Form, inWords, outcome, stagesOf} from "../forms.js";
import {answerLine, button, choice, field, form as formOf, hazard, plain, prompt, row} from "../parts.js";
import {read, stackOf, written} from "../stack.js";
import {offer, opener} from "../transfer.js";

export const title = "Stacks", key = "s", role = "command";

const SIGNS = {good: "\u2713", bad: "\u2717", open: "\u2026"};
const LABELS = {good: "done", bad: "failed", open: "under way"};

export async function open({root, api, live, keys, craft, can, notify}) {
    const stack = stackOf(craft);
    let chosen = Math.min(stack.at, stack.steps.length - 1), forms = [];

    const body = h("tbody"), names = h("datalist", {id: "stack-commands"}), status = answerLine("answer grow");
    const next = button("Run the next", () => stack.run(api, live, false), {title: "e"});
    const all = button("Run until one fails", () => stack.run(api, live, true), {class: "primary", title: "r"});
    const stop = button("Stop", () => stack.stop(), {class: "danger", title: "x"});
    const again = button("From the top", () => stack.rewind());
    const file = opener("a saved stack", () => root, (text) => stack.replace(read(text)));
    const fresh = h("input", {placeholder: "Add a command", "aria-label": "add a command", class: "grow"});
    fresh.setAttribute("list", "stack-commands");
    const editor = h("section", {class: "panel editor", "aria-label": "the step"});

    function add() {
        const form = forms.find(({name}) => name === fresh.value.trim());
        if (!form) return notify(`There is no command "${fresh.value.trim()}"`, true);
        fresh.value = "";
        stack.add({command: form.name, arguments: {}}, chosen + 1);
        choose(chosen + 1);
        editor.querySelector("input, select, textarea")?.focus();
        return undefined;
    }

    function choose(k) {
        chosen = Math.max(-1, Math.min(stack.steps.length - 1, k));
        edit();
        draw();
        body.children[chosen]?.scrollIntoView({block: "nearest"});
    }

    /** Show the form of the chosen step. */
    function edit() {
        const step = stack.steps[chosen], about = forms.find((form) => form.name === step?.command);
        if (!step)
            return editor.replaceChildren(
                h("p", {class: "none soft"}, "Add a command, here or on the page of commands."));
        const form = about && new Form(about, step.arguments, () => {
            const values = form.values(false);
            if (values) Object.assign(step, {arguments: values});
            stack.changed();
        });
        const set = (name, value) => {
            step[name] = value;
            stack.changed();
        };
        return editor.replaceChildren(h("h2", {}, `${chosen + 1}. ${step.command}`),
            about ? h("p", {class: "soft"}, about.description) :
                    h("p", {class: "problem"}, `${craft} has no command "${step.command}"`),
            about && hazard(about), form?.element ?? "",
            h("div", {class: "row"},
                field("go on when it is", choice(null, stagesOf(forms).filter((stage) => stage !== "progress"),
                    (stage) => set("until", stage), {value: step.until})),
                field("then wait [s]", h("input", {type: "number", min: 0, step: "any", value: String(step.wait),
                    style: "width: 7em", oninput: ({target}) => target.validity.valid &&
                        set("wait", Number(target.value))})),
                field("note", h("input", {value: step.note, oninput: ({target}) => set("note", target.value)}),
                    "field grow")),
            h("div", {class: "row"}, button("Up", () => choose(stack.move(chosen, -1)), {title: "K"}),
                button("Down", () => choose(stack.move(chosen, 1)), {title: "J"}), button("Copy", () => {
                    stack.add(structuredClone(step), chosen + 1);
                    choose(chosen + 1);
                }), button("Remove", () => {
                    stack.remove(chosen);
                    choose(chosen);
                }), button("Begin here", () => stack.rewind(chosen))));
    }

    function draw() {
        body.replaceChildren(...stack.steps.map((step, k) => {
            const {state, text} = step.sent ? outcome(step.sent, step.until) : {}, here = k === stack.at;
            return row({class: k === chosen ? "at" : "", onclick: () => choose(k), "aria-current": here && "step"},
                h("td", {class: `tick ${state ?? ""}`, "aria-label": LABELS[state] ?? (here ? "next" : "to do")},
                    SIGNS[state] ?? (here ? "\u25b6" : "")),
                ["num soft", k + 1], step.command, ["soft", inWords(step.arguments)], ["soft", step.until],
                ["num soft", step.wait ? `${step.wait} s` : ""],
                [state === "bad" ? "problem" : "soft", ["bad", "open"].includes(state) ? text : step.note]);
        }));
        const left = stack.steps.length - stack.at, may = can("command");
        next.disabled = all.disabled = stack.running || left <= 0 || !may;
        stop.disabled = !stack.running;
        again.disabled = stack.running;
        status.say(stack.problem ? `Stopped: ${stack.problem}` :
            stack.running ? stack.waiting || `step ${stack.at + 1} of ${stack.steps.length}` :
            left <= 0 && stack.steps.length ? "All steps are done." : "", Boolean(stack.problem));
    }

    root.append(h("div", {class: "row"}, all, next, stop, again, status,
        button("Save", () => offer(written(craft, stack.steps), `${craft}-stack.json`)),
        button("Load", () => file.click()), file,
        button("Clear", async () => stack.steps.length &&
            await prompt("Clear the stack", "Its steps are removed.", [], "Clear") && stack.replace([]))),
        h("div", {class: "split stack"}, h("section", {class: "panel steps"},
            plain(["", "", "command", "arguments", "go on when", "wait", ""], body),
            formOf(add, {class: "row"}, fresh, names, h("button", {}, "Add"))), editor));
    keys.add("r", "run until one fails", () => all.click());
    keys.add("e", "run the next", () => next.click());
    keys.add("x", "stop", () => stop.click());
    keys.add("j", "next step", () => choose(chosen + 1));
    keys.add("k", "previous step", () => choose(Math.max(0, chosen - 1)));
    keys.add("J", "move the step down", () => choose(stack.move(chosen, 1)));
    keys.add("K", "move the step up", () => choose(stack.move(chosen, -1)));
    keys.add("a", "add a command", () => fresh.focus());
    const off = stack.on(() => {
        if (chosen >= stack.steps.length || (chosen < 0 && stack.steps.length)) choose(0);
        else draw();
    });
    draw();
    await attempt(root, async () => {
        forms = await api.get(of(craft, "commands"));
        names.append(...forms.map((form) => h("option", {value: form.name}, form.description)));
        edit();
    });
    return off;
}
