// SPDX-License-Identifier: Apache-2.0
// Every page and action has a key. "g" and a letter opens a page; "?" shows them all.
import {h} from "./dom.js";

const TYPED = "input:not([type=range]):not([type=checkbox]):not([type=radio]), textarea, select, [contenteditable]";

export class Keys {
    constructor() {
        Object.assign(this, {all: new Map(), page: new Map(), pages: new Map(), prefix: 0});
        document.addEventListener("keydown", (event) => this.press(event));
        this.always("?", "show the keys", () => this.help());
    }

    /** A key that every page has. */
    always(key, text, action) { this.all.set(key, {text, action}); }

    /** A key of the open page: it goes when the page goes. */
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
            const found = this.pages.get(event.key);
            if (!found) return;
            event.preventDefault();
            found.action();
            return;
        }
        if (event.key === "g") {
            this.prefix = performance.now() + 1500;
            return;
        }
        const found = this.page.get(event.key) ?? this.all.get(event.key);
        if (!found) return;
        event.preventDefault();
        found.action();
    }

    help() {
        const part = (title, keys, before = "") => keys.size > 0 && h("section", {}, h("h3", {}, title),
            h("dl", {}, [...keys].map(([key, {text}]) => h("div", {},
                h("dt", {}, before && [h("kbd", {}, before), " "], h("kbd", {}, key)), h("dd", {}, text)))));
        const dialog = h("dialog", {class: "keys", "aria-label": "keys", onclose: () => dialog.remove(),
                                    onclick: (event) => event.target === dialog && dialog.close()},
            h("div", {class: "row"}, h("h2", {}, "Keys"), h("span", {class: "grow"}),
                h("button", {onclick: () => dialog.close()}, "Close")),
            h("div", {class: "columns"}, part("Pages", this.pages, "g"), part("This page", this.page),
                part("Everywhere", this.all)));
        document.body.append(dialog);
        dialog.showModal();
    }
}
