# SPDX-License-Identifier: Apache-2.0
"""The control room: a server that decodes the telemetry of spacecraft, keeps it, commands them, and has a console in
the browser (docs/control-room.md).

    settings.py     reads FILE of `fledge ground serve FILE`
    room.py         all spacecraft, and the listeners to their events
    spacecraft.py   one spacecraft: the thread that has its link, and the order of its work; its parts are
        mission.py      the mission of Fledge that it flies, if it does
        link.py         the link: opened, and opened again when it broke; clock.py: its time
        telemetry.py    database, monitor, archive; past.py: queries of the archive
        derived.py      parameters that the server computes from others
        limits.py       limits that administrators set; alarms.py: an alarm stays until it is acknowledged
        commanding.py   commands: forms and bytes; uplink.py, verifying.py: sending, and stages (stages.py)
        transfers.py    files; tables.py: parameters of modules; stored.py: commands that wait on board
        scene.py        its 3-D view; contacts.py: stations and passes; displays.py: those that a mission composes
        run_control.py  the run in which it flies: of the server itself, or of a co-simulation
    replay.py       plays a session again, as a further spacecraft
    journal.py      commands, events, alarms, transfers and the operators' log, in SQLite; reporter.py: of one craft
    guard.py        checks each request; access.py: users with roles, and tokens; passwords.py, sessions.py, logins.py,
                    request_log.py; connections.py: limits on what clients without a login use; bounds.py: all limits
    web.py          HTTP and WebSocket; handlers/ (routes.py) answers requests, openapi.py describes them, live.py has
                    the WebSocket; questions.py: of scripts, to operators
    postgres.py     writes parameters into PostgreSQL

Example:

    $ ./fledge ground serve room.toml
"""
