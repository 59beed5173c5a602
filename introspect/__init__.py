# SPDX-License-Identifier: Apache-2.0
"""The reader: C headers become one typed model, and everything else is written from that model.

    sources.py  which headers                       model.py    the typed model
    reader.py   headers -> model, by libclang.py    rules.py    what a header may not do
    comment.py  the grammar of field comments       units.py    the grammar of units
    emit/       model -> text                       errors.py   how a header is refused
    files.py    writing and hashing of generated text

Example:

    from pathlib import Path

    import introspect
    from introspect.model import Kind
    from introspect.reader import read
    from introspect.sources import Source

    model = read([Source(Path(introspect.__file__).parents[1], "flight", Kind.MODULE, "flight")])
    gain = next(field for field in model.structs["MrpFeedback"].fields if field.name == "K")
"""
