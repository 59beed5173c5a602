// SPDX-License-Identifier: Apache-2.0
// A browser for checks of the console: node SCRIPT ADDRESS FOLDER MODULES CHROMIUM
// prints {check: "" or what went wrong}. testing/console.py starts it. FLEDGE_PICTURES=DIR keeps pictures.
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

/** The server's page at a link, which may ask for a user first; or a file's. */
export async function enter(hash, {width = 1280, height = 800, colorScheme = "dark"} = {}) {
    const context = await browser.newContext({viewport: {width, height}, colorScheme, acceptDownloads: true});
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE);
    page.problems = [];
    page.on("pageerror", (error) => page.problems.push(error.stack));
    page.on("console", (said) => said.type() === "error" && !/status of 4\d\d|response code: 401/.test(said.text()) &&
        page.problems.push(said.text()));
    page.on("dialog", (dialog) => {
        page.problems.push(`a dialog: ${dialog.message()}`);
        dialog.dismiss();
    });
    await page.goto(hash.startsWith("file:") ? hash : `${address}/${hash}`);
    return page;
}

/** A page of the console. */
export async function open(name, {craft = "", selection = "", ...look} = {}) {
    const page = await enter(anchor(name, {craft, sel: selection}), look);
    await page.waitForSelector("html[data-opened]");
    return page;
}

/**
 * What a page hides: a part that is wider than the window, and words that are cut where no pointer can read them in
 * full. A list of sentences.
 */
export async function hidden(page) {
    return page.evaluate(() => {
        const found = new Set(), seen = (node) => node.checkVisibility({visibilityProperty: true}) &&
            node.getBoundingClientRect().width > 1;
        const named = (node) => `${node.tagName.toLowerCase()}${[...node.classList].map((one) => `.${one}`).join("")}`;
        const scrolls = (style) => ["auto", "scroll"].includes(style.overflowX);
        for (const node of [document.documentElement, document.body, ...document.querySelectorAll("main, .page")])
            if (node.scrollWidth > node.clientWidth + 1)
                found.add(`${named(node)} is ${node.scrollWidth} wide, of ${node.clientWidth}`);
        for (const node of document.querySelectorAll("body *")) {
            const text = [...node.childNodes].some((one) => one.nodeType === Node.TEXT_NODE && one.data.trim());
            if (!seen(node) || !text && !node.matches("button, input, select, textarea, canvas")) continue;
            const words = `"${(node.textContent || node.value || "").trim().slice(0, 60)}" in ${named(node)}`;
            let {right} = node.getBoundingClientRect();
            if (text && node.scrollWidth > node.clientWidth + 1 && getComputedStyle(node).overflowX !== "visible" &&
                !scrolls(getComputedStyle(node)) && getComputedStyle(node).display !== "inline") {
                node.dispatchEvent(new PointerEvent("pointerover", {bubbles: true}));
                if (!node.closest("[title]")) found.add(`${words} is cut`);
            }
            for (let at = node.parentElement; at && at !== document.documentElement; at = at.parentElement) {
                const style = getComputedStyle(at), edge = at.getBoundingClientRect();
                if (scrolls(style)) right = Math.min(right, edge.right);      // a person can scroll to it
                else if (style.overflowX !== "visible" && right > edge.right + 1) {
                    if (!node.closest("[title]")) found.add(`${words} ends behind the edge of ${named(at)}`);
                    break;
                }
            }
            if (right > innerWidth + 1) found.add(`${words} ends beyond the window`);
        }
        return [...found];
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
            // The other colours change nothing but the contrast, and a phone's window not even that.
            for (const [colorScheme, options] of [["dark", {}], ["light", {runOnly: ["color-contrast"]}]]) {
                if (width === 400) break;
                await page.emulateMedia({colorScheme});
                const {violations} = await page.evaluate((asked) => window.axe.run(asked), options);
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

/** Run the checks, one after the other; each returns its page. */
export async function run(checks) {
    const found = {};
    for (const [name, check] of Object.entries(checks)) {
        found[name] = "";
        try {
            const page = await check();
            assert.deepEqual(page?.problems ?? [], [], "the page's own errors");
            if (page) await picture(page, name);
        } catch (error) {
            found[name] = error.stack;
        }
        for (const one of browser.contexts()) await one.close();
    }
    await browser.close();
    console.log(JSON.stringify(found));
}
