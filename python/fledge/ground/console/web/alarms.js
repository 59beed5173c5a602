// SPDX-License-Identifier: Apache-2.0
// The open alarms of all spacecraft, for the page of alarms and for what every page shows of them.

export const isShelved = (one) => BigInt(one.shelved_until_ns || 0) > BigInt(Date.now()) * 1000000n;
const rank = (one) => (isShelved(one) ? 2 : one.acknowledged ? 1 : 0);

export class Alarms {
    constructor(live) {
        Object.assign(this, {live, byCraft: new Map()});
        live.on("alarm", (one) => this.merge(one.craft, one));
        live.on("crafts", () => this.load());
    }

    /** Ask anew for those of all spacecraft, or throw what the server said of one. */
    async load(only) {
        await Promise.all(this.live.crafts.filter(({name}) => !only || name === only).map(async ({name}) => {
            try {
                const found = await this.live.rows(name, "alarms", "alarm");
                this.byCraft.set(name, new Map(found.filter((one) => !one.ended_ns).map((one) => [one.name, one])));
            } catch (error) {
                if (only) throw error;
            }
        }));
        this.live.emit("alarms", {});
    }

    merge(craft, one) {
        if (!this.byCraft.has(craft)) this.byCraft.set(craft, new Map());
        if (one.ended_ns) this.byCraft.get(craft).delete(one.name);
        else this.byCraft.get(craft).set(one.name, one);
        this.live.emit("alarms", {craft});
    }

    /** Those of a craft: what is not acknowledged first, the worst before others. */
    of(craft) {
        return [...(this.byCraft.get(craft)?.values() ?? [])].sort((a, b) => rank(a) - rank(b) || b.worst - a.worst ||
            (a.name < b.name ? -1 : 1));
    }

    /** How many wait for a person, and the worst of them. */
    waiting(craft) {
        const open = this.of(craft).filter((one) => !rank(one));
        return {count: open.length, worst: open[0]?.worst ?? 0};
    }
}
