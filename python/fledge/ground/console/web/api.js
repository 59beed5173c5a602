// SPDX-License-Identifier: Apache-2.0
// The server's HTTP interface. Errors carry the server's sentence.

export class ApiError extends Error {
    constructor(status, body) {
        super(body?.error ?? `The server answered ${status}`);
        Object.assign(this, {status, body: body ?? {}});
    }
}

const wire = (value) => (typeof value === "bigint" ? String(value) : value);

export class Api {
    constructor() {
        this.session = null;
        this.refused = () => {};    // called when the user is no longer logged in
    }

    /** Who is here: {user, roles, csrf, version}; user null: no user is. */
    async begin() {
        this.session = await this.get("/api/session");
        return this.session;
    }

    /** GET as JSON. query: {name: value}; undefined and null are left out. */
    async get(path, query = {}, options = {}) {
        return (await this.ask("GET", path + search(query), undefined, options)).json();
    }

    /** GET, or POST of a body, as JSON whose integers beyond 2^53 are BigInt, where the browser can tell. */
    async exact(path, body) {
        const answer = await this.ask(body ? "POST" : "GET", path, body);
        return JSON.parse(await answer.text(), (_, value, from) => (typeof value === "number" &&
            Number.isInteger(value) && !Number.isSafeInteger(value) && /^-?\d+$/.test(from?.source) ?
            BigInt(from.source) : value));
    }

    /** GET as an ArrayBuffer. */
    async bytes(path, query = {}, options = {}) {
        return (await this.ask("GET", path + search(query), undefined, options)).arrayBuffer();
    }

    async post(path, body = {}, method = "POST") {
        const answer = await this.ask(method, path, body);
        const text = await answer.text();
        return text ? JSON.parse(text) : {};
    }

    put(path, body) { return this.post(path, body, "PUT"); }
    delete(path) { return this.post(path, undefined, "DELETE"); }

    async ask(method, path, body, options = {}) {
        const headers = {};
        if (method !== "GET") headers["X-Fledge-CSRF"] = this.session?.csrf ?? "";
        const raw = body instanceof Blob || body instanceof ArrayBuffer;
        if (body !== undefined && !raw) headers["Content-Type"] = "application/json";
        let answer;
        try {
            answer = await fetch(path, {
                method, headers, signal: options.signal, credentials: "same-origin",
                body: body === undefined || raw ? body : JSON.stringify(body, (_, value) => wire(value)),
            });
        } catch (error) {
            if (error.name === "AbortError") throw error;
            throw new Error("The server does not answer");
        }
        if (!answer.ok) {
            const said = await answer.json().catch(() => null);
            if (answer.status === 401 && !path.startsWith("/api/login")) this.refused();
            throw new ApiError(answer.status, said);
        }
        return answer;
    }
}

function search(query) {
    const kept = Object.entries(query).filter(([, value]) => value !== undefined && value !== null && value !== "");
    return kept.length ? `?${new URLSearchParams(kept.map(([name, value]) => [name, String(value)]))}` : "";
}

/** The path of something of a craft: of("imager", "alarms", 3) -> "/api/crafts/imager/alarms/3" */
export const of = (craft, ...rest) => `/api/crafts/${[craft, ...rest].map((one) => encodeURIComponent(one)).join("/")}`;

const MOST = 100;       // names of a question
const LOOK_BACK = 600n * 1000000000n;     // a value of the past is the newest of so long before

/** What parameters were at a time: name -> {t in ns, value, text, concern}, as the server's history has them. */
export async function valuesAt(api, craft, names, at, session) {
    const parts = Array.from({length: Math.ceil(names.length / MOST)}, (_, k) => names.slice(MOST * k, MOST * (k + 1)));
    const found = await Promise.all(parts.map((part) => api.get(of(craft, "history"), {
        names: part.join(","), from_ns: at - LOOK_BACK, to_ns: at + 1n, points: 1, session})));
    const all = Object.entries(Object.assign({}, ...found)).filter(([, {t_ns}]) => t_ns.length);
    return new Map(all.map(([name, one]) => [name, {
        t: BigInt(one.t_ns.at(-1)), value: one.value.at(-1), text: one.text?.at(-1), concern: one.concern.at(-1)}]));
}

/** The series of a binary history answer: [{t: Float64Array in s, t_ns: BigInt64Array, value, low, high, worst}]. */
export function series(buffer) {
    const head = new Uint32Array(buffer, 0, 2), found = [];
    if (head[0] !== 0x32484c46) throw new Error("This is no history of the server");
    for (let k = 0, at = 8; k < head[1]; k++) {
        const n = new Uint32Array(buffer, at, 1)[0];
        at += 8;
        const take = (Kind) => new Kind(buffer, (at += 8 * n) - 8 * n, n);
        const t_ns = take(BigInt64Array), value = take(Float64Array), low = take(Float64Array),
              high = take(Float64Array), worst = new Uint8Array(buffer, at, n);
        at += n + 7 & ~7;
        found.push({t_ns, t: Float64Array.from(t_ns, (one) => Number(one) / 1e9), value, low, high, worst});
    }
    return found;
}
