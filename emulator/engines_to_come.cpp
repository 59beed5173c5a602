// SPDX-License-Identifier: Apache-2.0
// Until the faster engines are here, the plain interpreter stands in.
#include "emulator/cpu/engine.h"

namespace fledge::emulator {

[[gnu::weak]] std::unique_ptr<Engine> make_threaded()
{
    return make_interpreter();
}

[[gnu::weak]] std::unique_ptr<Engine> make_translator()
{
    return make_threaded();
}

} // namespace fledge::emulator
