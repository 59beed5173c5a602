// SPDX-License-Identifier: Apache-2.0
// Run control of a craft that the server flies: pause, step, speed, and changes of the world that are faults.
import {of} from "../api.js";
import {attempt, dress, h, has, put} from "../dom.js";
import {bare, clock} from "../format.js";

export const title = "Simulation", key = "r", role = "command";

const SPEEDS = [0.1, 1, 2, 5, 10, 50, 100, 1000, 0];
const words = (speed) => (speed ? `${speed} \u00d7 real time` : "as fast as possible");

/** Parse the value of a fault: a number, list, true or false; else the text itself. */
export function valueOf(text) {
    try {
        return JSON.parse(text);
    } catch { return text.trim(); }
}

export async function open({root, api, live, keys, craft, can, on, every}) {
    if (!has(live, craft, root, "run", "no run control, as this server does not fly it")) return undefined;
    const may = can("command");
    let run = null;
    const state = h("strong", {class: "state"}), t = h("span", {class: "big"}), real = h("span", {class: "soft"});
    const seconds = h("input",
        {type: "number", min: 0, step: "any", value: "1", "aria-label": "seconds of a step", style: "width: 6em"});
    const speed = h("select",
        {"aria-label": "speed", onchange: () => post({action: "go", speed: Number(speed.value)}), disabled: !may});
    const pause = h("button",
        {disabled: !may, onclick: () => post({action: run?.state === "running" ? "pause" : "go"}), title: "space"});
    const step = h("button",
        {disabled: !may, onclick: () => post({action: "step", seconds: Number(seconds.value)}), title: "s"}, "Step");
    const instant = h("input",
        {type: "number", min: 0, step: "any", "aria-label": "instant to go back to", style: "width: 8em"});
    const back = h("button", {
        disabled: !may,
        title: "ends this run; another one goes on from that instant",
        onclick: () => instant.value && post({action: "rewind", seconds: Number(instant.value)})
    },
        "Back to");
    const past = h("div", {class: "row", hidden: true}, back, instant, h("span", {class: "soft"}, "s of the run"));
    const control = h("section", {class: "panel", "aria-label": "run control"}, h("h3", {}, "Run"),
        h("div", {class: "row"}, state, t, real),
        h("div", {class: "row"}, pause, step, seconds, h("span", {class: "soft"}, "s"), h("span", {class: "grow"}),
            h("label", {class: "soft"}, "speed ", speed)),
        past);
    const search = h("input", {
        type: "search",
        placeholder: "Search what may be changed",
        "aria-label": "search what may be changed",
        oninput: () => faults()
    });
    const body = h("tbody"), done = h("ol", {class: "done"});
    const path = h("output", {class: "mono grow"}),
          value = h("input", {"aria-label": "value", placeholder: "value, as in 0.03 or [0, 1, 0]"});
    const inject = h("section", {class: "panel faults", "aria-label": "faults"}, h("h3", {}, "Inject a fault"),
        h("p", {class: "soft"}, "Choose a parameter of the world, and give it another value at this instant."), search,
        h("div", {class: "frame"},
            h("table", {class: "plain"},
                h("thead", {},
                    h("tr", {}, ["parameter", "value", "unit", "meaning"].map((name) => h("th", {class: name}, name)))),
                body)),
        h("form", {
            class: "row",
            onsubmit: (event) => {
                event.preventDefault();
                fault();
            }
        },
            path, value, h("button", {class: "danger", disabled: !may}, "Inject")),
        done);

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
        put(state, {running: "\u25b6 running", paused: "\u23f8 paused", ended: "\u25a0 ended"}[run.state] ?? run.state);
        dress(state, `state ${run.state}`);
        put(t, clock(run.t_ns, false, 1));
        put(real,
            [run.real_speed ? `${Number(run.real_speed).toPrecision(3)} \u00d7` : "", run.text].filter(Boolean).join(
                ", "));
        put(pause, run.state === "running" ? "Pause" : "Go");
        past.hidden = !run.rewinds;
        pause.disabled = step.disabled = !may || run.state === "ended";
        const all = [...new Set([...SPEEDS, run.speed])];
        if (speed.childElementCount !== all.length)
            speed.replaceChildren(...all.map((change) => h("option", {value: String(change)}, words(change))));
        if (document.activeElement !== speed) speed.value = String(run.speed);
        if (first || change.faults) faults();
    }
    function faults() {
        const wanted = search.value.toLowerCase().split(/\s+/), all = run?.faults ?? [];
        const matches = all.filter(({path, meaning}) =>
            wanted.every((word) => `${path} ${meaning}`.toLowerCase().includes(word)));
        body.replaceChildren(...matches.slice(0, 300).map((fault) => {
            const pick = () => {
                path.value = fault.path;
                value.value = JSON.stringify(fault.value);
                value.focus();
                value.select();
            };
            return h("tr", {
                tabIndex: 0,
                title: fault.meaning,
                onclick: pick,
                onkeydown: (event) => event.key === "Enter" && (event.preventDefault(), pick())
            },
                h("td", {class: "mono"}, fault.path), h("td", {class: "mono"}, JSON.stringify(fault.value)),
                h("td", {class: "soft unit"}, bare(fault.unit)), h("td", {class: "soft meaning"}, fault.meaning));
        }));
        if (matches.length > 300)
            body.append(h("tr", {}, h("td", {class: "soft", colSpan: 4}, `and ${matches.length - 300} more: search`)));
    }
    root.append(h("div", {class: "tiles run"}, control, inject));
    const load = () => attempt(root, async () => update(await api.get(of(craft, "run"))));
    on("run", (change) => change.craft === craft && update(change));
    every(1000, () => {
        const now = live.craft(craft);
        if (run && now?.t_ns) update({t_ns: now.t_ns});
    });
    keys.add(" ", "pause, or go on", () => pause.click());
    keys.add("s", "a step", () => step.click());
    keys.add("+", "faster", () => faster(1));
    keys.add("-", "slower", () => faster(-1));
    function faster(by) {
        const all = [...speed.options].map((option) => option.value);
        speed.selectedIndex = Math.max(0, Math.min(all.length - 1, speed.selectedIndex + by));
        speed.dispatchEvent(new Event("change"));
    }
    keys.add("F", "inject a fault", () => search.focus());
    await load();
    return undefined;
}
