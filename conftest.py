# SPDX-License-Identifier: Apache-2.0
"""Lets a bare `/usr/bin/python3 -m pytest` find the packages and the extension of the release build, in any folder.

The launcher sets PYTHONPATH itself, to the build under test, and that one wins.
"""

import os
import re
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from _pytest.terminal import TerminalReporter

ROOT = Path(__file__).resolve().parent
FOLDERS = [str(ROOT / part) for part in ("python", ".", f"build/{os.environ.get('FLEDGE_PRESET', 'release')}/python")]

# In a sub-folder, `python3 -m pytest` puts that folder first: python/fledge/flight.py would hide flight/.
sys.path[:] = [*(path for path in sys.path if path not in ("", os.getcwd())), *FOLDERS]
# The programs that tests start.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), *FOLDERS]))

# A script's `&` ignores Ctrl-C, nohup ignores that the terminal is closed, and programs inherit what is ignored or
# blocked. The tests and what they start begin with signals as usual; only the tests themselves go on after nohup.
signal.pthread_sigmask(signal.SIG_SETMASK, ())
for number in signal.valid_signals() - {signal.SIGPIPE, signal.SIGXFSZ}:    # Python ignores these, its children do not
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: lambda *_: None}.get(
            number, signal.SIG_DFL))

# Tests of the launcher, of documents, of generated sources, of programs of targets, of pages in a browser, and of
# Python that flies what other tests fly: the sanitizers check none of these. And the tests of Dask and of pools,
# whose threads run, or are about to end, while the test forks: if one holds the lock of the sanitizer's allocator then,
# the child waits for that lock forever.
IN_RELEASE = [ROOT / path for path in (
    "bench/falsify_test.py", "bench/mutants_test.py", "fmi/export", "introspect", "python/fledge/export",
    "python/fledge/pool", "python/fledge/scene", "python/fledge/targets", "registers/emit_test.py",
    "registers/machines_test.py", "studies/analysis", "studies/falsify", "studies/flips", "studies/prove",
    "studies/rules", "studies/verify", "targets",
    "tests/branches_test.py", "tests/crash_test.py", "tests/data_test.py", "tests/decisions_test.py",
    "tests/docs_test.py", "tests/flight_symbols_test.py", "tests/format_test.py", "tests/hygiene_test.py",
    "tests/include_direction_test.py", "tests/install_test.py", "tests/launcher_test.py",
    "tests/leon3_programs_test.py", "tests/links_test.py", "tests/mistakes_test.py", "tests/module_hash_test.py",
    "tests/mutants_test.py", "tests/notebook_test.py", "tests/project_test.py")]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", default="all", metavar="all|none|I/N",
                     help="which tests that are marked long run: all, none, or the share I of N")
    parser.addoption("--complete", action="store_true", help="fail where a test is skipped for want of a package")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "spread: the tests of this file share no folder; workers take them one by "
                            "one, where each other file is one worker's")
    config.addinivalue_line("markers", "long(why, share=True): this takes long, and says why; a shorter test of the "
                            "same folder shows the same capability each time. share=False: in no share, only with all")
    if not re.fullmatch("all|none|[0-9]+/[1-9][0-9]*", config.getoption("--long")):
        raise pytest.UsageError(f"--long takes all, none or I/N, such as 0/5; found {config.getoption('--long')}")


# --- what is not installed, and what takes how long ------------------------------------------------

def lacking(config: pytest.Config) -> dict[str, Counter[str]]:
    """What is not installed, or not built -> how many tests were skipped without it (tests/needs.py). With --complete,
    the packages of each target belong to that, without a count: tests fly on those targets that are there."""
    skipped = config.pluginmanager.get_plugin("terminalreporter").stats.get("skipped", [])
    whys = [str(report.longrepr[2]) for report in skipped]
    counts = {"not installed": Counter(name for why in whys if (found := re.search("not installed: (.*)", why))
                                       for name in found[1].split(", ")),
              "not built": Counter(found[1] for why in whys if (found := re.search(r"(\S+) (is|are) not built", why)))}
    if config.getoption("--complete"):
        from tests.needs import NOT_INSTALLED, TARGETS, reason_on

        for why in map(reason_on, TARGETS):
            if why.startswith(NOT_INSTALLED):
                counts["not installed"].update(dict.fromkeys(why.removeprefix(NOT_INSTALLED).split(", "), 0))
    return {what: count for what, count in counts.items() if count}


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.getoption("--complete") and not hasattr(session.config, "workerinput") and \
            lacking(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    for what, counts in lacking(config).items():
        terminalreporter.write_line(f"{what}, and tests that were skipped for it: " + ", ".join(
            f"{name} {count}" for name, count in counts.most_common()) + "; ./fledge setup --test --view has all" +
            "; 0: of a target, on which tests would have flown" * (0 in counts.values()),
            red=config.getoption("--complete"))


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """A link in the package leads to a folder that has the tests itself."""
    return collection_path.is_symlink() or None


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """The reports have the seconds of each case's set-up, which include those of the fixtures that it is first to use,
    and whether it is long."""
    if call.when == "setup":
        item.user_properties += [("setup", f"{call.duration:.3f}")] * (call.duration > 0.05)
        item.user_properties += [("long", "yes")] * (item.get_closest_marker("long") is not None)
    yield


COLLECTED = pytest.StashKey[list[pytest.Item]]()


def or_skip(make: Callable[[], tuple[int, int]]) -> Callable[[], tuple[int, int]]:
    """The function, which skips the test where the system makes no pseudo terminal, as in a bare container."""
    def attempt() -> tuple[int, int]:
        try:
            return make()
        except OSError as error:
            pytest.skip(f"no pseudo terminal can be made: {error}")
    return attempt


os.openpty, os.forkpty = or_skip(os.openpty), or_skip(os.forkpty)


@pytest.fixture
def collected(request: pytest.FixtureRequest) -> list[pytest.Item]:
    """All tests that pytest collected, also those that are left out."""
    return request.config.stash[COLLECTED]


def runs_now(item: pytest.Item, wanted: str) -> bool:
    """Whether a test is in the first circle, or among the long tests that are wanted."""
    mark = item.get_closest_marker("long")
    if mark is None:
        return True
    if not (len(mark.args) == 1 and isinstance(mark.args[0], str) and mark.args[0].strip()):
        raise pytest.UsageError(f'{item.nodeid} is marked long without a reason: @pytest.mark.long("200 flights")')
    if "/" not in wanted:
        return wanted == "all"
    from tests.circles import share_of, tenth_of

    share, shares = share_of(wanted)
    return tenth_of(item, shares) == share


@pytest.hookimpl(tryfirst=True)     # before pytest-xdist reads the marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Give each worker whole files, except for those that are spread. Leave out the long tests that are not wanted, and
    under the sanitizers the tests of IN_RELEASE."""
    config.stash[COLLECTED] = list(items)
    left_out = {item for item in items if not runs_now(item, config.getoption("--long"))}
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]
    sanitized = os.environ.get("FLEDGE_PRESET", "release") in ("asan", "tsan")
    for item in items:
        if item.get_closest_marker("spread") is None:
            item.add_marker(pytest.mark.xdist_group(item.path.stem))
        if sanitized and any(path in IN_RELEASE for path in (item.path, *item.path.parents)):
            item.add_marker(pytest.mark.skip(reason="the release build shows it"))
