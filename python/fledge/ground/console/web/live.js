// SPDX-License-Identifier: Apache-2.0
// The connection that lives: values of what is visible, and what happens. It comes back by itself.
import {of} from "./api.js";
import {Store, craftOf} from "./store.js";

const COUNTED = 2000;       // ms between two looks at the counts of packets and links

export class Live {
    constructor(api) {
        Object.assign(this, {
            api,
            crafts: [],
            stores: new Map(),
            wishes: new Set(),
            hearers: new Map(),
            frames: new Set(),
            skipped: 0,
            state: "lost",
            received: 0,
            pause: 500,
            sent: new Map(),
            pending: 0
        });
        document.addEventListener("visibilitychange", () => this.changed());
    }

    async begin() {
        await this.load();
        this.connect();
        setInterval(() => document.hidden || this.state !== "connected" || this.count().catch(() => {}), COUNTED);
    }

    /** Ask again which craft there are. */
    async load() {
        this.crafts = await this.api.get("/api/crafts");
        this.emit("crafts", {});
    }

    /** Ask for the counts of all craft. */
    async count() {
        this.crafts = await this.api.get("/api/crafts");
        this.draw();
    }

    craft(name) { return this.crafts.find((one) => one.name === name); }

    /** The store of a craft's values; its slots are known when the promise is kept. */
    async slots(name) {
        const store = this.store(name);
        store.ready ??= this.api.get(of(name, "slots")).then((slots) => store.learn(slots));
        try {
            await store.ready;
        } catch (error) {
            store.ready = undefined;
            throw error;
        }
        return store;
    }

    store(name) {
        if (!this.stores.has(name)) this.stores.set(name, new Store(name));
        return this.stores.get(name);
    }

    /** Have values: slots: a list of numbers, or "all"; truth: and the motion of the 3-D view. Returns a wish with
        change(slots) and end(). */
    want(craft, slots, hz = 10, truth = false) {
        const wish = {craft, slots, hz, truth,
                      change: (other) => { wish.slots = other; this.changed(); },
                      end: () => { this.wishes.delete(wish); this.changed(); }};
        this.wishes.add(wish);
        this.changed();
        return wish;
    }

    /** Hear of a kind of message ("event", "alarm", "sent", ...; "state" of the connection). Returns what ends it. */
    on(kind, hear) {
        if (!this.hearers.has(kind)) this.hearers.set(kind, new Set());
        this.hearers.get(kind).add(hear);
        return () => this.hearers.get(kind).delete(hear);
    }

    /**
     * Ask for a list of a craft whose rows have an id. A message of the same kind that arrives before the answer may be
     * newer than the answer, so it replaces its row.
     */
    async rows(craft, list, kind) {
        const said = new Map(), end = this.on(kind, (one) => one.craft === craft && said.set(one.id, one));
        try {
            const found = await this.api.get(of(craft, list));
            return [...found.filter(({id}) => !said.has(id)), ...said.values()];
        } finally {
            end();
        }
    }

    /** Be called once in each picture of the browser in which values have changed. Returns what ends it. */
    onFrame(draw) {
        this.frames.add(draw);
        return () => this.frames.delete(draw);
    }

    emit(kind, message) {
        for (const hear of [...(this.hearers.get(kind) ?? [])]) hear(message);
    }

    connect() {
        const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/live`);
        socket.binaryType = "arraybuffer";
        socket.onopen = () => {
            Object.assign(this, {socket, pause: 500, sent: new Map()});
            this.set("connected");
            this.changed();
            if (this.once) this.again().catch(() => {});
            this.once = true;
        };
        socket.onmessage = ({data}) => (typeof data === "string" ? this.hear(JSON.parse(data)) : this.take(data));
        socket.onclose = () => {
            this.socket = null;
            this.set("lost");
            this.api.begin().then(({user}) => user || this.api.refused(), () => {});    // the session may have ended
            setTimeout(() => this.connect(), this.pause);
            this.pause = Math.min(5000, 1.6 * this.pause);
        };
    }

    /** Ask what happened meanwhile; the server may be another one, with another session. */
    async again() {
        if (!(await this.api.begin()).user) return this.api.refused();
        await this.load();
        return this.emit("again", {});
    }

    set(state) {
        this.state = state;
        this.emit("state", {state});
    }

    take(buffer) {
        const index = craftOf(buffer), craft = this.crafts.find((one) => one.index === index);
        if (!craft) return;
        this.store(craft.name).take(buffer);
        this.received++;
        this.draw();
    }

    /** Draw what has changed, in the browser's next picture. */
    draw() {
        if (this.drawing) return;
        this.drawing = requestAnimationFrame(() => {
            this.drawing = 0;
            for (const draw of [...this.frames]) draw();
        });
    }

    hear(message) {
        if (message.kind === "skipped") this.skipped = message.count;
        if (message.kind === "crafts") this.load().catch(() => {});
        if (message.kind === "slots" && this.stores.get(message.craft)?.ready) {
            const store = this.store(message.craft);
            store.ready = this.api.get(of(message.craft, "slots"), {first: message.first})
                .then((slots) => { store.learn(slots); this.emit("learned", message); });
        }
        if (message.kind === "craft") {
            const at = this.crafts.findIndex((one) => one.name === message.craft);
            if (at >= 0) this.crafts[at] = {...this.crafts[at], ...message};
        }
        this.emit(message.kind, message);
        this.draw();
    }

    /** The wishes have changed: tell the server what is visible, once for all changes of this moment. */
    changed() {
        if (this.pending) return;
        this.pending = setTimeout(() => {
            this.pending = 0;
            this.subscribe();
        });
    }

    subscribe() {
        if (this.socket?.readyState !== WebSocket.OPEN) return;
        const wanted = new Map();
        for (const {craft, slots, hz, truth} of document.hidden ? [] : this.wishes) {
            const had = wanted.get(craft) ?? {slots: new Set(), hz: 0, truth: false};
            had.hz = Math.max(had.hz, hz);
            had.truth ||= truth;
            if (slots === "all" || had.slots === "all") had.slots = "all";
            else for (const slot of slots) had.slots.add(slot);
            wanted.set(craft, had);
        }
        for (const craft of this.sent.keys())
            if (!wanted.has(craft)) {
                this.socket.send(JSON.stringify({unsubscribe: craft}));
                this.sent.delete(craft);
            }
        for (const [craft, {slots, hz, truth}] of wanted) {
            const list = slots === "all" ? slots : [...slots].sort((a, b) => a - b);
            const text = JSON.stringify({subscribe: {craft, slots: list, hz, truth}});
            if (this.sent.get(craft) !== text) this.socket.send(text);
            this.sent.set(craft, text);
        }
    }
}
