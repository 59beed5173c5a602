// SPDX-License-Identifier: Apache-2.0
// Events on board and on the ground, filtered by severity, source and words.
import {of} from "../api.js";
import {CONCERNS, concern, h, put, stamp} from "../dom.js";
import {List} from "../list.js";

export const title = "Events", key = "e";

const level = (event) => Math.max(0, CONCERNS.indexOf(event.severity));

export async function open(context) {
    const {root, time, craft, keys} = context;
    let [least, source, word] = [0, "", context.selection];
    const sources = new Set();
    const severity = h("select", {
        "aria-label": "least severity",
        onchange: () => {
            least = Number(severity.value);
            list.filter();
        }
    },
        ["everything", ...CONCERNS.slice(1).map((severity) => `${severity} and worse`)].map(
            (text, k) => h("option", {value: k}, text)));
    const from = h("select", {"aria-label": "source", onchange: () => { source = from.value; list.filter(); }},
        h("option", {value: ""}, "all sources"));
    const search = h("input", {
        type: "search",
        placeholder: "search  ( / )",
        value: word,
        "aria-label": "search events",
        oninput: () => {
            word = search.value;
            context.select(word);
            list.filter();
        }
    });
    const list = new List(context, {
        path: of(craft, "events"),
        fits: (event) => level(event) >= least && (!source || event.source === source) &&
            (!word || `${event.source} ${event.text}`.toLowerCase().includes(word.toLowerCase())),
        table: {
            label: "events", empty: "No event fits",
            columns: [{title: "Time", width: "12rem", class: "tab", narrow: "5.6rem"},
                      {title: "Severity", width: "6.5rem", narrow: "1.2rem", class: "shape"},
                      {title: "Source", width: "minmax(7rem, 1fr)", narrow: "minmax(3rem, 1fr)"},
                      {title: "Text", width: "minmax(12rem, 4fr)", narrow: "minmax(0, 3fr)"}],
            fill: (cells, event) => {
                stamp(cells[0], time.text(event.t_ns));
                concern(level(event), cells[1].firstChild ?? cells[1].appendChild(h("span")));
                if (!level(event)) put(cells[1].firstChild, event.severity);
                put(cells[2], event.source);
                put(cells[3], event.text);
                if (event.source && !sources.has(event.source)) {
                    sources.add(event.source);
                    from.append(h("option", {value: event.source}, event.source));
                }
            },
            moved: (event) => put(whole, `${event.source}: ${event.text}`),
        },
    });
    const whole = h("p", {class: "whole"});
    root.append(h("div", {class: "head"}, h("h1", {}, title), severity, from, search), list.element, whole);
    keys.add("w", "only warnings and worse", () => {
        severity.value = least === 2 ? "0" : "2";
        severity.dispatchEvent(new Event("change"));
    });
    context.on("event", (event) => event.craft === craft && list.add([event]));
    await list.load();
    return () => list.close();
}
