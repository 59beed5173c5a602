// SPDX-License-Identifier: Apache-2.0
// Events on board and on the ground, filtered by severity, source and words.
import {of} from "../api.js";
import {put, stamp} from "../dom.js";
import {List} from "../list.js";
import {choice, head, putLevel} from "../parts.js";
import {CONCERNS, levelOf} from "../words.js";

export const title = "Events", key = "e";

export async function open(context) {
    const {root, time, craft, keys} = context;
    const severity = choice("least severity", ["everything", ...CONCERNS.slice(1).map((name) => `${name} and worse`)]
        .map((text, k) => [k, text]), () => list.filter());
    const source = choice("source", [["", "all sources"]], () => list.filter());
    const list = new List(context, {
        path: of(craft, "events"), kind: "event", searching: ["search events", "search  ( / )"],
        fits: (event) => levelOf(event) >= Number(severity.value) && (!source.value || event.source === source.value),
        text: (event) => `${event.source} ${event.text}`,
        below: (event) => `${event.source}: ${event.text}`,
        table: {
            label: "events", empty: "No event fits",
            columns: [{title: "Time", width: "12rem", class: "tab", narrow: "5.6rem"},
                      {title: "Severity", width: "6.5rem", narrow: "1.2rem", class: "shape"},
                      {title: "Source", width: "minmax(7rem, 1.4fr)", narrow: "minmax(3rem, 1fr)"},
                      {title: "Text", width: "minmax(12rem, 4fr)", narrow: "minmax(0, 3fr)"}],
            fill: (cells, event) => {
                stamp(cells[0], time.text(event.t_ns));
                putLevel(cells[1], levelOf(event), event.severity);
                put(cells[2], event.source);
                put(cells[3], event.text);
                if (event.source) source.learn(event.source);
            },
        },
    });
    root.append(head(title, severity, source, list.search), list.element, list.line);
    keys.add("w", "only warnings and worse", () => {
        severity.value = severity.value === "2" ? "0" : "2";
        list.filter();
    });
    await list.load();
    return () => list.close();
}
