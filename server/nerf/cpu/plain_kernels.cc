#include "server/nerf/cpu/kernels-inl.h"
#include "server/nerf/cpu/kernels.h"

namespace romap::nerf {

const KernelTable& PlainKernels() {
  static const KernelTable table = plain::MakeKernelTable<float, plain::OutputByRows>("plain");
  return table;
}

}  // namespace romap::nerf
