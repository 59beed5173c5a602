# SPDX-License-Identifier: Apache-2.0
"""The wiring of a simulation as a picture, laid out by graphviz.

Each process is a box and each of its tasks a box in it. In a task, data flow from the top down, its
longest chain as a straight stack. What only publishes its parameters (the vehicle, the wheels) stands
beside. The world stands beside flight, sensors towards it. What a dashed wire carries is read at a
later instant, for its reader runs first.
"""

import re
import subprocess
from html import escape
from pathlib import Path

from fledge.errors import SetupError
from fledge.files import Part
from fledge.objects.words import first_sentence

FORMATS = ("svg", "png", "pdf", "dot")

# The colours. The report turns each of them into its dark counterpart.
INK, SOFT, PALE, PAPER = "#222222", "#6f7780", "#c9d1d9", "#ffffff"
ACCENT = "#c0561f"
SHADES = {"flight": ("#1f5a96", "#f3f7fb", "#e4edf6"),  # of lines, of the ground, of boxes
          "world": ("#3d7a50", "#f4f9f5", "#e5f1e8")}
FONT = "DejaVu Sans,Helvetica,Arial,sans-serif"


def save(wiring, path):
    """Draw into a file, whose ending says how. Returns the path."""
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


def render(source, kind, dpi=144):
    """The bytes that graphviz makes of a text in its language. Raises SetupError if it is not installed."""
    arguments = ["dot", f"-T{kind}"] + ([f"-Gdpi={dpi}"] if kind == "png" else [])
    try:
        done = subprocess.run(arguments, input=source.encode(), capture_output=True)
    except FileNotFoundError:
        raise SetupError("drawing the wiring needs graphviz, which is not installed: apt-get install graphviz"
                         ) from None
    if done.returncode:
        raise SetupError("graphviz cannot draw the wiring: " + done.stderr.decode(errors="replace").strip())
    # A PDF holds the date of its making: always the same one, of the same length.
    return re.sub(rb"(?<=/CreationDate \(D:)\d{14}", b"19700101000000", done.stdout)


# --- graphviz' language ----------------------------------------------------------------------------

def dot(wiring, links=False):
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
    for node in wiring.nodes.values():
        if node.host:
            style = _attributes(label="part", dir="back", arrowtail="odiamond", color=SHADES[node.kind][0],
                                penwidth=0.8, arrowsize=0.8, weight=20)
            lines.append(f"  {_quoted(node.host)} -> {_quoted(node.path)} [{style}];")
    return "\n".join([*lines, "}", ""])


def _process(wiring, process, links):
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
        # Before the nodes, for graphviz begins with an order like that of their first mention.
        for row in filter(None, (_row_of_parts(wiring, node) for node in nodes)):
            lines.append(f"      {{rank=same; {' -> '.join(_quoted(n.path) for n in row)} [style=invis]}}")
        lines += [*(f"      {_node(node, links)}" for node in nodes), "    }"]
    return [*lines, *(f"    {_node(node, links)}" for node in process.run_by(None)), "  }"]


def _row_of_parts(wiring, host):
    """Who stands below a craft: the sensors that look at it first, towards flight, then its parts."""
    parts = [n for n in wiring.nodes.values() if n.host == host.path]
    above = {}
    for link in wiring.links:
        if not link.back and not link.crosses:
            above.setdefault(link.to, set()).add(link.start)
    if any(n.path in above or any(n.path in sources for sources in above.values()) for n in parts):
        return []  # they stand where their wires want them
    sensors = [n for n in wiring.nodes.values() if n.task == host.task and above.get(n.path) == {host.path}]
    return [*sensors, *parts] if sensors and parts else []


def _node(node, links):
    line, _, box = SHADES[node.kind]
    quiet = node.place is None
    name = _text(node.name) if quiet else f"<B>{_text(node.name)}</B>"
    words = [f'<FONT COLOR="{SOFT if quiet else INK}" POINT-SIZE="{9.5 if quiet else 11.5}">{name}</FONT>',
             _font(SOFT, node.type, 8 if quiet else 9), *(_font(SOFT, note, 8) for note in node.notes)]
    style = {"label": _Markup(f"<{'<BR/>'.join(words)}>"), "tooltip": first_sentence(node.doc),
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


def _wire(wiring, link):
    a, b = wiring.nodes.get(link.start), wiring.nodes.get(link.to)
    quiet = a is not None and a.place is None
    words = [_font(SOFT if quiet else INK, link.ports), _font(SOFT, link.message, 7.5),
             *(_font(ACCENT, option) for option in link.options)]
    # The blanks keep the words off the line.
    label = _Markup("<" + "".join(f'&#160;{word}&#160;<BR ALIGN="LEFT"/>' for word in words) + ">")
    says = f"{link.source} >> {link.target}"
    style = {"label": label, "color": PALE if quiet else SHADES[wiring.kinds[link.start.partition(".")[0]]][0],
             "edgetooltip": says, "labeltooltip": says}
    tail, head = (link.start if a else link.source), (link.to if b else link.target)
    if link.back:
        style["style"] = "dashed"
    if a and b and link.crosses and a.kind == b.kind:
        # Between several spacecraft: all in one direction, for graphviz fails where ranks go in a ring.
        order = list(wiring.kinds)
        style["weight"] = 0
        if order.index(a.process) > order.index(b.process):
            style["dir"] = "back"
            tail, head = head, tail
    elif a and b and (link.back or link.crosses):
        style["constraint"] = "false"  # processes stand side by side, whatever goes back and forth
    if a and b and link.crosses and (a.kind, b.kind) == ("flight", "world"):
        # Commands are laid from the world to flight, like measurements, so that they run beside them.
        style["dir"] = "back"
        tail, head = head, tail
    elif a and b and not link.back and a.in_stack and b.in_stack and a.task == b.task:
        style.update(weight=8, tailport="s", headport="n")
    return f"  {_quoted(tail)} -> {_quoted(head)} [{_attributes(**style)}];"


# --- text ------------------------------------------------------------------------------------------

class _Markup(str):
    """An HTML-like label, complete: not to be quoted."""


def _attributes(**values):
    return ", ".join(f"{name}={value if isinstance(value, _Markup) else _quoted(value)}"
                     for name, value in values.items())


def _quoted(text):
    """A string of graphviz' language. A backslash is doubled, for it would begin an escape."""
    return '"' + _printable(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _font(colour, text, size=8.5):
    return f'<FONT COLOR="{colour}" POINT-SIZE="{size}">{_text(text)}</FONT>'


def _wrapped(text, width):
    """Text of a few lines, broken between words."""
    from textwrap import wrap

    return "<BR/>".join(_font(SOFT, line) for line in wrap(text, width))


def _text(text):
    """Text within an HTML-like label."""
    return escape(_printable(text))


def _printable(text):
    """Without the control characters that XML cannot hold."""
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f\ufffe\uffff]", "\N{REPLACEMENT CHARACTER}", str(text))
