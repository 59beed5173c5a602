# SPDX-License-Identifier: Apache-2.0
"""The records of a run, with the same methods in memory (`mission.log`) and in a file (`archive`).

    series.py    fields by name: `Records`, and the `Series` of one field
    activity.py  modes, events, commands and resets

Example:

    from fledge import Archive
    from fledge.records.activity import happenings

    for happening in happenings(Archive("run.mcap")):
        print(happening.t, happening.process, happening.kind, happening.name)
"""
