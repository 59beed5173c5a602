// SPDX-License-Identifier: Apache-2.0
#include "sim/library_file.h"

#include "sim/error.h"

#include <dlfcn.h>

namespace fledge::sim {

void check_version(const std::string &library, const char *what, std::uint32_t found, std::uint32_t ours)
{
    if (found != ours) {
        throw SetupError("the library " + library + " was built for version " + std::to_string(found) + " of the " +
                         what + ", this is version " + std::to_string(ours) + ": build it again");
    }
}

LibraryFile open_library(const std::string &path, const std::string &name, const void *ours)
{
    Dl_info self;
    std::string file = path;
    if (dladdr(ours, &self)) {
        // Python and importers load libraries with local symbols; this makes them global.
        dlopen(self.dli_fname, RTLD_NOW | RTLD_NOLOAD | RTLD_GLOBAL);
        const std::string here = self.dli_fname;
        file = path.find('/') == std::string::npos ? here.substr(0, here.rfind('/') + 1) + path : path;
    }
    void *handle = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!handle) {
        const std::string why = dlerror();
        const bool missing = why.find("undefined symbol") != std::string::npos;
        throw SetupError("cannot load the library " + file + ": " + why +
                         (missing ? "; do its sources, as CMake has them, define it?" : ""));
    }
    const std::string symbol = "fledge_library_" + name;
    const auto *tables = static_cast<const FledgeLibrary *>(dlsym(handle, symbol.c_str()));
    if (!tables) {
        dlclose(handle);
        throw SetupError("the library " + path + " does not export " + symbol);
    }
    const std::string models_symbol = "fledge_models_" + name;
    const auto *own = static_cast<const ModelLibrary *>(dlsym(handle, models_symbol.c_str()));
    if (own) {
        check_version(name, "models", own->version, model_version);
    }
    check_version(tables->name, "tables", tables->version, FLEDGE_TABLE_VERSION);
    return {tables, own ? std::span(own->types, own->n) : std::span<const ModelType>()};
}

} // namespace fledge::sim
