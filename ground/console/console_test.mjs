// SPDX-License-Identifier: Apache-2.0
// The pages that show. console_test.py starts it, and flies the spacecraft.
import assert from "node:assert/strict";

import {accessible, button, open, row, run} from "./testing/console.mjs";

const PAGES = ["overview", "parameters", "plots", "alarms", "events", "packets", "archive", "log", "server"];
const cell = (page, text, place) => row(page, text).locator(".td").nth(place);
const frames = (page) => page.evaluate(() => controlRoom.live.received);
/** Wait until no cell has this text. */
const gone = (page, text) => page.waitForFunction(
    (old) => ![...document.querySelectorAll(".td")].some(({textContent}) => textContent === old), text);

await run({
    async "values move, exact to the last bit"() {
        const page = await open("parameters");
        await page.waitForFunction(() => controlRoom.live.state === "connected" && controlRoom.live.received > 2);
        const value = cell(page, "big", 1), first = await value.textContent();
        assert.match(first, /^184467429741\d{8}$/);     // 2^64 - 2^40 and a little
        await gone(page, first);
        assert.ok(BigInt(await value.textContent()) > BigInt(first));
        await page.locator(".concern", {hasText: "warning"}).first().waitFor();
        return page;
    },

    async "the overview of a spacecraft without a mission shows only what its link knows"() {
        const page = await open("overview");
        await page.locator(".card dd", {hasText: /bit\/s, \d+(\.\d+)? packets\/s/}).waitFor();
        await page.locator(".card dd", {hasText: /^skipped 0 \u00b7 dropped 0/}).waitFor();
        assert.deepEqual(await page.locator(".card h3:visible").allTextContents(),
            ["State", "Telemetry", "Newest events"]);
        assert.deepEqual(await page.locator(".card section:has(h3:text-is('State')) dt").allTextContents(),
            ["Mode", "Voltage"]);
        assert.equal(await page.locator(".card img").count(), 0);
        return page;
    },

    async "texts are shown as texts"() {
        const page = await open("parameters");
        await page.locator(".td", {hasText: "<img src=x onerror=alert(1)>"}).first().waitFor();
        assert.match(await cell(page, "said", 1).textContent(), /onerror=alert\(1\)>\u27e8202E\u27e9/);
        await page.locator(".td", {hasText: "<b>V</b>"}).first().waitFor();
        await page.locator(".td", {hasText: "<b>POINT</b>"}).first().waitFor();
        await row(page, "voltage").click();
        await page.locator(".detail dd", {hasText: "<img src=x"}).waitFor();
        assert.equal(await page.locator("main img, main b").count(), 0);
        return page;
    },

    async "values of the past have all their digits, texts and states"() {
        const page = await open("parameters");
        await cell(page, "big", 1).filter({hasText: /^\d{20}$/}).waitFor();
        await page.keyboard.press(",");
        await page.locator(".time.past").waitFor();
        await cell(page, "big", 1).filter({hasText: /^1844674297\d{10}$/}).waitFor();
        const big = BigInt(await cell(page, "big", 1).textContent());     // 2^64 - 2^40 and a count
        assert.ok(big >= 2n ** 64n - 2n ** 40n && big < 2n ** 64n - 2n ** 40n + 100000n, String(big));
        await cell(page, "said", 1).filter({hasText: "onerror=alert(1)>\u27e8202E\u27e9"}).waitFor();
        await cell(page, "voltage", 3).filter({hasText: /warning|critical|distress/}).waitFor();
        await cell(page, "mode", 1).filter({hasText: /SAFE|POINT/}).waitFor();
        assert.equal(await page.locator("main img, main b").count(), 0);
        await page.keyboard.press("n");
        return page;
    },

    async "what matters comes first, headers of packets are hidden until a key shows them"() {
        const page = await open("parameters");
        const names = () => page.locator(".tbody .tr:not([hidden]) .td:first-child").allTextContents();
        await row(page, "big").waitFor();
        assert.deepEqual(await names(), ["At a glance", "Mode", "Voltage", "Power", "voltage", "big", "mode", "said"]);
        await page.keyboard.press("h");
        await row(page, "version_to_apid").waitFor();
        assert.deepEqual((await names()).slice(8), ["Packet", "version_to_apid", "sequence", "length"]);
        await page.keyboard.press("h");
        await row(page, "version_to_apid").waitFor({state: "hidden"});
        await page.keyboard.press("/");
        await page.keyboard.type("apid");       // a search finds them in any case
        await row(page, "version_to_apid").waitFor();
        assert.deepEqual(await names(), ["version_to_apid"]);
        return page;
    },

    async "pages and search by keys alone"() {
        const page = await open("overview");
        await page.keyboard.press("?");
        await page.locator("dialog.keys", {hasText: "return to now"}).waitFor();
        await page.keyboard.press("Escape");
        await page.keyboard.press("/");
        await page.keyboard.type("volt");       // at once: none is lost
        await page.waitForFunction(() => document.querySelectorAll(".tbody .tr:not([hidden])").length === 1);
        await page.keyboard.press("Escape");
        await page.keyboard.press("m");
        await page.keyboard.press("ArrowDown");
        await page.keyboard.press("l");
        await page.locator(".page.plots .u-legend", {hasText: "voltage"}).waitFor();
        for (const name of PAGES) {
            const letter = await page.locator(`nav [data-page=${name}] kbd`).textContent();
            await page.keyboard.press("g");
            await page.keyboard.press(letter);
            await page.locator(`.page.${name}`).waitFor();
        }
        return page;
    },

    async "before a choice, the newest packet is shown, with what to do"() {
        const page = await open("packets");
        await page.locator(".inspect .tip", {hasText: "The newest packet when this list was read"}).waitFor();
        await row(page.locator(".inspect"), "voltage").waitFor();
        await row(page.locator(".list"), "Power").click();
        await page.locator(".inspect .tip:empty").waitFor({state: "attached"});
        assert.match(page.url(), /sel=/);
        return page;
    },

    async "changes of the mode are events, whose labels are texts"() {
        const page = await open("events");
        await page.getByLabel("source").selectOption("mode");
        await row(page, "the mode is <b>POINT</b>; before, it was SAFE").waitFor();
        await row(page, "the mode is SAFE; before, it was <b>POINT</b>").waitFor();
        assert.equal(await page.locator("main b").count(), 0);
        return page;
    },

    async "a packet's bits, and why another packet did not decode"() {
        const page = await open("packets");
        while (!await page.locator(".inspect h2", {hasText: "Power"}).isVisible()) {
            await row(page, "Power").click();       // rows move as packets come: the click may reach another row
            await page.waitForTimeout(200);
        }
        await page.locator(".inspect .tr", {hasText: "mode"}).hover();
        await page.locator(".bits", {hasText: "bit 144 to 151, from byte 18, bit 0"}).waitFor();
        const lit = await page.evaluate(() => [...document.querySelectorAll(".inspect .hex span")].flatMap((octet, k) =>
            (octet.style.backgroundImage ? [k] : [])));
        assert.deepEqual(lit, [18]);
        await page.keyboard.press("u");
        await page.waitForFunction(() => [...document.querySelectorAll(".list .tbody .tr:not([hidden])")].every(
            ({textContent}) => textContent.includes("version_to_apid")));
        await row(page.locator(".list"), "version_to_apid").click();
        await page.locator(".inspect .problem", {hasText: /version_to_apid.*1.*at bit 0: byte 0, bit 0/s}).waitFor();
        assert.ok(await page.locator(".inspect .hex .wrong").count());
        return page;
    },

    async "an alarm is acknowledged with a note, and shelved"() {
        const page = await open("alarms");
        await row(page, "voltage").waitFor();
        await page.keyboard.press("a");
        await page.locator("dialog input").fill("seen & <b>noted</b>");
        await page.keyboard.press("Enter");
        await page.locator(".page > p", {hasText: "acknowledged by operator: seen & <b>noted</b>"}).waitFor();
        await page.keyboard.press("s");
        await page.locator("dialog button.primary").click();
        await cell(page, "voltage", 5).filter({hasText: "shelved"}).waitFor();
        await page.locator(".top .alarms", {hasText: "no alarms"}).waitFor();
        await page.keyboard.press("s");
        await cell(page, "voltage", 5).filter({hasText: "acknowledged"}).waitFor();
        await page.keyboard.press("g");
        await page.keyboard.press("g");
        await row(page, "alarms").waitFor();
        return page;
    },

    async "limits upside down are refused in the dialog, others hold"() {
        const page = await open("parameters");
        await row(page, "voltage").click();
        await page.locator(".detail button", {hasText: "Edit limits"}).click();
        await page.getByLabel("distress, low").fill("3");
        await page.getByLabel("distress, high").fill("-3");
        await page.keyboard.press("Enter");
        await page.locator("dialog .problem", {hasText: "from the lower to the higher"}).waitFor();
        await page.getByLabel("distress, low").fill("");
        await page.getByLabel("distress, high").fill("-3");
        await page.keyboard.press("Enter");
        await page.locator("dialog").waitFor({state: "detached"});
        await page.locator(".detail dd", {hasText: "distress: open to \u22123"}).waitFor();
        await cell(page, "voltage", 3).filter({hasText: /distress|critical/}).waitFor();
        return page;
    },

    async "a plot, live and back in time on one axis, and now again"() {
        const page = await open("plots", {selection: "voltage,mode"});
        const time = page.locator(".u-legend .u-value").first();
        await page.waitForFunction(() => /\d\d:\d\d/.test(document.querySelector(".u-legend .u-value")?.textContent));
        const first = await time.textContent();
        await page.waitForFunction((old) => document.querySelector(".u-legend .u-value").textContent > old, first);
        const {width} = await page.locator(".u-over").boundingBox();
        await page.locator(".u-over").hover({position: {x: 0.1 * width, y: 20}});
        await page.locator(".u-legend .u-series",       // from the archive
            {hasText: /voltage.*0\.[5-8].*(warning|distress|critical)/}).waitFor();
        await page.keyboard.press(",");
        await page.locator(".time.past").waitFor();
        assert.match(page.url(), /[?&]t=\d{19}/);
        const other = await page.context().newPage();       // the link holds page, time and selection
        await other.goto(page.url());
        await other.locator(".time.past").waitFor();
        assert.equal(await other.evaluate(() => String(controlRoom.time.t)),
            await page.evaluate(() => String(controlRoom.time.t)));
        await other.close();
        await page.keyboard.press("g");
        await page.keyboard.press("p");
        await cell(page, "voltage", 1).filter({hasText: /\d/}).waitFor();
        const then = await cell(page, "voltage", 1).textContent();
        await page.waitForTimeout(500);
        assert.equal(await cell(page, "voltage", 1).textContent(), then, "a past value does not move");
        await page.keyboard.press("n");
        await page.locator(".time:not(.past)").waitFor();
        await gone(page, then);
        return page;
    },

    async "a session is replayed as a spacecraft of its own"() {
        const page = await open("archive");
        await page.getByLabel("speed").selectOption("10");
        await button(page, "Replay").click();
        await page.locator(".page.parameters").waitFor();
        await page.waitForFunction(() => controlRoom.time.craft.includes("@replay"));
        await cell(page, "voltage", 1).filter({hasText: /\d/}).waitFor();
        await page.keyboard.press("g");
        await page.keyboard.press("h");
        await page.locator("button", {hasText: "End this replay"}).click();
        await page.waitForFunction(() => !controlRoom.time.craft.includes("@replay"));
        return page;
    },

    async "a browser that slept shows the newest values"() {
        const page = await open("parameters");
        await page.waitForFunction(() => controlRoom.live.received > 2);
        const sleep = (hidden) => page.evaluate((now) => {
            Object.defineProperty(document, "hidden", {value: now, configurable: true});
            document.dispatchEvent(new Event("visibilitychange"));
        }, hidden);
        await sleep(true);
        let before = -1;
        for (let now = 0; now !== before; now = await frames(page)) {   // until no frame is on its way
            before = await frames(page);
            await page.waitForTimeout(500);
        }
        await sleep(false);
        await page.waitForFunction((old) => controlRoom.live.received > old + 2, before);
        await page.evaluate(() => controlRoom.live.socket.close());      // and if the connection broke
        await page.locator(".link.bad").waitFor();
        await page.locator(".link.good").waitFor();
        const again = await frames(page);
        await page.waitForFunction((old) => controlRoom.live.received > old + 2, again);
        return page;
    },

    async "this server shows each limit with its use"() {
        const page = await open("server");
        await page.locator(".limits tr", {hasText: "disk that stays free"}).waitFor();
        const {limits} = await page.evaluate(() => controlRoom.live.api.get("/api/server"));
        assert.equal(await page.locator(".limits tbody tr").count(), limits.length);
        const waits = page.locator(".limits tr", {hasText: "queries that wait"}).locator("td");
        assert.equal(await waits.nth(1).textContent(), "4");
        assert.match(await page.locator(".page.server dl").textContent(), /longest block\d+ ms in the last minute/);
        if (process.env.SHOT) await page.screenshot({path: process.env.SHOT});
        return page;
    },

    async "axe finds nothing serious, and nothing is wider than its window"() {
        return accessible(Object.fromEntries(PAGES.map((name) => [name, name === "plots" ? "voltage" : ""])));
    },
});
