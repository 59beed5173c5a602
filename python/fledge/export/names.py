# SPDX-License-Identifier: Apache-2.0
"""Names in C for what has a name in Python."""
from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence
from pathlib import Path

from introspect.keywords import C, CPP
from introspect.model import snake as snake
from introspect.sources import uncommented

# No names of members in C, nor in C++, which may include the header: keywords, and macros in small letters.
NO_MEMBERS = C | CPP | {"complex", "errno", "linux", "unix"}

# Headers of C and POSIX, for which an exported one of the name would be taken.
HEADERS = frozenset("""
aio alloca assert complex ctype dirent dlfcn endian errno fcntl features fenv float fmtmsg fnmatch ftw getopt glob grp
iconv inttypes iso646 langinfo libgen libintl limits locale malloc math monetary mqueue netdb nl_types poll pthread pwd
regex sched search semaphore setjmp signal spawn stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib
stdnoreturn string strings syscall syslog tar termios tgmath threads time uchar ulimit unistd utime utmpx wchar wctype
wordexp""".split())

# Of functions of the C library, as sem_init and argz_next, the beginnings.
OF_LIBC = re.compile("sem|mtx|cnd|argz|(pthread|posix|inet6)_.*|aio|fanotify|inotify")

INCLUDED = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.M)


def camel(name: str) -> str:
    """nadir_spin -> NadirSpin"""
    return "".join(word[:1].upper() + word[1:] for word in name.split("_"))


def identifier(text: str, keywords: Container[str] = C) -> str:
    """An identifier of C: what is no letter or digit becomes one underscore, a keyword gets one behind it."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "unnamed"
    if name[0].isdigit():
        name = "n" + name
    return name + "_" if name in keywords else name


def distinct(texts: Iterable[str], taken: Iterable[str] = (), keywords: Container[str] = C) -> dict[str, str]:
    """Text -> identifier for each. Where two would share one, or differ in case only, which enumerators do not
    show, the later has a number behind it."""
    names, used = {}, {name.lower() for name in taken}
    for text in texts:
        name = stem = identifier(text, keywords)
        n = 2
        while name.lower() in used:
            name, n = f"{stem}_{n}", n + 1
        used.add(name.lower())
        names[text] = name
    return names


def words(headers: Iterable[str], roots: Sequence[Path]) -> set[str]:
    """The words in the code of headers, and of those they include, each from the first of the roots that has it."""
    found: set[str] = set()
    read, todo = set(), list(headers)
    while todo:
        file = next((root / todo[-1] for root in roots if (root / todo[-1]).is_file()), None)
        read.add(todo.pop())
        if file:
            text = uncommented(file.read_text(encoding="utf-8", errors="replace"))
            found.update(re.findall(r"\w+", text))
            todo += set(INCLUDED.findall(text)) - read
    return found
