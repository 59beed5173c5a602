# SPDX-License-Identifier: Apache-2.0
"""The control room: a server that decodes the telemetry of spacecraft, keeps it, commands them, and has a console in
the browser (docs/control-room.md).

    settings.py     reads FILE of `fledge ground serve FILE`
    spacecraft.py   one spacecraft: its link in a thread, its monitor and archive
    simulated.py    a spacecraft that the server itself flies
    commanding.py   commands: forms, bytes, and the stages that flight reports
    alarms.py       alarms; each stays until an operator has acknowledged it
    derived.py      parameters that the server computes from others
    journal.py      commands, events, alarms, transfers and the operators' log, in SQLite
    replay.py       plays a session again, as a further spacecraft
    users.py        users with roles, sessions, tokens, and limits on what clients without a login use
    web.py          HTTP and WebSocket; api.yaml describes them
"""
