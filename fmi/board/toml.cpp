// SPDX-License-Identifier: Apache-2.0
// The reader of TOML, which elsewhere is a library of the system: an importer's machine need not have it.
#define TOML_IMPLEMENTATION
#include <toml++/toml.h>
