# SPDX-License-Identifier: Apache-2.0
"""The models of a library as sim/model_library.h has them, in C++20.

A model whose interface is `world/eddy_damping.h` has its class, EddyDampingModel, in
`world/eddy_damping_model.h`: in no namespace, in fledge::world, or in one named after the library.
"""
from __future__ import annotations

from introspect.emit import ctext
from introspect.model import Kind, Library


def emit(library: Library) -> dict[str, str]:
    name = library.name
    interfaces = [s for s in library.structs if s.kind is Kind.MODEL]
    headers = sorted({s.header.removesuffix(".h") + "_model.h" for s in interfaces})
    rows = "".join(f"    {{&fledge_struct_{s.name}, make_model<{s.name}Model, {s.name}>}},\n"
                   for s in interfaces)
    parts = [
        ctext.banner(f"The models of library {name}."),
        '#include "sim/model_library.h"\n\n',
        *[f'#include "{header}"\n' for header in headers],
        '\nextern "C" {\n',
        *[f"extern const FledgeStruct fledge_struct_{s.name};\n" for s in interfaces],
        '}\n\nnamespace fledge::world {}\nusing namespace fledge::world;\n',
        f"namespace {name} {{}}\nusing namespace {name};\n",
        "\nusing fledge::sim::make_model;\n",
        f"\nstatic const fledge::sim::ModelType types[] = {{\n{rows}}};\n",
        '\nextern "C" {\n'
        f'extern __attribute__((visibility("default"))) const fledge::sim::ModelLibrary '
        f"fledge_models_{name};\n"
        f"const fledge::sim::ModelLibrary fledge_models_{name} = {{\n"
        f"    fledge::sim::model_version, {len(interfaces)}u, types,\n}};\n}}\n",
    ]
    return {f"{name}_models.cpp": "".join(parts) if interfaces else ctext.banner(f"{name} has no models.")}
