// SPDX-License-Identifier: Apache-2.0
// A long list of the server, newest first: it is read in parts, follows what is new, or shows what was known at a time.
import {attempt, h} from "./dom.js";
import {Table} from "./table.js";

const PART = 200;

/** A table over such a list.
 *
 *  path: of the list;  query(): what it is asked for;  fits(entry): what the person has filtered
 *  table: as for Table, with fill(cells, entry, element), and choose and moved with the entry
 */
export class List {
    constructor(context, {path, query = () => ({}), fits = () => true, table}) {
        Object.assign(this, {context, path, query, fits, entries: [], shown: [], whole: false, loading: null});
        const {fill, choose, moved} = table;
        this.table = new Table({
            ...table, fill: (cells, row, element) => fill(cells, this.shown[row], element),
            choose: choose && ((row) => choose(this.shown[row])), moved: moved && ((row) => moved(this.shown[row])),
            viewed: (_, last) => last >= this.shown.length - 20 && this.older(),
        });
        this.problem = h("div");
        this.element = h("div", {class: "list"}, this.problem, this.table.element);
        context.onTime(() => {
            clearTimeout(this.soon);
            this.soon = setTimeout(() => this.load(), 150);
        });
    }

    ask(more) {
        const {api, time} = this.context;
        return attempt(this.problem, () => api.get(this.path, {
            limit: PART, before_ns: time.isLive ? null : time.at, ...this.query(), ...more}));
    }

    /** Read anew. */
    async load() {
        const turn = this.turn = {};
        const found = await this.ask({});
        if (this.turn !== turn || !found) return;
        Object.assign(this, {entries: found, whole: !found.length});
        this.filter();
    }

    async older() {
        if (this.whole || this.loading || !this.entries.length) return;
        const {turn} = this;
        this.loading = this.ask({before: this.entries.at(-1).id});
        const found = await this.loading;
        this.loading = null;
        if (this.turn !== turn || !found) {
            this.whole = true;      // the server has said why
            return;
        }
        this.whole = !found.length;
        this.entries.push(...found);
        this.filter();
    }

    /** New entries have come, newest first. What is looked at stays where it is. */
    add(entries) {
        if (!this.context.time.isLive) return;
        const known = new Set(this.entries.slice(0, 2 * PART).map(({id}) => id));
        const fresh = entries.filter(({id}) => !known.has(id));
        if (!fresh.length) return;
        this.entries.unshift(...fresh);
        this.table.shift(fresh.filter(this.fits).length);
        this.filter();
    }

    filter() {
        this.shown = this.entries.filter(this.fits);
        this.table.set(this.shown.length);
        if (this.table.last >= this.shown.length - 20) this.older();
    }

    close() {
        this.turn = null;
        clearTimeout(this.soon);
        this.table.close();
    }
}
