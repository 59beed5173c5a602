// SPDX-License-Identifier: Apache-2.0
// Each page of a spacecraft with hostile texts has the elements that its harmless twin has, and shows no letter that
// turns or hides others. hostile_page_test.py starts it.
import assert from "node:assert/strict";
import {readFileSync} from "node:fs";
import {join} from "node:path";

import {folder, open, run} from "./testing/console.mjs";

const TEXTS = JSON.parse(readFileSync(join(folder, "texts.json"), "utf-8"));
const PAGES = ["overview", "parameters", "plots", "alarms", "events", "packets", "archive", "log", "commands",
    "displays", "stacks"];

/** What a page is made of: tag -> how many; and what no page may show, in texts and what is read out. */
const made = (page) => page.evaluate(() => {
    const counts = {}, shown = [];
    for (const node of document.querySelectorAll("main *, dialog *")) {
        counts[node.tagName] = (counts[node.tagName] ?? 0) + 1;
        const texts = [...node.childNodes].filter((one) => one.nodeType === Node.TEXT_NODE).map((one) => one.data);
        shown.push(...texts, ...["title", "aria-label", "placeholder"].map((one) => node.getAttribute(one) ?? ""));
        if (/^\s*javascript:/i.test(node.getAttribute("href") ?? "")) shown.push(`\x00${node.outerHTML}`);
    }
    // eslint-disable-next-line no-control-regex
    const bad = shown.filter((one) => /[\0-\x09\x0b-\x1f\x7f-\x9f\u200b-\u200f\u202a-\u202e\u2060-\u2069]/.test(one));
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
            const found = {};
            for (const craft of ["plain", "evil"]) {
                last = await open(name, {craft, selection: selections[name]?.(TEXTS[craft], craft) ?? ""});
                await last.waitForFunction(() => controlRoom.live.state === "connected");
                const wanted = JSON.stringify(found.plain?.counts);
                for (let k = 0, old = "", now = ""; !now || (now !== (wanted ?? old) && k < 60); k++) {
                    await last.waitForTimeout(1000);        // until all is shown that comes
                    found[craft] = await made(last);
                    [old, now] = [now, JSON.stringify(found[craft].counts)];
                }
                assert.deepEqual(last.problems, [], name);
            }
            assert.equal(found.evil.ran, null, `${name}: a script ran`);
            assert.deepEqual(found.evil.bad, [], name);
            assert.deepEqual(found.evil.counts, found.plain.counts, name);
            assert.ok(Object.keys(found.plain.counts).length > 1, name);
        }
        return last;
    },
});
