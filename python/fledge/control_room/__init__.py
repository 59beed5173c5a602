# SPDX-License-Identifier: Apache-2.0
"""The control room: a server that decodes the telemetry of spacecraft, keeps it, commands them, and has a console in
the browser (docs/control-room.md).

    settings.py     what FILE of `fledge ground serve FILE` says
    spacecraft.py   one spacecraft: its link in a thread, its monitor and archive
    simulated.py    a spacecraft that the server itself flies
    commanding.py   commands from forms to bytes, and what became of them
    alarms.py       alarms that stay until somebody has acknowledged them
    derived.py      parameters that are computed from others
    journal.py      commands, events, alarms, transfers and the operators' log, in SQLite
    replay.py       a session again, as a further spacecraft
    users.py        who may use the server: roles, sessions, tokens, and what a stranger may cost
    web.py          HTTP and WebSocket; api.yaml describes them
"""
