// SPDX-License-Identifier: Apache-2.0
// Stacks of commands: an ordered list that runs step by step, or until a verifier fails. A run goes on while the user
// opens other pages of the console; it ends when the browser closes the console.
import {outcome, send} from "./forms.js";
import {keep, kept} from "./transfer.js";
import {STAGES} from "./words.js";

const KIND = "fledge-stack";
const stacks = new Map();

/** The stack of a craft. */
export function stackOf(craft) {
    if (!stacks.has(craft)) stacks.set(craft, new Stack(craft));
    return stacks.get(craft);
}

/** The steps of a saved stack. Throws an error that names the wrong step. */
export function read(text) {
    let whole;
    try {
        whole = JSON.parse(text);
    } catch (error) { throw new Error(`A stack is a file of JSON: ${error.message}`); }
    if (whole?.kind !== KIND || !Array.isArray(whole.steps))
        throw new Error(`A stack has "kind": "${KIND}" and a list "steps"; this file has not`);
    return whole.steps.map((step, k) => {
        const {command, arguments: values = {}, until = "completed", wait = 0, note = ""} = step ?? {};
        if (typeof command !== "string" || !command) throw new Error(`Step ${k + 1} has no "command"`);
        if (typeof values !== "object" || values === null || Array.isArray(values))
            throw new Error(`Step ${k + 1}: "arguments" is {name: value}; found ${JSON.stringify(values)}`);
        if (!STAGES.includes(until))
            throw new Error(`Step ${k + 1}: "until" is one of ${STAGES.join(", ")}; found ${JSON.stringify(until)}`);
        if (!(wait >= 0 && wait < 1e9))
            throw new Error(`Step ${k + 1}: "wait" is in s, 0 or more; found ${JSON.stringify(wait)}`);
        return {command, arguments: values, until, wait, note: String(note)};
    });
}

export const written = (craft, steps) => `${JSON.stringify({kind: KIND, craft, steps: steps.map(
    ({command, arguments: values, until, wait, note}) =>
        ({command, arguments: values, until, wait, ...(note && {note})}))}, null, 1)}\n`;

export class Stack {
    constructor(craft) {
        Object.assign(this, {craft, steps: [], at: 0, running: false, problem: "", listeners: new Set(), over: null});
        try {
            this.steps = read(kept(this.place) ?? written(craft, []));
        } catch { /* an older console wrote it in another form */ }
    }

    get place() { return `fledge.stack.${this.craft}`; }

    /** Add a listener of changes. Returns a function that removes it. */
    on(listener) {
        this.listeners.add(listener);
        return () => this.listeners.delete(listener);
    }

    changed() {
        keep(this.place, written(this.craft, this.steps));
        for (const listener of [...this.listeners]) listener();
    }

    add({command, arguments: values, until = "completed", wait = 0, note = ""}, at = this.steps.length) {
        this.steps.splice(at, 0, {command, arguments: values, until, wait, note});
        if (at < this.at) this.at++;
        this.changed();
    }

    remove(k) {
        this.steps.splice(k, 1);
        if (k < this.at) this.at--;
        this.changed();
    }

    move(k, by) {
        const to = Math.max(0, Math.min(this.steps.length - 1, k + by));
        this.steps.splice(to, 0, ...this.steps.splice(k, 1));
        this.changed();
        return to;
    }

    replace(steps) {
        Object.assign(this, {steps, at: 0, problem: ""});
        this.changed();
    }

    /** Begin again at a step. */
    rewind(at = 0) {
        Object.assign(this, {at, problem: ""});
        for (const step of this.steps.slice(at)) delete step.sent;
        this.changed();
    }

    stop() { this.over?.abort(); }

    /** Send the next step, or all that are left, until one fails. */
    async run(api, live, all) {
        if (this.running) return;
        Object.assign(this, {running: true, problem: "", over: new AbortController()});
        const signal = this.over.signal;
        try {
            do {
                const k = this.at, step = this.steps[k];
                if (!step) break;
                delete step.sent;
                this.changed();
                const row = await this.verified(api, live, step, signal);
                if (row === null) throw new Error("it was not confirmed");
                const {state, text} = outcome(row, step.until);
                if (state === "bad") throw new Error(text);
                this.at = k + 1;
                this.changed();
                if (all && step.wait > 0 && this.at < this.steps.length) await this.wait(live, step.wait, signal);
            } while (all && !signal.aborted);
        } catch (error) {
            const step = this.steps[this.at];
            if (step && !signal.aborted) step.sent ??= {stages: [{stage: "refused", good: false, text: error.message}]};
            this.problem = signal.aborted ? `stopped by hand at step ${this.at + 1}` :
                                            `step ${this.at + 1}, ${this.steps[this.at]?.command}: ${error.message}`;
        } finally {
            this.running = false;
            this.waiting = "";
            this.changed();
        }
    }

    /** Send a step and wait for its verifier. Resolves to the row of the sent command; null if it was not confirmed. */
    verified(api, live, step, signal) {
        return new Promise((good, bad) => {
            let id = null;
            const early = new Map();
            const update = (row) => {
                if (row.craft !== undefined && row.craft !== this.craft) return;
                if (id === null)
                    early.set(row.id, row);
                else if (row.id === id) {
                    step.sent = row;
                    this.changed();
                    if (outcome(row, step.until).state !== "open") done(good, row);
                }
            };
            const again = async () => {
                for (const row of await live.rows(this.craft, "sent", "sent")) update(row);
            };
            const off = [live.on("sent", update), live.on("again", () => again().catch(() => {}))];
            const done = (settle, value) => {
                off.forEach((end) => end());
                settle(value);
            };
            signal.addEventListener("abort", () => done(bad, new Error("stopped")));
            send(api, this.craft, step.command, step.arguments).then((sent) => {
                if (sent === null) return done(good, null);
                id = sent;
                if (early.has(id))
                    update(early.get(id));
                else
                    again().catch(() => {});
                return undefined;
            }, (error) => done(bad, error));
        });
    }

    /** Wait until the craft's clock has advanced by some seconds. */
    wait(live, seconds, signal) {
        const now = () => {
            const craft = live.craft(this.craft);
            return craft?.clock === "simulated" ? Number(craft.t_ns) / 1e9 : Date.now() / 1e3;
        };
        const end = now() + seconds;
        return new Promise((good, bad) => {
            const timer = setInterval(() => {
                const left = end - now();
                if (left <= 0) {
                    clearInterval(timer);
                    good();
                }
                this.waiting = `waits ${Math.max(0, left).toFixed(0)} s`;
                for (const listener of [...this.listeners]) listener();
            }, 100);
            signal.addEventListener("abort", () => {
                clearInterval(timer);
                bad(new Error("stopped"));
            });
        });
    }
}
