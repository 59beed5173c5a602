// SPDX-License-Identifier: Apache-2.0
// The operators' log: the actions of each user, and which were refused.
import {dress, put, stamp} from "../dom.js";
import {clock} from "../format.js";
import {List} from "../list.js";
import {head} from "../parts.js";

export const title = "Log", key = "g";

export async function open(context) {
    const list = new List(context, {
        path: "/api/log", searching: ["search the log", "search users, actions  ( / )", {size: 34}],
        text: ({user, craft, action, text}) => `${user} ${craft ?? ""} ${action} ${text}`,
        below: ({craft, action, text}) => [craft, action, text].filter(Boolean).join(" "),
        table: {
            label: "operators' log",
            empty: "No action yet",
            columns: [
                {title: "Time (UTC)", width: "12rem", class: "tab", narrow: "5.6rem"},
                {title: "User", width: "8rem", narrow: "4rem"}, {title: "Spacecraft", width: "8rem", narrow: ""},
                {title: "Action", width: "minmax(10rem, 2fr)", narrow: "minmax(0, 2fr)"},
                {title: "Details", width: "minmax(8rem, 3fr)", class: "mono", narrow: ""},
                {title: "Result", width: "5rem", narrow: "1.2rem", class: "shape"}
            ],
            fill: (cells, entry) => {
                stamp(cells[0], clock(entry.time_ns, true));
                [entry.user ?? "no user", entry.craft ?? "", entry.action, entry.text,
                    entry.good === false ? "\u25a0 refused" : ""].forEach((text, k) => put(cells[k + 1], text));
                dress(cells[5], `td shape ${entry.good === false ? "c4" : ""}`);
            },
        },
    });
    list.line.classList.add("mono");
    context.root.append(head("Operators\u2019 log", list.search), list.element, list.line);
    context.onAny("log", (entry) => list.add([entry]));
    await list.load();
    return () => list.close();
}
