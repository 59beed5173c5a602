// SPDX-License-Identifier: Apache-2.0
// The archive's sessions with their gaps: to look at, to replay, to save as a table.
import {of} from "../api.js";
import {attempt, h, hint, put} from "../dom.js";
import {count, span, ticks} from "../format.js";
import {button, choice, head} from "../parts.js";
import {Table} from "../table.js";
import {offer} from "../transfer.js";

export const title = "Archive", key = "h";

export async function open(context) {
    const {root, api, live, time, craft, keys} = context;
    let sessions = [];
    const notes = h("div"), about = h("div", {class: "panel about"});
    const table = new Table({
        label: "sessions",
        empty: "Nothing is archived yet",
        columns: [
            {title: "Session", width: "4.5rem", class: "num", narrow: "3.4rem"},
            {title: "From", width: "minmax(9rem, 1fr)", class: "tab", narrow: "minmax(0, 1fr)"},
            {title: "To", width: "minmax(9rem, 1fr)", class: "tab", narrow: ""},
            {title: "Length", width: "5rem", class: "num", narrow: "3.6rem"},
            {title: "Packets", width: "6rem", class: "num", narrow: "5rem"},
            {title: "Gaps", width: "3.5rem", class: "num", narrow: ""},
            {title: "Ended", width: "minmax(7rem, 1fr)", narrow: ""}
        ],
        fill: (cells, row) => {
            const session = sessions[row];
            const texts = [
                session.session, time.text(session.first_ns, 0), time.text(session.last_ns, 0),
                span(Number(BigInt(session.last_ns) - BigInt(session.first_ns)) / 1e9), count(session.packets),
                session.gaps?.length ? `\u25b3 ${session.gaps.length}` : "", session.ended || "still open"
            ];
            texts.forEach((text, k) => put(cells[k], String(text)));
            hint(cells[6], session.ended ?? "");
        },
        moved: (row) => choose(sessions[row]),
    });

    const when = (label, t) => h("input", {"aria-label": label, value: time.text(t, 0), size: 20, spellcheck: false});
    const read = (field) => {
        const t = ticks(field.value, time.utc);
        if (t === null) throw new Error(`"${field.value}" is no time; it would be as ${time.text(time.at, 0)}`);
        return t;
    };

    function choose({session, first_ns, last_ns, gaps}) {
        const from = when("from", first_ns), to = when("to", last_ns);
        const speed = choice("speed", [1, 10, 100, 1000].map((x) => [x, `${x} times real time`]), () => {});
        const names =
            h("input", {"aria-label": "parameters", placeholder: "parameter, parameter", size: 40, spellcheck: false});
        const problem = h("div"), act = (text, action, about) => button(text, () => attempt(problem, action), about);
        about.replaceChildren(h("h2", {}, `Session ${session}`),
            h("div", {class: "row"}, from, h("span", {class: "soft"}, "to"), to, act("Look at it", () => {
                time.seek(read(from), session);
                context.go({page: "plots"});
            })),
            h("div", {class: "row"}, speed, act("Replay", async () => {
                const replay = await api.post(of(craft, "replay"),
                    {session, from_ns: read(from), to_ns: read(to), speed: Number(speed.value)});
                await live.load();
                context.go({page: "parameters", craft: replay.name, sel: ""});
            }, {class: "primary"})),
            h("div", {class: "row"}, names, act("Save as CSV", async () => {
                if (!names.value.trim()) throw new Error("Name at least one parameter");
                const about = {names: names.value.replace(/\s/g, ""), from_ns: read(from), to_ns: read(to), session};
                const text = await api.bytes(of(craft, "history"), {...about, points: 0, format: "csv"});
                offer(text, `${craft}.csv`, "text/csv");
            })),
            problem, h("h3", {}, "Gaps"),
            gaps?.length ? h("ul", {class: "lines"}, gaps.map(([a, b, why]) => h("li", {},
                h("time", {}, `${time.text(a, 0)} to ${time.text(b, 0)}`), h("span", {}, why)))) :
                h("p", {class: "soft"}, "none"));
    }

    async function load() {
        const list = await attempt(notes, () => api.get(of(craft, "sessions")));
        if (!list) return;
        sessions = [...list].reverse();
        table.set(sessions.length);
        if (table.at < 0 && sessions.length) table.go(0);
    }

    const replay = craft.includes("@replay") && button("End this replay", () => attempt(notes, async () => {
        await api.delete(of(craft, "replay"));
        await live.load();
        context.go({craft: craft.split("@")[0], sel: ""});
    }), {class: "danger"});
    root.append(head(title, replay), notes, table.element, about);
    if (replay) keys.add("x", "end this replay", () => replay.click());
    context.every(5000, load);
    await load();
    return () => table.close();
}
