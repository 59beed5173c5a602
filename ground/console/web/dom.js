// SPDX-License-Identifier: Apache-2.0
// Elements of the page. Texts of a spacecraft or a user become text, never markup.

const SHOWN = new Set(["title", "aria-label", "placeholder", "alt", "label"]);   // attributes that a user reads

/** h("td", {class: "value"}, "text", element, ...): attributes, properties, on... handlers, and children. */
export function h(tag, about = {}, ...inside) {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(about)) {
        if (value === undefined || value === null || value === false) continue;
        if (key === "class") node.className = value;
        else if (key.startsWith("on")) node.addEventListener(key.slice(2).toLowerCase(), value);
        else if (key in node && !key.startsWith("aria")) node[key] = SHOWN.has(key) ? visible(value) : value;
        else node.setAttribute(key, value === true ? "" : SHOWN.has(key) ? visible(value) : value);
    }
    node.append(...inside.flat(Infinity).filter((part) => part !== null && part !== undefined && part !== false)
        .map((part) => (part instanceof Node ? part : visible(part))));
    return node;
}

// Control characters, invisible ones, those that change the direction of text, and lone surrogates; as in errors.py.
const HIDDEN = new RegExp("[\\0-\\t\\v-\\x1f\\x7f-\\x9f\\xad\\u061c\\u180e\\u200b-\\u200f\\u2028-\\u202e" +
    "\\u2060-\\u206f\\ufeff\\ufff9-\\ufffb\\ud800-\\udfff\\u{e0000}-\\u{e007f}]", "gu");

/** A text whose control characters are visible: an escape becomes <1B>. */
export function visible(text) {
    return String(text ?? "").replace(
        HIDDEN, (character) => `\u27e8${character.codePointAt(0).toString(16).toUpperCase().padStart(2, "0")}\u27e9`);
}

/** Set a node's text, if it differs. */
export function put(node, text) {
    if (node.shown === text) return;
    node.shown = text;
    node.textContent = visible(text);
}

/** Set the text that is shown where a pointer rests on a node that may cut its own text. */
export function hint(node, text) {
    if (node.hint === text) return;
    node.hint = text;
    node.title = visible(text);
}

/** Show a time of day; with its date, where there is room. */
export function stamp(node, text) {
    if (node.shown === text) return;
    node.shown = text;
    const day = text.match(/^\d{4}-\d\d-\d\d /)?.[0] ?? "";
    node.replaceChildren(h("span", {class: "date"}, day), text.slice(day.length));
    hint(node, text);
}

/** Give a node whose text is cut the whole text as its title, when a pointer rests on it. */
export function showWhole({target}) {
    if (!(target instanceof HTMLElement) || target.title && !target.whole) return;
    const cut = target.scrollWidth > target.clientWidth && getComputedStyle(target).overflowX !== "visible";
    if (cut || target.whole) target.title = cut ? target.textContent : "";
    target.whole = cut;
}

/** Set a node's class name, if it differs. */
export function dress(node, name) {
    if (node.className !== name) node.className = name;
}

/** Run an action, and show its error in the element `place`. Returns its result; undefined after an error. */
export async function attempt(place, action) {
    place.querySelector(":scope > .problem[role=alert]")?.remove();
    try {
        return await action();
    } catch (error) {
        if (error.name !== "AbortError")
            place.append(h("p", {class: "problem", role: "alert"}, error.message || String(error)));
        return undefined;
    }
}
