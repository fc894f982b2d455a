#include "client/synth/solids.h"

namespace romap::synth {

std::span<const SolidKind> SolidKinds() {
  static constexpr SolidKind kKinds[] = {
      {"mug", MakeMug},           {"bottle", MakeBottle}, {"bowl", MakeBowl},      {"teapot", MakeTeapot},
      {"glass", MakeWineGlass},   {"book", MakeBook},     {"box", MakeBox},        {"laptop", MakeLaptop},
      {"lamp", MakeLamp},         {"clock", MakeClock},   {"pens", MakePenHolder}, {"chair", MakeChair},
      {"bear", MakeBear},         {"duck", MakeDuck},     {"car", MakeCar},        {"vase", MakeVase},
      {"plant", MakePottedPlant}, {"apple", MakeApple},
  };
  return kKinds;
}

}  // namespace romap::synth
