// SPDX-License-Identifier: Apache-2.0
// Until the translator is here, the threaded interpreter stands in.
#include "emulator/cpu/engine.h"

namespace fledge::emulator {

std::unique_ptr<Engine> make_translator()
{
    return make_threaded();
}

} // namespace fledge::emulator
