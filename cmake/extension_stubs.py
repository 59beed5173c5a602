# SPDX-License-Identifier: Apache-2.0
"""The type stub of an extension, from the signatures that pybind11 writes into its docstrings.

    PYTHONPATH=build/release/python python3 cmake/extension_stubs.py _core build/release/introspect/stubs/_core.pyi

It names a function whose types say nothing, as `list`: its binding returns a container of C++, or a Typed
(core/typed.h). That ends no build, because another pybind11 may have other words: the stub has Any there, and
tests/extension_stubs_test.py fails. Debian's stubgen would be a package more for each build, and leaves out what the
docstrings explain.
"""

from __future__ import annotations

import ast
import builtins
import importlib
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

_TYPING = {"Any", "Callable", "Iterable", "Iterator", "Mapping", "Sequence"}
_BUILT_IN = {"List": "list", "Dict": "dict", "Tuple": "tuple", "Set": "set", "handle": "object", "capsule": "object",
             "buffer": "Any", "Buffer": "Any"}
_CONDUIT = "_pybind11_conduit_v1_"                      # what pybind11 from 2.12 on adds to each class, for itself
_EMPTY = {"object", "list", "dict", "tuple", "set"}     # say too little
_OF_CORE = {"Module", "Model", "Message"}               # which the other extensions name
# Of methods that are written with C's API, whose text signatures have no types. They return None.
_ARGUMENTS = {"t": "float", "dt": "float", "t_ns": "int | None", "dt_ns": "int | None", "output": "Message",
              "quality": "Any"}
# What Python adds to a type at run time.
_ADDED = {"Model": "    # Some have properties besides their parameters, such as `parts` and `gravity`.\n"
                   "    def __getattr__(self, name: str) -> Any: ...\n"
                   "    def __setattr__(self, name: str, value: Any) -> None: ...\n"}


class Unclear(Exception):
    """A word that is no type."""


class _Types(ast.NodeTransformer):
    """pybind11's words for types -> those of a stub. accepts: of an argument, which takes more than a result is."""

    def __init__(self, module: ModuleType, used: set[str], members: set[str], accepts: bool) -> None:
        self.module, self.used, self.members, self.accepts = module, used, members, accepts

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        text = ast.unparse(node)
        module, _, name = text.rpartition(".")
        if module == self.module.__name__:
            return ast.Name(name)
        if text == "numpy.ndarray":
            self.used.add("NDArray")
            return ast.parse("NDArray[Any]", mode="eval").body
        self.used.add(module)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        # Containers of C++ take any sequence. Those that write `list` for them, as pybind11 from 2.12 on does, write it
        # for a list of Python, too.
        names = ("list", "dict") if _is_recent(self.module) else ("List", "Dict")
        wider = dict(zip(names, ("Sequence", "Mapping"))) if self.accepts else {}
        name = wider.get(node.id) or _BUILT_IN.get(node.id, node.id)
        if name in _TYPING or name in _OF_CORE and not hasattr(self.module, name):
            self.used.add(name)
        elif not hasattr(builtins, name) and not hasattr(self.module, name):
            raise Unclear(f"{name} is no type that a stub knows")
        elif name in self.members:      # of the class, which has them under the name of a type
            self.used.add("builtins")
            return ast.Attribute(ast.Name("builtins"), name)
        return ast.Name(name)

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        of = ast.unparse(node.value)
        if of == "numpy.ndarray":
            self.used.add("NDArray")
            of = ast.parse("numpy.bool_", mode="eval").body if ast.unparse(node.slice) == "bool" else node.slice
            return ast.Subscript(ast.Name("NDArray"), self.visit(of))
        if of == "Annotated":                           # of pybind11 from 2.12 on: list[float], FixedSize(3)
            return self.visit(node.slice.elts[0])
        if of == "Optional":
            return ast.BinOp(self.visit(node.slice), ast.BitOr(), ast.Constant(None))
        if of == "Union":
            return ast.parse(" | ".join(ast.unparse(self.visit(type_)) for type_ in node.slice.elts), mode="eval").body
        if isinstance(node.slice, ast.Constant):        # an array of C++: float[3]
            return self.visit(node.value)
        if of == "Callable" and self.accepts:
            inner = _Types(self.module, self.used, self.members, accepts=False)
            takes, gives = inner.visit(node.slice).elts
            if ast.unparse(gives) == "None":            # a function that returns something does as well
                gives = ast.Name("object")
            self.used.add("Callable")
            return ast.Subscript(ast.Name("Callable"), ast.Tuple([takes, gives]))
        return ast.Subscript(self.visit(node.value), self.visit(node.slice))


def _is_recent(module: ModuleType) -> bool:
    return any(_CONDUIT in vars(value) for value in vars(module).values() if isinstance(value, type))


class Stub:
    """The lines of a module's stub, and the names that they use."""

    def __init__(self, module: ModuleType) -> None:
        self.module = module
        self.used: set[str] = set()
        self.problems: list[str] = []
        self.members: set[str] = set()      # of the class
        body = "".join(self._member(name, value) for name, value in vars(module).items() if not name.startswith("__"))
        modules = {name for name in self.used if name.islower() and name != "overload"}
        imports = [f"import {name}" for name in sorted(modules)]
        typing = self.used & _TYPING | ({"overload"} & self.used) | ({"Any"} if "Any" in body else set())
        imports += [f"from typing import {', '.join(sorted(typing))}"] if typing else []
        imports += ["from numpy.typing import NDArray"] if "NDArray" in self.used else []
        imports += [f"from _core import {', '.join(sorted(self.used & _OF_CORE))}"] if self.used & _OF_CORE else []
        self.text = (f"# Written by cmake/extension_stubs.py from {module.__name__}: do not edit.\n"
                     + "".join(f"{line}\n" for line in imports) + "\n" + body)

    def _member(self, name: str, value: Any) -> str:
        if isinstance(value, type):
            return self._class(value)
        if callable(value):
            return self._function(name, value.__doc__, "", name)
        return f"{name}: {type(value).__name__}\n"

    def _class(self, cls: type) -> str:
        bases = [base.__name__ for base in cls.__bases__ if base is not object and base.__name__ != "pybind11_object"]
        body = _doc(cls.__doc__ or "", "    ")
        self.members = set(vars(cls))
        for name, value in vars(cls).items():
            if name == _CONDUIT:
                continue
            kind, where = type(value).__name__, f"{cls.__name__}.{name}"
            if kind == "property":
                body += self._property(name, value, where)
            elif kind == "staticmethod":
                body += "    @staticmethod\n" + self._function(name, value.__func__.__doc__, "    ", where)
            elif kind == "instancemethod":
                body += self._function(name, value.__doc__, "    ", where, method=True)
            elif kind == "method_descriptor" and not name.startswith("_"):
                typed = re.sub(r"\w+(?=[,)=])", lambda a: f"{a[0]}: {_ARGUMENTS[a[0]]}" if a[0] in _ARGUMENTS else a[0],
                               re.sub(r"\$self(, /(?=, |\)$))?", "self", value.__text_signature__))
                text = f"{name}{typed} -> None"
                body += self._function(name, f"{text}\n\n{value.__doc__}", "    ", where, method=True)
            elif kind == "wrapper_descriptor" and name in ("__rshift__", "__rrshift__"):
                body += f"    def {name}(self, other: Any) -> Any: ...\n"
        body += _ADDED.get(cls.__name__, "")
        self.members = set()
        return f"\nclass {cls.__name__}{'(' + ', '.join(bases) + ')' if bases else ''}:\n{body or '    ...' + chr(10)}"

    def _property(self, name: str, value: property, where: str) -> str:
        if value.fget is None:                          # write only
            function = self._parsed(f"f{(value.fset.__doc__ or '').splitlines()[0]}", where)
            return f"    {name}: {self._type(function.args.args[-1].annotation, where, accepts=True)}\n"
        function = self._parsed(f"f{(value.fget.__doc__ or '').splitlines()[0]}", where)
        gives = self._type(function.returns, where)
        doc = _doc(value.__doc__ or "", "    " if value.fset else "        ")
        if value.fset:
            return f"    {name}: {gives}\n{doc}"
        head = f"    @property\n    def {name}(self) -> {gives}:"
        return f"{head}\n{doc}" if doc else f"{head} ...\n"

    def _function(self, name: str, doc: str | None, indent: str, where: str, method: bool = False) -> str:
        head, _, rest = (doc or "").partition("\n")
        if rest.startswith("Overloaded function."):
            parts = re.split(rf"^\d+\. (?={name}\()", rest, flags=re.M)[1:]
            self.used.add("overload")
            before = f"{indent}@overload\n"
        else:
            parts, before = [doc or ""], ""
        lines = ""
        for part in parts:
            head, _, rest = part.partition("\n")
            function = self._parsed(head, where)
            arguments = function.args
            if method:
                own = (arguments.posonlyargs + arguments.args)[0]
                own.arg, own.annotation = "self", None
            for argument in arguments.posonlyargs + arguments.args + arguments.kwonlyargs:
                if argument.annotation is not None:
                    text = self._type(argument.annotation, f"{where}({argument.arg})", accepts=True)
                    # A std::function may be empty.
                    argument.annotation = ast.Name(text + " | None" if text.startswith("Callable[") else text)
            self.problems += [f"{where}: an argument has no name" for argument in arguments.args
                              if re.fullmatch(r"arg\d+", argument.arg)]
            arguments.defaults = [ast.Constant(...) for _ in arguments.defaults]
            arguments.kw_defaults = [default and ast.Constant(...) for default in arguments.kw_defaults]
            signature = ast.unparse(arguments).replace("=...", " = ...")
            line = f"{before}{indent}def {name}({signature}) -> {self._type(function.returns, where)}:"
            about = _doc(rest, indent + "    ")
            lines += f"{line}\n{about}" if about else f"{line} ...\n"
        return lines

    def _parsed(self, signature: str, where: str) -> ast.FunctionDef:
        try:
            function = ast.parse(f"def {signature}: ...").body[0]
        except SyntaxError:
            self.problems.append(f"{where}: {signature}: a type is bound later, or not at all")
            function = ast.parse("def f(self) -> Any: ...").body[0]
        assert isinstance(function, ast.FunctionDef)
        return function

    def _type(self, annotation: ast.expr | None, where: str, accepts: bool = False) -> str:
        try:
            types = _Types(self.module, self.used, self.members, accepts)
            text = ast.unparse(types.visit(annotation)) if annotation else "object"
        except Unclear as unclear:
            self.problems.append(f"{where}: {unclear}")
            return "Any"
        if text in _EMPTY and not (accepts and text == "object"):
            self.problems.append(f"{where}: {text} says too little; give it a type, as core/typed.h does")
        return text


def _doc(text: str, indent: str) -> str:
    lines = text.strip().replace("\\", "\\\\").replace('"', "'").splitlines()
    if not lines:
        return ""
    if len(lines) > 1:
        lines.append("")
    return f'{indent}"""' + "\n".join(f"{indent if k else ''}{line}".rstrip() if line or k < len(lines) - 1 else indent
                                      for k, line in enumerate(lines)) + '"""\n'


def main(name: str, out: str) -> None:
    stub = Stub(importlib.import_module(name))
    for problem in stub.problems:
        print(f"warning: {name}.{problem}")
    path = Path(out)
    if not path.exists() or path.read_text(encoding="utf-8") != stub.text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(stub.text, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
