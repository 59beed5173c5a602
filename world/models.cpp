// SPDX-License-Identifier: Apache-2.0
#include "world/models.h"

#include "world/dynamics/reaction_wheels_model.h"
#include "world/dynamics/spacecraft_model.h"
#include "world/environment/celestial_body_model.h"
#include "world/sensors/navigation_model.h"

// The reader's tables of the faces.
extern "C" {
extern const FledgeStruct fledge_struct_CelestialBody;
extern const FledgeStruct fledge_struct_Navigation;
extern const FledgeStruct fledge_struct_ReactionWheels;
extern const FledgeStruct fledge_struct_Spacecraft;
}

namespace fledge::world {

namespace {

template <typename Behaviour, typename Face> std::unique_ptr<sim::Model> make(void *face)
{
    return std::make_unique<Behaviour>(*static_cast<Face *>(face));
}

const sim::ModelType all[] = {
    {&fledge_struct_Spacecraft, make<SpacecraftModel, Spacecraft>},
    {&fledge_struct_ReactionWheels, make<ReactionWheelsModel, ReactionWheels>},
    {&fledge_struct_CelestialBody, make<CelestialBodyModel, CelestialBody>},
    {&fledge_struct_Navigation, make<NavigationModel, Navigation>},
};

} // namespace

std::span<const sim::ModelType> models()
{
    return all;
}

} // namespace fledge::world
