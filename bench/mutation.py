# SPDX-License-Identifier: Apache-2.0
"""The small changes ("mutants") that bench/mutants.py makes in C, C++ and Python: which there are in a text.

C and C++ go through a lexer that leaves out comments, strings and preprocessor lines. It knows an operator with two
operands by the spaces on both sides, which clang-format puts there: `a < b` compares, `vector<int>` does not.
"""
from __future__ import annotations
import ast
import io
import re
import tokenize
from collections.abc import Iterator
from typing import NamedTuple


class Change(NamedTuple):
    """Replace text[start:stop]."""

    start: int
    stop: int
    after: str


SWAPS = {
    "<": ["<=", ">="], "<=": ["<", ">"], ">": [">=", "<="], ">=": [">", "<"], "==": ["!="], "!=": ["=="],
    "&&": ["||"], "||": ["&&"], "and": ["or"], "or": ["and"], "+": ["-"], "-": ["+"], "*": ["/"], "/": ["*"],
    "+=": ["-="], "-=": ["+="], "*=": ["/="], "/=": ["*="], "true": ["false"], "false": ["true"],
    "True": ["False"], "False": ["True"], "++": ["--"], "--": ["++"],
}
WORDS = {"true", "false", "++", "--"}                                   # no spaces on both sides
NUMBER = re.compile(r"(0|[1-9]\d{0,5})(?:(\.\d{0,2}))?([uUlLfF]*)$")    # no coefficient, no mask


def changes(name: str, text: str) -> list[Change]:
    """All changes of a file, in the order of its text."""
    found = _python(text) if name.endswith(".py") else _c(text, name.endswith((".cpp", ".h")))
    return sorted(set(found))


def applied(text: str, change: Change) -> str:
    return text[:change.start] + change.after + text[change.stop:]


def other_number(text: str) -> str:
    """1 for 0, 0 for 1, and one more for others; "" for what is no short decimal number."""
    match = NUMBER.match(text)
    if not match:
        return ""
    whole, fraction, suffix = match.groups()
    is_one = whole == "1" and not (fraction or "").strip(".0")
    return ("0" if is_one else str(int(whole) + 1)) + (fraction or "") + suffix


# --- C and C++ -------------------------------------------------------------------------------------

TOKEN = re.compile(r"""
    (?P<skipped> \s+ | //(?:\\\n|[^\n])* | /\*.*?\*/ | (?<![^\n])[ \t]*\#(?:\\\n|/\*.*?\*/|[^\n])*
        | (?:u8|[uUL])?R"(?P<mark>[^()\s\\]*)\(.*?\)(?P=mark)" )
  | (?P<text> (?:u8|[uUL])?"(?:\\.|[^"\\\n])*" | (?:u8|[uUL])?'(?:\\.|[^'\\\n])*' )
  | (?P<number> \.?\d (?: [eEpP][+-] | '?[\w.] )* )
  | (?P<word> [A-Za-z_]\w* )
  | (?P<sign> <=> | <<= | >>= | ->\* | \.\.\. | :: | -> | \+\+ | -- | << | >> | [<>=!+\-*/%&|^]= | && | \|\| | . )
""", re.VERBOSE | re.DOTALL)

OPEN, CLOSED = {"(": ")", "[": "]", "{": "}"}, {")", "]", "}"}
ASSIGNMENTS = {"=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>="}
ENDINGS = {"break", "continue", "throw", "return", "goto"}
OTHER_KEYWORDS = {
    "using", "typedef", "struct", "class", "enum", "union", "static", "const", "constexpr", "auto", "if", "else", "for",
    "while", "do", "switch", "case", "default", "template", "namespace", "friend", "extern", "public", "private",
    "protected", "static_assert", "_Static_assert", "operator", "explicit", "virtual", "inline", "volatile", "try",
    "catch", "sizeof",
}


class Token(NamedTuple):
    kind: str
    text: str
    start: int
    stop: int


def tokens_of(text: str) -> list[Token]:
    return [Token(m.lastgroup or "", m.group(), m.start(), m.end()) for m in TOKEN.finditer(text)
            if m.lastgroup not in ("skipped", "mark")]


def _c(text: str, is_cpp: bool) -> Iterator[Change]:
    tokens = tokens_of(text)
    asserted = -1       # the end of a static assertion, which the compiler checks
    for i, token in enumerate(tokens):
        if token.text in ("static_assert", "_Static_assert"):
            asserted = tokens[_end_of_statement(tokens, i)].stop
        if token.start < asserted:
            continue
        spaced = text[token.start - 1:token.start].isspace() and text[token.stop:token.stop + 1].isspace()
        if token.kind in ("sign", "word") and (spaced or token.text in WORDS):
            for other in SWAPS.get(token.text, []):
                yield Change(token.start, token.stop, other)
        if token.kind == "number" and (other := other_number(token.text)):
            yield Change(token.start, token.stop, other)
        if token.text in ("if", "while") and tokens[i + 1].text == "(":
            yield from _negated(text, tokens, i + 1)
        if token.text == "return":
            yield from _returned(text, tokens, i, is_cpp)
        if i > 0 and (tokens[i - 1].text in (";", "{", "}", ")", ":", "else")):
            yield from _deleted(text, tokens, i)


def _closing(tokens: list[Token], i: int) -> int:
    """The index of the bracket that closes the one at i."""
    depth = 0
    for k in range(i, len(tokens)):
        depth += (tokens[k].text in OPEN) - (tokens[k].text in CLOSED)
        if depth == 0:
            return k
    return len(tokens) - 1


def _end_of_statement(tokens: list[Token], i: int) -> int:
    """The index of the semicolon that ends the statement at i, or of a bracket that closes before."""
    while i < len(tokens) - 1 and tokens[i].text != ";" and tokens[i].text not in CLOSED:
        i = _closing(tokens, i) + 1 if tokens[i].text in OPEN else i + 1
    return min(i, len(tokens) - 1)


def _negated(text: str, tokens: list[Token], i: int) -> Iterator[Change]:
    last = _closing(tokens, i)
    inner = tokens[i + 1:last]
    begin = max((k + 1 for k, t in enumerate(inner) if t.text == ";"), default=0)
    if inner[begin:] and not any(t.text == "=" for t in inner[begin:]):    # `if (T x = f())` declares
        start, stop = inner[begin].start, inner[-1].stop
        yield Change(start, stop, f"!({text[start:stop]})")


def _returned(text: str, tokens: list[Token], i: int, is_cpp: bool) -> Iterator[Change]:
    end = _end_of_statement(tokens, i)
    start, stop = tokens[i + 1].start, tokens[end - 1].stop
    value = text[start:stop]
    if end > i + 1 and value not in ("{}", "nullptr", "NULL", "true", "false") and not other_number(value):
        yield Change(start, stop, "{}" if is_cpp else "0")


def _deleted(text: str, tokens: list[Token], i: int) -> Iterator[Change]:
    end = _end_of_statement(tokens, i)
    inner = tokens[i:end]
    if tokens[end].text != ";" or not inner or not (inner[0].text in ENDINGS or _is_expression(text, inner)):
        return
    if inner[0].text == "return" and len(inner) > 1:
        return  # a function that returns no value there does not compile
    start, stop = inner[0].start, inner[-1].stop
    yield Change(start, stop, "\n" * text.count("\n", start, stop))


def _is_expression(text: str, tokens: list[Token]) -> bool:
    """Whether a statement calls or assigns, and declares nothing: no two names stand side by side in what is called or
    assigned to."""
    if tokens[0].text in OTHER_KEYWORDS or not (tokens[0].kind == "word" or tokens[0].text in ("*", "(", "++", "--")):
        return False
    if tokens[-1].text in ("delete", "default", "0") and tokens[-2].text == "=":
        return False    # of a declared function, or one that looks like it
    acts, k, before = False, 0, None
    while k < len(tokens) and tokens[k].text not in ASSIGNMENTS:
        token = tokens[k]
        if token.text == "{" or (before and before.kind == "word" and token.kind == "word"):
            return False
        if before and before.text in ("*", "&", "&&", ">") and token.kind == "word" and k > 1:
            return False
        acts = acts or token.text in ("(", "++", "--")
        if token.text in OPEN:
            k = _closing(tokens, k)
        before = tokens[min(k, len(tokens) - 1)]
        k += 1
    return acts or k < len(tokens)


# --- Python ----------------------------------------------------------------------------------------

def _python(text: str) -> Iterator[Change]:
    lines = text.splitlines(keepends=True)
    begins = [0]
    for line in lines:
        begins.append(begins[-1] + len(line))

    def place(line: int, column: int) -> int:
        """The offset of a place whose column counts bytes, as ast's do."""
        return begins[line - 1] + len(lines[line - 1].encode()[:column].decode())

    def span(node: ast.AST) -> tuple[int, int]:
        return place(node.lineno, node.col_offset), place(node.end_lineno, node.end_col_offset)

    tree = ast.parse(text)
    skipped = [span(node) for node in ast.walk(tree) if isinstance(node, ast.If) and _is_of_the_interpreter(node.test)]
    for change in (*_python_tokens(text, begins), *_python_nodes(tree, text, span)):
        if not any(start <= change.start < stop for start, stop in skipped):
            yield change


def _is_of_the_interpreter(test: ast.expr) -> bool:
    return any(isinstance(node, ast.Name) and node.id in ("TYPE_CHECKING", "__name__") for node in ast.walk(test))


def _python_tokens(text: str, begins: list[int]) -> Iterator[Change]:
    before = ""     # what stands before an operator with two operands
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        start, stop = (begins[line - 1] + column for line, column in (token.start, token.end))
        word = token.string
        binary = word not in ("+", "-", "*", "/") or (
            text[start - 1:start].isspace() == text[stop:stop + 1].isspace()
            and re.fullmatch(r"[\w.)\]}]+", before) and before not in ("return", "in", "lambda", "else", "and", "or"))
        if token.type in (tokenize.OP, tokenize.NAME) and binary:
            for other in SWAPS.get(word, []):
                yield Change(start, stop, other)
        if token.type == tokenize.NUMBER and (other := other_number(word)):
            yield Change(start, stop, other)
        before = word


def _python_nodes(tree: ast.Module, text: str, span) -> Iterator[Change]:
    for node in ast.walk(tree):
        if isinstance(node, (ast.If, ast.While, ast.IfExp)):
            start, stop = span(node.test)
            yield Change(start, stop, f"(not ({text[start:stop]}))")
        elif isinstance(node, ast.Return) and node.value and not isinstance(node.value, ast.Constant):
            yield Change(*span(node.value), "None")
        elif (isinstance(node, (ast.Raise, ast.Break, ast.Continue, ast.AugAssign))
              or (isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant))
              # Without an assignment to a name, Python itself finds that the name is missing.
              or (isinstance(node, ast.Assign) and isinstance(node.targets[0], (ast.Attribute, ast.Subscript)))):
            yield Change(*span(node), "pass")
