// SPDX-License-Identifier: Apache-2.0
// Each page of a spacecraft with hostile texts has the same elements as that of its harmless twin, and shows no letter
// that reverses or hides others. hostile_page_test.py starts it.
import assert from "node:assert/strict";
import {readFileSync} from "node:fs";
import {join} from "node:path";

import {folder, open, run} from "./testing/console.mjs";

const TEXTS = JSON.parse(readFileSync(join(folder, "texts.json"), "utf-8"));
const PAGES = ["overview", "parameters", "plots", "alarms", "events", "packets", "archive", "log", "commands",
    "displays", "stacks"];

/** A page's elements, tag -> number; and the texts, also those that are read out, that no page may show. */
const content = (page) => page.evaluate(() => {
    const counts = {}, shown = [];
    for (const node of document.querySelectorAll("main *, dialog *")) {
        counts[node.tagName] = (counts[node.tagName] ?? 0) + 1;
        const texts = [...node.childNodes].filter(({nodeType}) => nodeType === Node.TEXT_NODE).map(({data}) => data);
        shown.push(...texts, ...["title", "aria-label", "placeholder"].map((name) => node.getAttribute(name) ?? ""));
        if (/^\s*javascript:/i.test(node.getAttribute("href") ?? "")) shown.push(`\x00${node.outerHTML}`);
    }
    // eslint-disable-next-line no-control-regex
    const bad = shown.filter((text) => /[\0-\x09\x0b-\x1f\x7f-\x9f\u200b-\u200f\u202a-\u202e\u2060-\u2069]/.test(text));
    return {counts, bad, ran: window.pwned ?? window.parent.pwned ?? null};
});

const selections = {
    plots: (of) => of.name,
    displays: (_, craft) => craft,
    parameters: (of) => of.name,
    commands: (of) => `/S/${of.command}`,
};

await run({
    async "no text becomes an element, a script or hides another"() {
        let last;
        for (const name of PAGES) {
            const pages = {};
            for (const craft of ["plain", "evil"]) {
                last = await open(name, {craft, selection: selections[name]?.(TEXTS[craft], craft) ?? ""});
                await last.waitForFunction(() => controlRoom.live.state === "connected");
                const wanted = JSON.stringify(pages.plain?.counts);
                for (let k = 0, old = "", now = ""; !now || (now !== (wanted ?? old) && k < 60); k++) {
                    await last.waitForTimeout(1000);        // until nothing more appears
                    pages[craft] = await content(last);
                    [old, now] = [now, JSON.stringify(pages[craft].counts)];
                }
                assert.deepEqual(last.problems, [], name);
            }
            assert.equal(pages.evil.ran, null, `${name}: a script ran`);
            assert.deepEqual(pages.evil.bad, [], name);
            assert.deepEqual(pages.evil.counts, pages.plain.counts, name);
            assert.ok(Object.keys(pages.plain.counts).length > 1, name);
        }
        return last;
    },
});
