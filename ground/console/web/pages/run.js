// SPDX-License-Identifier: Apache-2.0
// Run control of a craft that the server flies: pause, step, speed, and changes of the world that are faults.
import {of} from "../api.js";
import {attempt, dress, h, put} from "../dom.js";
import {bare, clock, matcher} from "../format.js";
import {button, choice, form, has, panel, plain, row, search} from "../parts.js";

export const title = "Simulation", key = "r", role = "command";

const MOST = 300;       // rows
const STATES = {running: "\u25b6 running", paused: "\u23f8 paused", ended: "\u25a0 ended"};
const SPEEDS = [0.1, 1, 2, 5, 10, 50, 100, 1000, 0];
const words = (speed) => (speed ? `${speed} \u00d7 real time` : "as fast as possible");

/** Parse the value of a fault: a number, list, true or false; else the text itself. */
export function valueOf(text) {
    try {
        return JSON.parse(text);
    } catch { return text.trim(); }
}

export async function open(context) {
    const {root, api, live, keys, craft, on, every} = context, may = context.can("command");
    if (!has(context, "run", "no run control, as this server does not fly it")) return;
    let run = null;
    const state = h("strong", {class: "state"}), t = h("span", {class: "big"}), real = h("span", {class: "soft"});
    const number = (label, width, about) =>
        h("input", {type: "number", min: 0, step: "any", "aria-label": label, style: `width: ${width}em`, ...about});
    const seconds = number("seconds of a step", 6, {value: "1"}), instant = number("instant to go back to", 8);
    const speed = choice("speed", [], (value) => post({action: "go", speed: Number(value)}), {disabled: !may});
    const pause = button("", () => post({action: run?.state === "running" ? "pause" : "go"}),
        {disabled: !may, title: "space"});
    const step = button("Step", () => post({action: "step", seconds: Number(seconds.value)}),
        {disabled: !may, title: "s"});
    const back = button("Back to", () => instant.value && post({action: "rewind", seconds: Number(instant.value)}),
        {disabled: !may, title: "ends this run; another one goes on from that instant"});
    const past = h("div", {class: "row", hidden: true}, back, instant, h("span", {class: "soft"}, "s of the run"));
    const control = panel("run control", "Run", h("div", {class: "row"}, state, t, real),
        h("div", {class: "row"}, pause, step, seconds, h("span", {class: "soft"}, "s"), h("span", {class: "grow"}),
            h("label", {class: "soft"}, "speed ", speed)),
        past);
    const wanted = search("search what may be changed", "Search what may be changed", () => faults());
    const body = h("tbody"), done = h("ol", {class: "done"});
    const path = h("output", {class: "mono grow"}),
          value = h("input", {"aria-label": "value", placeholder: "value, as in 0.03 or [0, 1, 0]"});
    const inject = panel("faults", "Inject a fault",
        h("p", {class: "soft"}, "Choose a parameter of the world, and give it another value at this instant."), wanted,
        h("div", {class: "frame"}, plain(["parameter", "value", "unit", "meaning"].map((name) => [name, name]), body)),
        form(() => fault(), {class: "row"}, path, value, h("button", {class: "danger", disabled: !may}, "Inject")),
        done);
    inject.classList.add("faults");

    const post = (change) => attempt(control, async () => update(await api.post(of(craft, "run"), change)));
    async function fault() {
        await attempt(inject, async () => {
            if (!path.value) throw new Error("Choose a parameter first.");
            const given = valueOf(value.value), at = run?.t_ns;
            if (given === "") throw new Error("Give a value.");
            update(await api.post(of(craft, "run"), {fault: {path: path.value, value: given}}));
            done.prepend(h("li", {}, `${clock(at, false, 1)} ${path.value} = ${JSON.stringify(given)}`));
        });
    }
    function update(change) {
        const first = !run?.faults && change.faults;
        run = {...run, ...change};
        put(state, STATES[run.state] ?? run.state);
        dress(state, `state ${run.state}`);
        put(t, clock(run.t_ns, false, 1));
        put(real, [run.real_speed ? `${Number(run.real_speed).toPrecision(3)} \u00d7` : "", run.text].filter(Boolean)
            .join(", "));
        put(pause, run.state === "running" ? "Pause" : "Go");
        past.hidden = !run.rewinds;
        pause.disabled = step.disabled = !may || run.state === "ended";
        for (const factor of [...SPEEDS, run.speed]) speed.learn(String(factor), words(factor));
        if (document.activeElement !== speed) speed.value = String(run.speed);
        if (first || change.faults) faults();
    }
    function faults() {
        const fits = matcher(wanted.value);
        const matches = (run?.faults ?? []).filter(({path, meaning}) => fits(`${path} ${meaning}`));
        body.replaceChildren(...matches.slice(0, MOST).map((fault) => {
            const pick = () => {
                path.value = fault.path;
                value.value = JSON.stringify(fault.example ?? fault.value);
                value.focus();
                value.select();
            };
            return row({tabIndex: 0, title: fault.meaning, onclick: pick,
                onkeydown: (event) => event.key === "Enter" && (event.preventDefault(), pick())},
                ["mono", fault.path], ["mono", JSON.stringify(fault.value)], ["soft unit", bare(fault.unit)],
                ["soft meaning", fault.meaning]);
        }));
        if (matches.length > MOST) body.append(h("tr", {},
            h("td", {class: "soft", colSpan: 4}, `and ${matches.length - MOST} more: search`)));
    }
    root.append(h("div", {class: "tiles run"}, control, inject));
    const load = () => attempt(root, async () => update(await api.get(of(craft, "run"))));
    on("run", update);
    every(1000, () => {
        const now = live.craft(craft);
        if (run && now?.t_ns) update({t_ns: now.t_ns});
    });
    keys.add(" ", "pause, or go on", () => pause.click());
    keys.add("s", "a step", () => step.click());
    keys.add("+", "faster", () => faster(1));
    keys.add("-", "slower", () => faster(-1));
    function faster(by) {
        speed.selectedIndex = Math.max(0, Math.min(speed.options.length - 1, speed.selectedIndex + by));
        speed.dispatchEvent(new Event("change"));
    }
    keys.add("F", "inject a fault", () => wanted.focus());
    await load();
}
