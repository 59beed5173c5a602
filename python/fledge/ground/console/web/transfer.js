// SPDX-License-Identifier: Apache-2.0
// Downloads, and sizes as text.
import {h} from "./dom.js";

/** Offer bytes as a download. */
export function offer(blob, name) {
    const url = URL.createObjectURL(blob), link = h("a", {href: url, download: name});
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
}

/** 20480 -> "20.5 kB" */
export function size(bytes) {
    const n = Number(bytes ?? 0);
    if (n < 1000) return `${n} B`;
    const [by, unit] = n < 1e6 ? [1e3, "kB"] : n < 1e9 ? [1e6, "MB"] : [1e9, "GB"];
    return `${(n / by).toPrecision(3)} ${unit}`;
}
