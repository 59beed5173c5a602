// SPDX-License-Identifier: Apache-2.0
// A long list of the server, newest first, which is read in parts. It follows new entries, or shows those up to a time.
import {attempt, h, put} from "./dom.js";
import {matcher} from "./format.js";
import {search} from "./parts.js";
import {Table} from "./table.js";

const PART = 200;

/** A table over such a list, with a field to search in, and a line for the whole text of an entry.
 *
 *  path: of the list;  kind: of the messages that bring new entries, if there are any
 *  query(): parameters of the request;  fits(entry): whether the user's filter shows it
 *  text(entry): in which the words of the search must be;  searching: [label, placeholder, attributes] of its field
 *  below(entry): the whole text, which is shown below the table when the cursor stands on the entry
 *  table: as for Table, but fill(cells, entry, element) and moved(entry)
 */
export class List {
    constructor(context, {path, kind, query = () => ({}), fits = () => true, text = () => "", searching = [],
                          below = () => "", table}) {
        Object.assign(this, {context, path, query, entries: [], shown: [], whole: false, loading: null});
        this.fits = (entry) => fits(entry) && this.words(text(entry));
        this.words = searching.length ? matcher(context.selection) : () => true;
        this.search = search(...searching.slice(0, 2), (word) => {
            this.words = matcher(word);
            context.select(word);
            this.filter();
        }, {value: context.selection, ...searching[2]});
        this.line = h("p", {class: "whole"});
        const {fill, moved = (entry) => put(this.line, below(entry))} = table;
        this.table = new Table({
            ...table, fill: (cells, row, element) => fill(cells, this.shown[row], element),
            moved: (row) => moved(this.shown[row]),
            viewed: (_, last) => last >= this.shown.length - 20 && this.older(),
        });
        this.problem = h("div");
        this.element = h("div", {class: "list"}, this.problem, this.table.element);
        if (kind) context.on(kind, (entry) => this.add([entry]));
        context.onTime(() => {
            clearTimeout(this.soon);
            this.soon = setTimeout(() => this.load(), 150);
        });
    }

    request(more) {
        const {api, time} = this.context;
        return attempt(this.problem, () => api.get(this.path, {
            limit: PART, before_ns: time.isLive ? null : time.at, ...this.query(), ...more}));
    }

    /** Read the newest part. */
    async load() {
        const turn = this.turn = {early: []};
        const newest = await this.request({}), {early} = turn;
        turn.early = null;      // from now on, all entries are in the list
        if (this.turn !== turn || !newest) return;
        Object.assign(this, {entries: newest, whole: !newest.length});
        this.filter();
        this.add(early);
    }

    async older() {
        if (this.whole || this.loading || !this.entries.length) return;
        const {turn} = this;
        this.loading = this.request({before: this.entries.at(-1).id});
        const entries = await this.loading;
        this.loading = null;
        if (this.turn !== turn || !entries) {
            this.whole = true;      // the problem is shown
            return;
        }
        this.whole = !entries.length;
        this.entries.push(...entries);
        this.filter();
    }

    /** Add new entries, newest first. The entries in view stay where they are. */
    add(entries) {
        if (!this.context.time.isLive) return;
        this.turn?.early?.unshift(...entries);      // the answer that is awaited may lack them
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
