# SPDX-License-Identifier: Apache-2.0
"""What `./fledge` does before a command: it installs packages that are missing, and builds what has changed.

The shell script `fledge` finds Python, or installs it, and starts `__main__.py`. The options before the command are
read first, then the command's own parser reads its words, and says what it needs. Nothing but the standard library is
imported until that is there. The command then runs in the same program.

    context.py      the preset, the project, and the variables of programs that use the build
    tools.py        programs that are started: log, progress, locks, and the message when one fails
    packages.py     Debian's packages
    build.py        Fledge's parts, and the project
    testing.py      `fledge test`
    commands.py     the commands that install, build and test by themselves: setup, package, demo, test, docs, exec
    completion.py   what may follow on a command line
    parser.py       reads a command line
    main.py         all of it, in order

Example:

    from fledge.launcher.packages import expanded
    from fledge.launcher.parser import parsed

    options = parsed(["fly", "nadir_spin", "--on", "linux"])
    assert expanded(options.needs(options)) == ["build loop"]
"""
