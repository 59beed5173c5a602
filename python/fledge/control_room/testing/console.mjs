// SPDX-License-Identifier: Apache-2.0
// A browser for checks of the console: node SCRIPT ADDRESS FOLDER MODULES CHROMIUM
// prints {check: "" or what went wrong}. testing/console.py starts it. FLEDGE_PICTURES=DIR keeps a picture of each check.
import assert from "node:assert/strict";
import {readFileSync} from "node:fs";
import {join} from "node:path";
import {pathToFileURL} from "node:url";

const [address, folder, modules, program] = process.argv.slice(2);
const {chromium} = await import(pathToFileURL(join(modules, "playwright-core/index.mjs")));
const axe = readFileSync(join(modules, "axe-core/axe.min.js"), "utf-8");
const PATIENCE = Number(process.env.FLEDGE_PATIENCE_MS ?? 60000);

const browser = await chromium.launch({executablePath: program, args: [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync"]});

export {address, folder};

/** A page of the console. */
export async function open(name, {craft = "", selection = "", width = 1280, height = 800, colorScheme = "dark"} = {}) {
    const context = await browser.newContext({viewport: {width, height}, colorScheme, acceptDownloads: true});
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE);
    page.problems = [];
    page.on("pageerror", (error) => page.problems.push(error.stack));
    page.on("console", (said) => said.type() === "error" && !/status of 4\d\d/.test(said.text()) &&
        page.problems.push(said.text()));
    page.on("dialog", (dialog) => {
        page.problems.push(`a dialog: ${dialog.message()}`);
        dialog.dismiss();
    });
    const about = new URLSearchParams();
    if (craft) about.set("craft", craft);
    if (selection) about.set("sel", selection);
    await page.goto(`${address}/#/${name}?${about}`);
    await page.waitForSelector("html[data-opened]");
    return page;
}

/** What axe-core finds that is serious, on the page as it is. */
export async function accessible(page) {
    await page.evaluate(axe);
    const found = await page.evaluate(() => window.axe.run());
    assert.deepEqual(found.violations.filter(({impact}) => ["serious", "critical"].includes(impact)).map((one) =>
        `${one.id}: ${one.nodes.map(({html}) => html.slice(0, 200)).join("\n")}`), []);
}

/** Run the checks, one after the other; each returns its page. */
export async function run(checks) {
    const found = {};
    for (const [name, check] of Object.entries(checks)) {
        found[name] = "";
        try {
            const page = await check();
            assert.deepEqual(page?.problems ?? [], [], "the page's own errors");
            if (process.env.FLEDGE_PICTURES && page)
                await page.screenshot({path: join(process.env.FLEDGE_PICTURES, `${name.replace(/[^\w]+/g, "-")}.png`)});
        } catch (error) {
            found[name] = error.stack;
        }
        for (const one of browser.contexts()) await one.close();
    }
    await browser.close();
    console.log(JSON.stringify(found));
}
