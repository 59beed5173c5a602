// SPDX-License-Identifier: Apache-2.0
// Light or dark: the system's setting, or the user's choice.
const KEY = "fledge.theme", system = matchMedia("(prefers-color-scheme: dark)"), listeners = new Set();

const chosen = () => {
    try {
        return localStorage.getItem(KEY);
    } catch {
        return null;
    }
};

export const theme = () => chosen() ?? (system.matches ? "dark" : "light");

function apply(name = theme()) {
    document.documentElement.dataset.theme = name;
    for (const listener of [...listeners]) listener(name);
}

export function turn() {
    const other = theme() === "dark" ? "light" : "dark";
    try {
        localStorage.setItem(KEY, other);
    } catch { /* it holds until the page is closed */ }
    apply(other);
}

/** Add a listener of changes of the theme. Returns a function that removes it. */
export function onTheme(listener) {
    listeners.add(listener);
    return () => listeners.delete(listener);
}

system.addEventListener("change", () => apply());
apply();
