// SPDX-License-Identifier: Apache-2.0
// Pictures of every page at three widths, light and dark, and the parts that each hides. testing/pictures.py starts it.
import {readFileSync} from "node:fs";
import {join} from "node:path";

import {enter, folder, hidden, run} from "./console.mjs";

const {out, user, password, pages, crafts, files} = JSON.parse(readFileSync(join(folder, "pictures.json"), "utf-8"));
const SIZES = [[400, 800], [1280, 800], [1920, 1080]];
const problems = [];

async function pictures(page, name, width) {
    for (const colorScheme of ["light", "dark"]) {
        await page.emulateMedia({colorScheme});
        await page.waitForTimeout(250);
        await page.screenshot({path: join(out, `${name}-${width}-${colorScheme}.png`)});
    }
    problems.push(...(await hidden(page)).map((text) => `${name}, ${width}: ${text}`));
}

/** The selection of a page: for plots a vector, for commands one with arguments. */
const selection = (page, name, craft) => page.evaluate(async ([shown, of]) => {
    const {live} = controlRoom, {slots} = await live.slots(of);
    if (shown === "plots") {
        const vector = slots.find((slot) => /omega.*\[0\]$/.test(slot?.name)) ??
            slots.find((slot) => slot?.kind === "real");
        return vector?.name.replace(/\[0\]$/, "") ?? "";
    }
    if (shown !== "commands") return "";
    const forms = await live.api.get(`/api/crafts/${of}/commands`);
    return (forms.find((form) => form.arguments.length > 2) ?? forms[0])?.name ?? "";
}, [name, craft]);

/** Pictures of a file in a window. */
async function ofFile(file, window) {
    const page = await enter(file, window);
    await page.waitForTimeout(1000);
    await pictures(page, file.split("/").at(-1).replace(/\.html$/, ""), window.width);
    problems.push(...page.problems);
    await page.context().close();
}

/** Pictures of the console's pages in a window. */
async function ofConsole(window) {
    const page = await enter("", window);
    await page.locator(".login input").first().waitFor();
    if (pages.includes("login")) await pictures(page, "login", window.width);
    await page.getByLabel("User").fill(user);
    await page.getByLabel("Password").fill(password);
    await page.keyboard.press("Enter");
    await page.waitForSelector("html[data-opened]");
    await page.waitForTimeout(3000);        // values come, and alarms
    const all = await page.locator("nav [data-page]").evaluateAll((links) => links.map(({dataset}) => dataset.page));
    for (const name of all.filter((page) => pages.includes("all") || pages.includes(page)))
        for (const craft of name === "overview" ? crafts.slice(0, 1) : crafts) {
            const sel = await selection(page, name, craft);
            await page.evaluate((hash) => { location.hash = hash; },
                `#/${name}?${new URLSearchParams({craft, sel})}`);
            await page.locator(`.page.${name}`).waitFor();
            await page.waitForTimeout(name === "view" ? 4000 : 1200);
            await pictures(page, name === "overview" ? name : `${name}-${craft}`, window.width);
        }
    problems.push(...page.problems);
    await page.context().close();
}

await run({
    async "pictures"() {
        for (const [width, height] of SIZES) {
            for (const file of files) await ofFile(file, {width, height});
            if (pages.length) await ofConsole({width, height});
        }
    },
});
console.error(problems.join("\n"));
