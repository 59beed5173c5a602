// SPDX-License-Identifier: Apache-2.0
// A table for long lists: rows of equal height, of which only those in view are elements; each stays where it is.
import {h} from "./dom.js";

const HEIGHT = 26, SPARE = 4, GAP = 11, SIZES = {rem: 16, em: 13};      // [px]

/** The least width of columns [px]: the first number of each one's width, and the gaps between them. */
const least = (columns) => columns.reduce((sum, {width}) => {
    const [, number = 0, unit = "em"] = /([\d.]+)(r?em)/.exec(width) ?? [];
    return sum + number * SIZES[unit] + GAP;
}, GAP);

let tables = 0;

const classOf = (column) => `td ${column.class ?? ""}${column.narrow === "" ? " aside" : ""}`;

/** A table.
 *
 *  columns: [{title, width (of CSS's grid), class, narrow}]; narrow: the width in a narrow table; "": hidden there
 *  fill(cells, row, element): show row number `row` in these cells; use put and dress, which write only changes
 *  choose(row, event): a row was chosen by Enter or a click;  moved(row): the cursor stands on another row
 *  viewed(first, last): other rows are in view
 */
export class Table {
    constructor({label, columns, fill, choose, moved, viewed, height = HEIGHT, empty = "Nothing yet"}) {
        Object.assign(
            this, {columns, fill, choose, moved, viewed, height, count: 0, at: -1, rows: [], first: 0, last: -1});
        this.id = `table${++tables}`;
        this.head = h("div", {class: "thead", role: "rowgroup"}, h("div", {class: "tr", role: "row"},
            columns.map((column) => h("span", {class: classOf(column), role: "columnheader"}, column.title))));
        this.body = h("div", {class: "tbody", role: "rowgroup"});
        this.none = h("p", {class: "none soft"}, empty);
        this.scroll = h("div", {
            class: "scroll",
            role: choose || moved ? "grid" : "table",
            tabIndex: 0,
            "aria-label": label,
            onscroll: () => this.draw(),
            onkeydown: (event) => this.press(event),
            onclick: (event) => this.click(event)
        },
            this.head, this.body);
        this.element = h("div", {class: "table"}, this.scroll, this.none);
        this.element.style.setProperty("--columns", columns.map((column) => column.width ?? "1fr").join(" "));
        this.element.style.setProperty("--narrow",
            columns.map((column) => column.narrow ?? column.width ?? "1fr").filter(Boolean).join(" "));
        this.watch = new ResizeObserver(() => {
            this.element.classList.toggle("narrow", this.scroll.clientWidth < least(columns));
            this.draw();
        });
        this.watch.observe(this.scroll);
    }

    /** Set the number of rows. */
    set(count) {
        this.count = count;
        this.none.hidden = count > 0;
        this.body.style.height = `${count * this.height}px`;
        this.scroll.setAttribute("aria-rowcount", count + 1);
        if (this.at >= count) this.at = count - 1;
        this.draw();
    }

    /** Rows were added before those in view: these stay where they are. */
    shift(rows) {
        if (this.scroll.scrollTop > 0) this.scroll.scrollTop += rows * this.height;
        if (this.at >= 0) this.at += rows;
    }

    /** Write the rows in view. */
    draw() {
        const top = this.scroll.scrollTop, view = this.scroll.clientHeight;
        const first = Math.max(0, Math.floor(top / this.height) - SPARE);
        const last = Math.min(this.count, Math.ceil((top + view) / this.height) + SPARE) - 1;
        const room = last - first + 1;
        while (this.rows.length < room) this.rows.push(this.make());
        for (const row of this.rows) row.used = false;
        for (let k = first; k <= last; k++) {
            const row = this.rows[k % this.rows.length];     // an element keeps its number while it is in view
            row.used = true;
            if (row.number !== k) {
                row.number = k;
                row.element.style.transform = `translateY(${k * this.height}px)`;
                row.element.setAttribute("aria-rowindex", k + 2);
                row.element.id = `${this.id}-${k}`;
            }
            if (row.element.hidden) row.element.hidden = false;
            const chosen = k === this.at;
            if (row.chosen !== chosen) {
                row.chosen = chosen;
                row.element.classList.toggle("at", chosen);
                if (this.choose || this.moved) row.element.setAttribute("aria-selected", chosen);
            }
            this.fill(row.cells, k, row.element);
        }
        for (const row of this.rows)
            if (!row.used && !row.element.hidden) {
                row.element.hidden = true;
                row.number = -1;
            }
        if (first !== this.first || last !== this.last) {
            Object.assign(this, {first, last});
            this.viewed?.(first, last);
        }
    }

    make() {
        const role = this.choose || this.moved ? "gridcell" : "cell";
        const cells = this.columns.map((column) => h("span", {class: classOf(column), role}));
        const element = h("div", {class: "tr", role: "row", hidden: true}, cells);
        element.style.height = `${this.height}px`;
        this.body.append(element);
        return {element, cells, number: -1, chosen: null};
    }

    /** Put the cursor on a row, and the row into view. */
    go(row, quiet = false) {
        if (!this.count) return;
        this.at = Math.max(0, Math.min(this.count - 1, row));
        const head = this.head.offsetHeight, top = this.at * this.height, view = this.scroll.clientHeight - head;
        if (top < this.scroll.scrollTop) this.scroll.scrollTop = top;
        if (top + this.height > this.scroll.scrollTop + view) this.scroll.scrollTop = top + this.height - view;
        this.draw();
        this.scroll.setAttribute("aria-activedescendant", `${this.id}-${this.at}`);
        if (!quiet) this.moved?.(this.at);
    }

    press(event) {
        if (event.target !== this.scroll || event.ctrlKey || event.altKey || event.metaKey) return;
        const page = Math.max(1, Math.floor(this.scroll.clientHeight / this.height) - 2);
        const steps = {ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity};
        if (event.key in steps && (this.choose || this.moved)) {
            event.preventDefault();
            this.go(Math.max(0, Math.min(this.count - 1, this.at + steps[event.key])));
        } else if (event.key === "Enter" && this.choose && this.at >= 0) {
            event.preventDefault();
            this.choose(this.at, event);
        }
    }

    click(event) {
        const row = this.rows.find(({element}) => element.contains(event.target));
        if (!row || event.target.closest("button, input, a, select")) return;
        this.go(row.number);
        this.choose?.(row.number, event);
    }

    close() { this.watch.disconnect(); }
}
