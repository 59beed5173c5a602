// SPDX-License-Identifier: Apache-2.0
// One page of the console for a long time, which shows each of its pages in turn: node console_soak.mjs ADDRESS FOLDER
// MODULES CHROMIUM PERIOD. After each PERIOD [s] it prints what the page holds after a garbage collection.
import {open} from "../ground/console/testing/console.mjs";

const STAY = 4000;      // [ms] on a page
const SELECTED = {craft: {plots: "p0_0,p1_0"},
                  imager: {plots: "flight.tracking.error.sigma_BR", commands: "flight.write.steering.K1"}};
const page = await open("overview", {craft: "craft"});
const names = await page.locator("nav [data-page]").evaluateAll((links) => links.map((link) => link.dataset.page));
const tools = await page.context().newCDPSession(page);
let printed = Date.now();
for (let turn = 0;; turn++) {
    const craft = Object.keys(SELECTED)[turn % 2];
    for (const name of names) {
        const about = new URLSearchParams({craft, sel: SELECTED[craft][name] ?? ""});
        await page.evaluate((to) => location.hash = to, `#/${name}?${about}`);
        await page.waitForTimeout(STAY);
    }
    if (Date.now() - printed < 1000 * process.argv[6]) continue;
    printed += 1000 * process.argv[6];
    await tools.send("HeapProfiler.collectGarbage");
    const {usedSize} = await tools.send("Runtime.getHeapUsage"), {nodes, jsEventListeners} =
        await tools.send("Memory.getDOMCounters");
    console.log(JSON.stringify({heap: usedSize, nodes, listeners: jsEventListeners, problems: page.problems,
                                updates: await page.evaluate(() => controlRoom.live.received)}));
}
