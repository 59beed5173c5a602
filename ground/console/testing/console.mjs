// SPDX-License-Identifier: Apache-2.0
// A browser for checks of the console: node SCRIPT ADDRESS FOLDER MODULES CHROMIUM
// prints {check: "" or its error}. testing/console.py starts it. FLEDGE_PICTURES=DIR keeps pictures.
import assert from "node:assert/strict";
import {readFileSync} from "node:fs";
import {join} from "node:path";
import {pathToFileURL} from "node:url";

const [address, folder, modules, program] = process.argv.slice(2);
const {chromium} = await import(pathToFileURL(join(modules, "playwright-core/index.mjs")));
const axe = readFileSync(join(modules, "axe-core/axe.min.js"), "utf-8");
const PATIENCE = Number(process.env.FLEDGE_PATIENCE_MS ?? 600000);

const browser = await chromium.launch({executablePath: program, args: [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync"]});

export {address, folder};

const anchor = (name, about) =>
    `#/${name}?${new URLSearchParams(Object.entries(about).filter(([, value]) => value))}`;

async function picture(page, name) {
    if (process.env.FLEDGE_PICTURES)
        await page.screenshot({path: join(process.env.FLEDGE_PICTURES, `${name.replace(/[^\w]+/g, "-")}.png`)});
}

/** The server's page at a link, which may show the login first; or the page of a file. */
export async function enter(hash, {width = 1280, height = 800, colorScheme = "dark"} = {}) {
    const context = await browser.newContext({viewport: {width, height}, colorScheme, acceptDownloads: true});
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE);
    page.problems = [];
    page.on("pageerror", (error) => page.problems.push(error.stack));
    page.on("console", (line) => line.type() === "error" && !/status of 4\d\d|response code: 401/.test(line.text()) &&
        page.problems.push(line.text()));
    page.on("dialog", (dialog) => {
        page.problems.push(`a dialog: ${dialog.message()}`);
        dialog.dismiss();
    });
    await page.goto(hash.startsWith("file:") ? hash : `${address}/${hash}`);
    return page;
}

/** A page of the console. */
export async function open(name, {craft = "", selection = "", ...window} = {}) {
    const page = await enter(anchor(name, {craft, sel: selection}), window);
    await page.waitForSelector("html[data-opened]");
    return page;
}

/** The rows of tables with a text; and the first of them. */
export const rows = (place, text) => place.locator(".tbody .tr:not([hidden])", {hasText: text});
export const row = (place, text) => rows(place, text).first();
export const button = (place, name) => place.getByRole("button", {name, exact: true});

/** A request to the server for data of a craft, or with a body for an action. */
export const request = (page, path, body) => page.evaluate(([target, data]) =>
    controlRoom.live.api[data ? "post" : "get"](`/api/crafts/${target}`, data), [path, body]);

/** What a page hides, as sentences: parts wider than the window, and cut words that no pointer shows in full. */
export async function hidden(page) {
    return page.evaluate(() => {
        const problems = new Set(), seen = (node) => node.checkVisibility({visibilityProperty: true}) &&
            node.getBoundingClientRect().width > 1;
        const named = (node) => `${node.tagName.toLowerCase()}${[...node.classList].map((name) => `.${name}`).join("")}`;
        const scrolls = (style) => ["auto", "scroll"].includes(style.overflowX);
        for (const node of [document.documentElement, document.body, ...document.querySelectorAll("main, .page")])
            if (node.scrollWidth > node.clientWidth + 1)
                problems.add(`${named(node)} is ${node.scrollWidth} wide, of ${node.clientWidth}`);
        for (const node of document.querySelectorAll("body *")) {
            const text = [...node.childNodes].some(({nodeType, data}) => nodeType === Node.TEXT_NODE && data.trim());
            if (!seen(node) || !text && !node.matches("button, input, select, textarea, canvas")) continue;
            const words = `"${(node.textContent || node.value || "").trim().slice(0, 60)}" in ${named(node)}`;
            let {right} = node.getBoundingClientRect();
            if (text && node.scrollWidth > node.clientWidth + 1 && getComputedStyle(node).overflowX !== "visible" &&
                !scrolls(getComputedStyle(node)) && getComputedStyle(node).display !== "inline") {
                node.dispatchEvent(new PointerEvent("pointerover", {bubbles: true}));
                if (!node.closest("[title]")) problems.add(`${words} is cut`);
            }
            for (let at = node.parentElement; at && at !== document.documentElement; at = at.parentElement) {
                const style = getComputedStyle(at), edge = at.getBoundingClientRect();
                if (scrolls(style)) right = Math.min(right, edge.right);      // a person can scroll to it
                else if (style.overflowX !== "visible" && right > edge.right + 1) {
                    if (!node.closest("[title]")) problems.add(`${words} ends behind the edge of ${named(at)}`);
                    break;
                }
            }
            if (right > innerWidth + 1) problems.add(`${words} ends beyond the window`);
        }
        return [...problems];
    });
}

/**
 * Open pages {name: selection} in windows from a screen to a phone, dark and light: axe-core finds nothing serious, and
 * nothing is hidden.
 */
export async function accessible(pages, craft = "") {
    for (const [width, height] of [[1280, 800], [820, 1180], [400, 800]]) {
        const page = await open(Object.keys(pages)[0], {craft, width, height});
        await page.evaluate(axe);
        for (const [name, sel] of Object.entries(pages)) {
            await page.evaluate((hash) => { location.hash = hash; }, anchor(name, {craft, sel}));
            await page.locator(`.page.${name}`).waitFor();
            await page.waitForTimeout(300);
            assert.deepEqual(await hidden(page), [], `${name}, ${width}`);
            // In the other colours, and in a phone's window, nothing but the contrast could differ.
            for (const [colorScheme, options] of [["dark", {}], ["light", {runOnly: ["color-contrast"]}]]) {
                if (width === 400) break;
                await page.emulateMedia({colorScheme});
                const {violations} = await page.evaluate((given) => window.axe.run(given), options);
                assert.deepEqual(violations.filter(({impact}) => ["serious", "critical"].includes(impact))
                    .map((violation) =>
                    `${name}, ${colorScheme}, ${width}: ${violation.id}: ` +
                        violation.nodes.map(({html}) => html.slice(0, 200)).join("\n")), []);
                await picture(page, `${name}-${colorScheme}-${width}`);
            }
        }
        assert.deepEqual(page.problems, [], "the page's own errors");
        await page.context().close();
    }
}

/** Run the checks in turn; each returns its page. */
export async function run(checks) {
    const errors = {};
    for (const [name, check] of Object.entries(checks)) {
        errors[name] = "";
        try {
            const page = await check();
            assert.deepEqual(page?.problems ?? [], [], "the page's own errors");
            if (page) await picture(page, name);
        } catch (error) {
            errors[name] = error.stack;
        }
        for (const context of browser.contexts()) await context.close();
    }
    await browser.close();
    console.log(JSON.stringify(errors));
}
