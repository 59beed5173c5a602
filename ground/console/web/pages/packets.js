// SPDX-License-Identifier: Apache-2.0
// Packets: the bytes and the fields of each; for a packet that did not decode, the comparison that failed, and its bit.
import {of} from "../api.js";
import {attempt, dress, h, hint, put} from "../dom.js";
import {List} from "../list.js";
import {choice, head, toggle} from "../parts.js";
import {real} from "../store.js";
import {Table} from "../table.js";

export const title = "Packets", key = "k";

const WIDTH = 16;       // bytes in a line
const short = (path) => path?.split("/").at(-1);
const written = (value, single) =>
    (typeof value === "number" && !Number.isInteger(value) ? real(value, single) : String(value ?? ""));

export async function open(context) {
    const {root, api, time, craft, keys} = context;
    let rows = [], bytes = [], request = 0, undecoded = null;
    const bad = toggle("Not decoded", (pressed) => {
        undecoded = pressed ? 1 : null;
        load();
    });
    const kind = choice("container", [["", "all packets"]], () => load());
    const list = new List(context, {
        path: of(craft, "packets"),
        query: () => ({undecoded, container: kind.value}),
        table: {
            label: "packets", empty: "No packet is there",
            columns: [{title: "Time", width: "8.2rem", class: "tab"}, {title: "Container", width: "minmax(6rem, 1fr)"},
                      {title: "Bytes", width: "3.2rem", class: "num"}],
            fill: (cells, packet) => {
                put(cells[0], time.ofDay(packet.t_ns));
                hint(cells[0], time.text(packet.t_ns, 9));
                hint(cells[1], packet.container ?? packet.reason);
                put(cells[1], short(packet.container) ?? `\u25a0 ${packet.reason || "not decoded"}`);
                put(cells[2], String(packet.size));
                dress(cells[1], `td ${packet.container ? "" : "c4"}`);
                if (packet.container) kind.learn(packet.container, short(packet.container));
            },
            moved: (packet) => show(packet.id),
        },
    });

    // --- one packet ---
    let chosen = false;     // by the user; else the newest one is shown
    const name = h("h2", {}, "No packet yet"), tip = h("p", {class: "soft tip"}, "It will be shown here."),
          why = h("p", {class: "problem", hidden: true});
    const dump = h("div", {class: "hex", role: "img", "aria-label": "bytes of the packet"}),
          where = h("p", {class: "soft bits"}, "\u00a0");
    const fields = new Table({
        label: "fields",
        empty: "No field was decoded",
        columns: [
            {title: "Field", width: "minmax(8rem, 2fr)", narrow: "minmax(0, 2fr)"},
            {title: "Value", width: "minmax(5rem, 1.2fr)", class: "num mono"},
            {title: "Raw", width: "minmax(4rem, 1fr)", class: "num mono", narrow: ""},
            {title: "Bits", width: "5.5rem", class: "num"}
        ],
        fill: (cells, row, element) => {
            const field = rows[row], single = field.bits <= 32;
            put(cells[0], field.name);
            hint(cells[0], field.name);
            put(cells[1], field.status && field.status !== "good" ? field.status :
                written(field.value, single && field.value === field.raw));
            put(cells[2], written(field.raw, single));
            put(cells[3], `${field.bit} +${field.bits}`);
            element.onpointerenter = () => mark(row);
        },
        moved: (row) => mark(row),
    });

    /** Mark the bits of a field in the bytes. */
    function mark(row) {
        const field = rows[row];
        if (!field) return;
        const end = field.bit + field.bits;
        for (const [k, byte] of bytes.entries()) {
            const from = Math.max(0, field.bit - 8 * k), to = Math.min(8, end - 8 * k);
            const [begin, stop] = [12.5 * from, 12.5 * to].map((share) => `${share}%`);
            const style = from < to ? `linear-gradient(90deg, transparent ${begin}, var(--mark) ${begin} ${stop}, ` +
                `transparent ${stop})` : "";
            if (byte.style.backgroundImage !== style) byte.style.backgroundImage = style;
        }
        put(where, `${field.name}: bit ${field.bit} to ${end - 1}, from byte ${field.bit >> 3}, bit ${field.bit & 7}`);
    }

    function fill(packet, text) {
        put(name, text);
        put(tip, chosen ? "" : "The newest packet when this list was read. Choose another one in the list, or give " +
            "bytes in hex; point at a field or a byte to see its place.");
        fields.element.hidden = false;
        rows = (packet.rows ?? []).map(([name, raw, value, status, bit, bits]) =>
            ({name, raw, value, status, bit, bits}));
        const octets = (packet.hex ?? "").match(/../g) ?? [],
              wrong = packet.reason && Number.isInteger(packet.bit) ? packet.bit : null;
        const near = packet.nearest && !packet.container && !packet.reason?.includes(packet.nearest);
        why.hidden = !packet.reason;
        put(why, packet.reason ? [near && `Nearest: ${packet.nearest}. `, packet.reason,
            wrong !== null && `; at bit ${wrong}: byte ${wrong >> 3}, bit ${wrong & 7}`].filter(Boolean).join("") : "");
        bytes = octets.map((octet, k) => h("span", {class: wrong !== null && wrong >> 3 === k ? "wrong" : "",
            onpointerenter: () => {
                const row = rows.findIndex(({bit, bits}) => bit < 8 * k + 8 && bit + bits > 8 * k);
                if (row >= 0) fields.go(row);
            }}, octet));
        const lines = [];
        for (let k = 0; k < bytes.length; k += WIDTH)
            lines.push(h("div", {}, h("i", {}, k.toString(16).padStart(4, "0")), bytes.slice(k, k + WIDTH)));
        dump.replaceChildren(...lines);
        put(where, `${bytes.length} bytes, ${rows.length} fields`);
        fields.at = -1;
        fields.set(rows.length);
    }

    async function show(id, offered = false) {
        const turn = ++request;
        chosen ||= !offered;
        if (!offered) context.select(String(id));
        const packet = await attempt(list.problem, () => api.exact(of(craft, "packets", id)));
        if (packet && turn === request)
            fill(packet, `${short(packet.container) ?? "Not decoded"} \u00b7 ${time.text(packet.t_ns, 6)}`);
    }

    const typed = h("input", {placeholder: "or bytes in hex", "aria-label": "bytes in hex to decode",
        class: "mono grow", spellcheck: false, onchange: async () => {
            const hex = typed.value.replace(/0x|[\s,:]/g, "");
            if (!hex) return;
            request++;
            chosen = true;
            const packet = await attempt(list.problem, () => api.exact(of(craft, "inspect"), {hex}));
            if (packet) fill({...packet, hex}, short(packet.container) ?? "Not decoded");
        }});
    root.append(head(title, kind, bad, typed),
        h("div", {class: "split packets"}, list.element,
            h("div", {class: "panel inspect"}, name, tip, why, dump, where, fields.element)));
    keys.add("u", "only what did not decode", () => bad.click());
    keys.add("x", "decode bytes in hex", () => typed.focus());
    context.every(1000, async () => {
        if (!time.isLive || document.hidden) return;
        const newest = await list.request({});
        if (newest) list.add(newest);
        if (!bytes.length) await offer();
    });
    /** Show the newest packet of the list, until the user chooses one. */
    const offer = async () => chosen || !list.entries.length || show(list.entries[0].id, true);
    const load = () => list.load().then(offer);
    fields.element.hidden = true;
    if (context.selection) await Promise.all([list.load(), show(context.selection)]);
    else await load();
    return () => {
        list.close();
        fields.close();
    };
}
