// SPDX-License-Identifier: Apache-2.0
// Stacks of commands: edit them, save and load them as files, run them step by step or until a verifier fails.
import {of} from "../api.js";
import {attempt, dress, h, prompt, put} from "../dom.js";
import {Form, inWords, outcome, stagesOf} from "../forms.js";
import {read, stackOf, written} from "../stack.js";
import {offer} from "../transfer.js";

export const title = "Stacks", key = "s", role = "command";

export async function open({root, api, live, keys, craft, can, notify}) {
    const stack = stackOf(craft);
    let chosen = Math.min(stack.at, stack.steps.length - 1), forms = [];

    const body = h("tbody"), names = h("datalist", {id: "stack-commands"});
    const status = h("p", {class: "answer grow", role: "status"});
    const button = (text, action, about = {}) => h("button", {onclick: action, ...about}, text);
    const next = button("Run the next", () => stack.run(api, live, false), {title: "e"});
    const all = button("Run until one fails", () => stack.run(api, live, true), {class: "primary", title: "r"});
    const stop = button("Stop", () => stack.stop(), {class: "danger", title: "x"});
    const again = button("From the top", () => stack.rewind());
    const file = h("input", {
        type: "file",
        accept: ".json,application/json",
        hidden: true,
        "aria-label": "a saved stack",
        onchange: () => file.files[0] &&
            attempt(root,
                async () => {
                    const steps = read(await file.files[0].text());
                    file.value = "";
                    stack.replace(steps);
                })
    });
    const fresh = h("input", {placeholder: "Add a command", "aria-label": "add a command", class: "grow"});
    fresh.setAttribute("list", "stack-commands");
    const editor = h("section", {class: "panel editor", "aria-label": "the step"});

    async function add(event) {
        event.preventDefault();
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
            about?.hazardous && h("p", {class: "hazard"}, "\u26a0 hazardous: ", about.hazardous), form?.element ?? "",
            h("div", {class: "row"},
                h("label", {class: "field"}, h("span", {}, "go on when it is"),
                    h("select", {onchange: (event) => set("until", event.target.value)},
                        stagesOf(forms).filter((stage) => stage !== "progress")
                            .map((stage) => h("option", {selected: stage === step.until}, stage)))),
                h("label", {class: "field"}, h("span", {}, "then wait [s]"), h("input", {
                    type: "number",
                    min: 0,
                    step: "any",
                    value: String(step.wait),
                    style: "width: 7em",
                    oninput: (event) => event.target.validity.valid && set("wait", Number(event.target.value))
                })),
                h("label", {class: "field grow"}, h("span", {}, "note"),
                    h("input", {value: step.note, oninput: (event) => set("note", event.target.value)}))),
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
            const {state, text} = step.sent ? outcome(step.sent, step.until) : {};
            const sign = state === "good" ? "\u2713" :
                state === "bad"           ? "\u2717" :
                state                     ? "\u2026" :
                k === stack.at            ? "\u25b6" :
                                            "";
            return h("tr", {
                class: k === chosen ? "at" : "",
                onclick: () => choose(k),
                "aria-current": k === stack.at ? "step" : undefined
            },
                h("td", {
                    class: `tick ${state ?? ""}`,
                    "aria-label":
                        {good: "done", bad: "failed", open: "under way"}[state] ?? (k === stack.at ? "next" : "to do")
                },
                    sign),
                h("td", {class: "num soft"}, k + 1), h("td", {}, step.command),
                h("td", {class: "soft"}, inWords(step.arguments)), h("td", {class: "soft"}, step.until),
                h("td", {class: "num soft"}, step.wait ? `${step.wait} s` : ""),
                h("td", {class: state === "bad" ? "problem" : "soft"},
                    state === "bad"      ? text :
                        state === "open" ? text :
                                           step.note));
        }));
        const left = stack.steps.length - stack.at, may = can("command");
        next.disabled = all.disabled = stack.running || left <= 0 || !may;
        stop.disabled = !stack.running;
        again.disabled = stack.running;
        put(status,
            stack.problem ? `Stopped: ${stack.problem}` :
                stack.running ? stack.waiting || `step ${stack.at + 1} of ${stack.steps.length}` :
                left <= 0 && stack.steps.length ? "All steps are done." :
                                                  "");
        dress(status, `answer grow ${stack.problem ? "problem" : ""}`);
    }

    root.append(h("div", {class: "row"}, all, next, stop, again, status,
                    button("Save",
                        () => offer(new Blob([written(craft, stack.steps)], {type: "application/json"}),
                            `${craft}-stack.json`)),
                    button("Load", () => file.click()), file,
                    button("Clear",
                        async () => stack.steps.length &&
                            await prompt("Clear the stack", "Its steps are removed.", [], "Clear") &&
                            stack.replace([]))),
        h("div", {class: "split stack"},
            h("section", {class: "panel steps"},
                h("table", {class: "plain"},
                    h("thead", {}, h("tr", {}, ["", "", "command", "arguments", "go on when", "wait",
                        ""].map((title) => h("th", {}, title)))),
                    body),
                h("form", {class: "row", onsubmit: add}, fresh, names, h("button", {}, "Add"))),
            editor));
    keys.add("r", "run until one fails", () => all.click());
    keys.add("e", "run the next", () => next.click());
    keys.add("x", "stop", () => stop.click());
    keys.add("j", "next step", () => choose(chosen + 1));
    keys.add("k", "previous step", () => choose(Math.max(0, chosen - 1)));
    keys.add("J", "move the step down", () => choose(stack.move(chosen, 1)));
    keys.add("K", "move the step up", () => choose(stack.move(chosen, -1)));
    keys.add("a", "add a command", () => fresh.focus());
    const off = stack.on(() => {
        if (chosen >= stack.steps.length || (chosen < 0 && stack.steps.length))
            choose(0);
        else
            draw();
    });
    draw();
    await attempt(root, async () => {
        forms = await api.get(of(craft, "commands"));
        names.append(...forms.map((form) => h("option", {value: form.name}, form.description)));
        edit();
    });
    return off;
}
