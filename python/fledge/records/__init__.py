# SPDX-License-Identifier: Apache-2.0
"""What a run recorded, in memory (`mission.log`) or in a file (`archive`), seen alike.

    series.py    fields by name: `Records`, and the `Series` of one field
    activity.py  modes, events, commands and resets

    from fledge.records.activity import modes

    for process, intervals in modes(fledge.Archive("run.mcap")).items():
        print(process, intervals)
"""
