// SPDX-License-Identifier: Apache-2.0
// Every page and action has a key. "g" and a letter open a page; "?" shows all keys.
import {h} from "./dom.js";
import {button, openDialog} from "./parts.js";

const TYPED = "input:not([type=range]):not([type=checkbox]):not([type=radio]), textarea, select, [contenteditable]";

export class Keys {
    constructor() {
        Object.assign(this, {all: new Map(), page: new Map(), pages: new Map(), prefix: 0});
        document.addEventListener("keydown", (event) => this.press(event));
        this.always("?", "show the keys", () => this.help());
    }

    /** Add a key of all pages. */
    always(key, text, action) { this.all.set(key, {text, action}); }

    /** Add a key of the open page, until it is closed. */
    add(key, text, action) { this.page.set(key, {text, action}); }

    press(event) {
        if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
        if (event.target.closest?.(TYPED)) {
            if (event.key === "Escape") event.target.blur();
            return;
        }
        if (document.querySelector("dialog[open]")) return;
        if (performance.now() < this.prefix) {
            this.prefix = 0;
            const page = this.pages.get(event.key);
            if (!page) return;
            event.preventDefault();
            page.action();
            return;
        }
        if (event.key === "g") {
            this.prefix = performance.now() + 1500;
            return;
        }
        const bound = this.page.get(event.key) ?? this.all.get(event.key);
        if (!bound) return;
        event.preventDefault();
        bound.action();
    }

    help() {
        const part = (title, keys, before = "") => keys.size > 0 && h("section", {}, h("h3", {}, title),
            h("dl", {}, [...keys].map(([key, {text}]) => h("div", {},
                h("dt", {}, before && [h("kbd", {}, before), " "], h("kbd", {}, key)), h("dd", {}, text)))));
        const dialog = openDialog("keys", () => {}, {class: "keys", onclick: ({target}) =>
            target === dialog && dialog.close()},
            h("div", {class: "row"}, h("h2", {}, "Keys"), h("span", {class: "grow"}),
                button("Close", () => dialog.close())),
            h("div", {class: "columns"}, part("Pages", this.pages, "g"), part("This page", this.page),
                part("Everywhere", this.all)));
    }
}
