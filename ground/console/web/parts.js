// SPDX-License-Identifier: Apache-2.0
// Parts that pages share: heads, fields, buttons, forms, dialogs, tables, lists of facts, states and answers.
//     root.append(head("Files", search("search files", "search", find)), plain(["file", "size"], body))
import {dress, h, hint, put} from "./dom.js";
import {CONCERNS, SHAPES} from "./words.js";

export const head = (title, ...inside) => h("div", {class: "head"}, h("h1", {}, title), inside);

export const panel = (label, title, ...inside) =>
    h("section", {class: "panel", "aria-label": label}, title && h("h3", {}, title), inside);

export const button = (text, action, about = {}) => h("button", {onclick: action, ...about}, text);

/** A button that is pressed or not. changed(pressed) */
export function toggle(text, changed, about = {}) {
    const node = button(text, () => {
        const pressed = node.getAttribute("aria-pressed") === "false";
        node.setAttribute("aria-pressed", pressed);
        changed(pressed);
    }, {"aria-pressed": "false", ...about});
    return node;
}

/** A field to search in. changed(text): after each letter */
export const search = (label, placeholder, changed, about = {}) => h("input", {type: "search", placeholder,
    "aria-label": label, oninput: ({target}) => changed(target.value), ...about});

/** A field to choose in. label: null if it stands in one;  options: texts, or [value, text];  changed(value) */
export function choice(label, options, changed, about = {}) {
    const node = h("select", {"aria-label": label, onchange: () => changed(node.value), ...about});
    const known = new Set();
    /** Add an option, if it is not there. */
    node.learn = (value, text = value) => {
        if (known.has(value)) return;
        known.add(value);
        node.append(h("option", {value}, text));
    };
    for (const option of options) node.learn(...[option].flat());
    if (about.value !== undefined) node.value = about.value;
    return node;
}

/** A label over a field. */
export const field = (label, input, kind = "field") => h("label", {class: kind}, h("span", {}, label), input);

/** A form. submit(): when the user sends it */
export const form = (submit, about, ...inside) => h("form", {...about, onsubmit: (event) => {
    event.preventDefault();
    submit(event);
}}, inside);

/** Open a dialog, which is removed when it closes. closed(the value of the button that closed it) */
export function openDialog(label, closed, about, ...inside) {
    const node = h("dialog", {"aria-label": label, ...about, onclose: () => {
        node.remove();
        closed(node.returnValue);
    }}, inside);
    document.body.append(node);
    node.showModal();
    return node;
}

/** The last row of a dialog's form. */
export const ends = (word, {dangerous = false, first} = {}) => h("div", {class: "row end"}, first,
    button("Cancel", ({target}) => target.closest("dialog").close(), {type: "button"}),
    h("button", {class: dangerous ? "danger" : "primary", value: "yes"}, word));

/** Ask in a dialog. fields: [[label, element with a name]]; resolves to {name: value}, null if the user cancelled. */
export const prompt = (title, text, fields, word, dangerous = false) => new Promise((resolve) => openDialog(title,
    (answer) => resolve(
        answer === "yes" ? Object.fromEntries(fields.map(([, input]) => [input.name, input.value])) : null),
    {}, h("form", {method: "dialog"}, h("h2", {}, title), text && h("p", {}, text),
        fields.map(([label, input]) => field(label, input)), ends(word, {dangerous}))));

/** A row of a table. cells: contents, [class, content], or elements td */
export const row = (about, ...cells) => h("tr", about, cells.map((cell) => (cell?.tagName === "TD" ? cell :
    Array.isArray(cell) ? h("td", {class: cell[0]}, cell[1]) : h("td", {}, cell))));

/** A table. titles: of the columns, or [class, title] */
export const plain = (titles, body, about = {}, ...more) => h("table", {class: "plain", ...about},
    h("thead", {}, h("tr", {}, titles.map((title) =>
        (Array.isArray(title) ? h("th", {class: title[0]}, title[1]) : h("th", {}, title))))), body, more);

/** Fill a table's body with a row of each entry; if there are none, with a text over `width` columns. */
export const fillRows = (body, entries, make, none, width) => body.replaceChildren(...(entries.length ?
    entries.map(make) : [h("tr", {}, h("td", {class: "soft", colSpan: width}, none))]));

/** A list of facts, each of which has a name and a text. */
export class Facts {
    constructor(about = {}) { Object.assign(this, {about, element: h("dl", {class: "facts"}), known: new Map()}); }

    /** Add a fact. Returns the element of its text. */
    add(name, about = this.about) {
        const text = h("dd");
        this.element.append(h("dt", about, name), text);
        return text;
    }

    /** Set the text of a fact, which is added where there is none. */
    set(name, text, kind = "") {
        if (!this.known.has(name)) this.known.set(name, this.add(name));
        put(this.known.get(name), text);
        dress(this.known.get(name), kind);
    }
}

/** Show a level of concern in a node: by shape, word and colour. */
export function concern(level, node = h("span")) {
    dress(node, `concern c${level}`);
    put(node, level ? `${SHAPES[level]} ${CONCERNS[level]}` : "");
    hint(node, level ? CONCERNS[level] : "");       // where there is room for the shape alone
    return node;
}

/** Show a level in a table's cell; for none, a word. */
export function putLevel(cell, level, word) {
    const node = concern(level, cell.firstChild ?? cell.appendChild(h("span")));
    if (!level) put(node, word);
}

/** Show how many alarms wait, and the worst level of these. */
export function putAlarms(node, {count, worst}, kind = "soft") {
    dress(node, count ? `concern c${worst}` : kind);
    put(node, count ? `${SHAPES[worst]} ${count} alarm${count > 1 ? "s" : ""}` : "no alarms");
}

/** A line that says what became of an action: say(text, bad). */
export function answerLine(kind = "answer") {
    const node = h("p", {class: kind, role: "status"});
    node.say = (text, bad = false) => {
        put(node, text);
        dress(node, bad ? `${kind} problem` : kind);
    };
    return node;
}

/** The line that warns of a hazardous command. */
export const hazard = ({hazardous}) => hazardous && h("p", {class: "hazard"}, "\u26a0 hazardous: ", hazardous);

/** Whether a craft has the feature of a page; else the page says that it has none. */
export function has({live, craft, root}, feature, none) {
    const there = live.craft(craft)?.can?.includes(feature);
    if (!there) root.append(h("section", {class: "panel"}, h("p", {class: "none soft"}, `${craft} has ${none}.`)));
    return there;
}
