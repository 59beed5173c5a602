# SPDX-License-Identifier: Apache-2.0
"""The MCAP files that every target writes: read, converted, compared.

    reader.py   Archive: topics, fields and times by name; as pandas, CSV, HDF5
    mcap.py     the container: where the messages are, and what is damaged
    append.py   a file with more topics
    rosmsg.py   the message definitions
    compare.py  where two archives differ

Example:

    from fledge import Archive

    with Archive("run.mcap") as archive:
        error = archive["tracking.error.sigma_BR"]      # an array, a row for each message
        archive.frame("tracking.error")                 # of pandas
        archive.to_csv("csv")
"""

from fledge.archive.reader import Archive, ArchiveError, Channel, Field

__all__ = ["Archive", "ArchiveError", "Channel", "Field"]
