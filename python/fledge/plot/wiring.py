# SPDX-License-Identifier: Apache-2.0
"""The wiring of a simulation as a picture, laid out by graphviz.

Each process is a box and each of its tasks a box in it. In a task, data flow from the top down, and the longest chain
is a straight stack. Modules that only publish their parameters (the vehicle, the wheels) stand beside it. The world
stands beside flight, with its sensors towards flight. The reader of a dashed wire sees the data at a later instant,
because it runs first.
"""
from __future__ import annotations

import re
import subprocess
from html import escape
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

from fledge.errors import SetupError
from fledge.disk import Part
from fledge.objects.words import first_sentence

if TYPE_CHECKING:
    from fledge.mission.wiring import Link, Node, Wiring, _Process

FORMATS = ("svg", "png", "pdf", "dot")

INK, SOFT, PALE, PAPER = "#222222", "#6f7780", "#c9d1d9", "#ffffff"
ACCENT = "#c0561f"
SHADES = {"flight": ("#1f5a96", "#f3f7fb", "#e4edf6"),  # of lines, of the ground, of boxes
          "world": ("#3d7a50", "#f4f9f5", "#e5f1e8")}
# Their names as CSS variables of the report, which has dark counterparts.
NAMES = {INK: "ink", SOFT: "soft", PALE: "pale", PAPER: "ground", ACCENT: "accent",
         **{shade: kind + part for kind, shades in SHADES.items()
            for shade, part in zip(shades, ("", "-ground", "-box"))}}
ASIDE = ', constraint="false"'     # of a wire that lets processes stand side by side
FONT = "DejaVu Sans,Helvetica,Arial,sans-serif"

# In graphviz' SVG: the groups of boxes and wires, and the words in them.
GROUPS = re.compile(r'<g id="(?:clust|edge)\d+".*?(?=<g id="(?:clust|edge|node)\d+"|</g>\n</svg>)', re.DOTALL)
WORDS = re.compile(r'<g id="a_edge\d+-label">.*?</g>\n|<text\b.*?</text>\n', re.DOTALL)


def save(wiring: Wiring, path: Path | str) -> Path:
    """Draw into a file of the kind that its ending names. Returns the path."""
    path = Path(path)
    kind = path.suffix[1:].lower()
    if kind not in FORMATS:
        raise SetupError(f"{path}: the name of a picture ends in .{', .'.join(FORMATS[:-1])} or .{FORMATS[-1]}")
    source = dot(wiring)
    picture = source.encode() if kind == "dot" else render(source, kind)
    path.parent.mkdir(parents=True, exist_ok=True)
    with Part(path) as part:
        part.write_bytes(picture)
    return path


def render(source: str, kind: str) -> bytes:
    """The picture that graphviz makes of a text in its language. Raises SetupError if it is not installed."""
    # Where it fails with processes side by side, they stand one below the other.
    for text in (source, source.replace(ASIDE, "")):
        try:
            done = subprocess.run(["dot", f"-T{kind}", *(["-Gdpi=144"] if kind == "png" else [])], input=text.encode(),
                                  capture_output=True)
        except FileNotFoundError:
            raise SetupError("drawing the wiring needs graphviz, which is not installed: apt-get install graphviz"
                             ) from None
        if not done.returncode:
            break
    else:
        raise SetupError("graphviz cannot draw the wiring: " + done.stderr.decode(errors="replace").strip())
    if kind == "svg":
        return _words_on_top(done.stdout.decode()).encode()
    # A PDF holds its creation date: write the same date each time.
    return re.sub(rb"(?<=/CreationDate \(D:)\d{14}", b"19700101000000", done.stdout)


def _words_on_top(picture: str) -> str:
    """The SVG with the words of wires and the titles of boxes over all wires, each with an edge of paper."""
    words: list[str] = []

    def without(group: re.Match[str]) -> str:
        words.extend(WORDS.findall(group[0]))
        return WORDS.sub("", group[0])

    picture, end = GROUPS.sub(without, picture), "</g>\n</svg>"
    return picture.replace(end, f'<g class="words" stroke="{PAPER}" stroke-width="3" stroke-linejoin="round" '
                           f'style="paint-order: stroke">\n{"".join(words)}</g>\n{end}')


# --- graphviz' language ----------------------------------------------------------------------------

def dot(wiring: Wiring, links: bool = False) -> str:
    """The picture in graphviz' language. links: modules refer to "#flight.control"."""
    graph = _attributes(bgcolor=PAPER, fontname=FONT, nodesep=0.2, ranksep=0.38, margin=0, pad=0.1,
                        outputorder="edgesfirst")
    node = _attributes(fontname=FONT, fontsize=11, fontcolor=INK, shape="box", style="filled,rounded",
                       margin="0.16,0.07", height=0.42)
    edge = _attributes(fontname=FONT, fontsize=8.5, fontcolor=SOFT, arrowsize=0.6, penwidth=1.1)
    lines = [f"digraph {_quoted(wiring.name)} {{", f"  graph [{graph}];", f"  node [{node}];", f"  edge [{edge}];"]
    for process in wiring.processes:
        lines += _process(wiring, process, links)
    for port in wiring.open_ends:
        style = _attributes(shape="plaintext", style="", fontcolor=SOFT, fontsize=9.5)
        lines.append(f"  {_quoted(port)} [{style}];")
    lines += [_wire(wiring, link) for link in wiring.links]
    for part in wiring.nodes.values():
        if part.host:
            style = _attributes(label="part", dir="back", arrowtail="odiamond", color=SHADES[part.kind][0],
                                penwidth=0.8, arrowsize=0.8, weight=20)
            lines.append(f"  {_quoted(part.host)} -> {_quoted(part.path)} [{style}];")
    return "\n".join([*lines, "}", ""])


def _process(wiring: Wiring, process: _Process, links: bool) -> list[str]:
    line, ground, _ = SHADES[process.kind]
    rows = [f'<FONT COLOR="{line}" POINT-SIZE="12"><B>{_text(process.name)}</B></FONT>']
    for word, entries in (("mode", process.modes), ("event", process.events)):
        for name, text in entries:
            rows.append(" ".join([_font(SOFT, word), *([_font(INK, name)] if name else []), _wrapped(text, 64)]))
    if process.integrator:
        rows.append(_wrapped(process.integrator, 40))
    cells = "".join(f'<TR><TD ALIGN="LEFT" BALIGN="LEFT">{row}</TD></TR>' for row in rows)
    title = _Markup(f'<<TABLE BORDER="0" CELLBORDER="0" CELLSPACING="0" CELLPADDING="1">{cells}</TABLE>>')
    style = _attributes(label=title, labeljust="l", fontsize=8.5, style="rounded,filled", color=ground,
                        fillcolor=ground, margin=14)
    lines = [f"  subgraph {_quoted('cluster_' + process.name)} {{", f"    graph [{style}];"]
    for task in process.tasks:
        nodes = process.run_by(task.name)
        style = _attributes(label=task.title, labeljust="l", fontsize=9.5, fontcolor=line, style="rounded,filled",
                            color=PALE, fillcolor=PAPER, margin=12)
        lines += [f"    subgraph {_quoted(f'cluster_{process.name}_{task.name}')} {{", f"      graph [{style}];"]
        # Before the nodes, because graphviz starts with the order in which the text names them.
        for row in filter(None, (_row_of_parts(wiring, node) for node in nodes)):
            lines.append(f"      {{rank=same; {' -> '.join(_quoted(n.path) for n in row)} [style=invis]}}")
        lines += [*(f"      {_node(node, links)}" for node in nodes), "    }"]
    return [*lines, *(f"    {_node(node, links)}" for node in process.run_by(None)), "  }"]


def _row_of_parts(wiring: Wiring, host: Node) -> list[Node]:
    """The row below a craft: first its sensors, towards flight, then its parts."""
    parts = [n for n in wiring.nodes.values() if n.host == host.path]
    above: dict[str, set[str]] = {}
    for link in wiring.links:
        if not link.back and not link.crosses:
            above.setdefault(link.to, set()).add(link.start)
    if any(n.path in above or any(n.path in sources for sources in above.values()) for n in parts):
        return []  # their wires determine their positions
    sensors = [n for n in wiring.nodes.values() if n.task == host.task and above.get(n.path) == {host.path}]
    return [*sensors, *parts] if sensors and parts else []


def _node(node: Node, links: bool) -> str:
    line, _, box = SHADES[node.kind]
    quiet = not node.slot
    name = _text(node.name) if quiet else f"<B>{_text(node.name)}</B>"
    words = [f'<FONT COLOR="{SOFT if quiet else INK}" POINT-SIZE="{9.5 if quiet else 11.5}">{name}</FONT>',
             _font(SOFT, node.type, 8 if quiet else 9), *(_font(SOFT, note, 8) for note in node.notes)]
    style: dict[str, object] = {
        "label": _Markup(f"<{'<BR/>'.join(words)}>"), "tooltip": first_sentence(node.doc),
        "color": PALE if quiet else line, "fillcolor": PAPER if quiet else box}
    if quiet:
        style.update(penwidth=0.8, margin="0.1,0.04", height=0.32)
    else:
        style.update(penwidth=1.1)
    if node.in_stack:
        style["group"] = f"{node.process}.{node.task}"
    if links:
        style["URL"] = f"#{node.path}"
    return f"{_quoted(node.path)} [{_attributes(**style)}];"


def _wire(wiring: Wiring, link: Link) -> str:
    a, b = wiring.nodes.get(link.start), wiring.nodes.get(link.to)
    quiet = a is not None and not a.slot
    words = [_font(SOFT if quiet else INK, link.ports), _font(SOFT, link.message, 7.5),
             *(_font(ACCENT, option) for option in link.options)]
    # The blanks keep the words off the line.
    label = _Markup("<" + "".join(f'&#160;{word}&#160;<BR ALIGN="LEFT"/>' for word in words) + ">")
    tip = f"{link.source} >> {link.target}"
    style: dict[str, object] = {
        "label": label, "color": PALE if quiet else SHADES[wiring.kinds[(link.start or link.to).partition(".")[0]]][0],
        "edgetooltip": tip, "labeltooltip": tip}
    tail, head = (link.start if a else link.source), (link.to if b else link.target)
    if link.back:
        style["style"] = "dashed"
    if a and b and link.crosses and a.kind == b.kind:
        # Between several spacecraft: all in one direction, because graphviz fails where ranks form a ring.
        order = list(wiring.kinds)
        style["weight"] = 0
        if order.index(a.process) > order.index(b.process):
            style["dir"] = "back"
            tail, head = head, tail
    elif a and b and (link.back or link.crosses):
        style["constraint"] = "false"  # such wires do not move processes, which stand side by side
    if a and b and link.crosses and (a.kind, b.kind) == ("flight", "world"):
        # graphviz lays commands from the world to flight, like measurements, so that both are side by side.
        style["dir"] = "back"
        tail, head = head, tail
    elif a and b and not link.back and a.in_stack and b.in_stack and a.task == b.task:
        style.update(weight=8, tailport="s", headport="n")
    return f"  {_quoted(tail)} -> {_quoted(head)} [{_attributes(**style)}];"


# --- text ------------------------------------------------------------------------------------------

class _Markup(str):
    """A complete HTML-like label, which must not be quoted."""


def _attributes(**values: object) -> str:
    return ", ".join(f"{name}={value if isinstance(value, _Markup) else _quoted(value)}"
                     for name, value in values.items())


def _quoted(text: object) -> str:
    """A string of graphviz' language. Backslashes are doubled, because one starts an escape."""
    return '"' + _printable(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _font(colour: str, text: object, size: float = 8.5) -> str:
    return f'<FONT COLOR="{colour}" POINT-SIZE="{size}">{_text(text)}</FONT>'


def _wrapped(text: str, width: int) -> str:
    """Text of a few lines, broken between words."""
    return "<BR/>".join(_font(SOFT, line) for line in wrap(text, width))


def _text(text: object) -> str:
    """Text within an HTML-like label."""
    return escape(_printable(text))


def _printable(text: object) -> str:
    """Text without the control characters that XML cannot hold."""
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f\ufffe\uffff]", "\N{REPLACEMENT CHARACTER}", str(text))
