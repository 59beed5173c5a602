// SPDX-License-Identifier: Apache-2.0
// The open alarms of all spacecraft: for the page of alarms, and for the counts that every page shows.

export const isShelved = (alarm) => BigInt(alarm.shelved_until_ns || 0) > BigInt(Date.now()) * 1000000n;
const rank = (alarm) => (isShelved(alarm) ? 2 : alarm.acknowledged ? 1 : 0);

export class Alarms {
    constructor(live) {
        Object.assign(this, {live, byCraft: new Map()});
        live.on("alarm", (alarm) => this.merge(alarm.craft, alarm));
        live.on("crafts", () => this.load());
    }

    /** Load the alarms of all spacecraft; with `only`, those of one spacecraft, and throw the server's error. */
    async load(only) {
        await Promise.all(this.live.crafts.filter(({name}) => !only || name === only).map(async ({name}) => {
            try {
                const rows = await this.live.rows(name, "alarms", "alarm");
                const open = rows.filter((alarm) => !alarm.ended_ns);
                this.byCraft.set(name, new Map(open.map((alarm) => [alarm.name, alarm])));
            } catch (error) {
                if (only) throw error;
            }
        }));
        this.live.emit("alarms", {});
    }

    merge(craft, alarm) {
        if (!this.byCraft.has(craft)) this.byCraft.set(craft, new Map());
        if (alarm.ended_ns) this.byCraft.get(craft).delete(alarm.name);
        else this.byCraft.get(craft).set(alarm.name, alarm);
        this.live.emit("alarms", {craft});
    }

    /** The alarms of a craft: first those that are not acknowledged; of these, the worst first. */
    of(craft) {
        return [...(this.byCraft.get(craft)?.values() ?? [])].sort((a, b) => rank(a) - rank(b) || b.worst - a.worst ||
            (a.name < b.name ? -1 : 1));
    }

    /** The number of alarms that wait for an operator, and the worst state of these. */
    waiting(craft) {
        const open = this.of(craft).filter((alarm) => !rank(alarm));
        return {count: open.length, worst: open[0]?.worst ?? 0};
    }
}
