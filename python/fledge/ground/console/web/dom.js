// SPDX-License-Identifier: Apache-2.0
// Elements of the page. What comes from a spacecraft or a person becomes text, never markup.

const SAID = new Set(["title", "aria-label", "placeholder", "alt", "label"]);   // attributes that are shown or read out

/** h("td", {class: "value"}, "text", element, ...): attributes, properties, on... handlers, and what is inside. */
export function h(tag, about = {}, ...inside) {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(about)) {
        if (value === undefined || value === null || value === false) continue;
        if (key === "class") node.className = value;
        else if (key.startsWith("on")) node.addEventListener(key.slice(2).toLowerCase(), value);
        else if (key in node && !key.startsWith("aria")) node[key] = SAID.has(key) ? visible(value) : value;
        else node.setAttribute(key, value === true ? "" : SAID.has(key) ? visible(value) : value);
    }
    node.append(...inside.flat().filter((one) => one !== null && one !== undefined && one !== false)
        .map((one) => (one instanceof Node ? one : visible(one))));
    return node;
}

// Control characters, those that are not seen or turn the order of what is, and halves of pairs, as of errors.py.
const HIDDEN = new RegExp("[\\0-\\t\\v-\\x1f\\x7f-\\x9f\\xad\\u061c\\u180e\\u200b-\\u200f\\u2028-\\u202e" +
    "\\u2060-\\u206f\\ufeff\\ufff9-\\ufffb\\ud800-\\udfff\\u{e0000}-\\u{e007f}]", "gu");

/** A text with its control characters to be seen: an escape becomes <1B>. */
export function visible(text) {
    return String(text ?? "").replace(
        HIDDEN, (one) => `\u27e8${one.codePointAt(0).toString(16).toUpperCase().padStart(2, "0")}\u27e9`);
}

/** Set a node's text, if it has another one. */
export function put(node, text) {
    if (node.said === text) return;
    node.said = text;
    node.textContent = visible(text);
}

/** Say a text in full where a pointer rests on a node that may cut it. */
export function hint(node, text) {
    if (node.hint === text) return;
    node.hint = text;
    node.title = visible(text);
}

/** Show a time of day, with its date where there is room. */
export function stamp(node, text) {
    if (node.said === text) return;
    node.said = text;
    const day = text.match(/^\d{4}-\d\d-\d\d /)?.[0] ?? "";
    node.replaceChildren(h("span", {class: "date"}, day), text.slice(day.length));
    hint(node, text);
}

/** Say in full, where a pointer rests, what the page has no room for. */
export function sayWhole({target}) {
    if (!(target instanceof HTMLElement) || target.title && !target.whole) return;
    const cut = target.scrollWidth > target.clientWidth && getComputedStyle(target).overflowX !== "visible";
    if (cut || target.whole) target.title = cut ? target.textContent : "";
    target.whole = cut;
}

/** Give a node a class name, if it has another one. */
export function dress(node, name) {
    if (node.className !== name) node.className = name;
}

/** Run what may fail, and say beside an element what went wrong. Returns what it gave, or undefined. */
export async function attempt(place, action) {
    place.querySelector(":scope > .problem")?.remove();
    try {
        return await action();
    } catch (error) {
        if (error.name !== "AbortError")
            place.append(h("p", {class: "problem", role: "alert"}, error.message || String(error)));
        return undefined;
    }
}

/** Whether a craft has what a page is for; else the page says that it has none. */
export function has(live, craft, root, what, none) {
    const there = live.craft(craft)?.can?.includes(what);
    if (!there) root.append(h("section", {class: "panel"}, h("p", {class: "none soft"}, `${craft} has ${none}.`)));
    return there;
}

/** Ask in a dialog. fields: elements with a name; resolves to {name: value}, or null if the person thought better. */
export function ask(title, text, fields, word, dangerous = false) {
    return new Promise((answer) => {
        const form = h("form", {method: "dialog"}, h("h2", {}, title), text && h("p", {}, text),
            fields.map(([label, field]) => h("label", {class: "field"}, h("span", {}, label), field)),
            h("div", {class: "row end"},
                h("button", {type: "button", onclick: () => dialog.close()}, "Cancel"),
                h("button", {class: dangerous ? "danger" : "primary", value: "yes"}, word)));
        const dialog = h("dialog", {"aria-label": title, onclose: () => {
            const good = dialog.returnValue === "yes";
            answer(good ? Object.fromEntries(fields.map(([, field]) => [field.name, field.value])) : null);
            dialog.remove();
        }}, form);
        document.body.append(dialog);
        dialog.showModal();
    });
}

/** An element that shows how bad something is: by shape, word and colour. */
export const CONCERNS = ["nominal", "watch", "warning", "distress", "critical", "severe"];
export const SHAPES = ["", "\u25cb", "\u25b3", "\u25c7", "\u25a0", "\u2b23"];

export function concern(level, node = h("span")) {
    dress(node, `concern c${level}`);
    put(node, level ? `${SHAPES[level]} ${CONCERNS[level]}` : "");
    hint(node, level ? CONCERNS[level] : "");       // where there is room for the shape alone
    return node;
}
