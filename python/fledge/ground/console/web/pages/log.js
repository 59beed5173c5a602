// SPDX-License-Identifier: Apache-2.0
// The operators' log: the actions of each user, and which were refused.
import {dress, h, put, stamp} from "../dom.js";
import {clock} from "../format.js";
import {List} from "../list.js";

export const title = "Log", key = "g";

export async function open(context) {
    const {root} = context;
    let word = context.selection;
    const search = h("input", {type: "search", placeholder: "search users, actions  ( / )", value: word, size: 34,
                               "aria-label": "search the log", oninput: () => {
        word = search.value;
        context.select(word);
        list.filter();
    }});
    const whole = h("p", {class: "whole mono"});
    const list = new List(context, {
        path: "/api/log",
        fits: ({user, craft, action, text}) =>
            `${user} ${craft ?? ""} ${action} ${text}`.toLowerCase().includes(word.toLowerCase()),
        table: {
            label: "operators' log",
            empty: "Nobody has done anything",
            columns: [
                {title: "Time (UTC)", width: "12rem", class: "tab", narrow: "5.6rem"},
                {title: "User", width: "8rem", narrow: "4rem"}, {title: "Spacecraft", width: "8rem", narrow: ""},
                {title: "Action", width: "minmax(10rem, 2fr)", narrow: "minmax(0, 2fr)"},
                {title: "Details", width: "minmax(8rem, 3fr)", class: "mono", narrow: ""},
                {title: "Result", width: "5rem", narrow: "1.2rem", class: "shape"}
            ],
            fill: (cells, entry) => {
                stamp(cells[0], clock(entry.time_ns, true));
                put(cells[1], entry.user ?? "nobody");
                put(cells[2], entry.craft ?? "");
                put(cells[3], entry.action);
                put(cells[4], entry.text);
                put(cells[5], entry.good === false ? "\u25a0 refused" : "");
                dress(cells[5], `td shape ${entry.good === false ? "c4" : ""}`);
            },
            moved: (entry) => put(whole, [entry.craft, entry.action, entry.text].filter(Boolean).join(" ")),
        },
    });
    root.append(h("div", {class: "head"}, h("h1", {}, "Operators\u2019 log"), search), list.element, whole);
    context.on("log", (entry) => list.add([entry]));
    await list.load();
    return () => list.close();
}
