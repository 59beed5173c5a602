// SPDX-License-Identifier: Apache-2.0
// Light or dark: the system's setting, or the user's choice.
import {keep, kept} from "./transfer.js";

const KEY = "fledge.theme", system = matchMedia("(prefers-color-scheme: dark)"), listeners = new Set();

export const theme = () => kept(KEY) ?? (system.matches ? "dark" : "light");

function apply(name = theme()) {
    document.documentElement.dataset.theme = name;
    for (const listener of [...listeners]) listener(name);
}

export function turn() {
    const other = theme() === "dark" ? "light" : "dark";
    keep(KEY, other);
    apply(other);
}

/** Add a listener of changes of the theme. Returns a function that removes it. */
export function onTheme(listener) {
    listeners.add(listener);
    return () => listeners.delete(listener);
}

system.addEventListener("change", () => apply());
apply();
