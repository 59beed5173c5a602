# SPDX-License-Identifier: Apache-2.0
"""Sphinx's configuration: `./fledge docs` builds these pages and the reference into build/docs.

The sources are the repository's Markdown files as they are. The reference is written from the C headers by
introspect and from the docstrings by autodoc, into build/docs/reference. For a project, the sources are its own
Markdown files and headers; the reference of Fledge's, which they refer to, stands beside. Nothing needs a network.
"""
import importlib
import inspect
import os
import pkgutil
import re
import sys
import types
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HERE = Path(os.environ.get("FLEDGE_PROJECT") or ROOT)   # whose documents these are
OURS = HERE == ROOT
REFERENCE = "build/docs/reference"
sys.path.append(str(next(ROOT.glob("cosim/**/fledge_node.py")).parent))

project = "Fledge"
author = "the Fledge maintainers"
NOTEBOOKS = "build/docs/notebooks"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "README"
include_patterns = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/*.md", "*/README.md", "*/*/README.md",
                    "flight/services/*.md", f"{REFERENCE}/*", f"{NOTEBOOKS}/*.md"]
exclude_patterns = ["build/[!d]*/**", "build/debug/**", "python/*/*/README.md"]     # build/docs has the reference
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]
highlight_language = "none"
autodoc_member_order = "bysource"
add_module_names = False
toc_object_entries = False

html_theme = "furo"
html_title = "Fledge"
html_static_path = ["static"]
html_css_files = ["fledge.css"]
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_theme_options = {"sidebar_hide_name": False}


def chapters():
    """The sections of docs/README.md, with the pages that each lists."""
    found = {"Begin": ["All pages <docs/README>"]}
    text = (ROOT / "docs/README.md").read_text("utf-8").replace("](notebook.ipynb)", f"](../{NOTEBOOKS}/notebook.md)")
    for section in text.split("\n## ")[1:]:
        found.setdefault(section.partition("\n")[0], []).extend(
            f"{title} <{os.path.normpath(f'docs/{page}')}>"
            for title, page in re.findall(r"^- \[(.+)\]\((.+)\.md\)", section, re.M))
    return found


GENERATED = [f"{REFERENCE}/{page}" for page in (
    "flight-modules", "flight-messages", "world-models", "world-messages", "packets", "python", "nodes", "routes")]
if OURS:        # entries are documents, or `Title <document>`
    CHAPTERS = chapters() | {"Reference": GENERATED}
else:
    project = re.search(r"^\s*fledge_project\(\s*(\w+)", (HERE / "CMakeLists.txt").read_text("utf-8"), re.M)[1]
    html_title, author = project, ""
    extensions = ["myst_parser"]
    include_patterns = ["README.md", "docs/**.md", "missions/**.md", f"{REFERENCE}/*.md"]
    if not (HERE / "README.md").exists():
        root_doc = f"{REFERENCE}/index"
    CHAPTERS = {project: [*(f"{page.title()} <{REFERENCE}/{project}-{page}>"
                            for page in ("modules", "models", "messages")), f"{REFERENCE}/packets",
                          *(path.relative_to(HERE).with_suffix("").as_posix()
                            for folder in ("docs", "missions") for path in sorted(HERE.glob(f"{folder}/**/*.md")))],
                "Fledge": GENERATED[:4]}

# Classes of objects that the user gets from others, and therefore never imports.
RETURNED = {"Batch", "Campaign", "Dispersions", "Event", "Flight", "Log", "Mission", "Mode", "Result", "Task", "Trim",
            "Watch", "Wire", "World"}


# --- the reference ---------------------------------------------------------------------------------

def write_reference(app):
    from introspect.emit import reference
    from introspect.model import Kind
    from introspect.reader import read
    from introspect.sources import Source

    parts = [(ROOT, "flight", Kind.MODULE, "flight"), (ROOT, "world", Kind.MODEL, "world"),
             (HERE, "flight", Kind.MODULE, project), (HERE, "world", Kind.MODEL, project)][:2 if OURS else 4]
    parts = [part for part in parts if (part[0] / part[1]).is_dir()]
    model = read([Source(*part) for part in parts])
    pages = {}
    for name, root in {part[3]: part[0] for part in parts}.items():
        pages |= reference.emit(model.library(name), root)
    pages |= packet_pages()
    if OURS:
        pages["python.rst"] = python_page()
        pages["routes.md"] = routes_page()
        pages["nodes.rst"] = "\n".join(["Nodes in Python", "===============", "", *directive("module", "fledge_node")])
    else:
        own = [name for name in pages if name.startswith(project)]
        pages["index.md"] = f"# {project}\n\n" + "".join(f"- []({name})\n" for name in own)
    folder = HERE / REFERENCE
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages.items():
        if not (folder / name).exists() or (folder / name).read_text(encoding="utf-8") != text:
            (folder / name).write_text(text, encoding="utf-8")


def routes_page():
    """Who may what in the control room, by the rows from which its server checks that."""
    from fledge.ground.server.live import Browser
    from fledge.ground.server.logins import Logins
    from fledge.ground.server.routes import MESSAGE, rows
    from fledge.ground.server.handlers import TOPICS

    crafts = {"": "", "path": "the one that is named", "run": "all that its run flies"}
    entries = sorted({(row.method == MESSAGE, row.path.partition(":[")[0], row.method, row)
                      for holder in (*TOPICS, Logins, Browser) for row, _ in rows(holder)}, key=lambda row: row[:3])
    return "\n".join([
        "# Who may what in the control room", "",
        "The server checks each HTTP request, and each message of the WebSocket `/api/live`, by this table. Where no "
        "spacecraft is named, the answer has those that the user may see.", "",
        "| | | role | for the spacecraft | in the log before it is done |", "|---|---|---|---|---|",
        *(f"| {method} | `{path}` | {row.role} | {crafts[row.craft]} | {'yes' * row.logged} |"
          for _, path, method, row in entries), ""])


def packet_pages():
    """A page of packets, commands and events for each mission with flight software, and one that lists them."""
    import fledge
    from fledge import export
    from fledge.errors import SetupError
    from fledge.export import ground, packets
    from fledge.export.page import page
    from fledge.mission.folder import missions

    pages, rows = {}, []
    for name, mission in missions().items():
        if not mission.folder.is_relative_to(HERE / "missions"):
            continue
        try:
            exported = export.read_all(fledge.load(name))
            databases = [packets.database(process) for process in exported]
            text = page(name, exported, databases, ground.read(mission.folder, databases)) if exported else ""
        except SetupError as error:     # a prototype, a file of a project that is wrong
            rows.append(f"| {name} | {str(error).splitlines()[0].replace('|', ' ')} |")
            continue
        if text:
            pages[f"packets-{name}.md"] = text
            rows.append(f"| [{name}](packets-{name}.md) | {sum(len(d.packets) for d in databases)} packets, "
                        f"{sum(not c.abstract for d in databases for c in d.commands)} commands |")
    if rows:
        pages["packets.md"] = "\n".join([
            "# Packets of missions", "",
            "What the flight software of each mission sends and understands, bit by bit.", "",
            "| mission | |", "|---|---|", *rows, ""])
    return pages


def run_notebooks(app):
    """Run the notebooks of docs/, and write each as a page with what its cells put out. A cell that fails ends this."""
    import nbformat
    from nbclient import NotebookClient
    from nbconvert import MarkdownExporter

    folder = ROOT / NOTEBOOKS
    folder.mkdir(parents=True, exist_ok=True)
    for source in sorted((ROOT / "docs").glob("*.ipynb")):
        notebook = nbformat.read(source, 4)
        NotebookClient(notebook, kernel_name="python3", timeout=600,
                       resources={"metadata": {"path": str(folder)}}).execute()
        text, resources = MarkdownExporter().from_notebook_node(
            notebook, {"unique_key": source.stem, "output_files_dir": "."})
        for name, data in resources["outputs"].items():
            (folder / name).write_bytes(data)
        (folder / f"{source.stem}.md").write_text(text.replace("](guide.md", "](../../../docs/guide.md"), "utf-8")


def directive(kind, name, members=None):
    """An autodoc directive: with all members, with some (a list), or with none (an empty list)."""
    options = [f"   :members: {', '.join(members or ())}".rstrip()] if kind != "function" and members != [] else []
    return [f".. auto{kind}:: {name}", *options, ""]


def python_page():
    """What `import fledge` gives, the classes of the objects that it returns, and its public modules."""
    import fledge

    named = {name: getattr(fledge, name) for name in fledge.__all__}
    modules = {value.__name__: value for value in named.values() if isinstance(value, types.ModuleType)}
    modules.pop("fledge.flight")  # its names are on the page of the flight modules
    own = {name: value for name, value in named.items() if not isinstance(value, types.ModuleType)}
    own |= {name: value for name, value in classes_of(fledge).items() if name in RETURNED}
    lines = ["Python", "======", "", "``import fledge`` gives these names, and the modules below. ``fledge.flight``",
             "and ``fledge.world`` also have a class for each module and model of the headers.", ""]
    for name, value in sorted(own.items(), key=lambda item: item[0].lower()):
        kind = "class" if inspect.isclass(value) else "function"
        lines += [name, "-" * len(name), "", *directive(kind, f"{value.__module__}.{name}")]
    for name, module in modules.items():
        members = [n for n in dir(module) if n not in own and n[0] != "_" and is_member(getattr(module, n), module)]
        lines += [name, "-" * len(name), "", *directive("module", name, members)]
    return "\n".join(lines)


def is_member(value, module):
    """Whether a name of a module is a function or class that it or a part of it defines. The classes of the C
    structs have pages of their own."""
    if inspect.isclass(value) and {"Module", "Model", "Message"} & {base.__name__ for base in value.__mro__}:
        return False
    where = getattr(value, "__module__", None) or ""
    return (inspect.isclass(value) or inspect.isroutine(value)) and f"{where}.".startswith(f"{module.__name__}.")


def classes_of(package):
    """The classes that the modules of a package define, by name."""
    classes = {}
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not re.search(r"_test$|\.cli\b|\.templates|\.testing|__main__", module.name):
            there = importlib.import_module(module.name)
            classes |= {n: c for n, c in vars(there).items() if inspect.isclass(c) and c.__module__ == module.name}
    return classes


ARGUMENT = re.compile(r"([a-z_]\w*(?:, [a-z_]\w*)*): (?=\S)")


def as_rst(app, what, name, thing, options, lines):
    """Docstrings are plain text: code in single backticks, examples indented, and arguments as `name: what it is`,
    on lines of their own."""
    text, lines[:] = list(lines), []
    literal = item = False
    for line in text:
        if line[:1] == " " and not literal and not item:
            lines += ["", "::", ""]
            literal = True
        elif line[:1] != " " and line:
            if literal:
                lines.append("")
            literal = False
        if not literal and line.strip():
            line = escaped(line.strip())
            argument = ARGUMENT.match(line)
            if argument and what != "module":
                lines += [] if item else [""]
                line = f"* *{argument[1]}*: {line[argument.end():]}"
                item = True
            elif item and re.match("Raises|Returns", line):
                lines.append("")
                item = False
            elif item:
                line = "  " + line
        elif not literal:
            item = False
        lines.append(line)


def escaped(line):
    parts = line.split("`")
    parts[::2] = [re.sub(r"([\\*|])|(?<=\w)(_)(?!\w)", r"\\\g<0>", part) for part in parts[::2]]
    return "``".join(parts)


# --- the pages -------------------------------------------------------------------------------------

LINK = re.compile(r"\[([^]\n]*)\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)")


def prepare(app, page, source):
    """Link a folder to its README, if it has one; give the first page the list of all."""
    folder = (HERE / page).parent

    def resolved(link):
        readme = (folder / link[2] / "README.md").resolve()
        if readme.exists():
            return f"[{link[1]}]({os.path.relpath(readme, folder)}{link[3] or ''})"
        return link[1] if readme.parent.is_dir() else link[0]

    if OURS:
        source[0] = source[0].replace("](notebook.ipynb)", f"](../{NOTEBOOKS}/notebook.md)")
    if not page.startswith(REFERENCE):
        source[0] = LINK.sub(resolved, source[0])
    if page == root_doc:
        for title, pages in CHAPTERS.items():
            there = [p.replace(document(p), f"/{document(p)}") for p in pages
                     if any((HERE / (document(p) + end)).exists() for end in (".md", ".rst"))]
            source[0] += "\n".join(["\n```{toctree}", ":hidden:", f":caption: {title}", ":maxdepth: 1", "", *there,
                                    "```\n"])
    elif not any(page == document(p) for pages in CHAPTERS.values() for p in pages):
        source[0] = "---\norphan: true\n---\n" + source[0]


def document(entry):
    """The document of an entry, which is one or `Title <document>`."""
    return entry.partition("<")[2].rstrip(">") or entry


def begin_at_the_readme(app, error):
    if not error:
        Path(app.outdir, "index.html").write_text(
            f'<meta http-equiv="refresh" content="0; url={root_doc}.html">\n')


def setup(app):
    app.connect("builder-inited", write_reference)
    if OURS:
        app.connect("builder-inited", run_notebooks)
        app.connect("autodoc-process-docstring", as_rst)
    app.connect("source-read", prepare)
    app.connect("build-finished", begin_at_the_readme)
