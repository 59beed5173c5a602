// SPDX-License-Identifier: Apache-2.0
// File transfers to and from the spacecraft, by CFDP.
import {of} from "../api.js";
import {attempt, h} from "../dom.js";
import {clock} from "../format.js";
import {button, fillRows, form, has, panel, plain, row} from "../parts.js";
import {size} from "../transfer.js";

export const title = "Files", key = "f", role = "command";

const SIGNS = {completed: "\u2713 ", failed: "\u2717 "}, CLASSES = {completed: "good", failed: "problem"};
const ACTIONS = {active: ["suspend", "cancel"], suspended: ["resume", "cancel"]};
const capital = (word) => word[0].toUpperCase() + word.slice(1);

export async function open(context) {
    const {root, api, live, time, keys, craft, on, notify} = context, may = context.can("command");
    if (!has(context, "files", "no Files, so no file goes up or down")) return;
    const transfers = new Map(), aboard = h("tbody"), arrived = h("tbody"), going = h("tbody");
    const file = h("input", {type: "file", "aria-label": "a file of this computer",
        onchange: () => { name.value ||= file.files[0]?.name ?? ""; }});
    const name = h("input", {placeholder: "its name on board", "aria-label": "its name on board", maxLength: 127});
    const up = panel("to the spacecraft", "To the spacecraft", form(() => upload(), {class: "row"}, file, name,
        h("button", {class: "primary", disabled: !may}, "Send the file")));
    const wanted = h("input", {placeholder: "name on board", "aria-label": "name of a file on board", maxLength: 127});
    const down = panel("from the spacecraft", "From the spacecraft", form(() => fetchFile(wanted.value.trim()),
        {class: "row"}, wanted, h("button", {disabled: !may}, "Fetch"),
        button("List what is on board", () => directory(), {type: "button", disabled: !may, title: "d"})),
        plain(["on board", ""], aboard));
    const received = panel("received files", "Received", plain(["file", "size", "time (UTC)"], arrived));
    const way = panel("transfers", "Transfers", plain(["", "file", "progress", "", "state", "time", ""], going));
    way.classList.add("wide");

    const upload = () => attempt(up, async () => {
        const upload = file.files[0];
        if (!upload) throw new Error("Choose a file first.");
        const to = name.value.trim() || upload.name;
        await api.request("POST", `${of(craft, "files")}?${new URLSearchParams({name: to})}`, upload);
        file.value = name.value = "";
        notify(`${to} is on its way`);
        await load();
    });
    const fetchFile = (wish) => attempt(down, async () => {
        if (!wish) throw new Error("Give the name of a file on board.");
        await api.post(of(craft, "fetch"), {name: wish});
        await load();
    });
    const directory = () => attempt(down, async () => {
        fillRows(aboard, [], null, "requested \u2026");
        try {
            const {names} = await api.post(of(craft, "directory"));
            fillRows(aboard, names, (name) => row({}, ["grow", name], !name.endsWith("/") &&
                button("Fetch", () => fetchFile(name), {class: "small", disabled: !may})),
                "There are no files on board.");
        } catch (error) {
            aboard.replaceChildren();
            throw error;
        }
    });
    const act = (id, action) => attempt(way, () => api.post(of(craft, "transfers", id), {action}));

    const draw = () => fillRows(going, [...transfers.values()].sort((a, b) => Number(b.id) - Number(a.id)),
        ({id, up, name, state, done, size: whole, text, t_ns}) => row({},
            h("td", {title: up ? "to the spacecraft" : "from the spacecraft"}, up ? "\u2191 up" : "\u2193 down"), name,
            h("progress", {max: 1, value: state === "completed" ? 1 : whole ? done / whole : 0,
                "aria-label": `progress of ${name}`}),
            ["num soft", size(done) + (whole ? ` of ${size(whole)}` : "")],
            [CLASSES[state], `${SIGNS[state] ?? ""}${state}${text ? `: ${text}` : ""}`], ["soft", time.brief(t_ns)],
            ["acts", may && ACTIONS[state]?.map((action) =>
                button(capital(action), () => act(id, action), {class: "small"}))]),
        "No file was sent or fetched yet.", 7);
    async function load() {
        for (const transfer of await live.rows(craft, "transfers", "transfer")) transfers.set(transfer.id, transfer);
        draw();
        fillRows(arrived, await api.get(of(craft, "files")), ({name, size: bytes, t_ns}) => row({},
            h("a", {href: of(craft, "files", name), download: name}, name), ["num soft", size(bytes)],
            ["soft", t_ns ? clock(t_ns, true, 0) : ""]), "Nothing was received yet.");
    }
    on("transfer", (transfer) => {
        const ended = transfer.state === "completed" && transfers.get(transfer.id)?.state !== "completed";
        transfers.set(transfer.id, transfer);
        draw();
        if (ended) load().catch(() => {});
    });
    root.append(h("div", {class: "tiles"}, h("div", {class: "tower"}, up, down), received, way));
    keys.add("u", "choose a file to send", () => file.click());
    keys.add("d", "list what is on board", directory);
    keys.add("f", "fetch a file", () => wanted.focus());
    fillRows(aboard, [], null, "Not listed yet.");
    draw();
    await attempt(root, load);
}
