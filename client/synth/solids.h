#pragma once

#include <span>

#include "client/synth/random.h"
#include "client/synth/solid.h"

namespace romap::synth {

// A kind of object. `make` draws proportions, colors and patterns from the random stream.
struct SolidKind {
  const char* name;
  Solid (*make)(Random&);
};

// All kinds, in fixed order.
std::span<const SolidKind> SolidKinds();

// tableware.cc
Solid MakeMug(Random& random);
Solid MakeBottle(Random& random);
Solid MakeBowl(Random& random);
Solid MakeTeapot(Random& random);
Solid MakeWineGlass(Random& random);
// desk_objects.cc
Solid MakeBook(Random& random);
Solid MakeBox(Random& random);
Solid MakeLaptop(Random& random);
Solid MakeLamp(Random& random);
Solid MakeClock(Random& random);
Solid MakePenHolder(Random& random);
// toys.cc
Solid MakeChair(Random& random);
Solid MakeBear(Random& random);
Solid MakeDuck(Random& random);
Solid MakeCar(Random& random);
// plants.cc
Solid MakeVase(Random& random);
Solid MakePottedPlant(Random& random);
Solid MakeApple(Random& random);

}  // namespace romap::synth
