/* SPDX-License-Identifier: Apache-2.0 */
/* The check follows the instructions of a function in their order, with the kinds of the values on its stack. It stores
 * a state at each target of a jump; all ways there must agree in it. A jump backwards to instructions not followed yet,
 * or with a less known stack, needs one more pass. */
#include "targets/micropython/bytecode.h"

#include <py/bc.h>
#include <py/bc0.h>
#include <py/persistentcode.h>
#include <py/runtime.h>
#include <py/smallint.h>
#include <string.h>

enum {
    DEPTH = 8,   /* of nested functions and constants */
    CODE = 2048, /* [bytes] of a function */
    STACK = 255, /* values of a function */
    BLOCKS = 16, /* handlers of exceptions, one within the other */
    PRELUDE = 5, /* [bytes] of each of its two numbers */
    PASSES = 24
};

/* Kinds of values on the stack. */
enum {
    OBJECT,
    NONE,      /* an object, or that a block ended without an exception */
    EXCEPTION, /* an object, or NONE */
    MARKER,    /* why a block of `finally` or `with` ended: NONE, an exception, or where to go on */
    NOTHING,   /* no object: a default that is not given, or what deletes */
    SELF,      /* of a method; it may be nothing */
    ITERATOR   /* and the next three: memory of an iterator */
};

typedef struct Block {
    uint16_t handler;
    uint8_t depth; /* of the stack at its begin */
    uint8_t op;    /* that began it; of `with`, once it is cleaned up, SETUP_FINALLY */
    uint8_t active;
} Block;

typedef struct State {
    uint32_t depth, n;
    uint8_t kinds[STACK + 1];
    Block blocks[BLOCKS];
} State;

/* A state at a jump's goal, followed by its kinds and blocks. */
typedef struct Kept {
    struct Kept *next;
    uint16_t at;
    uint8_t depth, n;
} Kept;

typedef struct Instruction {
    uint8_t op, extra;
    uint32_t n;      /* the operand */
    uint32_t target; /* of a jump */
} Instruction;

typedef struct Reading {
    const uint8_t *bytes;
    uint32_t n, at;
    int wrong;
    uint32_t names, constants;
    uint8_t *work;
    size_t size;
} Reading;

typedef struct Function {
    Reading code; /* its instructions */
    uint32_t children, flags, locals, deepest;
    int reached; /* the instruction, by the one before it */
    int again;
    State now;
    Kept *kept;
    size_t used; /* [bytes] of the memory for what is kept */
    uint8_t starts[CODE / 8], goals[CODE / 8];
} Function;

static uint8_t read_byte(Reading *r)
{
    if (r->at >= r->n) {
        r->wrong = 1;
        return 0u;
    }
    return r->bytes[r->at++];
}

static uint32_t read_number(Reading *r)
{
    uint32_t x = 0u;
    for (;;) {
        const uint8_t byte = read_byte(r);
        if (r->wrong || x >> 24 != 0u) {
            r->wrong = 1;
            return 0u;
        }
        x = x << 7 | (byte & 0x7Fu);
        if (byte < 0x80u) {
            return x;
        }
    }
}

static void skip(Reading *r, uint32_t n)
{
    if (n > r->n - r->at) {
        r->wrong = 1;
    } else {
        r->at += n;
    }
}

static void require(Reading *r, int holds)
{
    r->wrong |= !holds;
}

/* --- the stack ------------------------------------------------------------------------------------- */

static int is_object(uint8_t kind)
{
    return kind <= EXCEPTION;
}

/* The kind that holds for both; -1: none. */
static int common(uint8_t a, uint8_t b)
{
    if (a == b) {
        return a;
    }
    if (is_object(a) && is_object(b)) {
        return a == OBJECT || b == OBJECT ? OBJECT : EXCEPTION;
    }
    return a + b == NONE + MARKER && (a == NONE || b == NONE) ? MARKER : -1;
}

static Block *top_block(State *s)
{
    return s->n != 0u ? &s->blocks[s->n - 1u] : NULL;
}

/* The least depth that an instruction may leave: values from before a block stay. */
static uint32_t floor_of(State *s)
{
    const Block *b = top_block(s);
    return b == NULL ? 0u : b->depth + (b->active && b->op != MP_BC_SETUP_EXCEPT ? 1u : 0u);
}

/* Room for n more values, and for where to go on behind each active block. */
static void need(Function *f, uint32_t n)
{
    uint32_t depth = f->now.depth + n;
    for (uint32_t i = 0u; i < f->now.n; i++) {
        depth += f->now.blocks[i].active && f->now.blocks[i].op != MP_BC_SETUP_EXCEPT ? 1u : 0u;
    }
    f->deepest = depth > f->deepest ? depth : f->deepest;
}

static void push(Function *f, uint8_t kind)
{
    if (f->now.depth >= STACK) {
        f->code.wrong = 1;
        return;
    }
    f->now.kinds[f->now.depth++] = kind;
    need(f, 0u);
}

static void drop(Function *f, uint32_t n)
{
    require(&f->code, n <= f->now.depth && f->now.depth - n >= floor_of(&f->now));
    f->now.depth -= f->code.wrong ? 0u : n;
}

/* Pop n values, of which those whose bit is set in `absent` may be NOTHING; the last value has bit 0. */
static void pop(Function *f, uint32_t n, uint32_t absent)
{
    drop(f, n);
    for (uint32_t i = 0u; i < n && !f->code.wrong; i++) {
        const uint8_t kind = f->now.kinds[f->now.depth + n - 1u - i];
        require(&f->code, is_object(kind) || (kind == NOTHING && i < 32u && (absent >> i & 1u) != 0u));
    }
}

static void turn_into(Function *f, uint32_t n, uint8_t kind)
{
    pop(f, n, 0u);
    push(f, kind);
}

static void local(Function *f, uint32_t i)
{
    require(&f->code, i < STACK);
    f->locals = i + 1u > f->locals ? i + 1u : f->locals;
}

static int is_iterator(const State *s)
{
    if (s->depth < 4u) {
        return 0;
    }
    const uint8_t *k = &s->kinds[s->depth - 4u];
    return ((k[0] == ITERATOR && k[1] == ITERATOR + 1 && k[2] == ITERATOR + 2 && k[3] == ITERATOR + 3) ||
            (k[0] == NOTHING && is_object(k[1]) && k[2] == NOTHING && k[3] == NOTHING));
}

/* --- jumps ----------------------------------------------------------------------------------------- */

static int has_bit(const uint8_t *bits, uint32_t i)
{
    return i < CODE && (bits[i / 8u] >> i % 8u & 1u) != 0u;
}

static void set_bit(uint8_t *bits, uint32_t i)
{
    bits[i / 8u] |= (uint8_t)(1u << i % 8u);
}

static Kept *kept_at(const Function *f, uint32_t at)
{
    Kept *k = f->kept;
    while (k != NULL && k->at != at) {
        k = k->next;
    }
    return k;
}

static void keep(Function *f, const State *s, uint32_t at)
{
    const size_t size = (sizeof(Kept) + s->depth + s->n * sizeof(Block) + 7u) & ~(size_t)7u;
    if (size > f->code.size - f->used) {
        f->code.wrong = 1;
        return;
    }
    Kept *k = (Kept *)(void *)(f->code.work + f->used);
    f->used += size;
    *k = (Kept){f->kept, (uint16_t)at, (uint8_t)s->depth, (uint8_t)s->n};
    memcpy((uint8_t *)(k + 1), s->kinds, s->depth);
    memcpy((uint8_t *)(k + 1) + s->depth, s->blocks, s->n * sizeof(Block));
    f->kept = k;
}

/* Merge the stored state with that of another way there. */
static void join(Function *f, const State *s, Kept *k)
{
    uint8_t *kinds = (uint8_t *)(k + 1);
    if (k->depth != s->depth || k->n != s->n || memcmp(kinds + k->depth, s->blocks, s->n * sizeof(Block)) != 0) {
        f->code.wrong = 1;
        return;
    }
    for (uint32_t i = 0u; i < s->depth; i++) {
        const int kind = common(kinds[i], s->kinds[i]);
        require(&f->code, kind >= 0);
        f->again |= k->at < f->code.at && kind != kinds[i];
        kinds[i] = (uint8_t)kind;
    }
}

/* A way with this state leads there. */
static void lead(Function *f, const State *s, uint32_t at)
{
    require(&f->code, has_bit(f->starts, at));
    for (uint32_t i = 0u; i < s->n; i++) { /* by its place, the interpreter knows whether a handler runs */
        require(&f->code, s->blocks[i].active == (at >= s->blocks[i].handler));
    }
    if (f->code.wrong) {
        return;
    }
    Kept *k = kept_at(f, at);
    if (k != NULL) {
        join(f, s, k);
    } else {
        keep(f, s, at);
        f->again |= at < f->code.at;
    }
}

static void begin_block(Function *f, const Instruction *in)
{
    State *s = &f->now;
    if (s->n >= BLOCKS || s->depth >= STACK) {
        f->code.wrong = 1;
        return;
    }
    Block *b = &s->blocks[s->n++];
    memset(b, 0, sizeof *b);
    b->handler = (uint16_t)in->target;
    b->depth = (uint8_t)s->depth;
    b->op = in->op;
    b->active = 1u;
    push(f, in->op == MP_BC_SETUP_EXCEPT ? EXCEPTION : MARKER);
    lead(f, s, in->target);
    s->depth--;
    b->active = 0u;
}

/* Without an exception, a block of `finally` or `with` goes on in its handler. */
static void enter_handler(State *s, uint32_t at)
{
    Block *b = top_block(s);
    if (b != NULL && at == b->handler && b->op != MP_BC_SETUP_EXCEPT && s->depth == b->depth + 1u &&
        s->kinds[b->depth] == NONE) {
        b->active = 1u;
    }
}

static void end_block(Function *f)
{
    State *s = &f->now;
    const Block *b = top_block(s);
    require(&f->code, b != NULL && b->active && s->depth == b->depth + 1u &&
                          (s->kinds[b->depth] == NONE ||
                           s->kinds[b->depth] == (b->op == MP_BC_SETUP_EXCEPT ? EXCEPTION : MARKER)));
    if (!f->code.wrong) {
        s->depth = b->depth;
        s->n--;
    }
}

static void clean_up(Function *f)
{
    State *s = &f->now;
    Block *b = top_block(s);
    require(&f->code, b != NULL && b->active && b->op == MP_BC_SETUP_WITH && s->depth == b->depth + 1u &&
                          (s->kinds[b->depth] == NONE || s->kinds[b->depth] == MARKER));
    if (!f->code.wrong) {
        need(f, 1u); /* the third argument of __exit__ */
        b->op = MP_BC_SETUP_FINALLY;
        b->depth = (uint8_t)(b->depth - 2u); /* __exit__ and its object, which SETUP_WITH has left */
        s->kinds[b->depth] = MARKER;
        s->depth = b->depth + 1u;
    }
}

/* `break` and `continue` leave blocks, whose `finally` runs on the way. */
static void unwind(Function *f, const Instruction *in)
{
    State s = f->now;
    need(f, 1u);
    for (uint32_t i = in->extra & 0x7Fu; i > 0u && !f->code.wrong; i--) {
        const Block *b = top_block(&s);
        if (b == NULL) {
            f->code.wrong = 1;
        } else if (b->op != MP_BC_SETUP_EXCEPT) {
            require(&f->code, s.depth == b->depth + (b->active ? 1u : 0u));
            s.depth = b->depth - (b->op == MP_BC_SETUP_WITH ? 2u : 0u);
        }
        s.n--;
    }
    if (!f->code.wrong && (in->extra & 0x80u) != 0u) {
        require(&f->code, is_iterator(&s));
        s.depth -= 4u;
    }
    if (!f->code.wrong) {
        lead(f, &s, in->target);
    }
}

/* --- instructions ---------------------------------------------------------------------------------- */

static Instruction decode(Reading *r)
{
    Instruction in = {read_byte(r), 0u, 0u, UINT32_MAX};
    if (in.op == MP_BC_LOAD_CONST_SMALL_INT) {
        uint32_t n = 0u;
        while ((read_byte(r) & 0x80u) != 0u && !r->wrong) {
            require(r, ++n < 10u);
        }
    } else if (MP_BC_FORMAT(in.op) == MP_BC_FORMAT_OFFSET) {
        const int is_signed = in.op <= MP_BC_POP_JUMP_IF_FALSE;
        uint32_t x = read_byte(r), zero = is_signed ? 0x40u : 0u;
        if ((x & 0x80u) != 0u) {
            x = (x & 0x7Fu) | (uint32_t)read_byte(r) << 7;
            zero = is_signed ? 0x4000u : 0u;
        }
        in.target = r->at + x - zero;
    } else if (MP_BC_FORMAT(in.op) != MP_BC_FORMAT_BYTE) {
        in.n = read_number(r);
    }
    if ((in.op & MP_BC_MASK_EXTRA_BYTE) == 0) {
        in.extra = read_byte(r);
    }
    return in;
}

static void call(Function *f, const Instruction *in, int is_method, int has_stars)
{
    const uint32_t positional = in->n & 0xFFu, named = in->n >> 8;
    require(&f->code, named <= 0xFFu);
    if (has_stars) {
        pop(f, 1u, 0u);
    }
    for (uint32_t i = 0u; i < named; i++) {
        pop(f, 2u, has_stars ? 2u : 0u);
    }
    pop(f, positional, 0u);
    if (is_method) {
        drop(f, 1u);
        require(&f->code, f->now.kinds[f->now.depth] == SELF);
    }
    turn_into(f, 1u, OBJECT);
}

static void make(Function *f, const Instruction *in, uint32_t defaults)
{
    require(&f->code, in->n < f->children);
    pop(f, in->extra, 0u);
    pop(f, defaults, 3u);
    push(f, OBJECT);
}

static void rotate(Function *f, uint32_t n)
{
    State *s = &f->now;
    pop(f, n, 7u);
    if (!f->code.wrong) {
        s->depth += n;
        const uint8_t top = s->kinds[s->depth - 1u];
        memmove(&s->kinds[s->depth - n + 1u], &s->kinds[s->depth - n], n - 1u);
        s->kinds[s->depth - n] = top;
    }
}

static void duplicate(Function *f, uint32_t n)
{
    pop(f, n, 0u);
    for (uint32_t i = 0u; i < n; i++) {
        push(f, f->now.kinds[f->now.depth]);
    }
    for (uint32_t i = 0u; i < n; i++) {
        push(f, f->code.wrong ? OBJECT : f->now.kinds[f->now.depth - n]);
    }
}

static void method(Function *f, uint32_t from)
{
    turn_into(f, from, OBJECT);
    push(f, SELF);
}

static void iterate(Function *f, const Instruction *in)
{
    require(&f->code, is_iterator(&f->now) && f->now.depth - 4u >= floor_of(&f->now));
    if (!f->code.wrong) {
        f->now.depth -= 4u;
        lead(f, &f->now, in->target);
        f->now.depth += 4u;
        push(f, OBJECT);
    }
}

/* An element of a list, set or dict that a comprehension makes. */
static void store_element(Function *f, uint32_t n)
{
    const uint32_t values = (n & 3u) == 1u ? 2u : 1u, down = n >> 2;
    require(&f->code, (n & 3u) != 3u && down >= values && down < f->now.depth);
    pop(f, values, 0u);
    require(&f->code, f->code.wrong || is_object(f->now.kinds[f->now.depth + values - 1u - down]));
}

static void follow_simple(Function *f, const Instruction *in)
{
    const uint8_t op = in->op;
    if (op >= MP_BC_LOAD_FAST_MULTI && op < MP_BC_LOAD_FAST_MULTI + MP_BC_LOAD_FAST_MULTI_NUM) {
        local(f, op - MP_BC_LOAD_FAST_MULTI);
        push(f, OBJECT);
    } else if (op >= MP_BC_STORE_FAST_MULTI && op < MP_BC_STORE_FAST_MULTI + MP_BC_STORE_FAST_MULTI_NUM) {
        local(f, op - MP_BC_STORE_FAST_MULTI);
        pop(f, 1u, 0u);
    } else if (op >= MP_BC_UNARY_OP_MULTI && op < MP_BC_UNARY_OP_MULTI + MP_BC_UNARY_OP_MULTI_NUM) {
        turn_into(f, 1u, OBJECT);
    } else if (op >= MP_BC_BINARY_OP_MULTI && op < MP_BC_BINARY_OP_MULTI + MP_BC_BINARY_OP_MULTI_NUM) {
        turn_into(f, 2u, OBJECT);
    } else if (op >= MP_BC_LOAD_CONST_SMALL_INT_MULTI && op < MP_BC_LOAD_FAST_MULTI) {
        push(f, OBJECT);
    } else {
        f->code.wrong = 1;
    }
}

static void follow(Function *f, const Instruction *in)
{
    Reading *r = &f->code;
    State *s = &f->now;
    require(r, MP_BC_FORMAT(in->op) != MP_BC_FORMAT_QSTR || in->n < r->names);
    switch (in->op) {
    case MP_BC_LOAD_CONST_NONE: push(f, NONE); break;
    case MP_BC_LOAD_NULL: push(f, NOTHING); break;
    case MP_BC_LOAD_CONST_OBJ: require(r, in->n < r->constants); /* fall through */
    case MP_BC_LOAD_CONST_FALSE:
    case MP_BC_LOAD_CONST_TRUE:
    case MP_BC_LOAD_CONST_SMALL_INT:
    case MP_BC_LOAD_CONST_STRING:
    case MP_BC_LOAD_NAME:
    case MP_BC_LOAD_GLOBAL:
    case MP_BC_LOAD_BUILD_CLASS: push(f, OBJECT); break;
    case MP_BC_LOAD_FAST_N:
    case MP_BC_LOAD_DEREF:
        local(f, in->n);
        push(f, OBJECT);
        break;
    case MP_BC_STORE_FAST_N:
    case MP_BC_STORE_DEREF:
        local(f, in->n);
        pop(f, 1u, 0u);
        break;
    case MP_BC_DELETE_FAST:
    case MP_BC_DELETE_DEREF: local(f, in->n); break;
    case MP_BC_DELETE_NAME:
    case MP_BC_DELETE_GLOBAL: break;
    case MP_BC_LOAD_ATTR:
    case MP_BC_GET_ITER: turn_into(f, 1u, OBJECT); break;
    case MP_BC_YIELD_VALUE:
        require(r, (f->flags & MP_SCOPE_FLAG_GENERATOR) != 0u);
        turn_into(f, 1u, OBJECT);
        break;
    case MP_BC_YIELD_FROM:
        require(r, (f->flags & MP_SCOPE_FLAG_GENERATOR) != 0u);
        turn_into(f, 2u, OBJECT);
        break;
    case MP_BC_LOAD_METHOD: method(f, 1u); break;
    case MP_BC_LOAD_SUPER_METHOD: method(f, 3u); break;
    case MP_BC_LOAD_SUBSCR:
    case MP_BC_IMPORT_NAME: turn_into(f, 2u, OBJECT); break;
    case MP_BC_IMPORT_FROM:
        turn_into(f, 1u, OBJECT);
        push(f, OBJECT);
        break;
    case MP_BC_STORE_NAME:
    case MP_BC_STORE_GLOBAL:
    case MP_BC_IMPORT_STAR: pop(f, 1u, 0u); break;
    case MP_BC_STORE_ATTR: pop(f, 2u, 2u); break;
    case MP_BC_STORE_SUBSCR: pop(f, 3u, 4u); break;
    case MP_BC_STORE_MAP:
        pop(f, 3u, 0u);
        push(f, OBJECT);
        break;
    case MP_BC_POP_TOP: drop(f, 1u); break;
    case MP_BC_DUP_TOP: duplicate(f, 1u); break;
    case MP_BC_DUP_TOP_TWO: duplicate(f, 2u); break;
    case MP_BC_ROT_TWO: rotate(f, 2u); break;
    case MP_BC_ROT_THREE: rotate(f, 3u); break;
    case MP_BC_BUILD_MAP:
        require(r, in->n <= CODE);
        push(f, OBJECT);
        break;
    case MP_BC_BUILD_SLICE: require(r, in->n == 2u || in->n == 3u); /* fall through */
    case MP_BC_BUILD_TUPLE:
    case MP_BC_BUILD_LIST:
    case MP_BC_BUILD_SET: turn_into(f, in->n, OBJECT); break;
    case MP_BC_STORE_COMP: store_element(f, in->n); break;
    case MP_BC_UNPACK_SEQUENCE:
    case MP_BC_UNPACK_EX: {
        const uint32_t rest = in->op == MP_BC_UNPACK_EX ? 1u : 0u;
        require(r, in->n <= (rest ? 0xFFFFu : STACK));
        pop(f, 1u, 0u);
        for (uint32_t n = (rest ? (in->n & 0xFFu) + (in->n >> 8) : in->n) + rest; n > 0u && !r->wrong; n--) {
            push(f, OBJECT);
        }
        break;
    }
    case MP_BC_MAKE_FUNCTION:
    case MP_BC_MAKE_CLOSURE: make(f, in, 0u); break;
    case MP_BC_MAKE_FUNCTION_DEFARGS:
    case MP_BC_MAKE_CLOSURE_DEFARGS: make(f, in, 2u); break;
    case MP_BC_CALL_FUNCTION: call(f, in, 0, 0); break;
    case MP_BC_CALL_FUNCTION_VAR_KW: call(f, in, 0, 1); break;
    case MP_BC_CALL_METHOD: call(f, in, 1, 0); break;
    case MP_BC_CALL_METHOD_VAR_KW: call(f, in, 1, 1); break;
    case MP_BC_GET_ITER_STACK:
        pop(f, 1u, 0u);
        for (uint8_t i = 0u; i < 4u; i++) {
            push(f, (uint8_t)(ITERATOR + i));
        }
        break;
    case MP_BC_FOR_ITER: iterate(f, in); break;
    case MP_BC_POP_JUMP_IF_TRUE:
    case MP_BC_POP_JUMP_IF_FALSE:
        pop(f, 1u, 0u);
        lead(f, s, in->target);
        break;
    case MP_BC_JUMP_IF_TRUE_OR_POP:
    case MP_BC_JUMP_IF_FALSE_OR_POP:
        turn_into(f, 1u, OBJECT);
        lead(f, s, in->target);
        pop(f, 1u, 0u);
        break;
    case MP_BC_SETUP_WITH:
        need(f, 3u);
        method(f, 1u);
        begin_block(f, in);
        push(f, OBJECT);
        break;
    case MP_BC_SETUP_EXCEPT:
    case MP_BC_SETUP_FINALLY: begin_block(f, in); break;
    case MP_BC_WITH_CLEANUP: clean_up(f); break;
    case MP_BC_END_FINALLY: end_block(f); break;
    case MP_BC_POP_EXCEPT_JUMP:
        require(r, s->n != 0u && top_block(s)->op == MP_BC_SETUP_EXCEPT && s->depth == top_block(s)->depth);
        s->n -= s->n != 0u ? 1u : 0u; /* fall through */
    case MP_BC_JUMP:
        lead(f, s, in->target);
        f->reached = 0;
        break;
    case MP_BC_UNWIND_JUMP:
        unwind(f, in);
        f->reached = 0;
        break;
    case MP_BC_RAISE_FROM: pop(f, 1u, 0u); /* fall through */
    case MP_BC_RETURN_VALUE:
    case MP_BC_RAISE_OBJ: pop(f, 1u, 0u); /* fall through */
    case MP_BC_RAISE_LAST: f->reached = 0; break;
    default: follow_simple(f, in); break;
    }
}

/* --- functions ------------------------------------------------------------------------------------- */

/* The state before an instruction, of the one before it and of the jumps that lead here. */
static void arrive(Function *f, uint32_t at)
{
    if (f->reached) {
        enter_handler(&f->now, at);
        if (has_bit(f->goals, at)) {
            lead(f, &f->now, at);
        }
    }
    const Kept *k = has_bit(f->goals, at) ? kept_at(f, at) : NULL;
    if (k != NULL) {
        f->now.depth = k->depth;
        f->now.n = k->n;
        memcpy(f->now.kinds, k + 1, k->depth);
        memcpy(f->now.blocks, (const uint8_t *)(k + 1) + k->depth, k->n * sizeof(Block));
        f->reached = 1;
    }
    for (uint32_t i = 0u; f->reached && i < f->now.n; i++) {
        require(&f->code, f->now.blocks[i].active == (at >= f->now.blocks[i].handler));
    }
}

/* Whether a number of the prelude ends in time. */
static int ends(const Reading *r)
{
    uint32_t n = 0u;
    while (n < PRELUDE && r->at + n < r->n && r->bytes[r->at + n] >= 0x80u) {
        n++;
    }
    return n < PRELUDE && r->at + n < r->n;
}

static void check_instructions(Function *f, size_t n_state, size_t n_exc_stack)
{
    Reading *r = &f->code;
    uint32_t most = 0u;
    while (r->at < r->n && !r->wrong) {
        set_bit(f->starts, r->at);
        const Instruction in = decode(r);
        if (in.target != UINT32_MAX && in.target < r->n) {
            set_bit(f->goals, in.target);
        }
    }
    uint32_t passes = 0u;
    do {
        r->at = 0u;
        f->now.depth = f->now.n = 0u;
        f->reached = 1;
        f->again = 0;
        while (r->at < r->n && !r->wrong) {
            arrive(f, r->at);
            const Instruction in = decode(r);
            if (f->reached && !r->wrong) {
                follow(f, &in);
                most = f->now.n > most ? f->now.n : most;
            }
        }
        require(r, ++passes < PASSES);
    } while (f->again && !r->wrong);
    require(r, !f->reached && f->deepest + f->locals <= n_state && most <= n_exc_stack);
}

static void check_function(Reading *r, const uint8_t *code, uint32_t n, uint32_t children)
{
    static Function memory; /* too large for the stack; children are checked after their parent */
    Function *const f = &memory;
    memset(f, 0, sizeof *f);
    f->code = *r;
    f->code.bytes = code;
    f->code.n = n;
    f->code.at = 0u;
    f->children = children;
    if (n > CODE || !ends(&f->code)) {
        r->wrong = 1;
        return;
    }
    const uint8_t *ip = code;
    MP_BC_PRELUDE_SIG_DECODE(ip);
    f->code.at = (uint32_t)(ip - code);
    if (!ends(&f->code)) {
        r->wrong = 1;
        return;
    }
    MP_BC_PRELUDE_SIZE_DECODE(ip);
    f->code.at = (uint32_t)(ip - code);
    const size_t arguments = n_pos_args + n_kwonly_args;
    f->flags = (uint32_t)scope_flags;
    f->locals = (uint32_t)(arguments + ((scope_flags & MP_SCOPE_FLAG_VARARGS) != 0u) +
                           ((scope_flags & MP_SCOPE_FLAG_VARKEYWORDS) != 0u));
    const uint32_t info = f->code.at;
    require(&f->code, n_state <= STACK && n_def_pos_args <= n_pos_args && arguments < STACK);
    for (size_t i = 0u; i <= arguments && !f->code.wrong; i++) {
        require(&f->code, read_number(&f->code) < r->names);
    }
    require(&f->code, f->code.at - info <= n_info && n_info <= n - info && n_cell <= n - info - n_info);
    for (size_t i = 0u; i < n_cell && !f->code.wrong; i++) {
        local(f, code[info + n_info + i]);
    }
    if (!f->code.wrong) {
        const uint32_t begin = (uint32_t)(info + n_info + n_cell);
        f->code.bytes = code + begin;
        f->code.n = n - begin;
        f->code.at = 0u;
        check_instructions(f, n_state, n_exc_stack);
    }
    r->wrong |= f->code.wrong;
}

static void check_functions(Reading *r, uint32_t depth)
{
    const uint32_t kind = read_number(r), n = kind >> 3;
    if ((kind & 3u) != 0u || depth == 0u) { /* machine code */
        r->wrong = 1;
        return;
    }
    const uint8_t *code = r->bytes + r->at;
    skip(r, n);
    const uint32_t children = (kind & 4u) != 0u && !r->wrong ? read_number(r) : 0u;
    if (!r->wrong) {
        check_function(r, code, n, children);
    }
    for (uint32_t i = 0u; i < children && !r->wrong; i++) {
        check_functions(r, depth - 1u);
    }
}

static void check_constant(Reading *r, uint32_t depth)
{
    const uint32_t kind = read_number(r);
    if (kind >= MP_PERSISTENT_OBJ_NONE && kind <= MP_PERSISTENT_OBJ_ELLIPSIS) {
        return;
    }
    if (kind < MP_PERSISTENT_OBJ_STR || kind > MP_PERSISTENT_OBJ_TUPLE || kind == MP_PERSISTENT_OBJ_COMPLEX ||
        depth == 0u) {
        r->wrong = 1;
        return;
    }
    const uint32_t n = read_number(r);
    if (kind != MP_PERSISTENT_OBJ_TUPLE) {
        skip(r, n + (kind <= MP_PERSISTENT_OBJ_BYTES ? 1u : 0u));
    }
    for (uint32_t i = 0u; kind == MP_PERSISTENT_OBJ_TUPLE && i < n && !r->wrong; i++) {
        check_constant(r, depth - 1u);
    }
}

int bytecode_is_sound(const uint8_t *bytes, uint32_t n, void *work, size_t size)
{
    Reading r = {bytes, n, 4u, 0, 0u, 0u, work, size};
    if (n < 4u || bytes[0] != 'M' || bytes[1] != MPY_VERSION || MPY_FEATURE_DECODE_ARCH(bytes[2]) != 0 ||
        bytes[3] > MP_SMALL_INT_BITS) {
        return 0;
    }
    r.names = read_number(&r);
    r.constants = read_number(&r);
    require(&r, r.names != 0u); /* the first is the file's */
    for (uint32_t i = 0u; i < r.names && !r.wrong; i++) {
        const uint32_t name = read_number(&r);
        if ((name & 1u) == 0u) {
            skip(&r, (name >> 1) + 1u);
        } else if (name >> 1 >= MP_QSTRnumber_of) {
            r.wrong = 1;
        }
    }
    for (uint32_t i = 0u; i < r.constants && !r.wrong; i++) {
        check_constant(&r, DEPTH);
    }
    if (!r.wrong) {
        check_functions(&r, DEPTH);
    }
    return !r.wrong && r.at == n;
}
