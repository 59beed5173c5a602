# SPDX-License-Identifier: Apache-2.0
"""`./fledge keys new | list | allow | deny`: the keys that may take part in a co-simulation beyond one machine.
`./fledge keys link`: the keys of a radio link.

Exit codes as of all commands: 0 done; 2 the command line or a key is wrong, and nothing is written.
"""
from __future__ import annotations

import argparse
import os
import sys

from fledge.cli.arguments import actions
from fledge.cli.console import say
from fledge.errors import Failure

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from fledge.cosim.keys import Key


def add(command: Callable) -> None:
    """Add the subcommand, by the function of cli.parser() that adds one."""
    sub: Any = command("keys", lambda options: sub.error("new, list, allow, deny or link?"),
                       "keys new controller world flight")
    sub.set_defaults(needs=lambda _: None)
    add_action = actions(sub, "keys")

    def action(name: str, function: Callable[[argparse.Namespace], None], text: str, example: str,
               folder: bool = True) -> Any:
        a = add_action(name, _spoken(function), text, example)
        if folder:
            a.add_argument("--keys", metavar="DIR", default=os.environ.get("FLEDGE_KEYS") or "keys",
                           help="their folder; default: FLEDGE_KEYS, else keys")
        return a

    a = action("new", new, "make a pair of keys each: for the controller, a node, or a machine of several nodes",
               "new controller world flight")
    a.add_argument("names", nargs="+", metavar="NAME")
    action("list", list_, "list the keys, and those that are allowed", "list")
    a = action("allow", allow, "let the owner of a public key take part", "allow lab1.public --as world flight")
    a.add_argument("keys_", nargs="+", metavar="KEY", help="a .public file, or the name of one in the folder")
    a.add_argument("--as", dest="nodes", nargs="+", metavar="NODE",
                   help="the nodes that it may speak as; '*': all. Default: the name of a key in the folder; for a "
                   "file, a terminal asks")
    a = action("deny", deny, "let the owner of a key take part no longer", "deny lab1")
    a.add_argument("names", nargs="+", metavar="NAME")
    a = action("link", link, "add a random key to those of a radio link, for both of its ends",
               "link my_sat/link.keys", folder=False)
    a.add_argument("file", metavar="FILE")


def _spoken(function: Callable[[argparse.Namespace], None]) -> Callable[[argparse.Namespace], int]:
    def spoken(options: argparse.Namespace) -> int:
        from fledge.cosim.keys import KeysError

        try:
            function(options)
        except KeysError as error:
            raise Failure(f"keys: {error}") from None
        return 0

    return spoken


def new(options: argparse.Namespace) -> None:
    from fledge.cosim import keys

    for path in keys.new(options.keys, options.names):
        say(f"  wrote  {path}")
    others = [name for name in options.names if name != keys.CONTROLLER]
    if any(name == keys.CONTROLLER and secret for name, _, secret, _ in keys.pairs(options.keys)):
        if others:
            say(f"./fledge keys allow {' '.join(others)}   admits them at the controller of this folder")
        else:
            say("all nodes need controller.public; ./fledge keys allow NAME.public admits a node")
    else:
        say(f"{' '.join(f'{name}.public' for name in others)} goes to the machine of the controller, and the "
            f"controller.public of that machine into {options.keys}")


def list_(options: argparse.Namespace) -> None:
    from fledge.cosim import keys

    pairs, allowed = keys.pairs(options.keys), keys.allowed(options.keys)
    width = max([len(name) for name, *_ in pairs] + [len(key.path.stem) for key in allowed] + [0]) + 2
    say(f"keys in {options.keys}")
    for name, public, secret, problem in pairs:
        say(f"  {name:{width}} {public.public if public else '':40}  {public.fingerprint if public else '':24}  "
            + ("with its secret" if secret else "public only"))
        if problem:
            say(f"  {'':{width}} {problem}")
    if not pairs:
        say("  none: ./fledge keys new NAME makes a pair")
    say("allowed")
    for key in allowed:
        say(f"  {key.path.stem:{width}} {key.public}  {key.fingerprint}  as " + (", ".join(key.nodes) or "no node"))
    if not allowed:
        say("  none: ./fledge keys allow NAME lets the owner of a key take part")


def allow(options: argparse.Namespace) -> None:
    from fledge.cosim import keys

    for key, is_file in [keys.find(options.keys, given) for given in options.keys_]:
        if is_file and not options.nodes:
            _confirm(key)
    for key, nodes in keys.allow(options.keys, options.keys_, options.nodes):
        say(f"  {key.path.stem} ({key.fingerprint}) may take part as "
            + ("any node" if "*" in nodes else ", ".join(nodes)))


def _confirm(key: Key) -> None:
    """Ask whether the owner of a key that somebody sent may take part under the file's name."""
    name = key.path.stem
    called = f", which calls itself {key.name}" if key.name != name else ""
    if not sys.stdin.isatty():
        raise Failure(f"keys: {key.path} holds the key {key.fingerprint}{called}; say as which nodes its owner may "
                      f"take part: --as {name}")
    if input(f"{key.path} holds the key {key.fingerprint}{called}. Its owner has the same digits (./fledge keys list). "
             f"Admit it as the node {name}? [y/N] ").strip().lower() not in ("y", "yes"):
        raise Failure("keys: nothing was allowed")


def deny(options: argparse.Namespace) -> None:
    from fledge.cosim import keys

    for path in keys.deny(options.keys, options.names):
        say(f"  {path.stem} may take part no longer; its open connections stay")


def link(options: argparse.Namespace) -> None:
    from fledge.cosim import keys

    say(f"  wrote  the key {keys.link(options.file)} into {options.file}")
