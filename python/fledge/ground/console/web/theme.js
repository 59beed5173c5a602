// SPDX-License-Identifier: Apache-2.0
// Light or dark: what the system says, or what the person has chosen here.
const KEY = "fledge.theme", system = matchMedia("(prefers-color-scheme: dark)"), hearers = new Set();

const chosen = () => {
    try {
        return localStorage.getItem(KEY);
    } catch {
        return null;
    }
};

export const theme = () => chosen() ?? (system.matches ? "dark" : "light");

function apply() {
    document.documentElement.dataset.theme = theme();
    for (const hear of [...hearers]) hear(theme());
}

export function turn() {
    const other = theme() === "dark" ? "light" : "dark";
    try {
        localStorage.setItem(KEY, other);
    } catch { /* it holds until the page is closed */ }
    document.documentElement.dataset.theme = other;
    for (const hear of [...hearers]) hear(other);
}

/** Hear of another theme. Returns what ends it. */
export function onTheme(hear) {
    hearers.add(hear);
    return () => hearers.delete(hear);
}

system.addEventListener("change", apply);
apply();
