// SPDX-License-Identifier: Apache-2.0
// File transfers to and from the spacecraft, by CFDP.
import {of} from "../api.js";
import {attempt, h, has} from "../dom.js";
import {clock} from "../format.js";
import {size} from "../transfer.js";

export const title = "Files", key = "f", role = "command";

export async function open({root, api, live, keys, craft, can, on, notify}) {
    if (!has(live, craft, root, "files", "no Files, so no file goes up or down")) return undefined;
    const utc = live.craft(craft)?.clock === "utc", transfers = new Map();
    const may = can("command");

    const file = h("input", {
        type: "file",
        "aria-label": "a file of this computer",
        onchange: () => {
            name.value ||= file.files[0]?.name ?? "";
        }
    });
    const name = h("input", {placeholder: "its name on board", "aria-label": "its name on board", maxLength: 127});
    const up = h("section", {class: "panel", "aria-label": "to the spacecraft"}, h("h3", {}, "To the spacecraft"),
        h("form", {
            class: "row",
            onsubmit: (event) => {
                event.preventDefault();
                upload();
            }
        },
            file, name, h("button", {class: "primary", disabled: !may}, "Send the file")));
    const wanted = h("input", {placeholder: "name on board", "aria-label": "name of a file on board", maxLength: 127});
    const aboard = h("tbody"), arrived = h("tbody"), going = h("tbody");
    const table = (heads, body) =>
        h("table", {class: "plain"}, h("thead", {}, h("tr", {}, heads.map((head) => h("th", {}, head)))), body);
    const down = h("section", {class: "panel", "aria-label": "from the spacecraft"}, h("h3", {}, "From the spacecraft"),
        h("form", {
            class: "row",
            onsubmit: (event) => {
                event.preventDefault();
                fetchFile(wanted.value.trim());
            }
        },
            wanted, h("button", {disabled: !may}, "Fetch"),
            h("button", {type: "button", disabled: !may, onclick: () => directory(), title: "d"},
                "List what is on board")),
        table(["on board", ""], aboard));
    const received = h("section", {class: "panel", "aria-label": "received files"}, h("h3", {}, "Received"),
        table(["file", "size", "time (UTC)"], arrived));
    const way = h("section", {class: "panel wide", "aria-label": "transfers"}, h("h3", {}, "Transfers"),
        table(["", "file", "progress", "", "state", "time", ""], going));

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
        aboard.replaceChildren(h("tr", {}, h("td", {class: "soft"}, "requested \u2026")));
        try {
            const {names} = await api.post(of(craft, "directory"));
            aboard.replaceChildren(...names.map(
                (name) => h("tr", {}, h("td", {class: "grow"}, name),
                    h("td", {},
                        !name.endsWith("/") &&
                            h("button", {class: "small", disabled: !may, onclick: () => fetchFile(name)}, "Fetch")))));
            if (!names.length) aboard.append(h("tr", {}, h("td", {class: "soft"}, "There are no files on board.")));
        } catch (error) {
            aboard.replaceChildren();
            throw error;
        }
    });
    const act = (id, action) => attempt(way, () => api.post(of(craft, "transfers", id), {action}));

    function draw() {
        going.replaceChildren(...[...transfers.values()].sort((a, b) => Number(b.id) - Number(a.id)).map((transfer) => {
            const open_ = transfer.state === "active" || transfer.state === "suspended",
                  share = transfer.size ? transfer.done / transfer.size : 0;
            return h("tr", {},
                h("td", {title: transfer.up ? "to the spacecraft" : "from the spacecraft"},
                    transfer.up ? "\u2191 up" : "\u2193 down"),
                h("td", {}, transfer.name), h("td", {}, h("progress", {
                    max: 1,
                    value: transfer.state === "completed" ? 1 : share,
                    "aria-label": `progress of ${transfer.name}`
                })),
                h("td", {class: "num soft"},
                    size(transfer.done) + (transfer.size ? ` of ${size(transfer.size)}` : "")),
                h("td", {class: transfer.state === "failed" ? "problem" :
                        transfer.state === "completed"      ? "good" :
                                                         ""},
                    `${{completed: "\u2713 ", failed: "\u2717 "}[transfer.state] ?? ""}${transfer.state}${
                        transfer.text ? `: ${transfer.text}` : ""}`),
                h("td", {class: "soft"}, clock(transfer.t_ns, utc, utc ? 0 : 1)),
                h("td", {class: "acts"}, open_ && may && [
                    transfer.state === "active" ?
                        h("button", {class: "small", onclick: () => act(transfer.id, "suspend")}, "Suspend") :
                        h("button", {class: "small", onclick: () => act(transfer.id, "resume")}, "Resume"),
                    h("button", {class: "small", onclick: () => act(transfer.id, "cancel")}, "Cancel")
                ]));
        }));
        if (!transfers.size)
            going.append(h("tr", {}, h("td", {class: "soft", colSpan: 7}, "No file was sent or fetched yet.")));
    }
    async function load() {
        for (const row of await live.rows(craft, "transfers", "transfer")) transfers.set(row.id, row);
        draw();
        const files = await api.get(of(craft, "files"));
        arrived.replaceChildren(
            ...files.map((file) => h("tr", {},
                             h("td", {}, h("a", {href: of(craft, "files", file.name), download: file.name}, file.name)),
                             h("td", {class: "num soft"}, size(file.size)),
                             h("td", {class: "soft"}, file.t_ns ? clock(file.t_ns, true, 0) : ""))));
        if (!files.length) arrived.append(h("tr", {}, h("td", {class: "soft"}, "Nothing was received yet.")));
    }
    on("transfer", (transfer) => {
        if (transfer.craft !== craft) return;
        const ended = transfer.state === "completed" && transfers.get(transfer.id)?.state !== "completed";
        transfers.set(transfer.id, transfer);
        draw();
        if (ended) load().catch(() => {});
    });
    root.append(h("div", {class: "tiles"}, h("div", {class: "tower"}, up, down), received, way));
    keys.add("u", "choose a file to send", () => file.click());
    keys.add("d", "list what is on board", directory);
    keys.add("f", "fetch a file", () => wanted.focus());
    aboard.append(h("tr", {}, h("td", {class: "soft"}, "Not listed yet.")));
    draw();
    await attempt(root, load);
    return undefined;
}
