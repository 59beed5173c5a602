// SPDX-License-Identifier: Apache-2.0
// Users who log in, and users without the role to command. users_page_test.py starts it.
import assert from "node:assert/strict";

import {address, button, enter, run} from "./testing/console.mjs";

const LACKS = "vera lacks the role 'command' for imager";
// The buttons that command, of each page.
const BUTTONS = {
    commands: ["Send"],
    stacks: ["Run until one fails", "Run the next"],
    stored: ["Store a command", "Read the list"],
    files: ["Send the file", "Fetch", "List what is on board"],
    tables: ["Read from the spacecraft"],
    run: ["Step", "Inject"],
};

async function login(page, name, password = name.repeat(4)) {
    await page.getByLabel("User").fill(name);
    await page.getByLabel("Password").fill(password);
    await page.keyboard.press("Enter");
}

async function inside(name, where = "overview") {
    const page = await enter(`#/${where}?craft=imager`);
    await login(page, name);
    await page.waitForSelector("html[data-opened]");
    return page;
}

await run({
    async "a wrong password is refused in words, the right one leads to the page of the link"() {
        const page = await enter("#/events?craft=imager");
        await login(page, "vera", "guess");
        await page.locator(".login .problem").waitFor();
        assert.doesNotMatch(await page.locator(".login .problem").textContent(), /401|undefined/);
        await login(page, "vera");
        await page.locator(".page.events").waitFor();
        assert.equal(await page.locator(".top .user").textContent(), "vera");
        assert.match(page.url(), /#\/events/);
        return page;
    },

    async "a user without the role has no button that commands, and sees why"() {
        const page = await inside("vera");
        for (const [name, buttons] of Object.entries(BUTTONS)) {
            await page.goto(`${address}/#/${name}?craft=imager${name === "commands" ? "&sel=flight.noop" : ""}`);
            await page.locator(`.page.${name}`).waitFor();
            await page.locator(".lacks", {hasText: LACKS}).waitFor();
            for (const text of buttons) assert(await button(page, text).first().isDisabled(), `${name}: ${text}`);
        }
        await page.goto(`${address}/#/parameters?craft=imager`);    // but all values
        await page.locator(".page.parameters").waitFor();
        await page.waitForFunction(() => controlRoom.live.received > 0);
        assert.equal(await page.locator(".lacks").count(), 0);
        return page;
    },

    async "an action that the server refuses shows why"() {
        const page = await inside("vera", "run");
        await page.locator(".page.run .state").waitFor();
        await page.keyboard.press("+");
        await page.locator(".page.run .problem", {hasText: LACKS}).waitFor();
        const before = await page.evaluate(() => controlRoom.live.api.get("/api/crafts/imager/run"));
        assert.equal(before.speed, 1, "and nothing has changed");
        await page.goto(`${address}/#/log?craft=imager`);
        await page.locator(".tbody .tr", {hasText: LACKS}).first().waitFor();
        return page;
    },

    async "a user with the role commands"() {
        const page = await inside("carl", "commands");
        await page.goto(`${address}/#/commands?craft=imager&sel=flight.noop`);
        await button(page, "Send").click();
        await page.locator(".sent .tbody .tr", {hasText: "carl"}).first().waitFor();
        assert.equal(await page.locator(".lacks").count(), 0);
        return page;
    },

    async "a session that has ended ends on all its pages"() {
        const page = await inside("vera"), other = await page.context().newPage();
        await other.goto(`${address}/#/plots?craft=imager`);
        await other.waitForSelector("html[data-opened]");
        await page.getByRole("button", {name: "Log out"}).click();
        for (const window of [page, other]) await window.locator(".login").waitFor();
        await login(other, "carl");
        await other.locator(".page.plots").waitFor();
        return page;
    },
});
