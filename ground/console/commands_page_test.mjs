// SPDX-License-Identifier: Apache-2.0
// The pages that command. commands_page_test.py starts the server.
import assert from "node:assert/strict";
import {readFileSync, writeFileSync} from "node:fs";
import {join} from "node:path";

import {accessible, button, folder, open, request, row, rows, run} from "./testing/console.mjs";

const at = (name, selection = "", craft = "imager") => open(name, {craft, selection});

/** The sent commands with this name; the newest of them. */
const sent = (page, name) => rows(page.locator(".sent"), name);
const newest = (page, name) => sent(page, name).first();
const ticked = (page, name, stage) => newest(page, name).locator(`[aria-label="${stage}"]`).waitFor();
const press = (page, name) => button(page, name).click();
const choose = async (page, name) => {
    await page.keyboard.press("/");
    await page.keyboard.type(name);
    await page.keyboard.press("Enter");
    await page.locator(".command h2", {hasText: name}).waitFor();
};

/** After an action, messages make an element appear; it stays when a list arrives that was requested before them. */
async function outlives(page, craft, shown, list, act) {
    const control = (action) => request(page, `${craft}/run`, {action});
    await control("pause");     // no message comes before the request for the list
    await page.route(list, async (route) => {
        const response = await route.fetch();
        await control("go");
        await shown.waitFor();
        await route.fulfill({response});
    });
    const late = page.waitForResponse(list);
    await act();
    await (await late).finished();
    await page.waitForTimeout(100);
    assert.equal(await shown.count(), 1);
}

await run({
    async "a command is sent by keys alone, and its verifiers tick"() {
        const page = await at("overview");
        await page.keyboard.press("g");
        await page.keyboard.press("c");
        await page.locator(".commands .finder .tr", {hasText: "noop"}).waitFor();
        await choose(page, "flight.noop");
        await page.keyboard.press("Enter");
        for (const stage of ["released", "accepted", "completed"]) await ticked(page, "flight.noop", stage);
        return page;
    },

    async "the bytes follow what is typed, with the place of each argument"() {
        const page = await at("commands", "flight.write.steering.K1");
        await page.fill("#argument-K1", "0.25");
        await page.waitForFunction(() => document.querySelector(".preview .octets")
                                             ?.getAttribute("aria-label")
                                             .endsWith("3f d0 00 00 00 00 00 00"));
        assert.equal(
            await page.locator(".byte.given").allTextContents().then((all) => all.join("")), "3fd0000000000000");
        await page.locator(".bytes summary").click();
        await page.locator(".bytes tbody tr", {hasText: "module"}).hover();
        assert.equal(await page.locator(".byte.on").count(), 2);
        await page.fill("#argument-K1", "-2");
        await page.waitForSelector(".preview.old");
        return page;
    },

    async "a refused argument says why beside it, and nothing is sent"() {
        const page = await at("commands", "flight.telemetry");
        await page.selectOption("#argument-output", {index: 1});
        await page.selectOption("#argument-on", {index: 1});
        for (const [text, why] of [["many", "a whole number is needed"], ["99999999", "too few for 99999999"]]) {
            await page.fill("#argument-every", text);
            await page.locator("#argument-every-problem", {hasText: why}).waitFor();
        }
        const before = await sent(page, "flight.telemetry").count();
        await press(page, "Send");
        await page.waitForFunction(() => document.activeElement.id === "argument-every");
        await page.locator("#argument-every[aria-invalid=true]").waitFor();
        assert.equal(await sent(page, "flight.telemetry").count(), before);
        return page;
    },

    async "what flight refuses says which rule it would break"() {
        const page = await at("commands", "flight.write.vehicle.I_B");
        await page.locator("#argument-I_B_0_0, .form textarea, .form input").first().waitFor();
        for (const field of await page.locator(".form :is(input, textarea)").all()) await field.fill("1");
        await press(page, "Send");
        await ticked(page, "flight.write.vehicle.I_B", "failed, no");
        await newest(page, "flight.write.vehicle.I_B")
            .locator(".problem", {hasText: "the parameters would break a rule"}).waitFor();
        return page;
    },

    async "a hazardous command asks once more"() {
        const page = await at("commands", "flight.reset_flight");
        await page.locator(".hazard", {hasText: "begin anew"}).waitFor();
        const count = () => sent(page, "flight.reset_flight").count();
        const before = await count();
        await press(page, "Send");
        await page.locator("dialog[open]", {hasText: "begin anew"}).waitFor();
        await page.keyboard.press("Escape");
        await page.locator(".answer", {hasText: "Not sent."}).waitFor();
        assert.equal(await count(), before);
        await press(page, "Send");
        await press(page, "Send it");
        await ticked(page, "flight.reset_flight", "completed");
        return page;
    },

    async "a stack stops at the step that fails, and goes on when that is mended"() {
        const step = (command, values = {}, more = {}) => ({command, arguments: values, ...more});
        const bad = {K1: "-3"},
              steps = [step("flight.noop", {}, {wait: 1}), step("flight.write.steering.K1", bad), step("flight.noop")];
        const file = join(folder, "stack.json");
        writeFileSync(file, JSON.stringify({kind: "fledge-stack", steps}));
        const page = await at("stacks");
        await page.setInputFiles("input[type=file]", file);
        await page.locator(".steps tbody tr").nth(2).waitFor();
        await page.keyboard.press("r");
        await page.locator(".answer.problem", {hasText: "step 2, flight.write.steering.K1"}).waitFor();
        const signs = () => page.locator(".steps tbody td:first-child").allTextContents();
        assert.deepEqual((await signs()).map((sign) => sign.trim()), ["\u2713", "\u2717", ""]);
        await page.locator(".steps tbody tr").nth(1).click();
        await page.fill("#argument-K1", "0.3");
        await page.keyboard.press("Escape");
        await page.keyboard.press("r");
        await page.locator(".answer", {hasText: "All steps are done."}).waitFor();
        assert.deepEqual((await signs()).map((sign) => sign.trim()), ["\u2713", "\u2713", "\u2713"]);
        const [saved] = await Promise.all([page.waitForEvent("download"), press(page, "Save")]);
        assert.equal(JSON.parse(readFileSync(await saved.path(), "utf-8")).steps[1].arguments.K1, 0.3);
        writeFileSync(file, '{"kind": "fledge-stack", "steps": [{"command": "flight.noop", "until": "later"}]}');
        await page.setInputFiles("input[type=file]", file);
        await page.locator(".problem", {hasText: 'Step 1: "until" is one of'}).waitFor();
        return page;
    },

    async "a table is read, edited beside what is on board, and loaded"() {
        const page = await at("tables", "flight.steering");
        await page.locator("h2", {hasText: "flight.steering"}).waitFor();
        await page.click("text=Read from the spacecraft");
        await page.waitForFunction(() => Number(document.querySelector(".pane tbody td.num")?.textContent) > 0);
        const other = (Number(await page.locator(".pane tbody td.num").first().textContent()) + 0.125).toString();
        const field = page.getByLabel("K1, to load");
        await field.fill("");
        await page.locator(".row .soft", {hasText: "1 values are wrong"}).waitFor();
        assert(await page.locator(".primary", {hasText: "Load"}).isDisabled());
        await field.fill(other);
        await page.locator(".row .soft", {hasText: "1 differs"}).waitFor();
        await page.click(".primary >> text=Load");
        await page.locator(".answer", {hasText: "done"}).waitFor();
        await page.locator(".row .soft", {hasText: "as on board"}).waitFor();
        await page.click("text=Read from the spacecraft");
        await page.waitForFunction((value) => document.querySelector(".answer").textContent.includes("done") &&
                document.querySelector(".pane tbody td.num").textContent === value,
            other);
        return page;
    },

    async "a file goes up, is listed, and comes back the same"() {
        const file = join(folder, "plan.bin"),
              content = Buffer.from(Array.from({length: 3000}, (_, k) => (k * k) % 251));
        writeFileSync(file, content);
        const page = await at("files", "", "flatsat");
        await page.setInputFiles("input[type=file]", file);
        await page.fill("[aria-label='its name on board']", "next");
        await page.click("text=Send the file");
        await page.locator("[aria-label=transfers] tr", {hasText: "next"}).locator("text=completed").first().waitFor();
        await page.fill("[aria-label='name of a file on board']", "next");
        await press(page, "Fetch");
        const link = page.locator("[aria-label='received files'] a", {hasText: "next"});
        await link.waitFor();
        const [down] = await Promise.all([page.waitForEvent("download"), link.click()]);
        assert(readFileSync(await down.path()).equals(content), "the file came back otherwise");
        await page.click("text=List what is on board");
        await page.locator("[aria-label='from the spacecraft'] tbody tr", {hasText: "next"}).waitFor();
        await page.fill("[aria-label='name of a file on board']", "nowhere");
        const failed = page.locator("[aria-label=transfers] tr", {hasText: "nowhere"}).locator("text=failed");
        await outlives(page, "flatsat", failed, "**/transfers",
            () => page.click("[aria-label='from the spacecraft'] >> text=Fetch"));
        return page;
    },

    async "a simulated craft pauses, steps, changes its speed, and takes a fault"() {
        const page = await at("run");
        const t = async () => BigInt((await request(page, "imager/run")).t_ns);
        await page.locator(".state.running").waitFor();
        await page.keyboard.press(" ");
        await page.locator(".state.paused").waitFor();
        const before = await t();
        await page.waitForTimeout(300);
        assert.equal(await t(), before);
        await page.fill("[aria-label='seconds of a step']", "7");
        await press(page, "Step");
        for (let k = 0; await t() !== before + 7000000000n; k++) {
            assert(k < 6000, `after a step of 7 s it is ${await t() - before} ns further`);
            await page.waitForTimeout(100);
        }
        await page.fill(".faults input[type=search]", "wheels friction");
        await page.locator(".faults tbody tr", {hasText: "world.wheels.friction"}).first().click();
        await page.fill("[aria-label=value]", "[0, 0.03, 0, 0]");
        await press(page, "Inject");
        await page.locator(".done li", {hasText: "world.wheels.friction = [0,0.03,0,0]"}).waitFor();
        await page.fill("[aria-label=value]", "[1]");
        await press(page, "Inject");
        await page.locator(".faults .problem").waitFor();
        await page.selectOption("[aria-label=speed]", "50");
        await page.locator(".state.running").waitFor();
        assert.equal((await request(page, "imager/run")).speed, 50);
        return page;
    },

    async "a display with an unknown name says why, and the rest of it moves"() {
        const page = await at("displays", "odd");
        await page.locator(".problem", {hasText: "odd.toml:6: there is no parameter 'flight.tracking.eror'"}).waitFor();
        await page.locator(".display h3", {hasText: "<img src=x onerror=alert(1)>"}).waitFor();
        assert.equal(await page.locator(".display img").count(), 0);
        const value = page.locator("td.value").first(), first = await value.textContent();
        await page.waitForFunction((was) => document.querySelector("td.value").textContent !== was, first);
        await page.locator("canvas").waitFor();
        const completed = page.locator(".buttons .answer", {hasText: "completed"});
        await outlives(page, "imager", completed, "**/sent", () => page.click(".buttons >> text=Nothing"));
        return page;
    },

    async "the overview has the mission's picture, and a question of a script until it is answered"() {
        const page = await at("overview");
        await page.waitForFunction(() => document.querySelector(".card img")?.naturalWidth === 480);
        await request(page, "imager/questions", {text: "Go on?"});
        await page.locator(".question", {hasText: "Go on?"}).waitFor();
        await page.reload();
        await page.locator(".question", {hasText: "Go on?"}).waitFor();
        await press(page, "Yes, go on");
        await page.locator(".question").waitFor({state: "detached"});
        return page;
    },

    async "the displays of the mission have no problem"() {
        const page = await at("displays", "pointing");
        await page.locator("canvas").waitFor();
        assert.equal(await page.locator(".display .problem").count(), 0);
        return page;
    },

    async "a plot has the components of a vector together, and their unit on its axis"() {
        const page = await at("parameters");
        await page.keyboard.press("/");
        await page.keyboard.type("tracking.error.omega_br_b[1]");
        await row(page, "omega_BR_B[1]").click();
        await page.locator(".detail button", {hasText: "Plot"}).click();
        await page.locator(".u-title", {hasText: /^flight\.tracking\.error\.omega_BR_B$/}).waitFor();
        assert.deepEqual(await page.locator(".u-label:visible").allTextContents(), ["t", "[0]", "[1]", "[2]"]);
        assert.equal(await page.evaluate(() => document.querySelector(".holder").plot.axes[1].label), "rad/s");
        await page.locator(".u-legend .u-series", {hasText: /^\[2\]:?\s*[\u2212\d.e]+ rad\/s/}).waitFor();
        return page;
    },

    async "axe finds nothing serious, and nothing is wider than its window"() {
        return accessible({commands: "flight.telemetry", stacks: "", stored: "", files: "", tables: "", run: "",
            displays: ""}, "imager");
    },
});
