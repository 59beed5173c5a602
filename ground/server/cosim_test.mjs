// SPDX-License-Identifier: Apache-2.0
// Run control of a co-simulation, which goes back in time. cosim_test.py starts it.
import assert from "node:assert/strict";

import {open, run} from "../console/testing/console.mjs";

const seconds = async (page) => Number(await page.evaluate(() => controlRoom.live.crafts[0].t_ns)) / 1e9;

await run({
    async "a run goes back, and the page comes back by itself"() {
        const page = await open("run"), state = page.locator(".state");
        await state.filter({hasText: "running"}).waitFor();
        await page.waitForFunction(() => Number(controlRoom.live.crafts[0].t_ns) > 300e9);
        await page.getByLabel("instant to go back to").fill("20");
        await page.getByRole("button", {name: "Back to"}).click();
        await page.locator(".link", {hasText: "no connection"}).waitFor();
        await page.locator(".link", {hasText: "connected"}).waitFor();
        await state.filter({hasText: "running"}).waitFor();
        await page.waitForFunction(() => Number(controlRoom.live.crafts[0].t_ns) > 20e9);
        assert.ok(await seconds(page) < 300, "it did not go back");
        await page.getByRole("button", {name: "Pause"}).click();     // the session is another one
        await state.filter({hasText: "paused"}).waitFor();
        const lost = /Failed to load resource|WebSocket connection/;     // while there was no server
        page.problems = page.problems.filter((problem) => !lost.test(problem));
        return page;
    },
});
