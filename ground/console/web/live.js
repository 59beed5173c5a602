// SPDX-License-Identifier: Apache-2.0
// The live connection: values of the visible slots, and messages. It reconnects by itself.
import {of} from "./api.js";
import {Store, craftOf} from "./store.js";

const COUNTED = 2000;       // [ms] between two requests for the counts of packets and links

export class Live {
    constructor(api) {
        Object.assign(this, {
            api,
            crafts: [],
            stores: new Map(),
            wishes: new Set(),
            listeners: new Map(),
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

    /** Load the list of spacecraft. */
    async load() {
        await this.count();
        this.emit("crafts", {});
    }

    /** Load the counts of all spacecraft. */
    async count() {
        this.crafts = await this.api.get("/api/crafts");
        this.draw();
    }

    craft(name) { return this.crafts.find((craft) => craft.name === name); }

    /** The store of a craft's values, after its slots have arrived. */
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

    /** Subscribe to values. slots: their numbers, or "all"; truth: also the motion for the 3-D view. Returns a wish
        with change(slots) and end(). */
    want(craft, slots, hz = 10, truth = false) {
        const wish = {craft, slots, hz, truth,
                      change: (other) => { wish.slots = other; this.changed(); },
                      end: () => { this.wishes.delete(wish); this.changed(); }};
        this.wishes.add(wish);
        this.changed();
        return wish;
    }

    /** Add a listener of a kind of message ("event", "alarm", "sent", ...; "state" of the connection). Returns a
        function that removes it. */
    on(kind, listener) {
        if (!this.listeners.has(kind)) this.listeners.set(kind, new Set());
        this.listeners.get(kind).add(listener);
        return () => this.listeners.get(kind).delete(listener);
    }

    /** Request a list of a craft whose rows have an id. A message that arrives before the answer may be newer than the
        answer, so it replaces its row. */
    async rows(craft, list, kind, query = {}) {
        const messages = new Map();
        const end = this.on(kind, (message) => message.craft === craft && messages.set(message.id, message));
        try {
            const rows = await this.api.get(of(craft, list), query);
            return [...rows.filter(({id}) => !messages.has(id)), ...messages.values()];
        } finally {
            end();
        }
    }

    /** Call a function before each repaint of the browser after which values have changed. Returns a function that
        removes it. */
    onFrame(draw) {
        this.frames.add(draw);
        return () => this.frames.delete(draw);
    }

    emit(kind, message) {
        for (const listener of [...(this.listeners.get(kind) ?? [])]) listener(message);
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
        socket.onmessage = ({data}) => (typeof data === "string" ? this.handle(JSON.parse(data)) : this.receive(data));
        socket.onclose = () => {
            this.socket = null;
            this.set("lost");
            // A session that has ended has no connection.
            this.api.begin().then(({user}) => (user ? this.reconnect() : this.api.refused()), () => this.reconnect());
        };
    }

    reconnect() {
        setTimeout(() => this.connect(), this.pause);
        this.pause = Math.min(5000, 1.6 * this.pause);
    }

    /** Load the state anew after a lost connection; the server may have restarted, with another session. */
    async again() {
        if (!(await this.api.begin()).user) return this.api.refused();
        this.stores.clear();        // another run may have other slots, and begin at an earlier time
        await this.load();
        return this.emit("again", {});
    }

    set(state) {
        this.state = state;
        this.emit("state", {state});
    }

    receive(buffer) {
        const index = craftOf(buffer), craft = this.crafts.find((craft) => craft.index === index);
        if (!craft) return;
        this.store(craft.name).update(buffer);
        this.received++;
        this.draw();
    }

    /** Draw what has changed, at the browser's next repaint. */
    draw() {
        if (this.drawing) return;
        this.drawing = requestAnimationFrame(() => {
            this.drawing = 0;
            for (const draw of [...this.frames]) draw();
        });
    }

    handle(message) {
        if (message.kind === "skipped") this.skipped = message.count;
        if (message.kind === "crafts") this.load().catch(() => {});
        if (message.kind === "slots" && this.stores.get(message.craft)?.ready) {
            const store = this.store(message.craft);
            store.ready = this.api.get(of(message.craft, "slots"), {first: message.first})
                .then((slots) => { store.learn(slots); this.emit("learned", message); });
        }
        if (message.kind === "craft") {
            const at = this.crafts.findIndex((craft) => craft.name === message.craft);
            if (at >= 0) this.crafts[at] = {...this.crafts[at], ...message};
        }
        this.emit(message.kind, message);
        this.draw();
    }

    /** The wishes have changed: send the server one subscription for all changes of this moment. */
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
            const merged = wanted.get(craft) ?? {slots: new Set(), hz: 0, truth: false};
            merged.hz = Math.max(merged.hz, hz);
            merged.truth ||= truth;
            if (slots === "all" || merged.slots === "all") merged.slots = "all";
            else for (const slot of slots) merged.slots.add(slot);
            wanted.set(craft, merged);
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
