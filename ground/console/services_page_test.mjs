// SPDX-License-Identifier: Apache-2.0
// Radio and passes, stored commands, and files. services_page_test.py starts it.
import assert from "node:assert/strict";
import {writeFileSync} from "node:fs";
import {join} from "node:path";

import {accessible, button, folder, open, request, run} from "./testing/console.mjs";

/** Let a craft fly on for some seconds as fast as it can, and pause. */
async function fly(page, craft, seconds) {
    await request(page, `${craft}/run`, {action: "step", seconds, speed: 0});
    while ((await request(page, `${craft}/run`)).state !== "paused") await page.waitForTimeout(100);
}

await run({
    async "the stations that see the spacecraft, locks, losses, and the next passes"() {
        const page = await open("overview", {craft: "radio"});
        const card = page.locator(".card", {has: page.locator("h2", {hasText: "radio"})});
        const cells = (name) => card.locator(`.radios tr:has(th:text-is("${name}")) td`);
        await card.locator("dd", {hasText: /no contact, rises in \d+ min/}).waitFor();
        await cells("receiver").first().filter({hasText: "below the mask"}).waitFor();
        const [first, second] = (await request(page, "radio/passes")).map(({rise_ns}) => Number(rise_ns) / 1e9);
        const now = async () => Number((await request(page, "radio/run")).t_ns) / 1e9;
        await fly(page, "radio", first + 100 - await now());
        await card.locator("dd.good", {hasText: "contact"}).waitFor();
        for (const way of [0, 1]) await cells("receiver").nth(way).filter({hasText: "locked"}).waitFor();
        await request(page, "radio/send", {name: "flight.telemetry", arguments: {output: "all"}});
        await fly(page, "radio", 20);
        await card.locator("dd", {hasText: /packets\/s/}).waitFor();
        await cells("received").first().filter({hasText: /[1-9]/}).waitFor();
        assert.match(await cells("bit rate").first().textContent(), /^2 Mbit\/s$/);
        await page.reload();
        await card.locator(".passes tr", {hasText: "in view"}).waitFor();
        await fly(page, "radio", 1000);
        await card.locator("dd", {hasText: `rises in ${Math.round((second - await now()) / 60)} min`}).waitFor();
        await cells("lost").first().filter({hasText: /[1-9]/}).waitFor();
        const other = page.locator(".card", {has: page.locator("h2", {hasText: "services"})});
        await other.locator("dd.good", {hasText: /^active \u00b7 CLCW: no flags$/}).waitFor();
        await other.locator("caption", {hasText: "packets of this server do not pass by it"}).waitFor();
        return page;
    },

    async "commands are stored, come due, are held, go on and end"() {
        const page = await open("stored", {craft: "services"});
        const list = page.getByLabel("list 2"), due = page.locator(".timeline .due");
        const dialog = page.locator("dialog[open]");
        await request(page, "services/run", {action: "go", speed: 1});
        const field = (name) => dialog.locator("label.field", {has: page.locator(`span:text-is("${name}")`)})
            .locator("input, select");
        for (const [step, at] of [[0, "0"], [1, "300"], [2, "310"]]) {
            await page.keyboard.press("a");
            await field("list").fill("2");
            await field("step").fill(String(step));
            await field("time [s]").fill(at);
            await field("command").selectOption("flight.noop");
            await button(dialog, "Store").click();
            await dialog.waitFor({state: "detached"});
            await list.locator("tbody tr").nth(step).waitFor();
        }
        assert.equal(await due.count(), 0);
        await button(list, "start").click();
        await list.locator("span", {hasText: /running for 0:00:\d\d/}).waitFor();
        await page.waitForFunction(() => document.querySelectorAll(".timeline .due").length === 2);
        await page.locator("p", {hasText: /3 on board \u00b7 1 executed \u00b7 0 skipped/}).waitFor();

        await button(list, "hold").click();
        await button(dialog, "hold").click();
        await list.locator("span", {hasText: "held"}).waitFor();
        await fly(page, "services", 1000);      // its time stands
        await request(page, "services/run", {action: "go", speed: 1});
        assert.equal(await due.count(), 0);
        await button(list, "release").click();
        await button(dialog, "release").click();
        await due.nth(1).waitFor();
        await page.locator("[aria-label='what is due'] tbody tr", {hasText: /^(5 min|2\d\d s)/}).first().waitFor();
        const [{due_ns}] = (await request(page, "services/stored")).lists[2].commands.slice(1);
        const {next_ns} = await request(page, "services/stored");
        assert.equal(due_ns, next_ns, "the time that flight reports");

        await list.getByLabel("delete step 2").click();
        await list.locator("tbody tr").nth(2).waitFor({state: "detached"});
        await button(list, "read").click();
        await list.locator("caption", {hasText: "Read at"}).waitFor();
        assert.equal(await list.locator("tbody tr").count(), 2);
        await fly(page, "services", 320);
        await list.locator("span", {hasText: "idle"}).waitFor();
        await page.locator("p", {hasText: "2 executed"}).waitFor();

        await request(page, "services/run", {action: "go", speed: 1});
        await page.keyboard.press("a");         // a command with an absolute time
        await field("list").fill("0");
        await dialog.locator("p", {hasText: /Its time is that of flight, which is \d{4} s now/}).waitFor();
        assert.match(await field("time [s]").inputValue(), /^\d{4}$/);
        await button(dialog, "Store").click();
        await due.filter({hasText: "0"}).waitFor();
        await fly(page, "services", 70);
        await page.getByLabel("list 0").waitFor({state: "detached"});
        await page.locator("p", {hasText: "3 executed"}).waitFor();
        return page;
    },

    async "a transfer is suspended and goes on, another transfer is cancelled"() {
        const page = await open("files", {craft: "services"}), file = join(folder, "picture");
        writeFileSync(file, Buffer.alloc(40000, "picture"));
        await request(page, "services/run", {action: "go", speed: 20});
        await page.setInputFiles("input[type=file]", file);
        await button(page, "Send the file").click();
        const rows = page.locator("[aria-label=transfers] tbody tr");
        const row = (text) => rows.filter({hasText: text}).first();
        await row("up").filter({hasText: "completed"}).waitFor();
        await request(page, "services/run", {action: "go", speed: 1});
        const fetched = async () => {
            await page.getByLabel("name of a file on board").fill("picture");
            await button(page, "Fetch").click();
            await row("down").filter({hasText: /active/}).waitFor();
            await page.waitForFunction(() => document.querySelector("[aria-label=transfers] progress").value > .1);
        };
        await fetched();
        await button(row("down"), "Suspend").click();
        await row("down").filter({hasText: "suspended"}).waitFor();
        await fly(page, "services", 10);
        const done = await row("down").locator(".num").textContent();
        await fly(page, "services", 30);
        assert.equal(await row("down").locator(".num").textContent(), done, "it stands");
        await request(page, "services/run", {action: "go", speed: 1});
        await button(row("down"), "Resume").click();
        await row("down").filter({hasText: "active"}).waitFor();
        await request(page, "services/run", {action: "go", speed: 20});
        await row("down").filter({hasText: "completed"}).waitFor();
        await page.locator("[aria-label='received files'] tr", {hasText: /40.0 kB20\d\d-\d\d-\d\d /}).waitFor();

        await request(page, "services/run", {action: "go", speed: 1});
        await fetched();
        await button(row("down"), "Cancel").click();
        await row("down").filter({hasText: "cancelled"}).waitFor();
        assert.equal(await row("down").getByRole("button").count(), 0);
        return page;
    },

    async "axe finds nothing serious, and nothing is wider than its window"() {
        await accessible({overview: "", stored: "", files: ""}, "services");
    },
});
