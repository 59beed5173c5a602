# SPDX-License-Identifier: Apache-2.0
"""Writes the powers of a file that flies, x ** y and x **= y, as calls of its builtins (flying.py)."""
from __future__ import annotations

import ast
from typing import Any


def rewritten(tree: ast.Module) -> ast.Module:
    """The tree of a file, with its powers as calls."""
    return ast.fix_missing_locations(Powers().visit(tree))


class Powers(ast.NodeTransformer):
    """Makes calls of the powers in a tree, in place; the parts of a target of **= are computed once."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        return self._call("__power__", node.left, node.right, node) if isinstance(node.op, ast.Pow) else node

    def visit_AugAssign(self, node: ast.AugAssign) -> Any:
        self.generic_visit(node)
        if not isinstance(node.op, ast.Pow):
            return node
        before: list[ast.stmt] = []

        def once(value: ast.expr, name: str) -> ast.expr:
            """The value, which is computed once."""
            before.append(ast.copy_location(ast.Assign([ast.Name(name, ast.Store())], value), node))
            return ast.Name(name, ast.Load())

        target: ast.expr = node.target
        if isinstance(target, ast.Attribute):
            target = ast.Attribute(once(target.value, "__of__"), target.attr, ast.Store())
        elif isinstance(target, ast.Subscript):
            of = once(target.value, "__of__")
            sliced = any(isinstance(inner, ast.Slice) for inner in ast.walk(target.slice))
            target = ast.Subscript(of, target.slice if sliced else once(target.slice, "__at__"), ast.Store())
        read = ast.parse(ast.unparse(target), mode="eval").body
        result = self._call("__power_in_place__", read, node.value, node)
        return [*before, ast.copy_location(ast.Assign([target], result), node)]

    @staticmethod
    def _call(name: str, x: ast.expr, y: ast.expr, node: ast.AST) -> ast.Call:
        return ast.copy_location(ast.Call(ast.Name(name, ast.Load()), [x, y], []), node)
