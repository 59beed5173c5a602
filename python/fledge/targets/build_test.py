# SPDX-License-Identifier: Apache-2.0
"""What is built once for all missions, as a C library: whole or not at all, and again by another recipe."""

import os
import threading

import pytest

from fledge.targets import build
from fledge.targets.build import once


@pytest.fixture
def places(tmp_path, monkeypatch):
    """The folder of a tree's builds, and that of a user's caches."""
    (tmp_path / "build/release").mkdir(parents=True)
    monkeypatch.setattr(build, "build_folder", lambda: tmp_path / "build/release")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "build", tmp_path / "cache/fledge"


def library(recipe):
    """(its folder, whether it was built now)"""
    with once("library", recipe, "a library") as (folder, missing):
        return folder, missing


def test_it_is_built_and_reported_once_by_each_recipe(places, capsys):
    ours, _ = places
    assert library("one") == (ours / "library", True)
    assert capsys.readouterr().err == "fledge: building a library, once\n"
    assert library("one") == (ours / "library", False)
    assert library("two") == (ours / "library", True)
    assert library("two") == (ours / "library", False)


def test_what_failed_is_built_again(places):
    library("one")
    with pytest.raises(KeyError), once("library", "two", "a library"):
        raise KeyError
    for recipe in ("one", "two"):
        assert library(recipe)[1]


def test_others_wait_until_it_is_whole(places):
    built = []
    other = threading.Thread(target=lambda: built.append(library("one")))
    with once("library", "one", "a library"):
        other.start()
        other.join(0.2)
        assert not built
    other.join()
    assert built == [(places[0] / "library", False)]


def test_a_user_without_write_access_builds_in_a_cache(places, monkeypatch):
    """But takes what the tree has."""
    ours, cache = places
    library("one")
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert library("one") == (ours / "library", False)
    assert library("two") == (cache / "library", True) and library("two") == (cache / "library", False)


def test_what_a_program_defines_or_includes_is_compiled_for_it_alone(tmp_path):
    paths = [build.ROOT / f"targets/{name}.c" for name in ("linux/main", "linux/crash", "cfs/evs")]

    def shared(*flags):
        return [path.stem for path in build.shared_objects(tmp_path, paths, "gcc", [*build.FLAGS, *flags])]

    assert shared() == shared("-DELSE=1") == ["main", "crash", "evs"]
    assert shared("-DFLEDGE_FILES") == ["crash", "evs"]
    assert shared("-DPOCKET_TASKS=8u") == ["main", "crash"]     # a header that it includes has it
    assert shared("-DREGISTERS_CLOCK_H") == ["crash", "evs"]    # and one that such a header includes
    assert shared("-include", "names.h") == []
