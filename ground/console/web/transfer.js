// SPDX-License-Identifier: Apache-2.0
// Downloads, files of JSON that are opened, texts that the browser keeps, and sizes as text.
import {attempt, h} from "./dom.js";

/** Offer a text or bytes as a download. */
export function offer(content, name, type = "application/json") {
    const url = URL.createObjectURL(new Blob([content], {type})), link = h("a", {href: url, download: name});
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
}

/** A hidden field for a file of JSON. take(its text); errors are shown in `place` */
export function opener(label, place, take) {
    const node = h("input", {type: "file", accept: ".json,application/json", hidden: true, "aria-label": label,
        onchange: () => node.files[0] && attempt(place(), async () => {
            const text = await node.files[0].text();
            node.value = "";
            take(text);
        })});
    return node;
}

/** A text that the browser keeps, or null. */
export function kept(key) {
    try {
        return localStorage.getItem(key);
    } catch {
        return null;
    }
}

export function keep(key, text) {
    try {
        localStorage.setItem(key, text);
    } catch { /* it holds until the page is closed */ }
}

/** 20480 -> "20.5 kB" */
export function size(bytes) {
    const n = Number(bytes ?? 0);
    if (n < 1000) return `${n} B`;
    const [by, unit] = n < 1e6 ? [1e3, "kB"] : n < 1e9 ? [1e6, "MB"] : [1e9, "GB"];
    return `${(n / by).toPrecision(3)} ${unit}`;
}
